"""The best mirror of a curve: its cost is the least of all, whatever the angles."""

import numpy as np
import pytest

from fitting.bare_surface.curve_data import Data
from fitting.bare_surface.mirror import MOST_A, mirror_fit


def _of_mirror(a, cos):
    """1 - R of s and p is a h / (1 + a h / 2), with h = cos for s and 1 / cos for p; a: (N,)."""
    of = {"R_s": cos, "R_p": 1.0 / cos, "R": 0.5 * (cos + 1.0 / cos)}
    return {c: 1.0 - a[:, None] * h / (1.0 + 0.5 * a[:, None] * h) for c, h in of.items()}


@pytest.mark.parametrize("seed", range(20))
def test_no_other_mirror_fits_better(seed):
    """Three steps from R = 1 were 10^6 of chi2 above the best one near grazing incidence."""
    random = np.random.default_rng(seed)
    angles, curves = random.integers(3, 60), 20
    low = random.uniform(0.0, 80.0)
    cos = np.cos(np.radians(np.sort(random.uniform(low, random.uniform(low + 3.0, 89.9), angles))))
    channels = [("R_s",), ("R_p",), ("R",), ("R_s", "R_p")][seed % 4]
    truth, noise = 10.0 ** random.uniform(-4.0, -0.53, curves), 10.0 ** random.uniform(-4.0, -1.5)
    exact = _of_mirror(truth, cos)
    values = tuple(exact[c] + noise * random.standard_normal((curves, angles)) for c in channels)
    weight = np.full(angles, 1.0 / noise)
    data = Data(cos, np.full(angles, 0.5), values, (weight,) * len(channels), 1.0, channels)
    here, cost, a, information = mirror_fit(data, np.full(curves, np.inf))
    assert len(here) == curves

    def cost_at(each):
        there = _of_mirror(each, cos)
        off = [(v - there[c]) / noise for v, c in zip(values, channels, strict=True)]
        return np.sum([(o * o).sum(1) for o in off], axis=0)

    np.testing.assert_allclose(cost, cost_at(a), rtol=1e-9)
    grid = np.concatenate([[0.0], np.geomspace(1e-6, MOST_A, 4000)])
    least = np.min([cost_at(np.full(curves, one)) for one in grid], axis=0)
    assert (cost <= least + 0.01).all()
    kept, *_ = mirror_fit(data, cost * (1.0 + 1e-9))
    assert len(kept) == curves
    # The information leaves out the residuals times the second derivative: .005 of it at most.
    step = 1e-4 * a + 1e-9
    bend = (cost_at(a + step) - 2.0 * cost + cost_at(a - step)) / (2.0 * step**2)
    seen = (a > 1e-3) & (a < 0.999 * MOST_A)
    np.testing.assert_allclose(bend[seen], information[seen], rtol=0.01)
