"""A small k in total reflection, where 1 - R grows as k and not as k^2, and its error.

With light from the denser side (n < 1) and angles beyond the critical one

    1 - R = A(theta) k + O(k^2),    A = lim dR/dk > 0 as k -> 0,

so k itself is the variable in which the curve is nearly linear. The sums of the solver do not serve
here: its derivative with respect to w ~ k^2 grows as 1/k, and its matrix stands one step behind its
end (at k = 0 it came out 6 times too large, and limits of k 2.4 times too small). So the sums are
taken anew at a k that the data would notice, about one standard error, and mapped to (eta, k).

Far beyond the critical angle A depends on eta through a factor that is nearly the same at all
angles, and eta and k are fixed in one product only: down to an eta of .001 some k fits as well. The
errors at the minimum do not tell, since upwards the valley ends where the first critical angle is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting.bare_surface.coordinates import index_derivatives, w_of_small_k
from fitting.bare_surface.curve_data import Data
from fitting.bare_surface.valley import Lanes, evaluate

# Beyond that many standard errors from 0 the sums of the solver are right to 1 %.
NEAR_SIGMAS = 10.0
# k of the first evaluation and least k of any, in eta: dR/dk holds 8 digits there.
FIRST, LEAST = 1e-4, 1e-9
EVALUATIONS = 3
# The floor of the valley at a given eta: Gauss-Newton steps in k, and its largest value.
FLOOR_STEPS, MOST_K = 6, 10.0
# An eta is not determined if this part of it fits as well.
SMALL_PART = 0.1
# The least eta that is looked at, in eta_i, and how often the range between is halved.
LEAST_ETA, HALVINGS = 1e-3, 24


class Small(NamedTuple):
    """Of L curves: information (L, 2, 2) in (eta, k), and reach, k where it might be negative.

    reach is where the quadratic model of the cost, as found at a small k, has its minimum.
    """

    information: np.ndarray
    reach: np.ndarray


def _sums(data: Data, lanes: Lanes) -> tuple[np.ndarray, ...]:
    """Return k, cost, gradient (2, L) and matrix (2, 2, L) of it in (eta, k) at the lanes."""
    now = evaluate(data, lanes)
    matrix = np.array([[now.h_xx, now.h_xw], [now.h_xw, now.h_ww]])
    # A lane that is as good as at its minimum has taken its last step; the gradient went with it.
    moved = np.array([now.x - lanes.x, now.w - lanes.w])
    gradient = np.array([now.g_x, now.g_w]) - (matrix * moved).sum(1)
    _, k, n_x, n_w, k_x, k_w = index_derivatives(lanes.x, lanes.w, lanes.chart)
    # d(x, w) / d(eta, k)
    back = np.array([[k_w, -k_x], [-n_w, n_x]]) / ((n_x * k_w - n_w * k_x) * data.eta_i)
    gradient = np.einsum("ail,il->al", back, gradient)
    matrix = np.einsum("ail,ijl,bjl->abl", back, matrix, back)
    return k * data.eta_i, now.cost, gradient, matrix


def small_k(
    data: Data,
    curve: np.ndarray,
    x: np.ndarray,
    eta: np.ndarray,
    k: np.ndarray,
    variance: np.ndarray,
) -> Small:
    """Return what ``data`` say of k around the minima (x; eta, k) with eta < eta_i, k near 0.

    curve: which of the curves of ``data`` each is of. variance: what one unit of the weighted sum
    of squares stands for.
    """
    place = np.maximum(k, FIRST * eta)
    with np.errstate(all="ignore"):
        for _ in range(EVALUATIONS):
            w = w_of_small_k(x, place / data.eta_i)
            at, _, g, matrix = _sums(data, Lanes(curve, x, w, np.full_like(x, -1.0)))
            (i_nn, i_nk), (_, i_kk) = matrix
            determinant = i_nn * i_kk - i_nk**2
            reach = at - (i_nn * g[1] - i_nk * g[0]) / determinant
            sigma = np.sqrt(variance * i_nn / determinant)
            place = np.clip(np.fmax(np.fmax(reach, sigma), LEAST * eta), 0.0, 0.3 * eta)
    return Small(np.moveaxis(matrix, -1, 0), reach)


def _floor(
    data: Data, eta_0: np.ndarray, k_0: np.ndarray, eta: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the least cost over k at these eta, and the k there, of N minima eta_0, k_0, (N,)."""
    sine = np.sqrt(1.0 - data.cos_theta.min(-1) ** 2)

    def factor(n: np.ndarray) -> np.ndarray:
        """1 - R_s is proportional to this times k."""
        return n / (np.sqrt(np.maximum(sine**2 - n * n, 1e-4)) * (1.0 - np.minimum(n, 0.99) ** 2))

    n, n_0 = eta / data.eta_i, eta_0 / data.eta_i
    k = np.maximum(k_0 / data.eta_i, FIRST * n_0) * factor(n_0) / factor(n)
    every, chart = np.arange(len(n)), np.full_like(n, -1.0)
    least, there = np.full_like(n, np.inf), k
    for _ in range(FLOOR_STEPS):
        k = np.clip(k, LEAST * n, MOST_K)
        x = np.log1p(((n - 1.0) ** 2 + k * k) / (2.0 * n))
        _, cost, g, matrix = _sums(data, Lanes(every, x, w_of_small_k(x, k), chart))
        lower = cost < least
        least, there = np.where(lower, cost, least), np.where(lower, k, there)
        k = k - g[1] / (matrix[1, 1] * data.eta_i)
    return least, there * data.eta_i


def open_to_small_index(
    data: Data, eta: np.ndarray, k: np.ndarray, allowed: np.ndarray
) -> np.ndarray:
    """Return where a small part of eta, with another k, fits at the ``allowed`` cost, (N,)."""
    with np.errstate(all="ignore"):
        return _floor(data, eta, k, SMALL_PART * eta)[0] <= allowed


def along_the_valley(
    data: Data, eta: np.ndarray, k: np.ndarray, allowed: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the range of eta that fits with some k, and that of these k, (N, 2) each.

    From LEAST_ETA to the index of the medium in front, each end to a millionth of it.
    """
    etas, ks = (np.stack([a, a], axis=-1) for a in (eta, k))
    with np.errstate(all="ignore"):
        for side, limit in enumerate((LEAST_ETA * data.eta_i, data.eta_i)):
            beyond = np.full_like(eta, limit)
            for halving in range(HALVINGS):
                here = np.sqrt(etas[:, side] * beyond) if halving else beyond
                cost, there = _floor(data, eta, k, here)
                fits = cost <= allowed
                etas[fits, side], ks[fits, side] = here[fits], there[fits]
                beyond = np.where(fits, beyond, here)
    return etas, np.sort(ks, axis=-1)
