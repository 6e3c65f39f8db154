"""One boundary of a scene: its media over wavelength, and the largest error of a model on it."""

import itertools
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from fresnel_jax import dispersion

from .forms import EXACT, Form
from .search import (
    FROM_SPECIAL,
    Place,
    angle_grid,
    cosine,
    crossings,
    largest,
    wavelength_grid,
)

BANDS = {0: "spectrum", 1: "one wavelength", 3: "three bands"}
LIGHT = ("s and p", "unpolarized")
# Arguments of one shape: one compiled program per form and dtype, and per material. A round of the
# refinement has 7,776 points, later ones fewer; in chunks of 16,384 most arithmetic was of what
# fills them up.
_CHUNK, _WAVELENGTH_CHUNK = 2592, 512
# Of an exact form in float64, within 8 eps, and of the reference that it is compared with.
_ROUNDING_64 = 7e-15
# Float32, in half eps: one for the cosine and each index (two where eta_i is rounded as well: only
# quotients count), then the arithmetic. R is monotonic over so small a box, whose corners hold its
# extremes.
_EPS_32 = float(np.finfo(np.float32).eps)
_CORNERS = {
    "float64": [(0.0, 0.0, 0.0)],
    "float32": [
        (0.5 * c * _EPS_32, 0.5 * n * _EPS_32, 0.5 * k * _EPS_32)
        for c, n, k in itertools.product((-1.0, 1.0), repeat=3)
    ],
}
_ARITHMETIC = {"float64": 0.0, "float32": 8.0 * _EPS_32}
_POLYNOMIAL_ARITHMETIC = 64.0 * _EPS_32  # Clenshaw's sums; measured: 20


class Model(NamedTuple):
    """A way to compute the scene: one of `FORMS`, how many bands (0: every wavelength), a dtype."""

    form: str = EXACT
    bands: int = 0
    dtype: str = "float64"

    def __str__(self):
        return "; ".join((self.form, BANDS[self.bands], self.dtype))


class Worst(NamedTuple):
    """The largest error of R that was found, and where it is."""

    error: float
    material: str
    wavelength_um: float
    angle_deg: float

    @property
    def bound(self) -> float:
        """What no error exceeds: the search may miss a hundredth of the highest peak."""
        return 1.01 * self.error + _ROUNDING_64


def _evaluated(given: Any, name: str) -> tuple[Callable, np.ndarray]:
    """wavelength_um -> (eta, k) as float64 arrays, checked; and the knots of a table."""
    if isinstance(given, str):
        given = dispersion.material(given)
    elif isinstance(given, tuple | list) and len(given) == 3:
        given = dispersion.Tabulated(*(np.asarray(x, float) for x in given))
    elif not callable(given):
        pair = given if isinstance(given, tuple | list) else (np.real(given), np.imag(given))
        constant = tuple(float(x) for x in pair)
        if len(constant) != 2:
            raise ValueError(f"{name}: {len(constant)} values came; wanted eta and k, or a table")
        given = lambda wavelength: constant  # noqa: E731

    def evaluate(wavelength_um):
        flat = wavelength_um.ravel()
        flat = np.pad(flat, (0, -flat.size % _WAVELENGTH_CHUNK), mode="edge")
        index: Any = given(flat)
        arrays = (np.broadcast_to(np.asarray(x, float), flat.shape) for x in index)
        eta, k = (x[: wavelength_um.size].reshape(wavelength_um.shape) for x in arrays)
        if not (np.isfinite(eta) & np.isfinite(k) & (eta > 0.0) & (k >= 0.0)).all():
            raise ValueError(
                f"{name}: an index with eta <= 0, k < 0 or not finite between "
                f"{wavelength_um.min():g} and {wavelength_um.max():g} um; wanted eta + ik, k >= 0"
            )
        return eta, k

    table = getattr(given, "model", given)
    return evaluate, np.asarray(getattr(table, "wavelength_um", ()))


class Boundary:
    """One material of a scene, and errors of models on it."""

    def __init__(
        self,
        name: str,
        medium,
        eta_i,
        wavelength_um: tuple[float, float],
        angle_deg: tuple[float, float],
        forms: Mapping[str, Form],
    ):
        self.name, self.forms = name, forms
        self.wavelength_um, self.angle_deg = wavelength_um, angle_deg
        self.index, knots = _evaluated(medium, name)
        self.index_i, knots_i = _evaluated(eta_i, "eta_i")
        self.knots = np.union1d(knots, knots_i)
        self.knots = np.union1d(self.knots, self._around_matches())
        self._grids = {}

    def _around_matches(self) -> np.ndarray:
        """Wavelengths at and around which eta = eta_i: there R for k = 0 has a peak of no width."""

        def mismatch(wavelength):
            eta, _, eta_i = self.media(wavelength)
            return eta - eta_i

        low, high = self.wavelength_um
        matches = crossings(mismatch, wavelength_grid(low, high, self.knots))
        return np.add.outer(matches, (high - low) * FROM_SPECIAL).ravel()

    def media(self, wavelength_um):
        eta, k = self.index(wavelength_um)
        eta_i, k_i = self.index_i(wavelength_um)
        if k_i.any():
            raise ValueError("eta_i has k > 0; the medium that light comes from must be lossless")
        return eta, k, eta_i

    def evaluate(self, form: str, cosines, media) -> np.ndarray:
        """R_s and R_p in float64, of shape (2, ...)."""
        arrays = np.broadcast_arrays(cosines, *media)
        flat = np.stack([x.ravel() for x in arrays])
        size = flat.shape[1]
        flat = np.pad(flat, ((0, 0), (0, -size % _CHUNK)), mode="edge")
        parts = [
            np.asarray(self.forms[form].function(*piece), float)
            for piece in np.split(flat, flat.shape[1] // _CHUNK, axis=1)
        ]
        return np.concatenate(parts, axis=1)[:, :size].reshape(2, *arrays[0].shape)

    def exact(self, wavelength, angle):
        """Media, and R_s and R_p by the exact form; kept for grids, which the models share."""
        key = wavelength.tobytes(), angle.tobytes()
        if key in self._grids:
            return self._grids[key]
        media = self.media(wavelength)
        result = media, self.evaluate(EXACT, cosine(angle), media)
        if angle.ndim == 2:
            self._grids[key] = result
        return result

    def worst(self, model: Model, light: str, enough: float = np.inf) -> Worst:
        """The largest error; the search ends early with the first that exceeds `enough`."""
        low, high = self.wavelength_um
        edges = np.linspace(low, high, max(model.bands, 1) + 1)
        arithmetic = _ARITHMETIC[model.dtype]
        if model.form.startswith("polynomial") and model.dtype == "float32":
            arithmetic = _POLYNOMIAL_ARITHMETIC
        best = Place(0.0, low, self.angle_deg[0])
        for band in itertools.pairwise(edges):
            centre = np.array([[sum(band) / 2.0]])
            representative = self.media(centre) if model.bands else None

            def difference(wavelength, angle, representative=representative):
                media, true = self.exact(wavelength, angle)
                used = representative or media
                eta, k, eta_i = used
                roundings = 1.0 if (np.float32(eta_i) == eta_i).all() else 2.0
                largest_error = np.zeros(true.shape[1:])
                for by_c, by_n, by_k in _CORNERS[model.dtype]:
                    by_n, by_k = roundings * by_n, roundings * by_k
                    corner = eta * (1.0 + by_n), k * (1.0 + by_k), eta_i
                    c = np.minimum(cosine(angle) * (1.0 + by_c), 1.0)
                    errors = self.evaluate(model.form, c, corner) - true
                    errors = errors if light == LIGHT[0] else np.mean(errors, axis=0, keepdims=True)
                    largest_error = np.maximum(largest_error, np.max(np.abs(errors), axis=0))
                return largest_error + arithmetic

            wavelengths = wavelength_grid(*band, self.knots)
            both = [self.media(wavelengths)] + [self.media(centre[0])] * (model.bands > 0)
            relative = [np.broadcast_to(eta / eta_i, wavelengths.shape) for eta, _, eta_i in both]
            angles = angle_grid(*self.angle_deg, np.stack(relative, axis=1))
            best = max(best, largest(difference, wavelengths, angles, enough))
            if best.error > enough:
                break
        return Worst(best.error, self.name, best.wavelength_um, best.angle_deg)
