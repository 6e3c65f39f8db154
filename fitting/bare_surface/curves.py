"""The fitted curve at any angle, and its standard error from that of eta and k."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from fitting.bare_surface.coordinates import index_derivatives
from fitting.bare_surface.curve_data import Data, of_rows
from fitting.bare_surface.descent import Solved
from fitting.bare_surface.estimate import K_MIN
from fitting.bare_surface.reflectances import CHANNELS, reflectances
from fitting.data.measurement import Measurement
from fitting.problem.evaluation import measured_places
from fitting.process.compiled import compiled, fit_settings
from fitting.residuals.noise import misfit, rounding, smooth_functions, smooth_misfit
from fitting.results.result_parts import IndexBand, Prediction

# The points of a call are rounded up to a multiple, so that few programs are compiled.
_MULTIPLE = 64
# The relative step of the differences that stand for slopes.
_STEP = 1e-5


def _with_slopes(cos_theta, s_share, eta, u, eta_i):
    """Return (3, 3, P): for each channel the reflectance and its slopes in eta and u = k^2."""

    def model(eta, u):
        return jnp.stack(
            reflectances(cos_theta, s_share, eta / eta_i, jnp.sqrt(u) / eta_i, CHANNELS)
        )

    one, zero = jnp.ones_like(eta), jnp.zeros_like(eta)
    value, along = jax.linearize(model, eta, u)
    return jnp.stack([value, along(one, zero), along(zero, one)], 1)


_with_slopes = compiled(_with_slopes, ())


def _reflectances(data: Data, n: np.ndarray, k: np.ndarray) -> np.ndarray:
    """Return the reflectances at an index (N,), (C, N, M).

    From Fresnel's formulas themselves, which are right to rounding here, so that the first fit of a
    process need not wait for one more program.
    """
    cos, square = data.cos_theta, ((n + 1j * k) ** 2)[:, None]
    q = np.sqrt(square - 1.0 + cos * cos)
    R_s = np.abs((cos - q) / (cos + q)) ** 2
    R_p = np.abs((square * cos - q) / (square * cos + q)) ** 2
    of = {"R_s": R_s, "R_p": R_p, "R": R_p + data.s_share * (R_s - R_p)}
    return np.array([of[c] for c in data.channels])


def fitted_curves(data: Data, s: Solved) -> np.ndarray:
    """Return the reflectances at the solutions, (C, N, M)."""
    n, k, *_ = index_derivatives(s.x, s.w, s.chart)
    return _reflectances(data, n, k)


def _in_a_row(a: np.ndarray) -> np.ndarray:
    """Return (C, N, M, ...) as (N, C M, ...): the channels of a curve one after the other."""
    return np.moveaxis(a, 0, 1).reshape(a.shape[1], -1, *a.shape[3:])


def _smooth(data: Data, angle_deg: np.ndarray, s: Solved, fitted: np.ndarray) -> np.ndarray:
    """Return which curves are missed by a smooth function of the angle, (N,)."""
    values, weights = np.array(data.values), np.array(data.wide_weights)
    n, k, *_ = index_derivatives(s.x, s.w, s.chart)
    # Their direction alone counts, for which differences do. At k = 0 it is that of k^2.
    slopes = np.stack([
        _reflectances(data, n * (1.0 + _STEP), k) - fitted,
        _reflectances(data, n, k + _STEP * (1.0 + k)) - fitted,
    ], -1)  # fmt: skip
    each = smooth_functions(np.broadcast_to(angle_deg, values.shape[1:]))
    own = np.zeros((len(values), *each.shape[:2], len(values), each.shape[2]))
    for i in range(len(values)):
        own[i, :, :, i] = each
    own = own.reshape(*own.shape[:3], -1)
    misfit = np.where(weights > 0.0, values - fitted, 0.0) * weights
    return smooth_misfit(
        _in_a_row(misfit), *(_in_a_row(a * weights[..., None]) for a in (slopes, own))
    )


def noise_of_misfits(data: Data, angle_deg: np.ndarray, s: Solved) -> np.ndarray:
    """Return the noise of the channel that is missed by most, (N,); NaN where none is a misfit."""
    fitted, weights = fitted_curves(data, s), np.array(data.wide_weights)
    value = np.where(weights > 0.0, np.array(data.values), np.nan)
    angles = np.broadcast_to(angle_deg, value.shape)
    rows = (-1, value.shape[-1])  # one for each channel of each curve
    each = misfit(angles.reshape(rows), value.reshape(rows), (value - fitted).reshape(rows))
    rms, noise, found = (a.reshape(value.shape[:-1]) for a in each)
    rest = np.flatnonzero(~found.any(0))
    if len(rest):
        at = angles[0][rest]
        smooth = rest[_smooth(data.take(rest), at, of_rows(s, rest), fitted[:, rest])]
        least = rounding(value[:, smooth].reshape(rows)).reshape(len(value), -1)
        found[:, smooth] = rms[:, smooth] > least
    worst = np.where(found, rms, -np.inf).argmax(0)
    return np.where(found.any(0), noise[worst, np.arange(data.curves)], np.nan)


def _covariance(information: np.ndarray, sigma_eta: np.ndarray, at_zero: np.ndarray) -> np.ndarray:
    """Return the covariance of (eta, u), (N, 2, 2): the inverse over what the data determine.

    A direction that the data do not determine at all is left out, since the curve does not change
    along it. At k = 0 the variance of u is the mean square of u >= 0, which follows from sigma_eta:
    eta shifts by -i_nu / i_nn for each unit of u. (In total reflection, where R is linear in k,
    sigma_eta is that of the inverse and u that of K_MIN, so that this is the inverse there too.)
    """
    ok = np.asarray(np.isfinite(information).all((1, 2)))
    safe = np.where(ok[:, None, None], information, np.eye(2))
    diagonal = np.sqrt(np.maximum(np.diagonal(safe, axis1=1, axis2=2), 1e-300))
    scaled = safe / (diagonal[:, :, None] * diagonal[:, None, :])
    covariance = np.linalg.pinv(scaled, rcond=1e-11, hermitian=True)
    covariance = covariance / (diagonal[:, :, None] * diagonal[:, None, :])
    i_nn = np.maximum(safe[:, 0, 0], 1e-300)
    shift = -safe[:, 0, 1] / i_nn
    square = np.maximum(sigma_eta**2 - 1.0 / i_nn, 0.0) / np.maximum(shift**2, 1e-300)
    edge = square[:, None, None] * np.stack([shift, np.ones_like(shift)], -1)[:, :, None]
    edge = edge * np.stack([shift, np.ones_like(shift)], -1)[:, None, :]
    edge[:, 0, 0] += 1.0 / i_nn
    at_edge = at_zero & (sigma_eta**2 < (1.0 - 1e-9) * covariance[:, 0, 0])
    covariance = np.where(at_edge[:, None, None], edge, covariance)
    return np.where(ok[:, None, None], covariance, np.nan)


class SurfaceCurves(NamedTuple):
    """The evaluator of N fitted curves; see `result.Evaluator`. Arrays are (N, ...).

    information: Fisher information in (eta, u = k^2), regular at k = 0, and singular where one
    combination is unknown, where the covariance does not exist; NaN where there is no fit, and
        infinite of exact data.
    """

    eta: np.ndarray
    k: np.ndarray
    sigma_eta: np.ndarray
    sigma_k: np.ndarray
    information: np.ndarray
    at_zero: np.ndarray
    eta_i: float
    wavelength_um: np.ndarray
    shape: tuple[int, ...]
    measurement: Measurement | None

    def _evaluate(
        self, curve: np.ndarray, angle_deg: np.ndarray, s_share: np.ndarray, quantity: str
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return value and sigma of one quantity at points (P,), each on the curve of a number."""
        if quantity not in CHANNELS:
            raise ValueError(f"quantity is {quantity!r}; one of {', '.join(CHANNELS)} was wanted.")
        points = len(angle_deg)
        at, angle, share = (
            np.pad(a, (0, -points % _MULTIPLE), mode="edge") for a in (curve, angle_deg, s_share)
        )
        with fit_settings():
            out = np.asarray(_with_slopes(
                np.cos(np.radians(angle)), share, self.eta[at],
                np.maximum(self.k[at], K_MIN) ** 2, np.float64(self.eta_i),
            ))  # fmt: skip
        value, by_eta, by_u = out[CHANNELS.index(quantity), :, :points]
        covariance = _covariance(self.information, self.sigma_eta, self.at_zero)[curve]
        slopes = np.stack([by_eta, by_u], -1)
        variance = np.einsum("pi,pij,pj->p", slopes, covariance, slopes)
        return value, np.sqrt(np.maximum(variance, 0.0))

    def over_angle(self, angle_deg: np.ndarray, quantity: str) -> Prediction:
        """Return each curve over angles (A,), shape + (A,); linear in eta and k^2.

        The error is defined where eta and k are not known apart (the curve is), and NaN where there
        is no fit, or nothing that tells the noise.
        """
        curve = np.arange(len(self.eta)).repeat(len(angle_deg))
        angle = np.tile(angle_deg, len(self.eta))
        value, sigma = self._evaluate(curve, angle, np.full(angle.shape, 0.5), quantity)
        shape = self.shape + angle_deg.shape
        return Prediction(value.reshape(shape), sigma.reshape(shape))

    def predict(self, measurement: Measurement | None = None) -> Prediction:
        """Return the reflectance at every row of a measurement; NaN at wavelengths not fitted."""
        m = self.measurement if measurement is None else measurement
        assert m is not None
        value, sigma = np.full(len(m), np.nan), np.full(len(m), np.nan)
        place = {w: i for i, w in enumerate(self.wavelength_um.tolist())}
        single = len(self.eta) == 1 and not np.isfinite(m.wavelength_um).any()
        which = np.array([
            0 if single else place.get(w, -1) for w in m.wavelength_um.tolist()
        ])  # fmt: skip
        share = m.s_share
        for quantity in dict.fromkeys(m.quantity.tolist()):
            rows = np.flatnonzero((m.quantity == quantity) & (which >= 0))
            if len(rows):
                value[rows], sigma[rows] = self._evaluate(
                    which[rows], m.angle_deg[rows], share[rows], quantity
                )
        return Prediction(value, sigma)

    def index(self, wavelength_um: Any = None, medium: str | None = None) -> IndexBand:
        """Return eta and k at the fitted wavelengths; see `Fit.index`."""
        if medium not in (None, "substrate"):
            raise ValueError(f"there is no medium {medium!r}; a bare surface has 'substrate' only.")
        chosen = np.arange(len(self.eta))
        if wavelength_um is not None:
            chosen = np.array(measured_places(self.wavelength_um, wavelength_um))
        columns = (self.wavelength_um, self.eta, self.sigma_eta, self.k, self.sigma_k)
        return IndexBand(*(c[chosen] for c in columns))

    def widened(self, factor: np.ndarray) -> SurfaceCurves:
        """Return the same with the errors of each curve times its factor, (N,)."""
        return self._replace(
            sigma_eta=self.sigma_eta * factor, sigma_k=self.sigma_k * factor,
            information=self.information / factor[:, None, None] ** 2,
        )  # fmt: skip

    def at(self, index: tuple[int, ...]) -> SurfaceCurves:
        """Return the evaluator of one curve."""
        i = int(np.ravel_multi_index(index, self.shape))
        one = {
            name: value[i : i + 1] for name, value in self._asdict().items()
            if isinstance(value, np.ndarray)
        }  # fmt: skip
        m = self.measurement
        if m is not None:
            m = m.where(m.at_wavelength(self.wavelength_um[i]))
        return self._replace(**one, shape=(), measurement=m)
