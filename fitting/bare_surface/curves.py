"""The fitted curve at any angle, with the band that the uncertainty of eta and k gives it."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from fitting.bare_surface.estimate import K_MIN
from fitting.bare_surface.index_result import AT_ZERO, NO_DATA, NOT_CONVERGED, FitResult
from fitting.bare_surface.reflectances import CHANNELS, reflectances
from fitting.compiled import compiled
from fitting.measurement import Measurement

# Angles of a call are rounded up to a multiple, so that few programs are compiled.
_ANGLES = 64


def _with_slopes(cos_theta, s_share, eta, u, eta_i):
    """Return (3, 3, N, A): for each channel the reflectance and its slopes in eta and u = k^2."""

    def model(eta, u):
        return jnp.stack(
            reflectances(cos_theta, s_share, eta / eta_i, jnp.sqrt(u) / eta_i, CHANNELS)
        )

    one, zero = jnp.ones_like(eta), jnp.zeros_like(eta)
    value, along = jax.linearize(model, eta, u)
    return jnp.stack([value, along(one, zero), along(zero, one)], 1)


_with_slopes = compiled(_with_slopes, ())


def _covariance(information: np.ndarray, sigma_eta: np.ndarray, at_zero: np.ndarray) -> np.ndarray:
    """Return the covariance of (eta, u), (N, 2, 2): the inverse over what the data determine.

    A direction that they do not see at all is left out: along it the curve does not change. At
    k = 0 it is the mean square of what u >= 0 may be, which sigma_eta tells: eta shifts by
    -i_nu / i_nn for each unit of u. (In total reflection, where R is linear in k, sigma_eta is that
    of the inverse, and u that of K_MIN: the inverse it is there too.)
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


def _evaluate(
    result: FitResult, angle_deg: np.ndarray, s_share: np.ndarray, quantity: str
) -> tuple[np.ndarray, np.ndarray]:
    """Return value and sigma, (N, A), of the N curves of the result at angles (1, A) or (N, A)."""
    if quantity not in CHANNELS:
        raise ValueError(f"quantity is {quantity!r}; one of {', '.join(CHANNELS)} was wanted.")
    eta, k = (np.reshape(a, (-1, 1)) for a in (result.eta, result.k))
    status = np.reshape(result.status, -1)
    information = np.reshape(result.information, (-1, 2, 2))
    angles = angle_deg.shape[1]
    pad = ((0, 0), (0, -angles % _ANGLES))
    with jax.enable_x64(True):
        out = _with_slopes(
            np.cos(np.radians(np.pad(angle_deg, pad))), np.pad(s_share, pad), eta,
            np.maximum(k, K_MIN) ** 2, np.float64(result.eta_i),
        )  # fmt: skip
        value, by_eta, by_u = np.asarray(out)[CHANNELS.index(quantity), :, :, :angles]
    sigma_eta = np.reshape(result.sigma_eta, -1)
    covariance = _covariance(information, sigma_eta, status == AT_ZERO)
    slopes = np.stack([by_eta, by_u], -1)
    variance = np.einsum("nai,nij,naj->na", slopes, covariance, slopes)
    wrong = np.isin(status, (NO_DATA, NOT_CONVERGED))[:, None]
    return value, np.where(wrong, np.nan, np.sqrt(np.maximum(variance, 0.0)))


def curve(
    result: FitResult, angle_deg: np.ndarray, quantity: str = "R"
) -> tuple[np.ndarray, np.ndarray]:
    """Return the fitted reflectance at ``angle_deg`` and its standard error.

    result: of `fit` or `fit_many`. angle_deg: (A,) degrees. quantity: "R_s", "R_p" or "R".
    Result: two arrays of shape result.shape + (A,). The error is that of the fitted curve, linear
    in eta and k^2; it is defined where eta and k are not known apart (the curve is), and NaN where
    there is no fit, or nothing that tells the noise.
    """
    angle_deg = np.atleast_1d(np.asarray(angle_deg, float))
    if angle_deg.ndim != 1:
        raise ValueError(f"angle_deg has shape {angle_deg.shape}; one axis was wanted.")
    line = angle_deg[None]
    value, sigma = _evaluate(result, line, np.full_like(line, 0.5), quantity)
    shape = result.shape + angle_deg.shape
    return value.reshape(shape), sigma.reshape(shape)


def fitted_values(result: FitResult, measurement: Measurement) -> tuple[np.ndarray, np.ndarray]:
    """Return the fitted reflectance at every datum of a measurement and its standard error, (N,).

    result: what `fit` made of this measurement. NaN in rows whose quantity is not fitted.
    """
    value, sigma = np.full(len(measurement), np.nan), np.full(len(measurement), np.nan)
    wavelengths, which = np.unique(measurement.wavelength_um, return_inverse=True)
    if len(wavelengths) != max(1, int(np.prod(result.shape))):
        raise ValueError(
            f"the result is of {int(np.prod(result.shape))} wavelengths, the measurement has "
            f"{len(wavelengths)}; pass the measurement that was fitted."
        )
    polarizer = np.sin(np.radians(measurement.polarizer_deg)) ** 2
    share = np.where(np.isnan(polarizer), 0.5, polarizer)
    for quantity in CHANNELS:
        rows = np.flatnonzero(measurement.quantity == quantity)
        if not len(rows):
            continue
        # All rows of a wavelength as one line of a table, filled up to the longest.
        order = rows[np.argsort(which[rows], kind="stable")]
        counts = np.bincount(which[order], minlength=len(wavelengths))
        column = np.arange(len(order)) - np.repeat(np.cumsum(counts) - counts, counts)
        table = np.zeros((len(wavelengths), int(counts.max())))
        shares = np.full_like(table, 0.5)
        table[which[order], column] = measurement.angle_deg[order]
        shares[which[order], column] = share[order]
        found, error = _evaluate(result, table, shares, quantity)
        value[order], sigma[order] = found[which[order], column], error[which[order], column]
    return value, sigma
