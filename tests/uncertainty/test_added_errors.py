"""Errors that stated ones lack: common to all data, or in proportion to what each one measured."""

import json

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from fitting import Measurement, fit, fit_many, simulate
from fitting.residuals.error_model import FLOOR, RELATIVE, likeliest_added, one_factor, sizes
from tests.truth.simulated import textbook

ANGLES = np.linspace(15.0, 85.0, 24)


def silicon(stated, seed, count, white=0.0, part=0.0, scaled=1.0):
    """R_s and R_p of 4 + .4 i with these stated errors of s and p, and others in addition."""
    rng = np.random.default_rng(seed)
    data = {}
    for name, sigma in zip(("R_s", "R_p"), stated, strict=True):
        R = textbook(ANGLES, np.full(24, name), 4.0, 0.4)
        a, b, c = rng.standard_normal((3, count, 24))
        data[name] = R + scaled * sigma * a + white * b + part * R * c
    return data, dict(zip(("R_s", "R_p"), stated, strict=True))


@pytest.mark.parametrize("kind", [FLOOR, RELATIVE])
@pytest.mark.parametrize("seed", range(4))
def test_the_likeliest_error_is_that_of_a_search(kind, seed):
    rng = np.random.default_rng(seed)
    fitted, sigma = rng.uniform(1e-3, 1.0, 40), 10.0 ** rng.uniform(-4.0, -2.0, 40)
    size = sizes(kind, fitted)
    residual = np.hypot(sigma, 0.03 * size) * rng.standard_normal(40)
    sigma[3] = np.inf  # no datum

    def minus_two_log(log_s):
        used = np.isfinite(sigma)
        variance = (sigma**2 + (np.exp(log_s) * size) ** 2)[used]
        return np.sum(residual[used] ** 2 / variance + np.log(variance))

    by_hand = minimize_scalar(minus_two_log, bounds=(-12.0, 2.0), options={"xatol": 1e-9})
    found = likeliest_added(residual, sigma, size)
    # The search sees the minimum to the root of the rounding of its value.
    assert found.s == pytest.approx(np.exp(by_hand.x), rel=1e-4)
    assert found.minus_two_log == pytest.approx(by_hand.fun, abs=1e-6)
    # One factor is found by the same search over it.
    square = (residual**2)[np.isfinite(sigma)]

    def of_factor(log_f):
        variance = (np.exp(log_f) * sigma[np.isfinite(sigma)]) ** 2
        return np.sum(square / variance + np.log(variance))

    by_hand = minimize_scalar(of_factor, bounds=(-9.0, 9.0), options={"xatol": 1e-9})
    assert one_factor(residual, sigma) == pytest.approx(by_hand.fun, abs=1e-6)


def test_only_powers_have_an_error_in_proportion_to_themselves():
    fitted, power = np.array([0.5, -0.1, 40.0]), np.array([True, True, False])
    assert sizes(RELATIVE, fitted, power).tolist() == [0.5, 0.1, 0.0]
    assert sizes(FLOOR, fitted, power).tolist() == [1.0, 1.0, 1.0]
    assert sizes(np.array([FLOOR, RELATIVE, "scaled"]), fitted).tolist() == [1.0, 0.1, 1.0]


@pytest.mark.study
def test_errors_of_5_percent_of_R_are_found_and_make_the_data_beside_brewsters_angle_count():
    data, sigma = silicon((2e-3, 2e-3), 3, 400, part=0.05)
    found = fit_many(ANGLES, **data, sigma=sigma, intervals="auto")
    assert (found.errors.taken == "relative").mean() > 0.98
    # Less by 2 %: likeliest of 48 data after a fit of two; the median of 400 is known to 1 %.
    assert np.median(found.errors.added) == pytest.approx(0.05, rel=0.05)
    scaled = fit_many(ANGLES, **data, sigma=sigma, errors="scaled", intervals="auto")
    for name, truth, narrower in (("eta", 4.0, 0.4), ("k", 0.4, 0.5)):
        ends, wide = found.parameters[name].interval, scaled.parameters[name].interval
        # 95 %, and 4 binomial errors of 400; with equal weights all.
        assert 0.906 < ((ends[:, 0] <= truth) & (truth <= ends[:, 1])).mean() < 0.99
        assert np.median(np.diff(ends)) < narrower * np.median(np.diff(wide))
    one = int(np.flatnonzero(found.errors.taken == "relative")[0])
    said = next(w for w in found.warnings[one] if w.code == "errors_relative")
    assert f"{found.errors.added[one]:.2%} of each fitted value" in said.text
    assert said.values["gain"] > 2.0


@pytest.mark.study
def test_errors_wrong_by_a_factor_are_scaled():
    data, sigma = silicon((1e-4, 1e-2), 4, 400, scaled=3.0)
    found = fit_many(ANGLES, **data, sigma=sigma)
    assert (found.errors.taken == "scaled").mean() > 0.97
    assert (found.errors.added[found.errors.taken == "scaled"] == 0.0).all()


def test_a_fit_that_follows_the_best_data_alone_is_not_what_errors_are_judged_by():
    """s stated a hundred times better than p, and .02 wrong as well: of 400 fits with one factor 15
    follow s to an index of 1.2 to 1.5 + 1.7 i, where R_p is missed by so much that no common error
    is likelier. The fit with a common error has to be made to see that it is."""
    data, sigma = silicon((1e-4, 1e-2), 5, 256, white=0.02)
    scaled = fit_many(ANGLES, **data, sigma=sigma, errors="scaled")
    assert (scaled.eta < 2.0).sum() > 4
    found = fit_many(ANGLES, **data, sigma=sigma)
    assert (found.errors.taken == "floor").mean() > 0.9
    assert (found.errors.taken != "scaled").all()
    assert (np.abs(found.eta - 4.0) < 1.0).all()
    # A model fit goes the same way.
    one = int(np.argmin(scaled.eta))
    curve = {name: value[one] for name, value in data.items()}
    m = Measurement.from_columns(ANGLES, 0.6, sigma=sigma, **curve)
    model = fit(m, "constant")
    assert model.errors.taken == "floor"
    # Weights are updated until s changes by less than 1 %.
    assert model.errors.added == pytest.approx(found.errors.added[one], rel=1e-2)
    # The valley in k is flat: from .74 to 0 chi2 rises by 2e-6.
    low, high = model.parameters["eta"].interval
    assert low < found.eta[one] < high


def glass(part, kind="R_s"):
    angle, wave = (a.ravel() for a in np.meshgrid([30.0, 50.0, 65.0], np.linspace(0.4, 0.9, 14)))
    clean = simulate("cauchy:2", {"A": 1.5, "B": 0.012}, angle, wave, kind)
    noise = np.random.default_rng(2).standard_normal((2, len(clean)))
    value = clean * (1.0 + part * noise[0]) + 2e-4 * noise[1]
    return Measurement.from_columns(angle, wave, sigma=2e-4, **{kind: value})


@pytest.mark.parametrize("errors", ["auto", "relative"])
def test_a_model_over_a_spectrum_has_them_too(errors):
    found = fit(glass(0.03), "cauchy:2", errors=errors, fixed={"B": 0.012})
    assert found.errors.taken == "relative"
    # 42 data tell it to 11 %.
    assert found.errors.added == pytest.approx(0.03, rel=0.3)
    # They are in the weights once: what is left to a factor is sqrt(42 / 41).
    assert found.errors.factor == pytest.approx(1.0, abs=0.05)
    assert f"{100.0 * found.errors.added:.2g} % of each" in str(found)
    assert any(w.code == "errors_relative" for w in found.warnings)
    fields = json.loads(json.dumps(found.to_dict()))["errors"]
    assert fields["taken"] == "relative" and fields["added"] == found.errors.added
    low, high = found.parameters["A"].interval
    assert low < 1.5 < high


def test_what_relative_errors_need_is_said():
    with pytest.raises(ValueError, match='errors "relative" need a standard error for every datum'):
        fit_many(ANGLES, R_s=np.full(24, 0.5), errors="relative")
    wave = np.linspace(0.4, 0.9, 14)
    psi = simulate("cauchy:2", {"A": 1.5, "B": 0.012}, np.full(14, 65.0), wave, "psi")
    m = Measurement.from_columns(np.full(14, 65.0), wave, psi=psi, sigma=0.1)
    with pytest.raises(ValueError, match=r"in proportion to R and T.*psi.*\"floor\""):
        fit(m, "cauchy:2", errors="relative")
