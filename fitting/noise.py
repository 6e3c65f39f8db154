"""The noise that a curve shows of itself: what neighbours scatter about a line through them.

    e_i = y_i - (a y_(i-1) + b y_(i+1)),    a + b = 1,    var e_i = (1 + a^2 + b^2) sigma^2

with a and b of the straight line through both neighbours, so that points need not be equidistant
(T. Gasser, L. Sroka and C. Jennen-Steinmetz, Biometrika 73, 625 (1986),
doi:10.1093/biomet/73.3.625). What is smooth over three points falls out, a misfit as the curve.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# Of white noise the mean square of the e has the scatter of so many independent squares each (the e
# of neighbours are correlated: 35 / 18 as many are needed at equal distances).
INDEPENDENT = 18.0 / 35.0
# Values beyond [0, 1] are noise within so many of these deviations ...
EXCURSION_DEVIATIONS = 4.0
# ... which at least so many triples of neighbours must show.
LEAST_TRIPLES = 3


class Noise(NamedTuple):
    """sigma: standard deviation; triples: how many neighbours told it. (L,) each; NaN for none."""

    sigma: np.ndarray
    triples: np.ndarray


def neighbour_noise(position: np.ndarray, value: np.ndarray) -> Noise:
    """Return the noise of each curve, (L,).

    position, value: (L, M), NaN where there is no datum; positions in any order. Repeats of one
    position count as neighbours of each other.
    """
    position, value = (np.atleast_2d(np.asarray(a, float)) for a in (position, value))
    position, value = np.broadcast_arrays(position, value)
    position = np.where(np.isfinite(value), position, np.nan)
    order = np.argsort(position, axis=1)  # NaN last
    x, y = (np.take_along_axis(a, order, axis=1) for a in (position, value))
    with np.errstate(all="ignore"):
        span = x[:, 2:] - x[:, :-2]
        b = np.where(span > 0.0, (x[:, 1:-1] - x[:, :-2]) / span, 0.5)
        a = 1.0 - b
        off = y[:, 1:-1] - a * y[:, :-2] - b * y[:, 2:]
        square = off**2 / (1.0 + a * a + b * b)
        triples = np.isfinite(square).sum(1)
        sigma = np.sqrt(np.nansum(square, axis=1) / np.maximum(triples, 1))
    return Noise(np.where(triples > 0, sigma, np.nan), triples)


def within_noise(position: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Return which values of one curve (M,) outside of [0, 1] are noise about 0 or 1.

    Those within `EXCURSION_DEVIATIONS` of the noise that the curve shows. The deviation is found
    without the values in question: a wrong one must not excuse itself.
    """
    position, value = (np.asarray(a, float) for a in (position, value))
    out = (value < 0.0) | (value > 1.0)
    if not out.any():
        return out
    beyond = np.where(value < 0.0, -value, value - 1.0)
    excused = np.zeros_like(out)
    # The farthest one is judged by all others, as long as one is too far.
    for first in np.argsort(-beyond)[: int(out.sum())]:
        others = np.where((np.arange(len(value)) == first) | ~np.isfinite(value), np.nan, value)
        others = np.where(out & (beyond > beyond[first]), np.nan, others)
        noise = neighbour_noise(position, others)
        enough = noise.triples[0] >= LEAST_TRIPLES
        excused[first] = enough and beyond[first] <= EXCURSION_DEVIATIONS * noise.sigma[0]
    return excused
