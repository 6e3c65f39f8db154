"""Fits of light from the denser side beyond the critical angle, where the data see k linearly."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from fitting import fit_many
from tests.estimates import at_zero, texts
from tests.truth.bounded import WIDE, own_root, roots
from tests.truth.textbook import reflectances

ANGLES = np.linspace(20.0, 80.0, 13)
NOISE = 2e-3


def textbook(angles, eta, k, eta_i):
    """R_s and R_p; arguments broadcast."""
    found = reflectances(np.cos(np.radians(angles)), eta + 1j * k, eta_i)
    return found["R_s"], found["R_p"]


def measured(eta, k, eta_i, count, seed=3):
    rng = np.random.default_rng(seed)
    both = textbook(ANGLES, eta, k, eta_i)
    return {
        q: v + NOISE * rng.standard_normal((count, len(ANGLES)))
        for q, v in zip(("R_s", "R_p"), both, strict=True)
    }


def fitted(data, eta_i, **how):
    how = {"sigma": NOISE, "errors": "stated", **how}
    return fit_many(ANGLES, **data, sample=f"{float(eta_i)!r} | free", **how)


@pytest.mark.study
@pytest.mark.parametrize(
    ("eta", "k", "eta_i"),
    [(0.458, 0.0, 1.0), pytest.param(1.0, 2e-4, 1.5, marks=pytest.mark.study)],
)
def test_error_and_limit_of_k_are_those_of_a_model_linear_in_k(eta, k, eta_i):
    """R = R(k = 0) + k dR/dk, the slope from a difference: k may then be below 0."""
    step, data = 1e-7, measured(eta, k, eta_i, 30)
    found = fitted(data, eta_i)
    below = limited = 0
    for i in range(30):

        def residuals(y, i=i):
            first, second = textbook(ANGLES, y[0], 0.0, eta_i), textbook(ANGLES, y[0], step, eta_i)
            return np.concatenate([
                (a + (b - a) / step * y[1] - data[q][i]) / NOISE
                for a, b, q in zip(first, second, ("R_s", "R_p"), strict=True)
            ])  # fmt: skip

        solved = least_squares(
            residuals, [found.eta[i], 1e-4], x_scale=[1e-3, 1e-5], xtol=1e-15, gtol=1e-15
        )
        reach = solved.x[1]
        sigma = np.sqrt(np.linalg.inv(solved.jac.T @ solved.jac)[1, 1])
        # What is quadratic in k, and an angle next to the critical one, move all by some per cent.
        if np.isfinite(found.parameters["k"].sigma[i]):
            assert found.parameters["k"].sigma[i] == pytest.approx(sigma, rel=0.04)
            continue
        limited += 1
        below += reach < 0.0
        assert (found.k[i] == 0.0) == (reach < 0.0)
        wide = own_root(reach / sigma, True) * sigma
        limit = reach + (np.hypot(reach, wide) if reach < 0.0 else wide)
        assert found.parameters["k"].upper_limit[i] == pytest.approx(limit, rel=0.04)
    assert limited > 5
    assert below > (8 if k == 0.0 else -1)


def brute_force(data, eta_i, eta, k, sigma_eta, k_most):
    """Ends in eta and in k by the rises that are due there (`bounded`), on a grid; for eta with a
    rise of 3.84 as well, as the standard error supposes."""
    etas = eta + sigma_eta * np.linspace(-5.0, 5.0, 401)
    ks = np.linspace(0.0, k_most, 301)
    chi2 = np.zeros((len(etas), len(ks)))
    both = textbook(ANGLES[:, None, None], etas[None, :, None], ks[None, None, :], eta_i)
    for value, came in zip(both, data.values(), strict=True):
        chi2 += (((value - came[:, None, None]) / NOISE) ** 2).sum(0)
    rise = chi2 - chi2.min()
    along_k = rise.min(0)
    stiff = np.polyfit(etas - eta, rise[:, along_k.argmin()], 2)[0]
    of_eta, of_k = roots(ks, along_k, etas[rise.argmin(0)], 1.0 / np.sqrt(stiff))

    def ends(of, grid, both):
        return np.array([grid[of <= root**2][i] for i, root in zip((0, -1), both, strict=True)])

    along_eta = rise.min(1)
    wide = ends(along_eta, etas, (WIDE, WIDE))
    return ends(along_eta, etas, of_eta), wide, ends(along_k, ks, of_k)


@pytest.mark.study
@pytest.mark.parametrize(
    ("eta", "k", "eta_i", "kinds"),
    [
        (0.458, 0.0, 1.0, ("quadratic", "profile")),
        pytest.param(1.33, 1e-4, 1.5, ("quadratic", "profile"), marks=pytest.mark.study),
        pytest.param(1.0, 1e-3, 1.5, ("quadratic", "profile"), marks=pytest.mark.study),
        # 45 degrees is the critical angle: not quadratic, and the program would choose the profile
        (np.sin(np.pi / 4.0), 1e-4, 1.0, ("profile", "auto")),
    ],
)
def test_intervals_are_those_of_the_likelihood_on_a_grid(eta, k, eta_i, kinds):
    data = measured(eta, k, eta_i, 4)
    for kind in kinds:
        found = fitted(data, eta_i, intervals=kind)
        near_0 = found.k < 3e-4
        assert (
            found.parameters["eta"].interval_kind[near_0]
            == ("quadratic" if kind == "quadratic" else "profile")
        ).all()
        for i in range(4):
            one = {q: v[i] for q, v in data.items()}
            etas, wide, ks = brute_force(
                one,
                eta_i,
                found.eta[i],
                found.k[i],
                found.parameters["eta"].sigma[i],
                1.2 * found.parameters["k"].interval[i, 1],
            )
            # The quadratic one knows nothing of the square root at the critical angle; the profile,
            # with parabolas between 8 lines, rounds the tip that the region has there.
            part = 0.04 if kind == "quadratic" else 0.03 if "auto" in kinds else 0.01
            np.testing.assert_allclose(found.parameters["k"].interval[i], ks, atol=part * ks[1])
            etas = wide if kind == "quadratic" else etas
            np.testing.assert_allclose(
                found.parameters["eta"].interval[i], etas, atol=part * np.ptp(etas)
            )


@pytest.mark.parametrize(
    ("errors", "k"),
    [("stated", 0.0), ("stated", 1e-4), ("stated", 1e-3), ("scaled", 3e-4),
     *(pytest.param(*case, marks=pytest.mark.study)
       for case in (("stated", 3e-4), ("scaled", 0.0), ("scaled", 1e-4), ("scaled", 1e-3)))],
)  # fmt: skip
def test_intervals_of_a_small_k_hold_the_truth(k, errors):
    """sigma_k is 1.2e-4. Between 94 and 96 % (and 3 binomial errors of 3000: 1.2 %)."""
    eta, eta_i = 1.0, 1.5
    found = fitted(measured(eta, k, eta_i, 3000, seed=8), eta_i, errors=errors)
    low, high = found.parameters["k"].interval.T
    assert 0.938 < ((low <= k) & (k <= high)).mean() < 0.972
    low, high = found.parameters["eta"].interval.T
    assert 0.938 < ((low <= eta) & (eta <= high)).mean() < 0.962
    limited = np.isfinite(found.parameters["k"].upper_limit)
    assert (np.isnan(found.parameters["k"].sigma) == limited).all()
    assert (
        found.parameters["k"].upper_limit[limited] == found.parameters["k"].interval[limited, 1]
    ).all()
    if k == 0.0:
        assert limited.mean() > 0.99
    if k == 1e-3:  # eight standard errors
        assert limited.mean() < 0.01
        seen = found.parameters["k"].sigma[~limited]
        assert (found.k[~limited] - k).std() / seen.mean() == pytest.approx(1.0, abs=0.05)


def test_what_is_said_and_drawn_of_a_k_that_is_not_seen():
    found = fitted(measured(1.0, 0.0, 1.5, 16), 1.5, intervals="auto")
    zero = found[int(np.flatnonzero(at_zero(found))[0])]
    (said,) = texts(zero)
    assert "too small for these data to determine" in said
    assert "k^2" not in said
    # The band of the curve beyond the critical angle is what the error of k gives it.
    step = 1e-7
    at = np.array([60.0, 75.0])
    before, after = (textbook(at, zero.eta, k, 1.5)[0] for k in (0.0, step))
    _, band = zero.predict(at, "R_s")
    slopes = np.abs(after - before) / step
    assert band[0] / band[1] == pytest.approx(slopes[0] / slopes[1], rel=0.05)
    assert 1e-5 < (band / slopes).mean() < 2e-4  # half the limit of k


def test_beyond_the_critical_angle_alone_the_interval_is_the_likelihoods():
    """The quadratic end is off by two thirds of the half width here; auto takes the profile."""
    angles, noise = np.linspace(44.8, 87.0, 9), 5e-3
    random = np.random.default_rng(4)
    s, p = (R + noise * random.standard_normal(9) for R in textbook(angles, 1.0, 2e-3, 1.5))
    how = {"sigma": noise, "errors": "stated", "sample": "1.5 | free", "intervals": "auto"}
    found = fit_many(angles, R_s=s, R_p=p, **how)
    eta, least = np.linspace(0.9, 1.1, 801)[:, None], np.inf
    for k in np.geomspace(1e-5, 0.1, 1500):
        model = textbook(angles, eta, k, 1.5)
        off = [((a - b) / noise) ** 2 for a, b in zip(model, (s, p), strict=True)]
        least = np.minimum(least, np.sum(off, axis=(0, 2)))
    inside = eta[least <= least.min() + WIDE**2]
    low, high = inside.min(), inside.max()
    np.testing.assert_allclose(
        found.parameters["eta"].interval, [low, high], atol=0.02 * (high - low)
    )
