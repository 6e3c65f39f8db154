"""Errors of R against 50 digits, at the exact inputs."""

import functools

import mpmath as mp
import numpy as np

from benchmarks import scenes

DIGITS = 50


@functools.cache
def truth(scene: str, dtype: str) -> tuple[mp.mpf, ...]:
    """R of unpolarized light by the textbook's quotients of amplitudes."""
    with mp.workdps(DIGITS):
        values = []
        for c, eta, k in zip(*scenes.points(scene, dtype), strict=True):
            c, N = mp.mpf(float(c)), mp.mpc(float(eta), float(k))
            Q = mp.sqrt(N * N - 1 + c * c)
            r_s = (c - Q) / (c + Q)
            r_p = (N * N * c - Q) / (N * N * c + Q)
            values.append((abs(r_s) ** 2 + abs(r_p) ** 2) / 2)
        return tuple(values)


def errors(scene: str, dtype: str, R: list[float]) -> dict:
    """Largest error, absolute and relative to R (below eps^2: to eps^2), and the failures."""
    eps = float(np.finfo(dtype).eps)
    absolute = relative = 0.0
    wrong = not_finite = 0
    with mp.workdps(DIGITS):
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
