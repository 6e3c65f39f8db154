"""Strong reflectors of which the data fix one number: 1 - R(0), or a bound of it.

With |N|^2 much larger than 1 an index enters through a = 4 n / |N|^2 alone,

    1 - R = a h / (1 + a h / 2),     h = cos(theta) for s, 1 / cos(theta) for p,

up to terms of 1 / |N|^2. Where that family, or R = 1 itself (a = 0), fits a curve as well as any
index, nothing is known of eta and k but this, whatever the best fit looks like: of R_s of a metal
(.06 + 3.6 i, noise .01) the best fit was total reflection with eta = .76 +- .004 in a fifth of the
repeats, its critical angle next to one datum that chance had made low.
"""

from __future__ import annotations

import functools

import numpy as np

from fitting.bare_surface.curve_data import Data
from fitting.bare_surface.descent import Solved

# An index is preferred if chance gives a fit as much better in less than this share of all curves.
CHANCE = 0.01
# The family is that of strong reflectors; the rms of the data says whether a curve may be of one.
LEAST_RMS, MOST_A = 0.85, 0.3
NORMAL_95 = 1.645


def allowed_rise(dof: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return by how many scatters a mirror may be worse, two parameters less, (N,).

    The quantile of chi2 with 2 degrees of freedom where the scatter is ``known`` beforehand; where
    it comes from the residuals themselves twice the quantile of F with 2 and dof.
    """
    d = np.maximum(dof, 1)
    return np.where(known, -2.0 * np.log(CHANCE), d * (CHANCE ** (-2.0 / d) - 1.0))


def _half_shapes(data: Data) -> np.ndarray:
    """Return h / 2 of the channels side by side, (C M,) or (N, C M)."""
    cos = np.maximum(data.cos_theta, 1e-6)
    of_s, of_p = 0.5 * cos, 0.5 / cos
    halves = {"R_s": of_s, "R_p": of_p}
    if "R" in data.channels:
        halves["R"] = of_p + data.s_share * (of_s - of_p)
    return np.concatenate([halves[c] for c in data.channels], axis=-1)


def mirror_fit(data: Data, most: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return which curves a mirror may fit at a cost of ``most`` (N,), and the best of each.

    Numbers of curves, and cost, a and information on a of their best mirrors, (K,) each. By a
    Gauss-Newton step, kept between 0 and MOST_A, from least squares that are linear in a,

        1 - R - a h (1 + R) / 2 = (1 + a h / 2) (1 - R - a h / (1 + a h / 2)),

    each datum divided by 1 + a h / 2 at the largest a: they miss no more than any mirror does.
    """
    half, weight = _half_shapes(data), np.concatenate(data.weights, axis=-1)
    value = np.concatenate(data.values, axis=1)
    scaled = weight / (1.0 + MOST_A * half)
    dark, line = (1.0 - value) * scaled, (1.0 + value) * (half * scaled)
    product, square = np.vecdot(line, dark), np.vecdot(line, line)
    a = product / np.maximum(square, 1e-300)
    here = (np.vecdot(dark, dark) - a * product <= most).nonzero()[0]
    if not len(here):
        return here, *np.empty((3, 0))
    half, weight = (of[here] if of.ndim == 2 else of for of in (half, weight))
    dark, twice = (1.0 - value[here]) * weight, 2.0 * half * weight

    def at(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what is missed, and the slope in a."""
        fall = 1.0 + a[:, None] * half
        slope = twice / fall
        return dark - a[:, None] * slope, slope / fall

    a = np.clip(a[here], 0.0, MOST_A)
    miss, slope = at(a)
    step = np.vecdot(slope, miss) / np.maximum(np.vecdot(slope, slope), 1e-300)
    a = np.clip(a + step, 0.0, MOST_A)
    miss, slope = at(a)
    return here, np.vecdot(miss, miss), a, np.vecdot(slope, slope)


def strong_reflectors(data: Data, s: Solved) -> np.ndarray:
    """Return the numbers of the curves whose data may be those of a strong reflector."""
    ones = functools.reduce(np.add, [(w * w).sum(-1) for w in data.weights])
    return (s.scale > LEAST_RMS**2 * ones).nonzero()[0]


def like_mirrors(
    data: Data,
    s: Solved,
    maybe: np.ndarray,
    dof: np.ndarray,
    known: np.ndarray,
    scatter: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return for curves that a mirror fits as well as the best index the bound of R(0), (N,).

    The least R at normal incidence (95 %); NaN for all other curves. And where R = 1 does, (N,).
    s: the best fits. maybe: the `strong_reflectors`. scatter: (N,), what one unit of the weighted
    sums of squares stands for, and whether that is ``known`` beforehand, () or (N,).
    """
    found, perfect = np.full(len(dof), np.nan), np.zeros(len(dof), bool)
    if not len(maybe):
        return found, perfect
    rise = allowed_rise(dof[maybe], known if np.ndim(known) == 0 else known[maybe])
    most = s.cost[maybe] + rise * scatter[maybe]
    here, cost, a, information = mirror_fit(data.take(maybe), most)
    if len(here):
        maybe, most = maybe[here], most[here]
        high = a + NORMAL_95 * np.sqrt(scatter[maybe] / information)
        bound = np.maximum(1.0 - high / (1.0 + 0.5 * high), 0.0)
        found[maybe] = np.where(cost <= most, bound, np.nan)
        perfect[maybe] = cost + information * a**2 <= most
    return found, perfect
