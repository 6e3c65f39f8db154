"""`fit_map`: a map of any size, fitted block by block into a store on disk.

A map begins with full searches on a coarse grid of its pixels; each pixel of a block starts from
the result of the nearest one. Parameters that all pixels share are found from the same grid: the
weighted mean, with the inverse of the pixels' covariances as weights, which is the joint
least-squares estimate where the errors are small beside the curvature of the model.

Blocks are fitted by two threads of this process, since one of them does not keep two processors
busy, or by the workers of a Dask cluster: by `fit_block`, submitted to an executor a few at a time.
"""

from __future__ import annotations

import itertools
import os
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
from fitting.maps.cube import Cube, block_shape, grid_of, open_cube, text_of
from fitting.maps.map_store import BITS, ENDS, ORDER, PENDING, STATUS, MapStore, package
from fitting.process.progress import tell
from fitting.process.start_up import cache_programs
from fitting.results.result_parts import DETERMINED, NOT_CONVERGED, REFUSED
from fitting.samples.parameters import names_of, plain_name
from fitting.samples.sample import Sample

_Place = tuple[int, ...]
_OPTIONS = (
    "free", "fixed", "bounds", "priors", "tie", "loss", "errors", "intervals", "starts", "start",
    "seed", "check",
)  # fmt: skip
# The warnings of a pixel that the sample, at this minimum, does not describe.
_MISFITS = ("chi2_large", "does_not_describe")
# A minimum is another one if its cost is lower by such a part.
_LOWER = 1e-3
# Values so many times as far from the median as is usual are of another minimum.
_FAR = 5.0
# A scheduler that has no worker after so long is refused.
WAIT_S = 30.0


def _missed(found: Fit) -> np.ndarray:
    """Return which pixels the sample, at the minimum that was found, does not describe."""
    misfits = (f.at for f in found.findings if f.code in _MISFITS)
    return np.any([found.status == NOT_CONVERGED, *misfits], axis=0)


def _minima(found: Fit) -> dict[str, np.ndarray]:
    """Return two minima of each pixel, name -> (2, pixels...): the lowest and, where another one
    fits nearly as well, that."""
    out = {}
    for name in found.names:
        both = [f.parameters[name].value for f in (found, *found.others[:1])]
        out[name] = np.where(np.isfinite(both), both, both[0])
    return out


def _begin(cube: Cube, sample: Sample, options: Mapping[str, Any]) -> dict[str, Any]:
    """Return what all blocks begin with, as plain data for the attributes of the store.

    shared: name -> (value, standard error) of shared parameters. fit: what `fit_many` takes beside
    curves. begin: units of the fitted parameters; of the G pixels of the grid that are well
    determined places (G, axes), starts (2, G), none of a bare surface, which needs no start, and
    added (G,), the variance by the errors of shared parameters; describes: whether the sample
    describes most of them.
    """
    grid, shared, added = grid_of(cube.shape), {}, {}
    curves, status = cube.block(grid)
    if not (good := status == STATUS[PENDING]).any():
        raise ValueError(
            "none of the pixels on a grid over the map has a curve that can be fitted: all are "
            "masked, missing or out of range. Look at units (fractions, not percent) and the mask."
        )
    fit = {n: v for n, v in options.items() if n != "shared" and v is not None}
    fit["sample"] = str(sample)
    found = fit_many(**{**fit, **curves})
    if options["shared"]:
        shared, added = _shared(found, options["shared"])
        fit["fixed"] = {**fit.get("fixed", {}), **{n: value for n, (value, _) in shared.items()}}
        for kind in ("bounds", "priors"):
            fit[kind] = {n: v for n, v in fit.get(kind, {}).items() if n not in shared}
        found = fit_many(**{**fit, **curves})
    determined = np.isin(found.status, DETERMINED) & np.isfinite([*added.values()]).all(0)
    good = determined if determined.any() else good
    return {"shared": shared, "fit": fit, "begin": {
        "units": {n: found.parameters[n].unit for n in found.names},
        "places": (np.argwhere(good) * [g.step for g in grid] + [g.start for g in grid]).tolist(),
        "starts": {} if sample.by_wavelength else {
            n: both[:, good].tolist() for n, both in _minima(found).items()
        },
        "added": {n: variance[good].tolist() for n, variance in added.items()},
        "describes": bool(_missed(found).mean() < 0.5),
    }}  # fmt: skip


def _shared(found: Fit, shared: list[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the joint estimate of parameters from all pixels' fits, name -> (value, standard
    error), and the variance that it adds to each of the others, name -> array on the grid."""
    names = list(found.names)
    if stray := [n for n in shared if n not in names]:
        wanted = f"one of the fitted parameters was wanted: {', '.join(names)}"
        raise ValueError(f"shared names {stray[0]!r}; {wanted}.")
    good = np.isin(found.status, DETERMINED) & np.isfinite(found.covariance).all((-1, -2))
    if good.sum() < 2:
        raise ValueError(
            "fewer than two pixels of the grid determine all parameters, so that none can be "
            "shared; fix them instead."
        )
    which = [names.index(n) for n in shared]
    value = np.stack([found.parameters[n].value[good] for n in shared], -1)
    covariance = found.covariance[good][:, :, which]
    weight = np.linalg.inv(covariance[:, which])
    slopes = covariance @ weight  # of all parameters by these

    def squares(middle: np.ndarray) -> np.ndarray:
        return np.einsum("ni,nij,nj->n", value - middle, weight, value - middle)

    # A pixel that ended at another fringe order has other values: it has no weight.
    far = squares(np.median(value, 0))
    near = far <= _FAR**2 * max(float(np.median(far)), len(which))
    weight[~near] = 0.0
    spread = np.linalg.inv(weight.sum(0))
    mean = spread @ np.einsum("nij,nj->i", weight, value)
    spread *= max(squares(mean).sum() / ((near.sum() - 1) * len(which)), 1.0)
    added = np.full((*good.shape, len(names)), np.nan)
    added[good] = np.einsum("npi,ij,npj->np", slopes, spread, slopes)
    errors = np.sqrt(np.diagonal(spread))
    return (
        {n: [float(v), float(s)] for n, v, s in zip(shared, mean, errors, strict=True)},
        {n: added[..., i] for i, n in enumerate(names) if n not in shared},
    )


def _nearest(places: Any, index: tuple[slice, ...]) -> Any:
    """Return which of some places is the nearest to each pixel of a block."""
    from scipy.spatial import KDTree  # slow to import, of use for films alone

    return KDTree(places).query(np.moveaxis(np.mgrid[index], 0, -1))[1]


def _fitted(store: MapStore, index: Any, curves: dict[str, Any]) -> dict[str, np.ndarray]:
    """Return the arrays of the store for a block, fitted from the starts of its map."""
    begin, fit, lower = store.attributes["begin"], store.attributes["fit"] | curves, False
    if starts := begin["starts"]:
        nearest = _nearest(begin["places"], index)
        starts = {n: np.array(both)[:, nearest] for n, both in starts.items()}
        found = fit_many(**{**fit, "start": starts, "check": 0})
        if begin["describes"] and _missed(found).any():  # the worst ones are searched afresh
            before, found = found, fit_many(**{**fit, "start": _minima(found)})
            cost = before.cost * before.noise**2  # in units of one noise
            lower = found.cost * found.noise**2 < (1.0 - _LOWER) * cost
    else:
        found = fit_many(**fit)
    out = {"chi2": np.array(found.chi2_reduced), "warnings": np.zeros(found.shape, np.uint64)}
    out["status"] = np.vectorize(STATUS.get, otypes=[np.uint8])(found.status)
    out["warnings"][lower] |= BITS[ORDER]
    for one in found.findings:
        out["warnings"][one.at] |= BITS[one.code]
    for name in found.names:
        e = found.parameters[name]
        each = e.value, e.sigma, e.interval[..., 0], e.interval[..., 1]
        out |= {name + end: np.array(a) for end, a in zip(ENDS, each, strict=True)}
    for name, variance in begin["added"].items():
        value, sigma = out[name], out[name + "_sigma"]
        shared = np.array(variance)[_nearest(begin["places"], index)]
        wider = np.sqrt(1.0 + shared / sigma**2)
        out[name + "_sigma"] = wider * sigma
        for end in ("_lower", "_upper"):
            out[name + end] = value + wider * (out[name + end] - value)
    return out


def fit_block(store: MapStore, source: Any, block: Any, place: _Place) -> int:
    """Fit a block, if it is not done, and return how many pixels it has.

    block: None: it is read here, from the ``source`` of a cube.
    """
    index = store.index(place)
    if not store.done(place):
        curves, status = block or map_store.opened_once(*source).block(index)
        found = {"status": status, "warnings": np.zeros(status.shape, np.uint64)}
        if (pending := status == STATUS[PENDING]).any():
            found = _fitted(store, index, curves)
        found["status"] = np.where(pending, found["status"], status)
        found["warnings"][status == STATUS[REFUSED]] = BITS["refused"]
        store.write(place, found)
    return int(np.prod([s.stop - s.start for s in index]))


def fit_missing(store: MapStore, cube: Cube, client: Any) -> list[_Place]:
    """Fit the missing blocks of a store; return the places of those that killed their workers."""
    missing, begun, blocks, pixels = store.missing(), time.perf_counter(), 0, 0
    tell(total=len(missing), done=0)
    executor, window, killed, source = futures.ThreadPoolExecutor(2), 2, (), None
    if client is not None:
        executor, killed = client.get_executor(pure=False), package("distributed").KilledWorker
        try:
            client.wait_for_workers(1, timeout=WAIT_S)
        except TimeoutError:
            raise ValueError(
                f"{client.scheduler.address}: this scheduler has no worker; start some (dask "
                "worker ADDRESS), and run the same again."
            ) from None
        client.register_worker_callbacks(cache_programs)  # also of workers to come
        window = 2 * max(sum(client.nthreads().values()), 1)
        source = cube.source

    def run(places: Iterable[_Place], window: int) -> list[_Place]:
        """Fit blocks, so many at a time; return the places of those that killed their workers."""
        nonlocal blocks, pixels
        left, failed, running = iter(places), list[_Place](), dict[Any, _Place]()
        try:
            while True:
                for place in itertools.islice(left, window - len(running)):
                    block = None if source else cube.block(store.index(place))
                    running[executor.submit(fit_block, store, source, block, place)] = place
                if not running:
                    return failed
                for future in futures.wait(running, return_when=futures.FIRST_COMPLETED).done:
                    place = running.pop(future)
                    try:
                        pixels += future.result()
                    except killed:
                        failed.append(place)
                        continue
                    blocks, seconds = blocks + 1, time.perf_counter() - begun
                    to_come = seconds * (len(missing) / blocks - 1)
                    tell(f"{pixels / seconds:,.0f} curves/s, {to_come:,.0f} s left")
        except futures.CancelledError:
            raise ValueError(
                "the scheduler of the workers does not answer. The blocks that are done stay; the "
                "same command goes on with the others when there is a scheduler."
            ) from None
        finally:
            for future in running:
                future.cancel()

    with executor:
        # The first worker compiles the programs, and the others load them.
        suspects = run(missing[:1], 1) + run(missing[1:], window)
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

    The store is the state: the same call again goes on with the blocks that are missing. Values,
    errors and warnings are those of `fit_many`.

    Args:
        data: a DataArray, or the path of a Zarr array or group, an ENVI header (.hdr), an HDF5 file
            (.h5, .nxs) or a NumPy array (.npy). Axes named quantity, angle and wavelength (their
            coordinates with the attribute units) are the points of each curve, all others are
            pixels. Axes without names: pixels first, then these three where they are several.
            Powers are fractions, psi and delta degrees; NaN marks a missing value.
        sample: as for `fit_many`. "free": eta and k in each pixel and at each wavelength.
        out: path of the store: on a disk that all workers see.
        sigma: None, a standard error, standard errors by quantity, a DataArray of axes of the data,
            or the name of an array in the same file.
        mask: None, or an array of the pixels, or the name of one; true: left out.
        client: of Dask distributed, whose workers fit the blocks; None: this process. They read a
            path themselves; of a DataArray the client sends them the blocks.
        shared: names of parameters that all pixels share. They are found from a grid of at most 64
            pixels and held; their errors are part of the errors of the others.
        dataset: name of the array in a file that has several.
        quantity, angle_deg, wavelength_um: names ("R_s"), degrees and micrometres of the data where
            they have no such coordinate.
        block: about so many curves are fitted together; two such blocks are in memory at a time.
        check: of a film, so many of the pixels of the grid, and of the badly described pixels of
            each block, are searched afresh.
        options: free, fixed, bounds, priors, tie, loss, errors, intervals, starts, seed as for
            `fit_many`; start: name -> value from which the pixels of the grid begin, and those of
            a bare surface.

    Returns:
        An xarray Dataset, not loaded: of each fitted parameter its value, `_sigma`, `_lower` and
        `_upper` (95 % interval); chi2 by degrees of freedom, NaN without stated errors; status and
        warnings, whose attributes say what their flags mean. Its attributes: sample, options,
        shared, versions, failed_blocks (those that end every worker).

    Raises:
        ValueError: for data, options or a store that do not go together; a store that another
            process fits into; input that cannot be read, or a store that cannot be written.
        ImportError: if a package of the extra "maps" is not installed.
    """
    which = Sample.parse(sample)
    if stray := [n for n in options if n not in _OPTIONS]:
        raise ValueError(
            f"{stray[0]} came; a map has the options of fit_many: {', '.join(_OPTIONS)}."
        )
    defaults = fit_many.__kwdefaults__ or {}
    options = {n: defaults[n] for n in _OPTIONS} | options | {
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
                started = _begin(cube, which, options)
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
        raise ValueError(
            f"{path}: it cannot be written ({error.strerror or error}). The blocks that are done "
            "stay; the same command goes on with the others when there is space and permission."
        ) from error
