"""A small k in total reflection, where 1 - R grows as k and not as k^2, and its error.

With light from the denser side (n < 1) and angles beyond the critical one

    1 - R = A(theta) k + O(k^2),    A = lim dR/dk > 0 as k -> 0,

so k itself is the variable in which the curve is nearly linear. The sums of the solver do not serve
here: its derivative with respect to w ~ k^2 grows as 1/k, and its matrix stands one step behind its
end (at k = 0 it came out 6 times too large, and limits of k 2.4 times too small). So the sums are
taken anew at a k that the data would notice, about one standard error, and mapped to (eta, k).
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


class Small(NamedTuple):
    """Of L curves: information (L, 2, 2) in (eta, k), and reach, k where it might be negative.

    reach is where the quadratic model of the cost, as found at a small k, has its minimum.
    """

    information: np.ndarray
    reach: np.ndarray


def _sums(data: Data, lanes: Lanes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return k, gradient (2, L) and matrix (2, 2, L) of the cost in (eta, k) at the lanes."""
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
    return k * data.eta_i, gradient, matrix


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
            at, g, matrix = _sums(data, Lanes(curve, x, w, np.full_like(x, -1.0)))
            (i_nn, i_nk), (_, i_kk) = matrix
            determinant = i_nn * i_kk - i_nk**2
            reach = at - (i_nn * g[1] - i_nk * g[0]) / determinant
            sigma = np.sqrt(variance * i_nn / determinant)
            place = np.clip(np.fmax(np.fmax(reach, sigma), LEAST * eta), 0.0, 0.3 * eta)
    return Small(np.moveaxis(matrix, -1, 0), reach)
