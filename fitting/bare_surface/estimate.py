"""Values and errors at the minima: covariance, limits, and what the data do not determine."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting.bare_surface.coordinates import W_MIN, index_derivatives, xi_of
from fitting.bare_surface.curve_data import Data
from fitting.bare_surface.descent import Solved
from fitting.bare_surface.total_reflection import NEAR_SIGMAS, small_k
from fitting.uncertainty.beside_zero import interval_from_zero
from fitting.uncertainty.limits import (
    mean_square,
    student_quantile,
    student_quantiles,
)

# 1 - correlation^2 below this is rounding: the normal matrix is then singular.
SINGULAR = 1e-11
# With eta less certain than this the valley of the fit bends within its errors, and limits from the
# quadratic model are wrong: for s alone on metals 43 % of them were below the true k.
LIMIT_SPREAD = 0.1
# k is seen where k^2 (k itself in total reflection) is this many standard errors above 0.
SEEN_SIGMAS = 3.0
# The k in place of 0 where a slope in k is converted to one in u = k^2 (here and in `curves`).
K_MIN = 1e-12


class Weighing(NamedTuple):
    """What the errors of N curves follow from.

    stated: whether the weights come from stated errors. absolute: whether these are taken at their
    word; otherwise the covariance is scaled by chi2 / dof. sin_max: (N,), the sine of the largest
    angle.
    """

    stated: bool
    absolute: bool
    sin_max: np.ndarray

    def take(self, index: np.ndarray) -> Weighing:
        """Return that of the curves of ``index``."""
        return self._replace(sin_max=self.sin_max[index])


class Estimated(NamedTuple):
    """What the data say about one minimum, one (N,) array each unless noted.

    information: (N, 2, 2), Fisher information in (eta, u = k^2) in units of the sigmas.
    variance: the unit of the weighted sum of squares (1, or chi2 / dof); NaN if it cannot be
        estimated.
    reach: the estimate of u without the bound (where ``linear`` of k), which may be negative.
    covariance: of eta and k; NaN where there is none.
    k_interval: (N, 2), 95 % interval of k from the quadratic model in u, or in total reflection in
        k; k_upper_limit is its end where k is compatible with 0, NaN elsewhere. t: how many
        standard errors 95 % are. linear: where the curve is linear in k (total reflection).
    moved: change of x = log[(1 + |N|^2) / 2n] along the null direction of the Fisher
        matrix, over the whole range of k.
    """

    eta: np.ndarray
    k: np.ndarray
    sigma_eta: np.ndarray
    sigma_k: np.ndarray
    covariance: np.ndarray
    k_upper_limit: np.ndarray
    k_interval: np.ndarray
    t: np.ndarray
    linear: np.ndarray
    information: np.ndarray
    variance: np.ndarray
    reach: np.ndarray
    at_zero: np.ndarray
    singular: np.ndarray
    spread: np.ndarray  # sigma_eta / eta with k free (metals in total reflection: or sigma_k / k)
    moved: np.ndarray


def _in_index(s: Solved, eta_i: float) -> tuple[np.ndarray, ...]:
    """Return eta, k, and the matrix (N, 2, 2) and gradient of the cost in (eta, u = k^2).

    With a = d(eta, u)/d(x, w) (rows x and w) they are a^-1 H a^-T and a^-1 g. a is regular at
    k = 0, where d(eta, k)/d(x, w) is not.
    """
    n, k, n_x, n_w, k_x, k_w = index_derivatives(s.x, s.w, s.chart)
    eta, k, a_xn, a_wn = n * eta_i, k * eta_i, n_x * eta_i, n_w * eta_i
    double = 2.0 * eta_i * k
    a_xu, a_wu = double * k_x, double * k_w
    determinant = a_xn * a_wu - a_xu * a_wn
    # The rows of a^-1.
    nx, nw = a_wu / determinant, -a_xu / determinant
    ux, uw = -a_wn / determinant, a_xn / determinant
    of_x, of_w = nx * s.h_xx + nw * s.h_xw, nx * s.h_xw + nw * s.h_ww
    information = np.empty((len(eta), 2, 2))
    information[:, 0, 0] = nx * of_x + nw * of_w
    information[:, 0, 1] = information[:, 1, 0] = ux * of_x + uw * of_w
    of_x, of_w = ux * s.h_xx + uw * s.h_xw, ux * s.h_xw + uw * s.h_ww
    information[:, 1, 1] = ux * of_x + uw * of_w
    return eta, k, information, nx * s.g_x + nw * s.g_w, ux * s.g_x + uw * s.g_w


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


def estimate(data: Data, s: Solved, how: Weighing) -> Estimated:
    """Return values and errors at the minima ``s`` of ``data``."""
    eta_i = data.eta_i
    eta, k, information, g_n, g_u = _in_index(s, eta_i)
    at_zero = s.w <= W_MIN
    k = np.where(at_zero, 0.0, k)
    u = k * k
    if how.absolute:
        variance, t = np.ones_like(eta), np.full_like(eta, student_quantile(0))
    else:
        dof = np.maximum(s.count - 2, 0)
        # Without a degree of freedom only the stated errors are available.
        variance = np.where(dof > 0, s.cost / dof, 1.0 if how.stated else np.nan)
        t = student_quantiles(dof.astype(int))
    # Beyond the critical angle 1 - R grows as k, not as k^2.
    beyond = (eta < eta_i) & (how.sin_max * eta_i > eta)
    linear = beyond & (k < eta)
    metal = beyond & ~linear
    line = linear.nonzero()[0]
    information, reach_k = _in_total_reflection(data, s, eta, k, information, variance, line)
    i_nn, i_nu, i_uu = information[:, 0, 0], information[:, 0, 1], information[:, 1, 1]
    independent = 1.0 - i_nu**2 / (i_nn * i_uu)  # 1 - correlation^2
    singular = ~(independent > SINGULAR) | (s.count < 2)
    independent = np.where(singular, np.nan, independent)
    c_nn, c_uu = variance / (i_nn * independent), variance / (i_uu * independent)
    spread = np.where(singular, np.inf, np.sqrt(c_nn) / eta)
    sigma_u = np.sqrt(c_uu)
    per_k = 2.0 * np.maximum(k, K_MIN)  # du/dk
    # In total reflection by an index of k > n the two are fixed in one product.
    spread = np.where(metal, np.fmax(spread, sigma_u / (per_k * k)), spread)

    # Where u would be if it could be negative (the minimum of the quadratic model).
    reach = u - (g_u - i_nu * g_n / i_nn) / (i_uu * independent)
    inside, sigma = u, sigma_u
    if len(line):
        reach, inside = np.where(linear, reach_k, reach), np.where(linear, k, u)
        sigma = np.where(linear, sigma_u / per_k, sigma_u)
    reach = np.where(at_zero, np.minimum(reach, 0.0), inside)
    # Compatible with 0: then a limit, and no standard error, which would not be one (at
    # u = sigma_u, above which a sixth of true zeros lies, k is already twice sigma_k).
    seen = ~at_zero & ((reach >= SEEN_SIGMAS * sigma) | metal)
    known = seen | (spread < LIMIT_SPREAD)
    k_interval = np.empty((len(k), 2))
    k_interval[:, 0], k_interval[:, 1] = interval_from_zero(reach, sigma, t)
    of_u = np.sqrt(k_interval)
    k_interval = np.where(linear[:, None], k_interval, of_u) if len(line) else of_u
    k_interval[~known] = np.nan
    # At k = 0 eta is as certain as it would be if k were known to be 0, plus what k may yet be:
    # eta shifts by c_nu / c_uu for each unit of u. Without this a silicon of k = .2, of which
    # the data saw nothing, was 6 standard errors off. Where u = 0 is just reached both agree.
    edge = (at_zero & ~linear).nonzero()[0]
    if len(edge):
        shift = (i_nu[edge] / i_nn[edge]) ** 2 * mean_square(reach[edge], sigma_u[edge])
        c_nn[edge] = (variance / i_nn)[edge] + shift
    c_nu = -i_nu / i_nn * c_uu
    return Estimated(
        eta, k, np.sqrt(c_nn), np.where(seen, sigma_u / per_k, np.nan),
        np.where(seen, c_nu / per_k, np.nan), np.where(seen, np.nan, k_interval[:, 1]),
        k_interval, t, linear, information, variance, reach, at_zero,
        singular, spread,
        # The direction in (x, w) that the data do not see, over the whole line of constant x.
        np.abs(s.h_xw / s.h_xx) * 4.0 * xi_of(s.x),
    )  # fmt: skip


def of_radius(s: Solved, e: Estimated, eta_i: float) -> np.ndarray:
    """Return the errors of eta and k together, in radii of the circle of constant R(0), (N,).

    Along that circle (`valley`) an index is least determined: errors that are no small part of its
    radius are those of a straight line where the valley is curved. NaN where k has no error.
    """
    return np.hypot(e.sigma_eta, e.sigma_k) / (eta_i * np.sinh(xi_of(s.x)))
