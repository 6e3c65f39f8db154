"""The least reflectance of a strong reflector is that of the best mirror, whatever the angles."""

import numpy as np
import pytest

from fitting import fit_many

NORMAL_95 = 1.6448536269514722


def _of_mirror(a, cos):
    """R of a mirror with R(0) = 1 - a: 1 - R is a h / (1 + a h / 2), h = cos of s, 1 / cos of p."""
    of = {"R_s": cos, "R_p": 1.0 / cos}
    return {c: 1.0 - a[:, None] * h / (1.0 + 0.5 * a[:, None] * h) for c, h in of.items()}


@pytest.mark.parametrize(
    "seed", [0, 1, 2, *(pytest.param(n, marks=pytest.mark.study) for n in (3, 4, 5))]
)
def test_no_other_mirror_fits_better(seed):
    """Three steps from R = 1 were 10^6 of chi2 above the best one near grazing incidence."""
    random = np.random.default_rng(seed)
    points, curves = random.integers(3, 60), 20
    low = random.uniform(0.0, 80.0)
    angles = np.sort(random.uniform(low, random.uniform(low + 3.0, 89.9), points))
    cos = np.cos(np.radians(angles))
    channels = [("R_s",), ("R_p",), ("R_s", "R_p")][seed % 3]
    truth, noise = 10.0 ** random.uniform(-4.0, -2.0, curves), 10.0 ** random.uniform(-3.0, -1.5)
    exact = _of_mirror(truth, cos)
    values = {c: exact[c] + noise * random.standard_normal((curves, points)) for c in channels}
    found = fit_many(angles, **values, sigma=noise, errors="stated")
    told = [next((w for w in one if w.code == "perfect_mirror"), None) for one in found.warnings]
    some = np.flatnonzero([w is not None for w in told])
    assert len(some) > 1
    grid = np.concatenate([[0.0], np.geomspace(1e-6, 0.5, 4000)])
    there = _of_mirror(grid, cos)
    for i in some:
        cost = sum((((values[c][i] - there[c]) / noise) ** 2).sum(1) for c in channels)
        at = grid[np.argmin(cost)]
        step = 1e-3 * at + 1e-5
        near = _of_mirror(np.array([at, at + step]), cos)
        slope = np.concatenate([(near[c][1] - near[c][0]) / (step * noise) for c in channels])
        scatter = max(1.0, found.chi2_reduced[i])
        high = at + NORMAL_95 * np.sqrt(scatter / (slope @ slope))
        loss = high / (1.0 + 0.5 * high)
        assert 1.0 - told[i].values["least_reflectance"] == pytest.approx(loss, rel=0.01)
