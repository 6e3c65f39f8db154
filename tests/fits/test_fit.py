"""Fitted values and errors against exact data, against scipy and against repeated simulation."""

import jax
import numpy as np
import pytest
from scipy.optimize import least_squares

from fitting import fit, fit_many
from fitting.data.measurement import Measurement
from tests.estimates import sigmas
from tests.truth import oracle
from tests.truth.simulated import textbook

ANGLES = np.linspace(10.0, 85.0, 16)
MATERIALS = {
    "glass": (1.5, 0.0),
    "water": (1.333, 1e-8),
    "tinted": (1.52, 0.2),
    "silicon": (4.15, 0.05),
    "germanium": (5.5, 1.6),
    "gold": (0.36, 2.6),
    "silver": (0.05, 4.0),
    "aluminium": (1.1, 7.0),
}


def both(eta, k, angles=ANGLES):
    return {q: textbook(angles, np.full(len(angles), q), eta, k) for q in ("R_s", "R_p")}


@pytest.mark.parametrize("material", MATERIALS)
def test_exact_data_give_back_the_exact_index(material):
    eta, k = MATERIALS[material]
    cosines = np.cos(np.radians(ANGLES))
    exact = [oracle.powers(c, eta, k, 1.0)[:2] for c in cosines]
    R_s, R_p = np.array(exact, dtype=float).T
    found = fit_many(ANGLES, R_s=R_s, R_p=R_p)
    assert found.status == "converged"
    # Data rounded to 2^-53 leave eta uncertain by a few 1e-15 of itself, for silver (which reflects
    # .98 or more everywhere) by ten times that.
    assert found.eta == pytest.approx(eta, rel=1e-13 if material == "silver" else 1e-14)
    if k > 0.01:
        # and k^2 by about 1e-15 n^2 absolutely.
        assert found.k == pytest.approx(k, rel=max(1e-12, 1e-15 * (eta / k) ** 2))
    else:
        assert found.k < 1e-6 * eta
    assert found.rms < 1e-15


def residuals(p, quantities, angles, values, sigma):
    """Of the textbook formulas in (eta, u = k^2), u < 0 allowed, so that no bound is in the way."""
    k = np.sqrt(complex(p[1]))
    model = np.concatenate([textbook(angles, np.full(len(angles), q), p[0], k) for q in quantities])
    return (model - values) / sigma


@pytest.mark.parametrize("quantities", [("R_s", "R_p"), ("R_p",), ("R",)], ids="-".join)
@pytest.mark.parametrize("material", ["tinted", "germanium", "gold", "aluminium"])
def test_noisy_data_give_the_minimum_and_the_covariance_of_scipy(material, quantities):
    eta, k = MATERIALS[material]
    rng = np.random.default_rng(5)
    sigma = rng.uniform(5e-4, 2e-3, (len(quantities), len(ANGLES)))
    clean = [textbook(ANGLES, np.full(len(ANGLES), q), eta, k) for q in quantities]
    noisy = np.array(clean) + sigma * rng.standard_normal(sigma.shape)
    found = fit_many(
        ANGLES,
        **dict(zip(quantities, noisy, strict=True)),
        sigma=dict(zip(quantities, sigma, strict=True)),
        errors="stated",
    )
    scipy = least_squares(
        residuals, (eta, k * k), args=(quantities, ANGLES, noisy.ravel(), sigma.ravel()),
        jac="3-point", xtol=1e-14, ftol=1e-14, gtol=1e-14, x_scale="jac",
    )  # fmt: skip
    covariance = np.linalg.inv(scipy.jac.T @ scipy.jac)  # of (eta, u)
    slope = np.diag([1.0, 0.5 / found.k])
    covariance = slope @ covariance @ slope
    assert found.status == "converged"
    assert found.chi2 == pytest.approx(2.0 * scipy.cost, rel=1e-8)
    assert found.eta == pytest.approx(scipy.x[0], abs=1e-3 * found.parameters["eta"].sigma)
    assert found.k == pytest.approx(np.sqrt(scipy.x[1]), abs=1e-3 * found.parameters["k"].sigma)
    # scipy's Jacobian is of differences; the covariance moves as the point does, 1e-3 sigma.
    np.testing.assert_allclose(found.covariance, covariance, rtol=5e-3)
    assert found.parameters["eta"].sigma == pytest.approx(np.sqrt(covariance[0, 0]), rel=5e-3)
    correlation = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
    assert found.correlation[0, 1] == pytest.approx(correlation, abs=5e-3)


def test_scaled_errors_are_absolute_ones_times_the_root_of_reduced_chi2():
    rng = np.random.default_rng(2)
    data = {q: r + 0.003 * rng.standard_normal(r.shape) for q, r in both(0.36, 2.6).items()}
    kept = fit_many(ANGLES, **data, sigma=0.001, errors="stated")
    scaled = fit_many(ANGLES, **data, sigma=0.001)
    equal = fit_many(ANGLES, **data)
    assert (kept.sigma_kind, scaled.sigma_kind, equal.sigma_kind) == ("absolute", *["scaled"] * 2)
    assert kept.dof == 30
    assert kept.n_data == 32
    assert kept.chi2 == pytest.approx(32 * kept.rms**2 / 0.001**2, rel=1e-6)
    assert kept.chi2_reduced == pytest.approx(kept.chi2 / 30, rel=1e-12)
    root = np.sqrt(kept.chi2_reduced)
    np.testing.assert_allclose(sigmas(scaled), root * sigmas(kept), rtol=1e-9)
    np.testing.assert_allclose(sigmas(equal), sigmas(scaled), rtol=1e-9)
    assert np.isnan(equal.chi2)
    assert np.isnan(equal.chi2_reduced)


def test_weights_decide_between_data_that_disagree():
    glass, dense = both(1.5, 0.0), both(1.8, 0.0)
    data = {q: np.where(np.arange(16) % 2, dense[q], glass[q]) for q in glass}
    first = np.tile([1e-5, 1e-1], 8)
    assert fit_many(ANGLES, **data, sigma=first).eta == pytest.approx(1.5, abs=1e-3)
    assert fit_many(ANGLES, **data, sigma=first[::-1]).eta == pytest.approx(1.8, abs=1e-3)


@pytest.mark.study
@pytest.mark.parametrize(("eta", "k"), [(1.5, 0.3), (3.0, 1.0), (0.5, 3.0)])
def test_errors_cover_the_truth_as_often_as_they_should(eta, k):
    """4000 repeats: the share within one and two sigma, and the scatter itself."""
    rng = np.random.default_rng(31)
    count, noise = 4000, 2e-3
    data = {q: r + noise * rng.standard_normal((count, len(r))) for q, r in both(eta, k).items()}
    for kwargs in ({}, {"sigma": noise, "errors": "stated"}):
        found = fit_many(ANGLES, **data, **kwargs)
        assert (found.status == "converged").all()
        for value, truth, sigma in (
            (found.eta, eta, found.parameters["eta"].sigma),
            (found.k, k, found.parameters["k"].sigma),
        ):
            z = (value - truth) / sigma
            # .683 and .954; 4 binomial errors of 4000 are .03 and .013. (30 degrees of freedom
            # widen the scaled one by less.)
            assert (np.abs(z) < 1.0).mean() == pytest.approx(0.683, abs=0.03)
            assert (np.abs(z) < 2.0).mean() == pytest.approx(0.954, abs=0.015)
            assert np.std(value) == pytest.approx(np.median(sigma), rel=0.06)


def test_medium_of_incidence_scales_the_index():
    # R depends on N / eta_i alone.
    scaled = fit_many(ANGLES, **both(0.36 / 1.33, 2.6 / 1.33), sample="1.33 | free")
    assert scaled.eta == pytest.approx(0.36, rel=1e-12)
    assert scaled.k == pytest.approx(2.6, rel=1e-12)
    assert scaled.sample.eta_i == 1.33


def test_total_reflection_in_a_prism_gives_the_index_outside():
    rng = np.random.default_rng(3)
    data = {q: r + 1e-3 * rng.standard_normal(r.shape) for q, r in both(1.0 / 1.5, 0.0).items()}
    found = fit_many(ANGLES, **data, sample="1.5 | free", sigma=1e-3, errors="stated")
    assert found.status == "converged"
    assert found.eta == pytest.approx(1.0, abs=4.0 * found.parameters["eta"].sigma)
    assert found.parameters["eta"].sigma < 2e-3


@pytest.mark.parametrize("start", [(1.0, 0.0), (3.0, 0.0), (0.2, 9.0), (40.0, 0.0)])
@pytest.mark.parametrize("material", ["glass", "gold", "germanium"])
def test_no_start_of_the_user_can_spoil_the_fit(material, start):
    eta, k = MATERIALS[material]
    found = fit_many(ANGLES, **both(eta, k), start=dict(zip(("eta", "k"), start, strict=True)))
    assert found.eta == pytest.approx(eta, rel=1e-12)
    assert found.k == pytest.approx(k, rel=1e-10, abs=1e-6)


def test_two_data_for_two_unknowns():
    angles = np.array([60.0, 75.0])
    exact = fit_many(angles, R_s=both(2.5, 0.8, angles)["R_s"])
    assert exact.rms < 1e-15
    one = fit_many([70.0], **both(1.8, 0.4, np.array([70.0])))
    assert one.status == "converged"
    assert (one.eta, one.k) == pytest.approx((1.8, 0.4), rel=1e-9)
    assert one.dof == 0
    assert np.isnan(one.parameters["eta"].sigma)
    assert any("two unknowns" in w.text for w in one.warnings)
    # Stated errors are then all there is to go by, scaled or not.
    stated = fit_many([70.0], **both(1.8, 0.4, np.array([70.0])), sigma=1e-3)
    assert 1e-4 < stated.parameters["eta"].sigma < 0.1
    assert np.isnan(stated.chi2_reduced)


def test_the_caller_need_not_switch_on_float64():
    data = both(0.36, 2.6)
    want = fit_many(ANGLES, **data)
    with jax.enable_x64(False):
        found = fit_many(ANGLES, **data)
    assert (found.eta, found.k, *sigmas(found)) == (want.eta, want.k, *sigmas(want))


def test_float32_data_are_fitted_in_float64():
    data = both(0.36, 2.6)
    rounded = {q: r.astype(np.float32) for q, r in data.items()}
    found = fit_many(ANGLES.astype(np.float32), **rounded)
    # Angles and data rounded to 6e-8.
    assert found.eta == pytest.approx(0.36, rel=1e-6)
    assert found.k == pytest.approx(2.6, rel=1e-6)


def test_a_polarizer_between_s_and_p_mixes_them():
    data = both(0.36, 2.6)
    third = np.radians(30.0)
    mixed = data["R_p"] * np.cos(third) ** 2 + data["R_s"] * np.sin(third) ** 2
    m = Measurement.from_columns(ANGLES, R=mixed, polarizer_deg=30.0)
    found = fit(m)
    assert (found.eta, found.k) == pytest.approx((0.36, 2.6), rel=1e-10)


@pytest.mark.study
@pytest.mark.parametrize("channels", [("R_s", "R_p"), ("R_p",), ("R",)])
def test_a_curve_in_total_reflection_from_end_to_end_finds_its_minimum(channels):
    """One such curve in four ended in a worse minimum before there were starts for them."""
    random = np.random.default_rng(5)
    eta, k = random.uniform(0.3, 0.88, 200), 10.0 ** random.uniform(-4, -2, 200)
    angles = np.linspace(62, 85, 11)
    noisy = {
        name: textbook(angles, np.full(11, name), eta[:, None], k[:, None])
        + 1e-4 * random.standard_normal((200, 11))
        for name in channels
    }
    found = fit_many(angles, **noisy, sigma=1e-4, errors="stated")
    with_truth = fit_many(angles, **noisy, sigma=1e-4, errors="stated", start={"eta": eta, "k": k})
    assert (found.chi2 > with_truth.chi2 + 4.0).sum() <= 1
    assert (found.status != "not converged").all()
