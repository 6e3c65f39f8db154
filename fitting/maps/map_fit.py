"""`fit_map`: a map of any size, fitted block by block into a store on disk.

A map begins with full searches on a coarse grid of its pixels; each pixel of a block starts from
the result of the nearest one. Parameters that all pixels share are found from the same grid: the
weighted mean, with the inverse of the pixels' covariances as weights, which is the joint
least-squares estimate where the errors are small beside the curvature of the model.

Blocks are fitted by threads of this process or by the workers of a Dask cluster: in both cases by
`fit_block`, submitted to an executor that knows of few blocks at a time.
"""

from __future__ import annotations

import contextlib
import functools
import inspect
import itertools
import os
import threading
import time
from collections.abc import Iterable, Mapping
from concurrent import futures
from pathlib import Path
from typing import Any

import numpy as np

import fitting
from fitting.batches import fit_many
from fitting.fit_result import Fit
from fitting.maps import map_store
from fitting.maps.cube import Block, Cube, block_shape, grid_of, open_cube, text_of
from fitting.maps.map_store import BITS, ENDS, STATUS, MapStore, MapStoreError, package
from fitting.process.progress import tell
from fitting.process.start_up import cache_programs
from fitting.results.result_parts import DETERMINED, NOT_CONVERGED, REFUSED
from fitting.samples.parameters import names_of, plain_name
from fitting.samples.sample import Sample
from fitting.searching.minima import alternative_chi2

_Columns = dict[str, np.ndarray]
_Place = tuple[int, ...]
_OPTIONS = ("free", "fixed", "bounds", "tie", "errors", "intervals", "start", "seed", "check")
# The warnings of a pixel that the sample, at this minimum, does not describe.
_MISFITS = ("chi2_large", "does_not_describe")
# Two minima of a pixel are two if a parameter differs by so many standard errors.
_APART = 4.0
# Values so many times as far from the median as is usual are of another minimum.
_FAR = 5.0
# A scheduler that has no worker after so long is refused.
WAIT_S = 30.0
_keep_programs = functools.cache(cache_programs)


def fit_pixels(known: Mapping[str, Any], cube: Cube, block: Block, **more: Any) -> Fit:
    """Return the fits of some pixels with the sample, options and shared values of a map.

    known: attributes of its store. more: what `fit_many` takes beside.
    """
    options = {n: v for n, v in known["options"].items() if n != "shared" and v is not None}
    if held := {n: value for n, (value, _) in known["shared"].items()}:
        options["fixed"] = {**options.get("fixed", {}), **held}
        bounds = options.get("bounds", {})
        options["bounds"] = {n: b for n, b in bounds.items() if n not in held}
    return fit_many(
        cube.angle_deg, cube.wavelength_um, **block[0], sigma=block[1], sample=known["sample"],
        **{**options, **more},
    )  # fmt: skip


def _begin(cube: Cube, known: Mapping[str, Any]) -> dict[str, Any]:
    """Return what all blocks begin with, as plain data for the attributes of the store.

    known: sample and options. shared: name -> (value, standard error) of shared parameters. begin:
    units of the others, by name; starts: name -> values on the grid, and the same of a second
    minimum nearly as low, where pixels have one; none of a bare surface, which needs no start;
    added: the variance that the shared ones add to the others, on the grid; describes: whether the
    sample describes most of these pixels.
    """
    block = cube.block(grid_of(cube.shape))
    if not (block[2] == STATUS[map_store.PENDING]).any():
        raise ValueError(
            "none of the pixels on a grid over the map has a curve that can be fitted: all are "
            "masked, missing or out of range. Look at units (fractions, not percent) and the mask."
        )

    def fits(shared: Mapping[str, Any]) -> Fit:
        return fit_pixels({**known, "shared": shared}, cube, block)

    found, shared, added = fits({}), {}, {}
    if known["options"]["shared"]:
        shared, added = _shared(found, known["options"]["shared"])
        found = fits(shared)
    starts = []
    if not Sample.parse(known["sample"]).by_wavelength:
        there = _nearest(np.isin(found.status, DETERMINED))
        starts = [{n: found.parameters[n].value[there] for n in found.names}]
        for other in found.others[:1]:
            near = np.isfinite(other.delta_chi2)
            starts.append({n: np.where(near, other.parameters[n].value, best)
                           for n, best in starts[0].items()})  # fmt: skip
    misfits = [np.mean(f.at) for f in found.findings if f.code in _MISFITS]
    return {"shared": shared, "begin": {
        "units": {n: found.parameters[n].unit for n in found.names}, "added": added,
        "starts": [{n: v.tolist() for n, v in one.items()} for one in starts],
        "describes": bool(max(misfits, default=0.0) < 0.5),
    }}  # fmt: skip


def _nearest(good: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the indices of the nearest good pixel of each pixel; of itself where none is good."""
    from scipy.ndimage import distance_transform_edt  # slow to import, of use for films alone

    indices: Any = distance_transform_edt(~good & good.any(), None, False, True)
    return tuple(indices)


def _shared(found: Fit, shared: list[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the joint estimate of parameters from all pixels' fits, name -> (value, standard
    error), and the variance that it adds to each of the others, name -> array on the grid."""
    names = list(found.names)
    if stray := [n for n in shared if n not in names]:
        raise ValueError(
            f"shared names {stray[0]!r}; one of the fitted parameters was wanted: "
            f"{', '.join(names)}."
        )
    which = [names.index(n) for n in shared]
    value = np.stack([found.parameters[n].value for n in shared], -1)
    good = np.isin(found.status, DETERMINED) & np.isfinite(found.covariance).all((-1, -2))
    if good.sum() < 2:
        raise ValueError(
            "fewer than two pixels of the grid determine all parameters, so that none can be "
            "shared; fix them instead."
        )

    def weights() -> np.ndarray:
        return np.linalg.inv(found.covariance[good][:, which][:, :, which])

    def squares(middle: np.ndarray) -> np.ndarray:
        apart = value[good] - middle
        return np.einsum("ni,nij,nj->n", apart, weights(), apart)

    # A pixel that ended at another fringe order has other values: it is left out.
    far = squares(np.median(value[good], 0))
    good[good] = far <= _FAR**2 * max(float(np.median(far)), len(which))
    spread = np.linalg.inv(weights().sum(0))
    mean = spread @ np.einsum("nij,nj->i", weights(), value[good])
    spread *= max(squares(mean).sum() / ((good.sum() - 1) * len(which)), 1.0)
    slopes = found.covariance[good][:, :, which] @ weights()  # of all parameters by these
    added = np.zeros((*good.shape, len(names)))
    added[good] = np.einsum("npi,ij,npj->np", slopes, spread, slopes)
    added, errors = added[_nearest(good)], np.sqrt(np.diagonal(spread))
    return (
        {n: [float(v), float(s)] for n, v, s in zip(shared, mean, errors, strict=True)},
        {n: added[..., i].tolist() for i, n in enumerate(names) if n not in shared},
    )


def _columns(found: Fit) -> _Columns:
    """Return the arrays of a batch that the store keeps, and its cost and degrees of freedom."""
    out: _Columns = {"chi2": np.array(found.chi2_reduced), "cost": np.array(found.cost),
                     "dof": np.array(found.dof)}  # fmt: skip
    for name in found.names:
        e = found.parameters[name]
        each = e.value, e.sigma, e.interval[..., 0], e.interval[..., 1]
        out |= {name + end: np.array(values) for end, values in zip(ENDS, each, strict=True)}
    out["warnings"] = np.zeros(found.shape, np.uint64)
    for one in found.findings:
        out["warnings"][one.at] |= BITS[one.code]
    out["status"] = np.vectorize(STATUS.get, otypes=[np.uint8])(found.status)
    return out


def _lower_of(one: _Columns, other: _Columns, stated: bool) -> _Columns:
    """Return for each pixel the lower of two minima, marked where both fit nearly as well, or the
    second one better."""
    first, second = (np.where(c["status"] == STATUS[NOT_CONVERGED], np.inf, c["cost"])
                     for c in (one, other))  # fmt: skip
    lower = second < (1.0 - 1e-6) * first
    out = {n: np.where(lower, other[n], a) for n, a in one.items()}
    apart = np.any([np.abs(one[n] - other[n]) > _APART * out[n + "_sigma"]
                    for n in one if n + "_sigma" in one], axis=0)  # fmt: skip
    scatter = out["cost"] / np.maximum(out["dof"], 1)
    limit = alternative_chi2(np.where(stated, 0, out["dof"]))
    limit = limit * (np.maximum(scatter, 1.0) if stated else scatter)
    near = np.isfinite(first) & np.isfinite(second) & (second <= first + limit)
    out["warnings"][apart & near] |= BITS[map_store.ORDER]
    return out


def _fitted(store: MapStore, index: Any, cube: Cube, block: Block) -> _Columns:
    """Return the fits of a block, from the starts of its map."""
    begin = store.attributes["begin"]

    def fits(**more: Any) -> _Columns:
        return _columns(fit_pixels(store.attributes, cube, block, **more))

    if not begin["starts"]:
        return fits()
    grid, stated = np.shape(begin["starts"][0][next(iter(begin["units"]))]), block[1] is not None
    cells = [np.minimum(np.arange(s.start, s.stop) // g.step, n - 1)
             for s, g, n in zip(index, grid_of(store.shape), grid, strict=True)]  # fmt: skip

    def nearest(values: Any) -> np.ndarray:
        """Return those of the nearest pixel of the grid."""
        return np.asarray(values)[np.ix_(*cells)]

    out, *others = [fits(check=0, start={n: nearest(v) for n, v in start.items()})
                    for start in begin["starts"]]  # fmt: skip
    for other in others:
        out = _lower_of(out, other, stated)
    doubtful = out["status"] == STATUS[NOT_CONVERGED]
    doubtful |= np.any([out["warnings"] & BITS[code] for code in _MISFITS], axis=0)
    if begin["describes"] and doubtful.any():  # the worst ones are searched afresh
        out = _lower_of(out, fits(start={n: out[n] for n in begin["units"]}), stated)
    for name, added in begin["added"].items():
        every = np.sqrt(out[name + "_sigma"] ** 2 + nearest(added))
        with np.errstate(invalid="ignore", divide="ignore"):
            wider = every / out[name + "_sigma"]
        for end in ("_lower", "_upper"):
            out[name + end] = out[name] + wider * (out[name + end] - out[name])
        out[name + "_sigma"] = every
    return out


def fit_block(turn: Any, store: MapStore, cube: Cube, read: Block | None, place: _Place) -> int:
    """Fit a block, unless it is done, and return how many pixels it has.

    turn: held while it is fitted; None on a worker, which shares its compiled programs with the
    others. read: the block; None: it is read here.
    """
    if turn is None:
        _keep_programs()
    index = store.index(place)
    if not store.done(place):
        block = read or cube.block(index)
        status = block[2]
        found = {"status": status, "warnings": np.zeros(status.shape, np.uint64)}
        if (pending := status == STATUS[map_store.PENDING]).any():
            with turn or contextlib.nullcontext():
                found = _fitted(store, index, cube, block)
        found["status"] = np.where(pending, found["status"], status)
        found["warnings"][status == STATUS[REFUSED]] = BITS["refused"]
        store.write(place, found)
    return int(np.prod([s.stop - s.start for s in index]))


def fit_missing(store: MapStore, cube: Cube, client: Any) -> list[_Place]:
    """Fit the missing blocks of a store; return the places of those that killed their workers."""
    missing, begun, pixels = store.missing(), time.perf_counter(), 0
    tell(total=len(missing), done=0)
    if client is None:  # one block is fitted while another one is read or written
        turn, killed, executor = threading.Lock(), (), futures.ThreadPoolExecutor(2)
    else:
        turn, killed = None, package("distributed").KilledWorker
        executor = client.get_executor(pure=False)
        try:
            client.wait_for_workers(1, timeout=WAIT_S)
        except TimeoutError:
            raise MapStoreError(
                f"{client.scheduler.address}: this scheduler has no worker; start some (dask "
                "worker ADDRESS), and run the same again."
            ) from None

    def submit(place: _Place) -> futures.Future[int]:
        # The client reads an array, and each worker a path.
        alone = cube if client is None or cube.source else cube._replace(data=None)
        read = None if alone is cube else cube.block(store.index(place))
        return executor.submit(fit_block, turn, store, alone, read, place)

    def run(places: Iterable[_Place], window: int) -> list[_Place]:
        """Fit blocks, so many at a time; return the places of those that killed their workers."""
        nonlocal pixels
        left, failed, running = iter(places), list[_Place](), dict[Any, _Place]()
        try:
            while True:
                for place in itertools.islice(left, window - len(running)):
                    running[submit(place)] = place
                if not running:
                    return failed
                for future in futures.wait(running, return_when=futures.FIRST_COMPLETED).done:
                    place = running.pop(future)
                    try:
                        pixels += future.result()
                        tell(f"{pixels / (time.perf_counter() - begun):,.0f} curves/s")
                    except killed:
                        failed.append(place)
        except futures.CancelledError:
            raise MapStoreError(
                "the scheduler of the workers does not answer. The blocks that are done stay; the "
                "same command goes on with the others when there is a scheduler."
            ) from None
        finally:
            for future in running:
                future.cancel()

    with executor:
        # The first worker compiles the programs, and the others load them.
        suspects = run(missing[:1], 1)
        suspects += run(missing[1:], 2 * max(sum(client.nthreads().values()), 1) if client else 2)
        # A block that shared its worker with the culprit may be innocent: each runs again, alone.
        return [place for one in suspects for place in run([one], 1)]


def fit_map(
    data: Any,
    sample: str | Sample = "free",
    out: str | os.PathLike[str] = "maps.zarr",
    *,
    sigma: Any = None,
    mask: Any = None,
    client: Any = None,
    shared: Any = (),
    dataset: str | None = None,
    quantity: Any = None,
    angle_deg: Any = None,
    wavelength_um: Any = None,
    block: int = 10_000,
    check: int = 8,
    **options: Any,
) -> Any:
    """Fit every pixel of a map, block by block, into a Zarr store, and return it as a Dataset.

    The store is the state: the same call again goes on with the blocks that are missing, and reads
    nothing else. Values, errors and warnings are those of `fit_many`.

    Args:
        data: an xarray DataArray, or the path of a Zarr array or group, an ENVI header (.hdr), an
            HDF5 file (.h5, .nxs) or a NumPy array (.npy). Axes named quantity, angle and wavelength
            (their coordinates with the attribute units) are the points of each curve, all others
            are pixels. Axes without names: pixels first, then these three where they are several.
            Powers are fractions, psi and delta degrees; NaN marks a missing value.
        sample: as for `fit_many`. "free": eta and k in each pixel and at each wavelength.
        out: path of the store: on a disk that all workers see.
        sigma: None, a standard error, standard errors by quantity, a DataArray of axes of the data,
            or the name of an array in the same file.
        mask: None, or a DataArray or array of the pixels, or the name of one; true: left out.
        client: a client of Dask distributed, whose workers fit the blocks; None: this process. They
            read a path themselves; of a DataArray the client sends them the blocks.
        shared: names of parameters that all pixels share. They are found from a grid of at most 64
            pixels and held; their errors are part of the errors of the others.
        dataset: name of the array in a file that has several.
        quantity, angle_deg, wavelength_um: names ("R_s"), degrees and micrometres of the data where
            they have no such coordinate.
        block: about so many curves are fitted, and kept in memory, at a time.
        check: of a film, so many of the pixels of the grid, and of the badly described pixels of
            each block, are searched afresh.
        options: free, fixed, bounds, tie, errors, intervals, seed as for `fit_many`; start: name ->
            value from which the pixels of the grid begin, and those of a bare surface.

    Returns:
        An xarray Dataset, not loaded, with, for each fitted parameter, its value, and `_sigma`,
        `_lower`, `_upper` (95 % interval), with errors of shared parameters in them; chi2 (by
        degrees of freedom, NaN without stated errors); status and warnings, whose attributes
        say what their flags mean; attributes sample, options, shared, versions, failed_blocks
        (those that kill every worker).

    Raises:
        ValueError: for data, options or a store that do not go together; a store that another
            process fits into; input that cannot be read, or a store that cannot be written. Blocks
            that are done stay.
        ImportError: if a package of the extra "maps" is not installed.
    """
    which = Sample.parse(sample)
    known = {n: p.default for n, p in inspect.signature(fit_many).parameters.items()}
    if stray := [n for n in options if n not in _OPTIONS]:
        raise ValueError(
            f"{stray[0]} came; a map has the options of fit_many: {', '.join(_OPTIONS)}."
        )
    options = {n: known[n] for n in _OPTIONS} | options | {
        "check": check, "free": list(names_of(options.get("free", ()))),
        "shared": [plain_name(n) for n in names_of(shared)],
    }  # fmt: skip
    cube = open_cube(
        data, sigma, mask, dataset, quantity, angle_deg, wavelength_um, which.by_wavelength
    )
    path = Path(out).absolute()
    wanted = {"sample": str(which), "options": options, "input": cube.fingerprint()}
    try:
        with map_store.lock(path):
            if not map_store.begun(path, wanted):
                started = _begin(cube, wanted)
                map_store.create(path, cube, block_shape(cube, block), {
                    **wanted, **started, "title": f"Fits of {which}", "read": str(cube),
                    "failed_blocks": [], "versions": {
                        "fresnel-jax": fitting.__version__,
                        **{n: package(n).__version__ for n in ("jax", "numpy", "zarr")},
                    },
                })  # fmt: skip
            store = MapStore(path)
            failed = fit_missing(store, cube, client)
            store.group.attrs["failed_blocks"] = [text_of(store.index(place)) for place in failed]
            return store.dataset()
    except OSError as error:
        raise MapStoreError(
            f"{path}: it cannot be written ({error.strerror or error}). The blocks that are done "
            "stay; the same command goes on with the others when there is space and permission."
        ) from error
