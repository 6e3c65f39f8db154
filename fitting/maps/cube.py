"""A cube of curves: pixels along some axes; quantity, angle and wavelength along the others.

It is read block by block: an xarray DataArray, or a file that is opened without being loaded.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import itertools
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fitting.data.errors import MissingExtra
from fitting.data.quantities import QUANTITIES
from fitting.data.units import WAVELENGTH_UNITS, incidence_deg, wavelength_um

QUANTITY, ANGLE, WAVELENGTH = POINTS = ("quantity", "angle", "wavelength")
# So many pixels, on a grid, stand for the map: in its fingerprint, and where its search begins.
GRID_PIXELS = 64
_DEGREES = ("", "deg", "degree", "degrees")
_RADIANS = ("rad", "radian", "radians")
_SPELLED = {"micrometer": "um", "micrometers": "um", "micrometre": "um", "micron": "um",
            "microns": "um", "µm": "um", "nanometer": "nm", "nanometers": "nm",
            "nanometre": "nm", "ev": "eV", "wavenumber": "cm-1"}  # fmt: skip


def package(name: str, asked: str) -> Any:
    """Return a package of the extra "maps", or raise ImportError that names the extra."""
    if importlib.util.find_spec(name.partition(".")[0]) is None:
        raise MissingExtra(asked, name.partition(".")[0], "maps")
    return importlib.import_module(name)


def text_of(index: tuple[slice, ...]) -> str:
    """Return the pixels of a block as they are named in messages: 0:10, 0:1000."""
    return ", ".join(f"{s.start}:{s.stop}" for s in index)


class Labelled(NamedTuple):
    """An array that is read by slices, and the names of its axes."""

    array: Any
    axes: tuple[str, ...]

    def read(self, index: Mapping[str, slice], order: tuple[str, ...]) -> np.ndarray:
        """Return a part with its axes in this order, of length 1 where it has no such axis."""
        part = np.asarray(self.cut(index).array)
        present = [a for a in order if a in self.axes]
        part = part.transpose([self.axes.index(a) for a in present])
        lengths = iter(part.shape)
        return part.reshape([next(lengths) if a in self.axes else 1 for a in order])

    def cut(self, index: Mapping[str, slice]) -> Labelled:
        """Return the part itself, as it lies."""
        part = tuple(index.get(a, slice(None)) for a in self.axes)
        return self._replace(array=self.array[part])


class Cube(NamedTuple):
    """A cube that can be read. pixels: names of the pixels' axes; shape: their lengths.

    quantity: (Q,) names. angle_deg, wavelength_um: of the M points, (M,); a wavelength is NaN where
    the wavelengths are an axis of pixels. places: coordinates of the pixels, with their units.
    """

    data: Labelled
    sigma: Any  # Labelled; or as `fit_many` takes them: a number, numbers by quantity, None
    mask: Labelled | None
    pixels: tuple[str, ...]
    shape: tuple[int, ...]
    chunks: tuple[int, ...]
    quantity: tuple[str, ...]
    angle_deg: np.ndarray
    wavelength_um: np.ndarray
    places: Mapping[str, tuple[np.ndarray, str]]

    def block(self, index: tuple[slice, ...]) -> tuple[Any, Any, np.ndarray]:
        """Return values by quantity, (pixels..., M), errors for `fit_many`, and the mask."""
        at = dict(zip(self.pixels, index, strict=True))
        order = *self.pixels, *(a for a in POINTS if a not in self.pixels)
        given, sigma, mask = self.sigma, self.sigma, self.mask
        try:
            values = self.data.read(at, order)
            if isinstance(given, Labelled):
                sigma = given.read(at, order)
            masked = None if mask is None else mask.read(at, self.pixels).astype(bool)
        except (OSError, ValueError, RuntimeError, KeyError) as error:
            raise ValueError(
                f"the pixels {text_of(index)} of the input cannot be read ({error}). The blocks "
                "that are done stay; run the same again when the input is whole."
            ) from error
        count = values.shape[: len(self.pixels)]

        def by_quantity(array: np.ndarray) -> dict[str, np.ndarray]:
            whole = np.broadcast_to(array, values.shape).astype(float)
            whole = whole.reshape(*count, len(self.quantity), -1)
            return {q: whole[..., i, :] for i, q in enumerate(self.quantity)}

        sigma = by_quantity(sigma) if isinstance(given, Labelled) else sigma
        none = np.zeros(count, bool)
        return by_quantity(values), sigma, none if masked is None else none | masked

    @property
    def wavelength(self) -> Any:
        """The wavelengths as `fit_many` takes them: (M,), one number, or None."""
        first = self.wavelength_um[0]
        if (self.wavelength_um != first).any() and not np.isnan(first):
            return self.wavelength_um
        return None if np.isnan(first) else float(first)

    def part(self, index: tuple[slice, ...]) -> Cube:
        """Return a cube of these pixels alone, which is sent to another process."""
        at = dict(zip(self.pixels, index, strict=True))
        sigma, mask = self.sigma, self.mask
        return self._replace(
            data=self.data.cut(at), mask=None if mask is None else mask.cut(at),
            sigma=sigma.cut(at) if isinstance(sigma, Labelled) else sigma, places={},
        )  # fmt: skip

    def grid(self) -> list[np.ndarray]:
        """Return the places of a coarse grid of pixels along each axis."""
        side = max(round(GRID_PIXELS ** (1.0 / len(self.shape))), 1)
        counts = [min(side, n) for n in self.shape]
        return [((np.arange(g) + 0.5) * n / g).astype(int)
                for g, n in zip(counts, self.shape, strict=True)]  # fmt: skip

    def on_grid(self) -> tuple[Any, Any]:
        """Return values (masked: NaN) and errors of the grid's pixels, (grid..., M) each."""
        grid = self.grid()
        places = itertools.product(*grid)
        read = [self.block(tuple(slice(i, i + 1) for i in place)) for place in places]
        shape = *map(len, grid), -1
        kept = [np.where(masked[..., None], np.nan, 1.0) for _, _, masked in read]
        values = {q: np.reshape([own[q] * k for (own, _, _), k in zip(read, kept, strict=True)],
                                shape) for q in self.quantity}  # fmt: skip
        if isinstance(self.sigma, Labelled):
            return values, {q: np.reshape([s[q] for _, s, _ in read], shape) for q in self.quantity}
        return values, self.sigma

    def fingerprint(self) -> str:
        """Return a hash of axes, coordinates, mask, and of the values and errors on the grid.

        Not of all values: reading them would take as long as fitting them.
        """
        values, sigma = self.on_grid()
        errors = sigma if isinstance(self.sigma, Labelled) else {}
        axes = self.pixels, self.shape, self.quantity, "" if errors else self.sigma
        told = hashlib.sha256(repr(axes).encode())
        for array in (self.angle_deg, self.wavelength_um, *values.values(), *errors.values(),
                      *(p for p, _ in self.places.values())):  # fmt: skip
            told.update(np.ascontiguousarray(array).tobytes())
        if self.mask is not None:
            told.update(np.packbits(np.asarray(self.mask.array).astype(bool)).tobytes())
        return told.hexdigest()

    def __str__(self) -> str:
        def span(name: str, values: np.ndarray, unit: str) -> str:
            known = np.unique(values[np.isfinite(values)])
            if len(known) < 2:
                return f"{name} {known[0]:g} {unit}" if len(known) else ""
            return f"{len(known)} {name}s {known[0]:g} to {known[-1]:g} {unit}"

        sizes = " x ".join(f"{n} {a}" for n, a in zip(self.shape, self.pixels, strict=True))
        parts = (sizes, ", ".join(self.quantity), span("angle", self.angle_deg, "deg"),
                 span("wavelength", self.wavelength_um, "um"))  # fmt: skip
        return "; ".join(filter(None, parts))


def _opened(path: Path, dataset: str | None) -> tuple[Labelled, dict[str, Any], Any]:
    """Return the array of a file, its coordinates by axis as (numbers, unit), and the file.

    Axes are named where the file names them, else "".
    """
    asked, kind = f"{path}", path.suffix.lower()
    if not path.exists():
        raise ValueError(f"{path}: there is no such file.")
    if kind == ".hdr":
        image = package("spectral", asked).open_image(os.fspath(path))
        rows, columns, bands = image.shape
        needed = image.offset + rows * columns * bands * image.sample_size
        if (size := os.path.getsize(image.filename)) < needed:
            raise ValueError(
                f"{path}: its data file has {size} bytes, and its header tells of {needed}; it was "
                "cut off."
            )
        known = {}
        if image.bands.centers:
            known[WAVELENGTH] = np.asarray(image.bands.centers, float), image.bands.band_unit
        cube = image.open_memmap(interleave="bip")
        return Labelled(cube, ("y", "x", WAVELENGTH)), known, None
    if kind == ".npy":
        array = np.load(path, mmap_mode="r")
        return Labelled(array, ("",) * array.ndim), {}, None
    if kind in (".h5", ".hdf5", ".nxs", ".hdf"):
        file = package("h5py", asked).File(path, "r")
        if dataset is None or dataset not in file:
            names: list[str] = []
            file.visititems(lambda name, one: names.append(name) if hasattr(one, "dtype") else None)
            raise _unnamed(path, dataset, names)
        array = file[dataset]
        known = {d.label: (np.asarray(d[0]), d[0].attrs.get("units", "")) for d in array.dims
                 if d.label and len(d)}  # fmt: skip
        return Labelled(array, tuple(d.label for d in array.dims)), known, file
    zarr, xarray = package("zarr", asked), package("xarray", asked)
    node = zarr.open(os.fspath(path), mode="r")
    if not isinstance(node, zarr.Group):
        return Labelled(node, tuple(node.metadata.dimension_names or ("",) * node.ndim)), {}, None
    file = xarray.open_dataset(os.fspath(path), engine="zarr", chunks=None, consolidated=False)
    names = list(map(str, file.data_vars))
    dataset = names[0] if dataset is None and len(names) == 1 else dataset
    if dataset not in names:
        raise _unnamed(path, dataset, names)
    return *_of_xarray(file[dataset]), file


def _unnamed(path: Path, dataset: str | None, names: list[str]) -> ValueError:
    came = "several arrays" if dataset is None else f"the name {dataset!r}"
    return ValueError(f"{path}: {came} came; name one of {', '.join(names)} by --dataset.")


def _of_xarray(array: Any) -> tuple[Labelled, dict[str, Any]]:
    known = {name: (np.asarray(c.values), c.attrs.get("units", ""))
             for name, c in array.coords.items() if c.ndim < 2}  # fmt: skip
    if array.name in QUANTITIES:
        known.setdefault(QUANTITY, (np.asarray(array.name), ""))
    return Labelled(array, tuple(map(str, array.dims))), known


def _role(name: Any) -> str:
    """Return quantity, angle or wavelength for the name of such an axis, with a unit or not."""
    head = str(name).split("_")[0]
    return head if head in POINTS else str(name)


def _numbers(kind: str, name: str, came: tuple[Any, str]) -> np.ndarray:
    """Return angles in degrees, wavelengths in micrometres, or names of quantities, (N,)."""
    values, unit = np.atleast_1d(came[0]), str(came[1] or "").strip()
    if kind == QUANTITY:
        names = [v.decode() if isinstance(v, bytes) else str(v) for v in values]
        if stray := [n for n in names if n not in QUANTITIES]:
            raise ValueError(f"the quantity {stray[0]!r} came; known are {', '.join(QUANTITIES)}.")
        return np.asarray(names)
    unit = unit or name.partition("_")[2]
    if kind == ANGLE:
        if unit.lower() not in (*_DEGREES, *_RADIANS):
            raise ValueError(f"the unit {unit!r} of the angles came; deg or rad was wanted.")
        numbers = np.asarray(values, float)
        in_radians = unit.lower() in _RADIANS
        return incidence_deg(numbers, "rad" if in_radians else "deg", numbers)
    unit = _SPELLED.get(unit.lower(), unit)
    if unit not in WAVELENGTH_UNITS:
        raise ValueError(
            f"the unit {unit!r} of the wavelengths came; one of {', '.join(WAVELENGTH_UNITS)} was "
            "wanted, as the attribute units of the coordinate, or wavelength_um in micrometres."
        )
    return wavelength_um(np.asarray(values, float), unit)


@functools.lru_cache(4)
def _cached(path: str, *rest: Any) -> Cube:
    return open_cube(path, *rest)


class Source(NamedTuple):
    """What a cube is opened from, small enough to be sent to another process; see `open_cube`."""

    data: Any
    sigma: Any
    mask: Any
    dataset: str | None
    quantity: tuple[str, ...] | None
    angle_deg: tuple[float, ...] | None
    wavelength_um: tuple[float, ...] | None
    spectrum: bool

    def open(self) -> Cube:
        """Return the cube; that of a path is opened once in a process."""
        small = str, float, int, type(None)
        plain = all(isinstance(one, small) for one in (self.data, self.sigma, self.mask))
        return _cached(*self) if plain else open_cube(*self)


def open_cube(
    data: Any, sigma: Any = None, mask: Any = None, dataset: str | None = None,
    quantity: Any = None, angle_deg: Any = None, wavelength_um: Any = None, spectrum: bool = False,
) -> Cube:  # fmt: skip
    """Return a cube from a DataArray or a path; arguments as of `fit_map`.

    spectrum: whether each wavelength is a fit of its own, and so an axis of pixels.
    Raises ValueError for what is no such cube, ImportError where a package is missing.
    """
    file = None
    if hasattr(data, "dims"):
        main, known = _of_xarray(data)
    else:
        try:
            main, known, file = _opened(Path(data), dataset)
        except (OSError, EOFError, ValueError) as error:
            if str(error).startswith(str(data)):
                raise
            raise ValueError(f"{data}: it cannot be read ({error}).") from error
    given = {QUANTITY: (quantity, ""), ANGLE: (angle_deg, "deg"), WAVELENGTH: (wavelength_um, "um")}
    coords = {_role(n): _numbers(_role(n), n, c) for n, c in known.items() if _role(n) in POINTS}
    coords |= {k: _numbers(k, k, c) for k, c in given.items() if c[0] is not None}
    axes = tuple(map(_role, main.axes))
    if not all(axes):  # pixels first, then the axes of which several coordinates are given
        last = [k for k in POINTS if len(coords.get(k, ())) > 1]
        count = len(axes) - len(last)
        first = ("y", "x") if count == 2 else tuple(f"pixel_{i}" for i in range(max(count, 0)))
        axes = *first, *last
    shape = main.array.shape
    for kind in (QUANTITY, ANGLE):
        if kind not in coords:
            raise ValueError(
                f"no {kind} came with the data; give {'angle_deg' if kind == ANGLE else kind} "
                f"(--{'angle-deg' if kind == ANGLE else kind})."
            )
    coords.setdefault(WAVELENGTH, np.array([np.nan]))
    for kind, values in coords.items():
        length = shape[axes.index(kind)] if kind in axes and len(axes) == len(shape) else 1
        if len(axes) != len(shape) or length != len(values):
            raise ValueError(
                f"the data have the shape {tuple(shape)} along {', '.join(axes)}, and "
                f"{len(values)} of {kind} came; axes of pixels first, then quantity, angle and "
                "wavelength where there are several, were wanted."
            )
    pixels = tuple(a for a in axes if a not in POINTS)
    waves, angles = coords[WAVELENGTH], coords[ANGLE]
    if spectrum and WAVELENGTH in axes:
        pixels += (WAVELENGTH,)
        waves = np.array([np.nan])
    if not pixels:
        raise ValueError("the data have no axis of pixels; fit_many takes arrays of curves.")
    sizes = dict(zip(axes, shape, strict=True))
    encoded = getattr(main.array, "encoding", {}).get("preferred_chunks", {})
    chunked = encoded or dict(zip(axes, getattr(main.array, "chunks", None) or (), strict=False))
    chunks = tuple(c if isinstance(c := chunked.get(a, 1), int) else max(c) for a in pixels)

    def beside(name: str, came: Any) -> Any:
        """Return errors or a mask: an array of axes of the cube, or one of the same file."""
        if isinstance(came, str):
            if file is None or came not in file:
                raise ValueError(f"{name} is {came!r}, which the file does not hold.")
            came = file[came]
        if hasattr(came, "dims") and all(isinstance(d, str) for d in came.dims):
            own = tuple(map(_role, came.dims))
        else:
            own = axes if np.ndim(came) == len(axes) else pixels
        if any(sizes.get(a) != n for a, n in zip(own, came.shape, strict=False)):
            raise ValueError(f"{name} has the shape {came.shape}, and the data {tuple(shape)}.")
        return Labelled(came, own)

    if isinstance(sigma, str) or np.ndim(sigma):
        sigma = beside("sigma", sigma)
    places = {n: (v, str(u)) for n, (v, u) in known.items() if n in pixels and len(v) == sizes[n]}
    if WAVELENGTH in pixels:
        places[WAVELENGTH] = coords[WAVELENGTH], "um"
    points = np.meshgrid(angles, waves, indexing="ij")
    return Cube(
        Labelled(main.array, axes), sigma, None if mask is None else beside("mask", mask),
        pixels, tuple(sizes[a] for a in pixels), chunks, tuple(map(str, coords[QUANTITY])),
        points[0].ravel(), points[1].ravel(), places,
    )  # fmt: skip


def block_shape(cube: Cube, curves: int) -> tuple[int, ...]:
    """Return the shape of blocks of about so many curves, in whole chunks of the input if they fit.

    The last axes are taken whole, as files store them.
    """
    block = [min(c, n) for c, n in zip(cube.chunks, cube.shape, strict=True)]
    for axis in range(len(block)):  # a chunk of more curves is cut, and read several times
        block[axis] = max(1, min(block[axis], block[axis] * curves // math.prod(block)))
    for axis in reversed(range(len(block))):
        whole = cube.shape[axis]
        block[axis] = min(whole, block[axis] * max(1, curves // math.prod(block)))
    return tuple(block)
