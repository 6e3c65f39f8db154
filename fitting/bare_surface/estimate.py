"""Values and errors at the minima: covariance, limits, and what the data do not determine."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting.bare_surface.coordinates import W_MIN, index_derivatives, xi_of
from fitting.bare_surface.curve_data import Data
from fitting.bare_surface.descent import Solved
from fitting.bare_surface.total_reflection import NEAR_SIGMAS, small_k
from fitting.uncertainty.limits import interval_from_zero, mean_square, student_quantiles

# 1 - correlation^2 below this is rounding: the normal matrix is then singular.
SINGULAR = 1e-11
# With eta less certain than this the valley of the fit bends within its errors, and limits from the
# quadratic model are wrong: for s alone on metals 43 % of them were below the true k.
LIMIT_SPREAD = 0.1
# k is seen where k^2 (k itself in total reflection) is this many standard errors above 0.
SEEN_SIGMAS = 3.0
# The k in place of 0 where a slope in k is converted to one in u = k^2 (here and in `curves`).
K_MIN = 1e-12


class Estimated(NamedTuple):
    """What the data say about one minimum, one (N,) array each unless noted.

    information: (N, 2, 2), Fisher information in (eta, u = k^2) in units of the sigmas.
    variance: the unit of the weighted sum of squares (1, or chi2 / dof); NaN if it cannot be
        estimated.
    covariance: (N, 2, 2) in (eta, k); NaN where there is none.
    k_interval: (N, 2), 95 % interval of k from the quadratic model in u, or in total reflection in
        k; k_upper_limit is its end where k is compatible with 0, NaN elsewhere. t: how many
        standard errors 95 % are. linear: where the curve is linear in k (total reflection).
    x: log[(1 + |N|^2) / 2n] and sigma_x its standard error; moved: change of x along the null
        direction of the Fisher matrix, over the whole range of k.
    """

    eta: np.ndarray
    k: np.ndarray
    sigma_eta: np.ndarray
    sigma_k: np.ndarray
    covariance: np.ndarray
    correlation: np.ndarray
    k_upper_limit: np.ndarray
    k_interval: np.ndarray
    t: np.ndarray
    linear: np.ndarray
    information: np.ndarray
    variance: np.ndarray
    at_zero: np.ndarray
    singular: np.ndarray
    spread: np.ndarray  # sigma_eta / eta with k free, also where k is at 0
    x: np.ndarray
    moved: np.ndarray


def _in_index(
    s: Solved, eta_i: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """Return eta, k, and the matrix and the gradient of the cost in (eta, u = k^2).

    With a = d(eta, u)/d(x, w) (rows x and w) they are a^-1 H a^-T and a^-1 g. a is regular at
    k = 0, where d(eta, k)/d(x, w) is not.
    """
    n, k, n_x, n_w, k_x, k_w = index_derivatives(s.x, s.w, s.chart)
    a_xn, a_wn = n_x * eta_i, n_w * eta_i
    a_xu, a_wu = 2.0 * k * k_x * eta_i**2, 2.0 * k * k_w * eta_i**2
    determinant = a_xn * a_wu - a_xu * a_wn

    def inverse_times(of_x: np.ndarray, of_w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return (a_wu * of_x - a_xu * of_w) / determinant, (a_xn * of_w - a_wn * of_x) / determinant

    left_x = inverse_times(s.h_xx, s.h_xw)
    left_w = inverse_times(s.h_xw, s.h_ww)
    i_nn, i_nu = inverse_times(left_x[0], left_w[0])
    _, i_uu = inverse_times(left_x[1], left_w[1])
    information = _matrices(i_nn, i_nu, i_uu)
    return n * eta_i, k * eta_i, information, inverse_times(s.g_x, s.g_w)


def _matrices(first: np.ndarray, both: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the symmetric matrices (N, 2, 2) of these entries, (N,) each."""
    out = np.empty((len(both), 2, 2))
    out[:, 0, 0], out[:, 1, 1] = first, second
    out[:, 0, 1] = out[:, 1, 0] = both
    return out


def _in_total_reflection(
    data: Data,
    s: Solved,
    eta: np.ndarray,
    k: np.ndarray,
    information: np.ndarray,
    variance: np.ndarray,
    linear: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return information in (eta, u) and the reach of k, corrected in the lanes ``linear``.

    Those of them with k near 0 are evaluated again; see `total_reflection`.
    """
    reach = k.copy()
    if not len(linear):
        return information, reach
    i_nn, i_nu, i_uu = (information[linear, i, j] for i, j in ((0, 0), (0, 1), (1, 1)))
    c_uu = variance[linear] * i_nn / (i_nn * i_uu - i_nu**2)
    u = k[linear] ** 2
    far = 2.0 * u > NEAR_SIGMAS * np.sqrt(c_uu)  # k of many sigma_u / 2k
    near = linear[~far & (s.count[linear] > 0)]
    if not len(near):
        return information, reach
    at = eta[near], k[near]
    found = small_k(data, near, s.x[near], *at, variance[near])
    per_k = 1.0 / (2.0 * np.maximum(at[1], K_MIN))  # dk/du
    to_u = np.stack([np.ones_like(per_k), per_k], -1)
    information = information.copy()
    information[near] = found.information * to_u[:, :, None] * to_u[:, None, :]
    reach[near] = found.reach
    return information, reach


def estimate(
    data: Data, s: Solved, *, stated: bool, absolute: bool, sin_max: np.ndarray
) -> Estimated:
    """Return values and errors at the minima ``s`` of ``data``.

    stated: the weights come from stated errors. absolute: these are taken at their word; otherwise
    the covariance is scaled by chi2 / dof. sin_max: (N,), the sine of the largest angle.
    """
    eta_i = data.eta_i
    with np.errstate(all="ignore"):
        eta, k, information, slope = _in_index(s, eta_i)
        at_zero = s.w <= W_MIN
        k = np.where(at_zero, 0.0, k)
        u = k * k
        dof = np.maximum(s.count - 2, 0)
        scatter = np.where(dof > 0, s.cost / np.maximum(dof, 1), np.nan)
        # Without a degree of freedom only the stated errors are available.
        variance = np.ones_like(eta) if absolute else np.where(
            (dof == 0) & stated, 1.0, scatter
        )  # fmt: skip
        estimated = not absolute and ~((dof == 0) & stated)
        t = student_quantiles(np.where(estimated, dof, 0).astype(int))
        # Beyond the critical angle 1 - R grows as k, not as k^2.
        beyond = (eta < eta_i) & (sin_max * eta_i > eta)
        linear = beyond & (k < eta)
        metal = beyond & ~linear
        information, reach_k = _in_total_reflection(
            data, s, eta, k, information, variance, linear.nonzero()[0]
        )
        i_nn, i_nu, i_uu = information[:, 0, 0], information[:, 0, 1], information[:, 1, 1]
        independent = 1.0 - i_nu**2 / (i_nn * i_uu)  # 1 - correlation^2
        singular = ~(independent > SINGULAR) | (s.count < 2)
        independent = np.where(singular, np.nan, independent)
        c_nn, c_uu = variance / (i_nn * independent), variance / (i_uu * independent)
        c_nu = -i_nu * variance / (i_nn * i_uu * independent)
        spread = np.where(singular, np.inf, np.sqrt(c_nn) / eta)
        sigma_u = np.sqrt(c_uu)
        per_k = 2.0 * np.maximum(k, K_MIN)  # du/dk

        # Where u would be if it could be negative (the minimum of the quadratic model).
        reach_u = u - (slope[1] - i_nu * slope[0] / i_nn) / (i_uu * independent)
        reach = np.where(linear, reach_k, reach_u)
        reach = np.where(at_zero, np.minimum(reach, 0.0), np.where(linear, k, u))
        sigma = np.where(linear, sigma_u / per_k, sigma_u)
        # Compatible with 0: then a limit, and no standard error, which would not be one (at
        # u = sigma_u, above which a sixth of true zeros lies, k is already twice sigma_k).
        seen = (~at_zero) & ((reach >= SEEN_SIGMAS * sigma) | metal)
        known = seen | (spread < LIMIT_SPREAD)
        k_interval = np.empty((len(k), 2))
        k_interval[:, 0], k_interval[:, 1] = interval_from_zero(reach, sigma, t)
        k_interval = np.where(linear[:, None], k_interval, np.sqrt(k_interval))
        k_interval[~known] = np.nan
        sigma_k = np.where(seen, sigma_u / per_k, np.nan)
        # At k = 0 eta is as certain as it would be if k were known to be 0, plus what k may yet be:
        # eta shifts by c_nu / c_uu for each unit of u. Without this a silicon of k = .2, of which
        # the data saw nothing, was 6 standard errors off. Where u = 0 is just reached both agree.
        edge = (at_zero & ~linear).nonzero()[0]
        if len(edge):
            shift = (i_nu[edge] / i_nn[edge]) ** 2 * mean_square(reach[edge], sigma_u[edge])
            c_nn[edge] = (variance / i_nn)[edge] + shift
        sigma_eta = np.sqrt(c_nn)
        c_nk = np.where(seen, c_nu / per_k, np.nan)
        covariance = _matrices(sigma_eta**2, c_nk, sigma_k**2)
        correlation = c_nk / (sigma_eta * sigma_k)
        # The direction in (x, w) that the data do not see, over the whole line of constant x.
        moved = np.abs(s.h_xw / s.h_xx) * 4.0 * xi_of(s.x)
    return Estimated(
        eta, k, sigma_eta, sigma_k, covariance, correlation,
        np.where(seen, np.nan, k_interval[:, 1]), k_interval, t, linear, information, variance,
        at_zero, singular, spread, s.x, moved,
    )  # fmt: skip
