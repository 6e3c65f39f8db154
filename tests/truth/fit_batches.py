"""Batches of simulated curves whose fits are timed: 60 angles, R_s and R_p, noise .1 %."""

from __future__ import annotations

import jax
import numpy as np

from fresnel_jax import powers
from tests.truth.random_measurements import CLASSES, draw_index

ANGLES = np.linspace(1.0, 89.0, 60)
NOISE = 1e-3


def truths(count: int) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Return eta, k and the noisy curves of ``count`` semiconductors."""
    rng = np.random.default_rng(0)
    eta, k = rng.uniform(2.0, 5.0, count), rng.uniform(0.01, 3.0, count)
    return eta, k, _noisy(eta, k, rng)


def mixed(count: int) -> dict[str, np.ndarray]:
    """Return noisy curves of dielectrics, weak absorbers, semiconductors and metals, in no order.

    count: how many, a multiple of four.
    """
    rng = np.random.default_rng(5)
    drawn = [draw_index(kind, count // 4, 1.0, rng) for kind in CLASSES[:4]]
    eta, k = rng.permutation(np.concatenate(drawn, axis=1), axis=1)
    return _noisy(eta, k, rng)


def _noisy(eta: np.ndarray, k: np.ndarray, rng: np.random.Generator) -> dict[str, np.ndarray]:
    with jax.enable_x64(True):
        exact = powers(np.cos(np.radians(ANGLES)), eta[:, None], k[:, None])
        curves = {"R_s": np.asarray(exact.R_s), "R_p": np.asarray(exact.R_p)}
    return {q: r + NOISE * rng.standard_normal(r.shape) for q, r in curves.items()}
