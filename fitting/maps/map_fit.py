"""`fit_map`: a map of any size, fitted block by block into a store on disk."""

from __future__ import annotations

import functools
import inspect
import itertools
import os
import time
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import fitting
from fitting.batches import fit_many
from fitting.fit_result import Fit
from fitting.maps import map_store
from fitting.maps.cube import Cube, Source, block_shape, package, text_of
from fitting.maps.map_start import MISFITS, Start, begin, has_data, usable
from fitting.maps.map_store import CODES, ENDS, ORDER, STATUSES, MapStore, MapStoreError, store_of
from fitting.maps.map_workers import run_on
from fitting.process.progress import listening, tell
from fitting.results.result_parts import NO_DATA, NOT_CONVERGED, REFUSED
from fitting.samples.parameters import names_of, plain_name
from fitting.samples.sample import Sample
from fitting.searching.minima import alternative_chi2

_Columns = dict[str, np.ndarray]
# Two minima of a pixel are two if a parameter differs by so many standard errors.
_APART = 4.0
_OPTIONS = ("free", "fixed", "bounds", "tie", "errors", "intervals", "start", "seed")
_BITS = {code: np.uint64(1 << i) for i, code in enumerate(CODES)}
_CODES = {name: np.uint8(i) for i, name in enumerate(STATUSES)}


def _columns(found: Fit) -> _Columns:
    """Return the arrays of a batch that the store keeps, and its cost and degrees of freedom."""
    out: _Columns = {}
    for name in found.names:
        e = found.parameters[name]
        for end, values in zip(
            ENDS, (e.value, e.sigma, e.interval[..., 0], e.interval[..., 1]), strict=True
        ):
            out[name + end] = np.array(values)
    bits = np.zeros(found.shape, np.uint64)
    for one in found.findings:
        bits |= np.where(one.at, _BITS[one.code], np.uint64(0))
    names, which = np.unique(found.status, return_inverse=True)
    codes = np.array([_CODES[n] for n in names])[which].reshape(found.shape)
    return out | {"chi2": np.array(found.chi2_reduced), "warnings": bits, "status": codes,
                  "cost": np.array(found.cost), "dof": np.array(found.dof)}  # fmt: skip


def _lower_of(one: _Columns, other: _Columns, stated: bool) -> _Columns:
    """Return for each pixel the lower of two minima, marked where both fit nearly as well, or the
    second one better."""
    good = [c["status"] != _CODES[NOT_CONVERGED] for c in (one, other)]
    take = good[1] & (~good[0] | (other["cost"] < (1.0 - 1e-6) * one["cost"]))
    out = {n: np.where(take, other[n], a) for n, a in one.items()}
    apart = np.zeros(take.shape, bool)
    for name in (n for n in one if n + "_sigma" in one):
        with np.errstate(invalid="ignore"):
            apart |= np.abs(one[name] - other[name]) > _APART * out[name + "_sigma"]
    scatter = out["cost"] / np.maximum(out["dof"], 1)
    limit = alternative_chi2(np.where(stated, 0, out["dof"]))
    near = np.abs(one["cost"] - other["cost"]) <= limit * np.where(
        stated, np.maximum(scatter, 1.0), scatter
    )
    doubt = apart & (take | near) & good[0] & good[1]
    out["warnings"] = out["warnings"] | np.where(doubt, _BITS[ORDER], np.uint64(0))
    return out


def fit_pixels(
    known: Mapping[str, Any], cube: Cube, values: Any, sigma: Any, **more: Any
) -> Fit:  # fmt: skip
    """Return the fits of some pixels with the options and shared values of a map.

    known: attributes of its store. more: what `fit_many` takes beside.
    """
    options = {n: v for n, v in known["options"].items() if n in _OPTIONS and v is not None}
    held = {n: value for n, (value, _) in known["begin"]["shared"].items()}
    if held:
        options["fixed"] = {**options.get("fixed", {}), **held}
        bounds = options.get("bounds", {})
        options["bounds"] = {n: b for n, b in bounds.items() if n not in held}
    with listening(None):  # blocks are counted, not the steps of their fits
        return fit_many(
            cube.angle_deg, cube.wavelength, **values, sigma=sigma, sample=known["sample"],
            **{**options, **more},
        )  # fmt: skip


def _fitted(store: MapStore, index: Any, cube: Cube, values: Any, sigma: Any) -> _Columns:
    """Return the fits of a block, from the starts of its map."""
    known = store.attributes
    start, check = Start(**known["begin"]), known["options"]["check"]

    def fits(values: Any, sigma: Any, **more: Any) -> _Columns:
        return _columns(fit_pixels(known, cube, values, sigma, **more))

    if not start.values:  # a bare surface, which needs no start
        return fits(values, sigma)
    nearest = start.nearest(index, store.block)
    out = fits(values, sigma, check=0, start={
        n: np.take(v, nearest) for n, v in start.values.items()
    })  # fmt: skip
    stated = sigma is not None
    if start.others:
        second = {n: np.take(v, nearest) for n, v in start.others.items()}
        out = _lower_of(out, fits(values, sigma, check=0, start=second), stated)
    large = np.any([out["warnings"] & _BITS[code] for code in MISFITS], axis=0)
    doubtful = has_data(values) & (large | (out["status"] == _CODES[NOT_CONVERGED]))
    if check and start.describes and doubtful.any():
        out = _searched(out, doubtful, check, fits, values, sigma)
    if start.shared:
        slopes = np.stack([np.take(np.asarray(start.slopes[n]), nearest, 0)
                           for n in start.values], -2)  # fmt: skip
        more = np.einsum("...ni,ij,...nj->...n", slopes, np.asarray(start.covariance), slopes)
        for i, name in enumerate(start.values):
            sigma_all = np.sqrt(out[name + "_sigma"] ** 2 + more[..., i])
            with np.errstate(invalid="ignore", divide="ignore"):
                wider = sigma_all / out[name + "_sigma"]
            for end in ("_lower", "_upper"):
                out[name + end] = out[name] + wider * (out[name + end] - out[name])
            out[name + "_sigma"] = sigma_all
    return out


def _searched(
    out: _Columns, doubtful: np.ndarray, check: int, fits: Any, values: Any, sigma: Any
) -> _Columns:
    """Search the worst of the doubtful pixels afresh, and try what is found on the whole block."""
    stated = sigma is not None
    reduced = np.where(doubtful, out["cost"] / np.maximum(out["dof"], 1), -1.0)
    reduced = np.where(np.isnan(reduced), np.inf, reduced).ravel()
    worst = np.argsort(-reduced, kind="stable")[:check]  # others are searched where these are few

    def few(arrays: Any) -> Any:
        return {q: a.reshape(-1, a.shape[-1])[worst] if np.ndim(a) else a
                for q, a in arrays.items()}  # fmt: skip

    found = fits(few(values), few(sigma) if isinstance(sigma, Mapping) else sigma, check=check)
    names = [n for n in out if n + "_sigma" in out]
    start = {n: out[n].ravel().copy() for n in names}
    for n in names:
        start[n][worst] = np.where(np.isfinite(found[n]), found[n], start[n][worst])
    shape = doubtful.shape
    again = fits(values, sigma, check=0, start={n: v.reshape(shape) for n, v in start.items()})
    return _lower_of(out, again, stated)


class _Block(NamedTuple):
    """A block as it was read, in the full shape of blocks: a short one is filled up with missing
    curves, so that all blocks run the same programs."""

    cube: Cube
    values: Any
    sigma: Any
    refused: np.ndarray
    masked: np.ndarray


def _read(store: MapStore, place: tuple[int, ...], source: Source | Cube) -> _Block:
    index = store.index(place)
    cube = source.open() if isinstance(source, Source) else source
    read = index if isinstance(source, Source) else (slice(None),) * len(index)
    values, sigma, masked = cube.block(read)
    more = [(0, b - n) for b, n in zip(store.block, masked.shape, strict=True)]

    def full(array: np.ndarray, fill: Any) -> np.ndarray:
        wide = [*more, *[(0, 0)] * (array.ndim - len(more))]
        return np.pad(array, wide, constant_values=fill)

    values = {q: full(v, np.nan) for q, v in values.items()}
    if isinstance(sigma, Mapping):
        sigma = {q: full(s, 1.0) if np.ndim(s) else s for q, s in sigma.items()}
    masked = full(masked, False)
    return _Block(cube, *usable(values, sigma, masked if masked.any() else None), masked)


def _results(store: MapStore, place: tuple[int, ...], block: _Block) -> _Columns:
    """Return what the store keeps of a block, in the full shape of blocks."""
    there = has_data(block.values)
    nothing = {n: np.full(store.block, a.fill_value, a.dtype)
               for n, a in store.arrays.items() if a.chunks == store.block}  # fmt: skip
    nothing = {n: a for n, a in nothing.items() if n not in store.attributes["places"]}
    index, out = store.index(place), nothing
    if there.any():
        out = _fitted(store, index, block.cube, block.values, block.sigma)
    out = {n: np.where(there, out[n], fill) for n, fill in nothing.items()}
    out["status"][~there] = _CODES[NO_DATA]
    out["status"][block.refused] = _CODES[REFUSED]
    out["warnings"][block.refused] = _BITS["refused"]
    out["status"][block.masked] = _CODES[map_store.MASKED]
    return out


@functools.cache
def _keep_programs() -> None:
    fitting.cache_programs()


def fit_block(out: str, known: str, source: Source | Cube, place: tuple[int, ...]) -> int:
    """Fit a block on a worker, unless it is done, and return how many pixels it has."""
    _keep_programs()
    store = store_of(out, known)
    if not store.done(place):
        _write(store, place, _results(store, place, _read(store, place, source)))
    return store.pixels(place)


def _write(store: MapStore, place: tuple[int, ...], values: _Columns) -> None:
    try:
        store.write(place, values)
    except OSError as error:
        raise MapStoreError(_unwritten(store.path, error)) from error


def _unwritten(out: Path, error: OSError) -> str:
    return (
        f"{out}: it cannot be written ({error.strerror or error}). The blocks that are done stay; "
        "the same command goes on with the others when there is space and permission."
    )


def _here(store: MapStore, source: Source, missing: list[tuple[int, ...]], done: Any) -> None:
    """Fit blocks in this process, one after the other.

    While one is fitted, the next is read and the one before is written.
    """
    with ThreadPoolExecutor(2) as aside:
        ahead: Future | None = None
        before: Future | None = None
        for place, following in itertools.zip_longest(missing, missing[1:]):
            block = ahead.result() if ahead else _read(store, place, source)
            ahead = aside.submit(_read, store, following, source) if following else None
            values = _results(store, place, block)
            if before is not None:
                before.result()
            before = aside.submit(_write, store, place, values)
            done(store.pixels(place))
        if before is not None:
            before.result()


def source_of(
    data: Any, sample: str | Sample, sigma: Any = None, mask: Any = None,
    dataset: str | None = None, quantity: Any = None, angle_deg: Any = None,
    wavelength_um: Any = None,
) -> Source:  # fmt: skip
    """Return what the cube of a map is opened from; arguments as of `fit_map`."""

    if not (hasattr(data, "dims") or isinstance(data, (str, os.PathLike))):
        raise ValueError(f"{type(data).__name__} came; a DataArray or a path was wanted.")

    def plain(came: Any, kind: Any) -> Any:
        return None if came is None else tuple(kind(x) for x in np.ravel(came).tolist())

    return Source(
        data if hasattr(data, "dims") else os.path.abspath(data), sigma, mask, dataset,
        plain(quantity, str), plain(angle_deg, float), plain(wavelength_um, float),
        Sample.parse(sample).by_wavelength,
    )  # fmt: skip


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
        client: a client of Dask distributed, whose workers fit the blocks; None: this process.
        shared: names of parameters that all pixels share. They are found from a grid of 64 pixels
            and held; their errors are part of the errors of the others.
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
    package("xarray", "fit_map")
    which = Sample.parse(sample)
    options = _checked(options) | {"check": check}
    named = tuple(plain_name(n) for n in names_of(shared))
    source = source_of(data, which, sigma, mask, dataset, quantity, angle_deg, wavelength_um)
    cube, path = source.open(), Path(out).absolute()
    wanted = {
        "sample": str(which), "options": {**options, "shared": list(named)},
        "input": cube.fingerprint(),
    }  # fmt: skip
    try:
        with map_store.lock(path):
            return _fit_map(cube, source, path, which, wanted, named, block, client)
    except OSError as error:
        raise MapStoreError(_unwritten(path, error)) from error


def _fit_map(
    cube: Cube, source: Source, out: Path, sample: Sample, wanted: dict[str, Any],
    shared: tuple[str, ...], block: int, client: Any,
) -> Any:  # fmt: skip
    known = map_store.begun(out)
    if known is None:
        options = {n: v for n, v in wanted["options"].items() if n in (*_OPTIONS, "check")}
        shape = block_shape(cube, block)
        start = begin(cube, sample, options, shared)
        map_store.create(out, cube, shape, start.units, {
            **wanted, "title": f"Fits of {sample}", "read": str(cube), "begin": start._asdict(),
            "shared": start.shared, "places": list(cube.places), "failed_blocks": [],
            "versions": {"fresnel-jax": fitting.__version__, **{
                name: package(name, "fit_map").__version__ for name in ("jax", "numpy", "zarr")
            }},
        })  # fmt: skip
    else:
        map_store.refuse_other(out, known, wanted)
    store = MapStore(os.fspath(out))
    missing = store.missing()
    tell(total=len(missing), done=0)
    begun, pixels = time.perf_counter(), 0

    def done(count: int) -> None:
        nonlocal pixels
        pixels += count
        tell(f"{pixels / (time.perf_counter() - begun):,.0f} curves/s")

    failed: list[tuple[int, ...]] = []
    if client is None:
        _here(store, source, missing, done)
    else:
        by_path = isinstance(source.data, str)
        failed = run_on(
            client,
            lambda place: (
                fit_block, os.fspath(out), wanted["input"],
                source if by_path else cube.part(store.index(place)), place,
            ),
            missing, done,
        )  # fmt: skip
    store.group.attrs["failed_blocks"] = [text_of(store.index(place)) for place in failed]
    return map_store.dataset(out)


def _checked(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options of a map with defaults, or raise ValueError for a name of none."""
    known = {n: p.default for n, p in inspect.signature(fit_many).parameters.items()}
    for name in options:
        if name not in _OPTIONS:
            raise ValueError(
                f"{name} came; a map has the options of fit_many: {', '.join(_OPTIONS)}."
            )
    free = names_of(options.get("free", ()))
    return {n: options.get(n, known[n]) for n in _OPTIONS} | {"free": list(free)}
