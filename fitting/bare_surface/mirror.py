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


def mirror_fit(data: Data) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return cost, a and information on a of the best mirror of each curve, (N,) each.

    By a Gauss-Newton step from the least squares of 1 - R = a h (1 + R) / 2, which are linear in a;
    kept between 0 and MOST_A.
    """
    half, weight = _half_shapes(data), np.concatenate(data.weights, axis=-1)
    value = np.concatenate(data.values, axis=1)
    dark, twice = (1.0 - value) * weight, 2.0 * half * weight

    def best(along: np.ndarray, off: np.ndarray) -> np.ndarray:
        return np.vecdot(along, off)[:, None] / np.maximum(np.vecdot(along, along), 1e-300)[:, None]

    def within(a: np.ndarray) -> np.ndarray:
        return np.minimum(np.maximum(a, 0.0), MOST_A)  # clip takes longer

    def at(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what is missed, and the slope in a."""
        fall = 1.0 + a * half
        slope = twice / fall
        return dark - a * slope, slope / fall

    a = within(best(half * (weight + weight * value), dark))
    miss, slope = at(a)
    a = within(a + best(slope, miss))
    miss, slope = at(a)
    return np.vecdot(miss, miss), a[:, 0], np.vecdot(slope, slope)


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
    unit = scatter[maybe]
    rise = allowed_rise(dof[maybe], known if np.ndim(known) == 0 else known[maybe])
    most = s.cost[maybe] + rise * unit
    cost, a, information = mirror_fit(data.take(maybe))
    here = cost <= most
    if here.any():
        high = a + NORMAL_95 * np.sqrt(unit / information)
        bound = np.maximum(1.0 - high / (1.0 + 0.5 * high), 0.0)
        found[maybe] = np.where(here, bound, np.nan)
        perfect[maybe] = cost + information * a**2 <= most
    return found, perfect
