"""Errors of R against 100 digits, at the exact inputs."""

import functools

import mpmath as mp
import numpy as np

from benchmarks import scenes
from tests.truth import oracle


@functools.cache
def truth(scene: str, dtype: str) -> tuple[mp.mpf, ...]:
    """R of unpolarized light."""
    points = zip(*scenes.points(scene, dtype), strict=True)
    return tuple(oracle.reflectance(*point, 1.0) for point in points)


def errors(scene: str, dtype: str, R: list[float]) -> dict:
    """Largest error, absolute and relative to R (below eps^2: to eps^2), and the failures."""
    eps = float(np.finfo(dtype).eps)
    absolute = relative = 0.0
    wrong = not_finite = 0
    with mp.workdps(oracle.DIGITS):
        for value, true in zip(R, truth(scene, dtype), strict=True):
            if not np.isfinite(value):
                not_finite += 1
                continue
            error = abs(mp.mpf(value) - true)
            quotient = float(error / max(true, mp.mpf(eps) ** 2))
            absolute, relative = max(absolute, float(error)), max(relative, quotient)
            wrong += quotient > 1e-3
    return {
        "largest_absolute": absolute,
        "largest_relative": relative,
        "largest_relative_eps": relative / eps,
        "wrong_share": (wrong + not_finite) / len(R),  # relative error above 1e-3, or not finite
        "not_finite": not_finite,
    }
