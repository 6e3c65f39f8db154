"""A cube of curves: pixels along some axes; quantity, angle and wavelength along the others.

Every input, an array of the caller or a file, is an xarray DataArray that is read block by block.
"""

from __future__ import annotations

import functools
import hashlib
import math
import os
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fitting.batch_arrays import without_refused
from fitting.data.quantities import QUANTITIES
from fitting.data.units import WAVELENGTH_UNITS, incidence_deg, span_of, wavelength_um
from fitting.maps.map_store import MASKED, PENDING, STATUS, package
from fitting.output.summary import counted
from fitting.reader.names import unit_of
from fitting.results.result_parts import NO_DATA, REFUSED

QUANTITY, ANGLE, WAVELENGTH = POINTS = ("quantity", "angle", "wavelength")
# Values (pixels..., M) by quantity, errors as `fit_many` takes them, and the status (pixels...) of
# what is not fitted: no data, refused, masked; else pending.
Block = tuple[dict[str, np.ndarray], Any, np.ndarray]
# At most so many pixels, on a grid, stand for the map: in its fingerprint, and at its start.
GRID_PIXELS = 64


def text_of(index: tuple[slice, ...]) -> str:
    """Return the pixels of a block as they are named in messages: 0:10, 0:1000."""
    return ", ".join(f"{s.start}:{s.stop}" for s in index)


def grid_of(shape: tuple[int, ...]) -> tuple[slice, ...]:
    """Return a coarse grid of pixels, each in the middle of a cell."""
    most = max(round(GRID_PIXELS ** (1.0 / len(shape))), 1)
    steps = [-(-n // most) for n in shape]
    return tuple(slice((min(s, n) - 1) // 2, n, s) for s, n in zip(steps, shape, strict=True))


class Cube(NamedTuple):
    """A cube that can be read.

    data: xarray Dataset of data and, along some of its axes, sigma and mask, with the coordinates
    of the pixels. sigma: as `fit_many` takes it, where it is no array. pixels: names of their axes.
    quantity: (Q,) names. angle_deg: of the M points, (M,). wavelength_um: (M,), or one number, NaN
    where the wavelengths are an axis of pixels. source: when a path was written, and all
    arguments of `open_cube`; None if one is an array.
    """

    data: Any
    sigma: Any
    pixels: tuple[str, ...]
    quantity: tuple[str, ...]
    angle_deg: np.ndarray
    wavelength_um: Any
    source: tuple[Any, ...] | None

    def __reduce__(self) -> Any:
        """In another process, that of a path is opened again; another one goes there as it is."""
        return (_opened_once, self.source) if self.source else (Cube, tuple(self))

    @property
    def shape(self) -> tuple[int, ...]:
        """How many pixels there are along each axis."""
        return tuple(self.data.sizes[a] for a in self.pixels)

    def block(self, index: tuple[slice, ...]) -> Block:
        """Return the curves of some pixels, NaN in those that are not to be fitted."""
        part = self.data.isel(dict(zip(self.pixels, index, strict=True)))
        every = *self.pixels, *(a for a in POINTS if a not in self.pixels)
        shape = tuple(part.sizes.get(a, 1) for a in every)
        count = shape[: len(index)]

        def by_quantity(name: str) -> dict[str, np.ndarray]:
            whole = np.broadcast_to(part[name].variable.set_dims(every).values, shape)
            whole = whole.astype(float).reshape(*count, len(self.quantity), -1)
            return {q: whole[..., i, :] for i, q in enumerate(self.quantity)}

        try:
            values, sigma = by_quantity("data"), self.sigma
            if each := "sigma" in part:
                sigma = by_quantity("sigma")
            masked = np.zeros(count, bool)
            if "mask" in part:
                masked |= part["mask"].variable.set_dims(self.pixels).values.astype(bool)
        except (OSError, ValueError, RuntimeError, KeyError) as error:
            raise ValueError(
                f"the pixels {text_of(index)} of the input cannot be read ({error}). The blocks "
                "that are done stay; run the same again when the input is whole."
            ) from error
        values = {q: np.where(masked[..., None], np.nan, v) for q, v in values.items()}
        values, sigma, reasons = without_refused(values, sigma, whole=True)
        if each:  # a datum without a standard error is left out
            values = {q: np.where(np.isfinite(sigma[q]), v, np.nan) for q, v in values.items()}
            sigma = {q: np.where(np.isfinite(values[q]), s, 1.0) for q, s in sigma.items()}
        status = np.full(count, STATUS[NO_DATA])
        status[np.any([np.isfinite(v).any(-1) for v in values.values()], axis=0)] = STATUS[PENDING]
        if reasons is not None:
            status[reasons != ""] = STATUS[REFUSED]
        status[masked] = STATUS[MASKED]
        return values, sigma, status

    def fingerprint(self) -> str:
        """Return a hash of axes, coordinates, mask, and of the values and errors on the grid.

        Not of all values: reading them would take as long as fitting them.
        """
        (values, sigma, _), each = self.block(grid_of(self.shape)), "sigma" in self.data
        whole = self.data.drop_vars(["data", "sigma"], errors="ignore").variables
        axes = self.pixels, self.shape, self.quantity, "" if each else sigma
        out = hashlib.sha256(repr(axes).encode())
        for array in (self.angle_deg, self.wavelength_um, *(v.values for v in whole.values()),
                      *values.values(), *(sigma.values() if each else ())):  # fmt: skip
            out.update(np.ascontiguousarray(array).tobytes())
        return out.hexdigest()

    def __str__(self) -> str:
        parts = [" x ".join(f"{n} {a}" for n, a in zip(self.shape, self.pixels, strict=True)),
                 ", ".join(self.quantity)]  # fmt: skip
        waves = self.data[WAVELENGTH] if WAVELENGTH in self.data.coords else self.wavelength_um
        for name, of, unit in (("angle", self.angle_deg, "deg"), ("wavelength", waves, "um")):
            if np.isfinite(of).all():
                parts.append(f"{counted(len(np.unique(of)), name)} {span_of(np.asarray(of), unit)}")
        return "; ".join(parts)


def lazy(array: Any, dims: Any, coords: Any = None) -> Any:
    """Return an array that is read by slices as a DataArray that is not loaded."""
    from xarray import DataArray
    from xarray.backends import BackendArray
    from xarray.core import indexing

    class BySlices(BackendArray):
        shape, dtype = array.shape, array.dtype

        def __getitem__(self, key: Any) -> Any:
            return indexing.explicit_indexing_adapter(
                key, self.shape, indexing.IndexingSupport.BASIC, lambda s: np.asarray(array[s])
            )

    dims = [name or f"dim_{i}" for i, name in enumerate(dims)]  # as those without a name in xarray
    out = DataArray(indexing.LazilyIndexedArray(BySlices()), dims=dims, coords=coords)
    out.encoding["preferred_chunks"] = dict(zip(dims, array.chunks or (), strict=False))
    return out


def _arrays(path: Path) -> dict[str, Any]:
    """Return the arrays of a file by name, as DataArrays that are not loaded."""
    xarray, kind = package("xarray"), path.suffix.lower()
    if kind == ".hdr":
        image = package("spectral").open_image(os.fspath(path))
        out = xarray.DataArray(image.open_memmap(interleave="bip"), dims=("y", "x", WAVELENGTH))
        if image.bands.centers:
            units = {"units": image.bands.band_unit}
            out.coords[WAVELENGTH] = WAVELENGTH, image.bands.centers, units
        return {"": out}
    if kind == ".npy":
        return {"": xarray.DataArray(np.load(path, mmap_mode="r"))}
    arrays: dict[str, Any] = {}
    if kind in (".h5", ".hdf5", ".nxs", ".hdf"):

        def add(name: str, one: Any) -> None:
            if hasattr(one, "dtype"):
                scales = {d.label: (d.label, d[0][...], {"units": d[0].attrs.get("units")})
                          for d in one.dims if d.label and len(d)}  # fmt: skip
                arrays[name] = lazy(one, [d.label for d in one.dims], scales)

        package("h5py").File(path, "r").visititems(add)
        return arrays
    node = package("zarr").open(os.fspath(path), mode="r")
    if hasattr(node, "shape"):
        return {"": lazy(node, node.metadata.dimension_names or (None,) * node.ndim)}
    group = xarray.open_dataset(path, engine="zarr", chunks=None, consolidated=False)
    return {str(name): array for name, array in group.data_vars.items()}


def _role(name: Any) -> str:
    """Return quantity, angle or wavelength for the name of such an axis, with a unit or not."""
    head = str(name).split("_")[0]
    return head if head in POINTS else str(name)


def _axes(array: Any) -> tuple[str, ...]:
    """Return what the axes of a DataArray are; () where none has a name."""
    unnamed = all(str(d).startswith("dim_") for d in array.dims)
    return () if unnamed else tuple(map(_role, array.dims))


def _variable(array: Any, axes: tuple[str, ...]) -> Any:
    """Return the values of a DataArray, which are not loaded, and its chunks, along named axes."""
    out = array.variable.copy(deep=False)
    chunks = {**out.encoding.get("preferred_chunks", {}), **out.chunksizes}
    sizes = {a: int(np.max(chunks.get(d, 1))) for a, d in zip(axes, out.dims, strict=True)}
    out.encoding, out.dims = {"preferred_chunks": sizes}, axes
    return out


def _numbers(kind: str, came: Any, unit: str) -> np.ndarray:
    """Return angles in degrees, wavelengths in micrometres, or names of quantities, (N,)."""
    values = np.atleast_1d(came)
    if kind == QUANTITY:
        names = [v.decode() if isinstance(v, bytes) else str(v) for v in values]
        if stray := [n for n in names if n not in QUANTITIES]:
            raise ValueError(f"the quantity {stray[0]!r} came; known are {', '.join(QUANTITIES)}.")
        return np.asarray(names)
    known = "cm-1" if unit.lower() == "wavenumber" else unit_of(unit)
    if kind == ANGLE:
        if unit and known not in ("deg", "rad"):
            raise ValueError(f"the unit {unit!r} of the angles came; deg or rad was wanted.")
        return incidence_deg(values.astype(float), known or "deg", values)
    if known not in WAVELENGTH_UNITS:
        raise ValueError(
            f"the unit {unit!r} of the wavelengths came; one of {', '.join(WAVELENGTH_UNITS)} was "
            "wanted, as the attribute units of the coordinate, or wavelength_um in micrometres."
        )
    return wavelength_um(values.astype(float), known)


def open_cube(
    data: Any, sigma: Any = None, mask: Any = None, dataset: str | None = None,
    quantity: Any = None, angle_deg: Any = None, wavelength_um: Any = None, spectrum: bool = False,
) -> Cube:  # fmt: skip
    """Return a cube from a DataArray or a path; arguments as of `fit_map`.

    spectrum: whether each wavelength is a fit of its own, and so an axis of pixels.
    Raises ValueError for what is no such cube, ImportError where a package is missing.
    """
    xarray = package("xarray")
    points = [a if a is None else tuple(np.ravel(a).tolist())
              for a in (quantity, angle_deg, wavelength_um)]  # fmt: skip
    source, arrays, array = None, {}, data
    if isinstance(data, str | os.PathLike):
        path = os.path.abspath(data)
        try:
            arrays = _arrays(Path(path))
        except (OSError, EOFError, ValueError) as error:
            raise ValueError(f"{path}: it cannot be read ({error}).") from error
        name = next(iter(arrays)) if dataset is None and len(arrays) == 1 else dataset
        if name not in arrays:
            came = "several arrays" if name is None else f"the name {name!r}"
            names = ", ".join(arrays)
            raise ValueError(f"{path}: {came} came; name one of {names} by --dataset.")
        array = arrays[name]
        if all(isinstance(a, str | float | int | None) for a in (sigma, mask)):
            source = os.stat(path).st_mtime_ns, path, sigma, mask, dataset, *points, spectrum
    elif not hasattr(data, "dims"):
        raise ValueError(f"{type(data).__name__} came; a DataArray or a path was wanted.")
    shape, axes = array.shape, _axes(array)
    coords = {QUANTITY: np.asarray([array.name])} if array.name in QUANTITIES else {}
    for name, c in array.coords.items():
        if (kind := _role(name)) in POINTS and c.ndim < 2:
            unit = str(c.attrs.get("units") or str(name).partition("_")[2]).strip()
            coords[kind] = _numbers(kind, c.values, unit)
    for kind, came, unit in zip(POINTS, points, ("", "deg", "um"), strict=True):
        if came is not None:
            coords[kind] = _numbers(kind, came, unit)
    if not axes:  # pixels first, then the axes of which several coordinates are given
        last = [k for k in POINTS if len(coords.get(k, ())) > 1]
        count = max(len(shape) - len(last), 0)
        first = ("y", "x") if count == 2 else tuple(f"pixel_{i}" for i in range(count))
        axes = *first, *last
    for kind, option in ((QUANTITY, "quantity"), (ANGLE, "angle_deg")):
        if kind not in coords:
            flag = option.replace("_", "-")
            raise ValueError(f"no {kind} came with the data; give {option} (--{flag}).")
    pixels, variables = [a for a in axes if a not in POINTS], {}
    beside = {"sigma": sigma if isinstance(sigma, str) or np.ndim(sigma) else None, "mask": mask}
    for name, came in {"data": array, **beside}.items():
        if isinstance(came, str) and came not in arrays:
            raise ValueError(f"{name} is {came!r}, which the file does not hold.")
        came = arrays[came] if isinstance(came, str) else came
        if came is not None:
            came = came if hasattr(came, "dims") else xarray.DataArray(came)
            variables[name] = came, _axes(came) or (axes if came.ndim == len(axes) else pixels)
    try:
        places = {n: (n, v) for n, v in coords.items() if n in axes or len(v) > 1}
        places |= {n: array.coords[n].variable for n in pixels if n in array.coords}
        variables = {n: _variable(*v) for n, v in variables.items()}
        whole = xarray.Dataset(variables, places)
        if stray := [str(a) for a in whole.dims if a not in axes]:
            raise ValueError(f"there are several of {stray[0]}, which is no axis of the data")
    except ValueError as error:
        raise ValueError(
            f"the data have the shape {shape} along {', '.join(axes)}: {error}. Axes of pixels "
            "first, then quantity, angle and wavelength where there are several, were wanted."
        ) from error
    if spectrum and WAVELENGTH in axes:
        pixels.append(WAVELENGTH)
        whole[WAVELENGTH].attrs["units"] = "um"
        del coords[WAVELENGTH]
    if not pixels:
        raise ValueError("the data have no axis of pixels; fit_many takes arrays of curves.")
    waves = coords.get(WAVELENGTH, np.array([np.nan]))
    return Cube(
        data=whole.drop_vars([a for a in POINTS if a not in pixels], errors="ignore"),
        sigma=None if "sigma" in whole else sigma, pixels=tuple(pixels),
        quantity=tuple(map(str, coords[QUANTITY])),
        angle_deg=np.repeat(coords[ANGLE], len(waves)),
        wavelength_um=np.tile(waves, len(coords[ANGLE])) if len(waves) > 1 else float(waves[0]),
        source=source,
    )  # fmt: skip


@functools.lru_cache(4)
def _opened_once(written_ns: int, *source: Any) -> Cube:
    """Return the cube of a path, opened once in a process for each time that it was written."""
    return open_cube(*source)


def block_shape(cube: Cube, curves: int) -> tuple[int, ...]:
    """Return the shape of blocks of about so many curves, in whole chunks of the input if they fit.

    The last axes are taken whole, as files store them.
    """
    chunks = cube.data["data"].encoding["preferred_chunks"]
    block = [min(chunks[a], n) for a, n in zip(cube.pixels, cube.shape, strict=True)]
    for axis in range(len(block)):  # a chunk of more curves is cut, and read several times
        block[axis] = max(1, min(block[axis], block[axis] * curves // math.prod(block)))
    for axis in reversed(range(len(block))):
        more = max(1, curves // math.prod(block))
        block[axis] = min(cube.shape[axis], block[axis] * more)
    return tuple(block)
