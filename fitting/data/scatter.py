"""The noise of a curve, from the scatter of neighbours about a polynomial through them.

The divided difference of order count - 1 of ``count`` neighbours is 0 for a polynomial of lower
degree. Divided by the root of the sum of its squared weights it has the variance of one datum, for
any spacing of positions.
"""

from __future__ import annotations

import numpy as np

# From fewer values no noise can be estimated with outliers and curvature left out.
LEAST_VALUES = 8
_QUARTILE = 0.6745  # of the normal distribution, in standard deviations
# Repeats of one position are separated by this part of the range, in the order in which they come.
_APART = 1e-9


def differences(position: np.ndarray, value: np.ndarray, count: int) -> np.ndarray:
    """Return the divided differences of ``count`` neighbours, of unit variance: (L, M - count + 1).

    position, value: (L, M), NaN where there is no datum; positions in any order.
    """
    position = np.where(np.isfinite(value), position, np.nan)
    order = np.argsort(position, axis=1, kind="stable")  # NaN last
    x, y = (np.take_along_axis(a, order, axis=1) for a in (position, value))
    span = np.fmax.reduce(x, axis=1, keepdims=True, initial=-np.inf) - x[:, :1]
    x = (x - x[:, :1]) / np.where(span > 0.0, span, 1.0) + _APART * np.arange(x.shape[1])
    width = x.shape[1] - count + 1
    near = [x[:, j : j + width] for j in range(count)]
    weights = []
    for here in near:
        gaps = [here - other for other in near if other is not here]
        weights.append(1.0 / np.prod(gaps, axis=0))
    length = np.sqrt(np.sum(np.square(weights), axis=0))
    return np.sum([w / length * y[:, j : j + width] for j, w in enumerate(weights)], axis=0)


def robust_noise(position: np.ndarray, value: np.ndarray) -> float:
    """Return the noise of one curve (M,) with outliers and curvature; NaN for too few values.

    It is the smallest of the medians for 3, 4 and 5 neighbours: a median does not depend on single
    outliers, and the smallest of the three hardly on curvature.
    """
    if len(value) < LEAST_VALUES:
        return float("nan")
    found = []
    with np.errstate(all="ignore"):
        for count in (3, 4, 5):
            each = np.abs(differences(position[None], value[None], count))
            each = each[np.isfinite(each)]
            found.append(np.median(each) / _QUARTILE if len(each) else np.nan)
    return float(min(found))
