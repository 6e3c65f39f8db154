"""A cube of curves: pixels along some axes; quantity, angle and wavelength along the others.

Every input, an array of the caller or a file, is an xarray DataArray that is read block by block.
"""

from __future__ import annotations

import hashlib
import math
import os
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fitting.batch_arrays import without_refused
from fitting.data.measurement import Measurement
from fitting.data.quantities import QUANTITIES
from fitting.data.units import span_of
from fitting.maps.map_store import MASKED, PENDING, STATUS, package
from fitting.output.summary import counted
from fitting.reader.names import unit_of
from fitting.results.result_parts import NO_DATA, REFUSED

QUANTITY, ANGLE, WAVELENGTH = POINTS = ("quantity", "angle", "wavelength")
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

    data: xarray Dataset of data, mask and, if it is an array, sigma, with the coordinates of the
    pixels. sigma: as `fit_many` takes it, where it is no array. pixels: names of their axes.
    shape, chunks: of the input, along these. quantity: (Q,) names. angle_deg: (M,), of the points.
    wavelength_um: (M,), or one number, NaN where the wavelengths are an axis of pixels. source: by
    which a worker opens a path again (`opened_once`); None if some argument is an array.
    """

    data: Any
    sigma: Any
    pixels: tuple[str, ...]
    shape: tuple[int, ...]
    chunks: tuple[int, ...]
    quantity: tuple[str, ...]
    angle_deg: np.ndarray
    wavelength_um: Any
    source: tuple[Any, ...] | None

    def block(self, index: tuple[slice, ...]) -> tuple[dict[str, Any], np.ndarray]:
        """Return curves as arguments of `fit_many`, and the status of each: pending, or why it is
        not fitted and has NaN."""
        try:
            part = self.data.isel(dict(zip(self.pixels, index, strict=True))).load()
        except (OSError, ValueError, RuntimeError, KeyError) as error:
            raise ValueError(
                f"the pixels {text_of(index)} of the input cannot be read ({error}). The blocks "
                "that are done stay; run the same again when the input is whole."
            ) from error
        every = *self.pixels, *(a for a in POINTS if a not in self.pixels)
        shape = tuple(part.sizes.get(a, 1) for a in every)
        count = shape[: len(index)]

        def by_quantity(array: Any) -> dict[str, np.ndarray]:
            whole = np.broadcast_to(array.variable.set_dims(every).values, shape)
            whole = whole.astype(float).reshape(*count, len(self.quantity), -1)
            return {q: whole[..., i, :] for i, q in enumerate(self.quantity)}

        masked = np.broadcast_to(part["mask"].variable.set_dims(self.pixels).values, count) != 0
        values = by_quantity(part["data"].where(part["mask"] == 0))
        sigma = by_quantity(part["sigma"]) if "sigma" in part else self.sigma
        values, sigma, reasons = without_refused(values, sigma, whole=True)
        if "sigma" in part:  # a datum without a standard error is left out
            values = {q: np.where(np.isfinite(sigma[q]), v, np.nan) for q, v in values.items()}
            sigma = {q: np.where(np.isfinite(values[q]), s, 1.0) for q, s in sigma.items()}
        status = np.full(count, STATUS[NO_DATA])
        status[np.any([np.isfinite(v).any(-1) for v in values.values()], axis=0)] = STATUS[PENDING]
        if reasons is not None:
            status[reasons != ""] = STATUS[REFUSED]
        status[masked] = STATUS[MASKED]
        points = {"angles_deg": self.angle_deg, "wavelength_um": self.wavelength_um}
        return {**points, **values, "sigma": sigma}, status

    def fingerprint(self) -> str:
        """Return a hash of axes, coordinates, mask, and of values and errors on the grid: reading
        all of these would take as long as fitting them."""
        curves, _ = self.block(grid_of(self.shape))
        errors = curves.pop("sigma") if "sigma" in self.data else {}
        known = self.data.drop_vars(["data", "sigma"], errors="ignore").variables
        arrays = [a for arrays in (known, curves, errors) for a in arrays.values()]
        text = repr((self.pixels, self.shape, self.quantity, self.sigma)).encode()
        return hashlib.sha256(text + b"".join(np.asarray(a).tobytes() for a in arrays)).hexdigest()

    def __str__(self) -> str:
        parts = [" x ".join(f"{n} {a}" for n, a in zip(self.shape, self.pixels, strict=True)),
                 ", ".join(self.quantity)]  # fmt: skip
        waves = self.data[WAVELENGTH] if WAVELENGTH in self.pixels else self.wavelength_um
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
    xarray, kind, out = package("xarray"), path.suffix.lower(), {}
    if kind == ".hdr":
        image = package("spectral").open_image(os.fspath(path))
        waves = WAVELENGTH, image.bands.centers, {"units": image.bands.band_unit}
        coords, values = {WAVELENGTH: waves}, image.open_memmap(interleave="bip")
        return {"": xarray.DataArray(values, coords if waves[1] else None, ("y", "x", WAVELENGTH))}
    if kind == ".npy":
        return {"": xarray.DataArray(np.load(path, mmap_mode="r"))}
    if kind in (".h5", ".hdf5", ".nxs", ".hdf"):

        def add(name: str, one: Any) -> None:
            if hasattr(one, "dtype"):
                scales = {d.label: (d.label, d[0][...], {"units": d[0].attrs.get("units")})
                          for d in one.dims if d.label and len(d)}  # fmt: skip
                out[name] = lazy(one, [d.label for d in one.dims], scales)

        package("h5py").File(path, "r").visititems(add)
        return out
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
    """Return what the axes of an array are; () where none has a name."""
    dims = getattr(array, "dims", ())
    return () if all(str(d).startswith("dim_") for d in dims) else tuple(map(_role, dims))


def _points(coords: dict[str, tuple[Any, str]]) -> dict[str, Any]:
    """Return quantities, degrees and micrometres (NaN for none) of values and their units."""
    (names, _), (angle, deg), (waves, um) = (coords.get(k, ([np.nan], "")) for k in POINTS)
    quantity = [n.decode() if isinstance(n, bytes) else str(n) for n in names]
    some: dict[str, Any] = {q: np.linspace(0.2, 0.8, len(angle) * len(waves)) for q in quantity}
    um = "cm-1" if um.lower() == "wavenumber" else unit_of(um) or um
    m = Measurement.from_columns(
        np.repeat(angle, len(waves)), np.tile(waves, len(angle)), **some,
        angle_unit=unit_of(deg) or deg or "deg", wavelength_unit=um or None,
        source="the coordinates (their attributes units are angle_unit and wavelength_unit)",
    )  # fmt: skip
    angle = m.angle_deg[: len(angle) * len(waves) : len(waves)]
    return {QUANTITY: quantity, ANGLE: angle, WAVELENGTH: m.wavelength_um[: len(waves)]}


def open_cube(
    data: Any, sigma: Any = None, mask: Any = None, dataset: str | None = None,
    quantity: Any = None, angle_deg: Any = None, wavelength_um: Any = None, spectrum: bool = False,
) -> Cube:  # fmt: skip
    """Return a cube from a DataArray or a path; arguments as of `fit_map`.

    spectrum: whether each wavelength is a fit of its own, and so an axis of pixels.
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
            raise ValueError(f"{path}: {came} came; name one of {', '.join(arrays)} by --dataset.")
        array = arrays[name]
        if all(isinstance(a, str | float | int | None) for a in (sigma, mask)):
            more = path, sigma, mask, dataset, *points, spectrum
            source = open_cube, os.stat(path).st_mtime_ns, *more
    elif not hasattr(data, "dims"):
        raise ValueError(f"{type(data).__name__} came; a DataArray or a path was wanted.")

    coords: dict[str, Any] = {QUANTITY: ([array.name], "")} if array.name in QUANTITIES else {}
    for name, c in array.coords.items():
        if (kind := _role(name)) in POINTS and c.ndim < 2:
            unit = c.attrs.get("units") or str(name).partition("_")[2]
            coords[kind] = np.atleast_1d(c.values), str(unit)
    axes, options = _axes(array), ("quantity", "angle_deg", "wavelength_um")
    for kind, option, unit, came in zip(POINTS, options, ("", "deg", "um"), points, strict=True):
        if came is not None:
            coords[kind] = came, unit
        elif kind not in coords and (kind in axes or kind != WAVELENGTH):
            flag = "--" + option.replace("_", "-")
            raise ValueError(f"no {kind} came with the data; give {option} ({flag}).")
    if not axes:  # pixels first, then the axes of which several coordinates are given
        last = [k for k in POINTS if k in coords and len(coords[k][0]) > 1]
        count = max(array.ndim - len(last), 0)
        axes = *(("y", "x") if count == 2 else (f"pixel_{i}" for i in range(count))), *last
    coords = _points(coords)
    angle, waves = coords[ANGLE], coords[WAVELENGTH]

    pixels = [a for a in axes if a not in POINTS]
    variables: dict[str, Any] = {"mask": ((), False)}
    several = sigma if isinstance(sigma, str) or np.ndim(sigma) else None
    for name, came in {"data": array, "sigma": several, "mask": mask}.items():
        if isinstance(came, str) and came not in arrays:
            raise ValueError(f"{name} is {came!r}, which the file does not hold.")
        if came is not None:
            came = arrays[came] if isinstance(came, str) else came
            unnamed = axes if np.ndim(came) == len(axes) else pixels
            variables[name] = _axes(came) or unnamed, came
    try:
        places = {n: (n, v) for n, v in coords.items() if n in axes or len(v) > 1}
        places |= {n: array.coords[n].variable for n in pixels if n in array.coords}
        whole = xarray.Dataset({n: xarray.Variable(*v) for n, v in variables.items()}, places)
        if stray := [str(a) for a in whole.dims if a not in axes]:
            raise ValueError(f"there are several of {stray[0]}, which is no axis of the data")
    except ValueError as error:
        raise ValueError(
            f"the data have the shape {array.shape} along {', '.join(axes)}: {error}. Wanted "
            "were axes of pixels, then quantity, angle and wavelength where there are several."
        ) from error
    if spectrum and WAVELENGTH in axes:
        pixels.append(WAVELENGTH)
        whole[WAVELENGTH].attrs["units"] = "um"
        waves = np.array([np.nan])
    if not pixels:
        raise ValueError("the data have no axis of pixels; fit_many takes arrays of curves.")
    chunks = {**array.encoding.get("preferred_chunks", {}), **array.chunksizes}
    chunk_of = {a: int(np.max(chunks.get(d, 1))) for a, d in zip(axes, array.dims, strict=True)}
    return Cube(
        data=whole.drop_vars([a for a in POINTS if a not in pixels], errors="ignore"),
        sigma=None if "sigma" in whole else sigma, pixels=tuple(pixels),
        shape=tuple(whole.sizes[a] for a in pixels),
        chunks=tuple(chunk_of[a] for a in pixels), quantity=tuple(coords[QUANTITY]),
        angle_deg=np.repeat(angle, len(waves)),
        wavelength_um=np.tile(waves, len(angle)) if len(waves) > 1 else float(waves[0]),
        source=source,
    )  # fmt: skip


def block_shape(cube: Cube, curves: int) -> tuple[int, ...]:
    """Return the shape of blocks of about so many curves: in whole chunks of the input if they fit,
    and with the last axes whole, as files store them."""
    block = [min(c, n) for c, n in zip(cube.chunks, cube.shape, strict=True)]
    for axis in range(len(block)):  # a chunk of more curves is cut, and read several times
        block[axis] = max(1, min(block[axis], block[axis] * curves // math.prod(block)))
    for axis in reversed(range(len(block))):
        more = max(1, curves // math.prod(block))
        block[axis] = min(cube.shape[axis], block[axis] * more)
    return tuple(block)
