"""A bare surface that is not what was measured is told from few angles, without stated errors."""

import numpy as np
import pytest

from fitting import Measurement, fit, fit_many

ANGLES = np.linspace(15.0, 80.0, 14)


def _powers(n, k=0.0, angles=ANGLES):
    """Return R_s and R_p of indices (N,) by Fresnel's formulas, (N, M) each."""
    cos, square = np.cos(np.radians(angles)), (np.asarray(n) + 1j * np.asarray(k))[:, None] ** 2
    q = np.sqrt(square - 1.0 + cos * cos)
    return (np.abs((cos - q) / (cos + q)) ** 2,
            np.abs((square * cos - q) / (square * cos + q)) ** 2)  # fmt: skip


def _told(found):
    """Return the share of fits with the warning."""
    return sum(np.mean(f.at) for f in found.findings if f.code == "does_not_describe")


def _random(curves, seed):
    random = np.random.default_rng(seed)
    return random, random.uniform(1.4, 1.9, curves)


@pytest.mark.parametrize("order", ["rising", "falling", "mixed"])
def test_R_s_named_R(order):
    """Of a glass it looks like an index of .97 with k of .5, to .007."""
    random, n = _random(300, 1)
    at = {"rising": np.arange(14), "falling": np.arange(14)[::-1], "mixed": random.permutation(14)}
    R = _powers(n)[0] + 0.001 * random.standard_normal((300, 14))
    found = fit_many(ANGLES[at[order]], R=R[:, at[order]])
    assert (found.status == "misfit").mean() > 0.9
    assert _told(found) > 0.97
    # By `fit` two wavelengths: of one alone the causes would be looked for.
    two = Measurement.from_columns(np.tile(ANGLES, 2), np.repeat([0.5, 0.6], 14), R=R[:2].ravel())
    assert _told(fit(two)) == 1.0


@pytest.mark.parametrize("noise", [0.001, 0.002, 0.005])
@pytest.mark.parametrize("channels", [("R_s", "R_p"), ("R",)])
def test_both_faces_of_a_window(channels, noise):
    random, n = _random(300, 2)
    R_s, R_p = (2.0 * r / (1.0 + r) for r in _powers(n))
    of = {"R_s": R_s, "R_p": R_p, "R": 0.5 * (R_s + R_p)}
    data = {c: of[c] + noise * random.standard_normal(R_s.shape) for c in channels}
    least = 0.1 if (noise, channels) == (0.005, ("R",)) else 0.95
    assert _told(fit_many(ANGLES, **data)) > least


def test_a_gain_of_3_percent():
    """It gives glass a k of .2."""
    random, n = _random(300, 4)
    data = {
        name: 1.03 * R + 0.001 * random.standard_normal(R.shape)
        for name, R in zip(("R_s", "R_p"), _powers(n), strict=True)
    }
    found = fit_many(ANGLES, **data)
    assert np.median(found.k) > 0.1
    assert _told(found) > 0.85


@pytest.mark.parametrize("kind", ["equal", "relative", "outliers", "printed"])
@pytest.mark.parametrize(
    "angles", [14, *(pytest.param(n, marks=pytest.mark.study) for n in (8, 60))]
)
def test_noise_is_no_misfit(kind, angles):
    """Of 1,000 curves of R_s, R_p and of R, dielectrics and metals alike."""
    random = np.random.default_rng(3)
    n, k = random.uniform(1.3, 4.0, 1000), random.uniform(-4.0, 4.0, 1000).clip(0.0)
    at = np.linspace(15.0, 80.0, angles)

    def measured(R):
        e = 0.002 * random.standard_normal(R.shape)
        match kind:
            case "relative":
                e = 5.0 * R * e
            case "outliers":
                e = np.where(random.random(R.shape) < 0.05, 10.0 * e, e)
            case "printed":
                return np.round(R, 3)
        return R + e

    R_s, R_p = _powers(n, k, at)
    assert _told(fit_many(at, R_s=measured(R_s), R_p=measured(R_p))) < 0.01
    assert _told(fit_many(at, R=measured(0.5 * (R_s + R_p)))) < 0.01
