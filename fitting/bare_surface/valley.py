"""The line of constant R(0), along which an index is least determined: points and costs on it.

Every index with one x = log[(1 + |N|^2) / 2n] lies on the circle

    n = cosh xi + c sinh xi cos phi,   k = sinh xi sin phi,   cosh xi = exp(x),

where k = 0 at phi = 0 (the end of the chart c, see `coordinates`) and at phi = pi. eta and k are
smooth in phi from end to end, and a place is named here by its share = sin(phi / 2)^2.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting.bare_surface.calls import run, start_rows
from fitting.bare_surface.coordinates import W_MIN, X_MAX, X_MIN, xi_of
from fitting.bare_surface.curve_data import Data, of_rows
from fitting.bare_surface.descent import Solved
from fitting.bare_surface.engine import Steps

# A first look at the other end that promises more than so many times what is allowed is the last.
FAR_ABOVE = 100.0


class Lanes(NamedTuple):
    """Places in the plane of some curves: which curve, x, w and chart, (L,) each."""

    curve: np.ndarray
    x: np.ndarray
    w: np.ndarray
    chart: np.ndarray

    def at(self, pick: np.ndarray) -> Lanes:
        """Return those of ``pick``."""
        return Lanes(*(a[pick] for a in self))


def _xi_slope(x: np.ndarray) -> np.ndarray:
    """Return dxi/dx = cosh xi / sinh xi."""
    return 1.0 / np.tanh(xi_of(x))


def on_line(x: np.ndarray, share: np.ndarray, chart: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return w and dw/dx on the line of constant share = sin(phi / 2)^2."""
    xi = xi_of(x)
    near, far = -np.expm1(-4.0 * xi) * share, np.expm1(np.minimum(4.0 * xi, 700.0)) * share
    first = chart > 0
    w = np.where(first, -np.log1p(-np.minimum(near, 1.0 - 1e-300)), np.log1p(far))
    slope = np.where(first, (share - near) / (1.0 - near), (share + far) / (1.0 + far))
    return np.clip(w, W_MIN, 4.0 * xi), 4.0 * slope * _xi_slope(x)


def share_of(x: np.ndarray, w: np.ndarray, chart: np.ndarray) -> np.ndarray:
    """Return sin(phi / 2)^2 of a place."""
    xi = xi_of(x)
    far = np.expm1(np.minimum(w, 700.0)) / np.expm1(np.minimum(4.0 * xi, 700.0))
    return np.clip(np.where(chart > 0, np.expm1(-w) / np.expm1(-4.0 * xi), far), 0.0, 1.0)


def from_nearer_end(s: Solved) -> Solved:
    """Return ``s`` in the chart whose end k = 0 is nearer: that end is exact, the far one is not.

    The other chart's w is 4 xi(x) - w; gradient and matrix follow by the chain rule.
    """
    away = s.w > 2.0 * xi_of(s.x)
    t = np.where(away, 4.0 * _xi_slope(s.x), 0.0)
    sign = np.where(away, -1.0, 1.0)
    return s._replace(
        w=np.where(away, np.maximum(4.0 * xi_of(s.x) - s.w, W_MIN), s.w),
        chart=sign * s.chart,
        g_x=s.g_x + t * s.g_w,
        g_w=sign * s.g_w,
        h_xx=s.h_xx + t * (2.0 * s.h_xw + t * s.h_ww),
        h_xw=sign * (s.h_xw + t * s.h_ww),
    )


def evaluate(data: Data, lanes: Lanes) -> Solved:
    """Return cost, gradient and matrix at these places (where a lane is at its minimum: near)."""
    count = len(lanes.x)
    start = start_rows(count, np.stack([lanes.x, lanes.w, lanes.chart]))
    start[4] = lanes.w
    found, _ = run(data.take(lanes.curve), start, Steps(1))
    return Solved(*found)


def _at_lossless_end(data: Data, x: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return cost, gradient and Gauss-Newton matrix in x of the curves at n > 1, k = 0, (N,) each.

    Fresnel's formulas of two lossless media, with q = sqrt(n^2 - sin^2):

        r_s = (cos - q) / (cos + q),    r_p = (n^2 cos - q) / (n^2 cos + q)
    """
    xi = xi_of(x)[:, None]
    n, cos = np.exp(xi), data.cos_theta
    square = n * n
    q = np.sqrt(square - 1.0 + cos * cos)
    dense = square * cos
    sum_s, sum_p = cos + q, dense + q
    r_s, r_p = (cos - q) / sum_s, (dense - q) / sum_p
    # dR/dx = 2 r (dr/dn) (dn/dx)
    common = 4.0 * square / np.tanh(xi) * cos / q
    R_s, R_p = r_s * r_s, r_p * r_p
    slope_s = -common * r_s / (sum_s * sum_s)
    slope_p = common * r_p * (2.0 * q * q - square) / (sum_p * sum_p)
    both = {"R_s": (R_s, slope_s), "R_p": (R_p, slope_p)}
    if "R" in data.channels:
        share = data.s_share
        both["R"] = R_p + share * (R_s - R_p), slope_p + share * (slope_s - slope_p)
    off, slope = (np.concatenate([both[c][i] for c in data.channels], axis=1) for i in (0, 1))
    weight = np.concatenate(data.weights, axis=-1)
    off = (off - np.concatenate(data.values, axis=1)) * weight
    slope *= weight
    return np.vecdot(off, off), np.vecdot(off, slope), np.vecdot(slope, slope)


def open_to_the_other_end(data: Data, s: Solved, allowed: np.ndarray) -> np.ndarray:
    """Return where the valley of a minimum with n < 1 leads to n > 1, k = 0, at ``allowed`` cost.

    Near normal incidence the noise decides at which end of the valley the minimum lies, and at
    n < 1, close to total reflection, it looks well determined. The end itself is looked at first,
    without a call of the program: of metals nearly none passes.
    """
    still = np.zeros(len(s.x), bool)
    # First roughly, where x is the same; then x moves a little along the floor.
    cost, g, h = _at_lossless_end(data, s.x)
    maybe = np.flatnonzero(cost - g * g / h <= FAR_ABOVE * allowed)
    if not len(maybe):
        return still
    x = np.clip(s.x - g / h, X_MIN, X_MAX)[maybe]
    cost, g, h = _at_lossless_end(data.take(maybe), x)
    here = maybe[cost - g * g / h <= allowed[maybe]]
    if not len(here):
        return still
    s, allowed = of_rows(s, here), allowed[here]
    outside = from_nearer_end(s)
    share = share_of(s.x, outside.w, outside.chart)
    share = np.where(outside.chart > 0, share, 1.0 - share)  # measured from n > 1
    phi = 2.0 * np.arcsin(np.sqrt(share))
    on = np.isfinite(phi)
    for part in (1.0 / 3.0, 2.0 / 3.0):
        some = np.flatnonzero(on)
        if not len(some):
            break
        x, chart = s.x[some], np.ones(len(some))
        w, _ = on_line(x, np.sin(0.5 * part * phi[some]) ** 2, chart)
        for _ in range(2):  # as above
            now = evaluate(data, Lanes(here[some], x, w, chart))
            x = np.clip(now.x - now.g_x / now.h_xx, X_MIN, X_MAX)
        on[some] = now.cost - now.g_x**2 / now.h_xx <= allowed[some]
    still[here] = on
    return still
