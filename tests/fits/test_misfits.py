"""Fits whose sample or instrument does not describe the data: their status, and what would."""

import json

import numpy as np
import pytest

from fitting import Measurement, fit, fit_many, simulate

ANGLES = np.linspace(30.0, 87.0, 16)


def silicon(leak, seed=0, stated=True):
    """R_s and R_p of silicon at 532 nm behind a polarizer that leaks; stated errors too small."""
    rng, data = np.random.default_rng(seed), {}
    s, p = (simulate("free", {"eta": 4.16, "k": 0.04}, ANGLES, 0.532, q) for q in ("R_s", "R_p"))
    for name, own, other in (("R_s", s, p), ("R_p", p, s)):
        data[name] = own + leak * (other - own) + 0.003 * rng.standard_normal(16)
    return data, {"R_s": 0.017, "R_p": 3e-4} if stated else None


def codes(found):
    return [w.code for w in found.warnings]


@pytest.fixture(scope="module")
def leaking():
    data, sigma = silicon(0.05)
    return fit(Measurement.from_columns(ANGLES, 0.532, sigma=sigma, **data), "free")


def test_a_leak_is_a_misfit_and_is_named_with_the_index_that_it_leaves(leaking):
    assert leaking.status == "misfit"
    assert codes(leaking)[:2] == ["does_not_describe", "explained_by"]
    (leak,) = leaking.warnings[1].values["explanations"]
    what, rms, describes, new, after = leak
    assert (what, describes) == ("leak", True)
    assert rms == pytest.approx(0.003, rel=0.4)  # the noise, of 32 data
    assert abs(new["leak"][0] - 0.05) < 3.0 * new["leak"][1]
    for name, truth in (("eta", 4.16), ("k", 0.04)):
        *_, low, high = after[name]
        assert low <= truth <= high
    assert "better by leak: leak 0.04" in leaking.warnings[1].text
    assert json.dumps(leaking.to_dict())


def test_intervals_of_a_misfit_cover_those_of_all_error_models(leaking):
    data, sigma = silicon(0.05)
    m = Measurement.from_columns(ANGLES, 0.532, sigma=sigma, **data)
    (told,) = (w for w in leaking.warnings if w.code == "errors_cover")
    assert "k" in told.values["parameters"]
    low, high = leaking.parameters["k"].interval
    for errors in ("scaled", "floor", "equal"):
        one = fit(m, "free", errors=errors, intervals="quadratic").parameters["k"]
        assert low <= one.value <= high
    # The standard error grows with the interval.
    e = leaking.parameters["k"]
    assert e.sigma == pytest.approx(np.sqrt(leaking.covariance[1, 1]))
    assert 3.0 * e.sigma < high - low < 6.0 * e.sigma


def test_a_curve_of_a_batch_has_the_status_of_its_fit_alone():
    good, bad = silicon(0.0)[0], silicon(0.05)[0]
    both = {q: np.stack([good[q], bad[q]]) for q in good}
    many = fit_many(ANGLES, 0.532, **both)
    assert many.status.tolist() == ["converged", "misfit"]
    assert many[1].status == "misfit"
    assert "does_not_describe" in codes(many[1])
    alone = Measurement.from_columns(ANGLES, 0.532, **good)
    assert fit(alone, "free").status == "converged"


def test_residuals_in_order_within_the_stated_errors_are_no_misfit():
    wave = np.linspace(0.4, 0.8, 40)
    clean = simulate("cauchy:2", {"A": 1.5, "B": 0.01}, np.zeros(40), wave, "R")
    value = clean + 2e-4 * np.cos(12.0 * wave)
    found = [
        fit(Measurement.from_columns(np.zeros(40), wave, R=value, sigma=s), "cauchy:2")
        for s in (1e-3, 2e-5, None)
    ]
    assert all("residuals_in_order" in codes(f) for f in found)
    assert [f.status for f in found] == ["converged", "misfit", "misfit"]
