"""Models compared by a robust loss: the likelihood against scipy's densities, and the choice."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import integrate, optimize, stats

from fitting import Measurement, choose, fit
from fitting.choice.selection import explains
from fitting.problem.programs import HUBER
from fitting.uncertainty.likelihood import criteria
from tests.truth.simulated import textbook

RESIDUALS = np.random.default_rng(2).standard_t(3, 60) * 7e-3


def test_unknown_noise_is_compared_by_the_t_law_at_its_likeliest_width():
    def minus_two_log(log_s):
        # 4 log(1 + r^2/4) is the t law of 3 degrees of freedom of r sqrt(3/4)
        return -2.0 * stats.t.logpdf(RESIDUALS, 3, scale=np.exp(log_s) * np.sqrt(4 / 3)).sum()

    least = optimize.minimize_scalar(minus_two_log, bounds=(-9.0, 0.0), method="bounded").fun  # pyright: ignore
    gaussian = 60 * (1.0 + np.log(2.0 * np.pi))  # what n log(chi2/n) leaves out
    wanted = least - gaussian + 2 * np.log(60)
    bic, aicc = criteria("huber", RESIDUALS, 60, 2, True)
    assert bic == pytest.approx(wanted, abs=1e-6)  # of the bounded search
    assert aicc == pytest.approx(least - gaussian + 2 * 3 * 60 / 56, abs=1e-6)
    squares, _ = criteria("squares", RESIDUALS, 60, 2, True)
    scale = np.sqrt(np.mean(RESIDUALS**2))
    by_scipy = -2.0 * stats.norm.logpdf(RESIDUALS, scale=scale).sum() - gaussian
    assert squares == pytest.approx(by_scipy + 2 * np.log(60), abs=1e-9)


@pytest.mark.parametrize("loss", ["squares", "huber"])
def test_stated_noise_is_taken_as_it_is(loss):
    r = RESIDUALS * 200.0

    def rho(x):
        far = 2.0 * HUBER * abs(x) - HUBER**2 if abs(x) > HUBER else x * x
        return {"squares": x * x, "huber": far}[loss]

    area = 2.0 * integrate.quad(lambda x: np.exp(-0.5 * rho(x)), 0.0, np.inf)[0]
    wanted = sum(map(rho, r)) + 120 * np.log(area / np.sqrt(2.0 * np.pi)) + 3 * np.log(60)
    assert criteria(loss, r, 60, 3, False)[0] == pytest.approx(wanted, rel=1e-7)


def test_a_perfect_fit_counts_as_one_at_rounding():
    for loss in ("squares", "huber"):
        assert np.isfinite(criteria(loss, np.zeros(20), 20, 2, True)).all()


def test_outliers_do_not_hide_absorption():
    """12 % outliers; least squares cannot tell k = .25 from 0 in these data."""
    rng = np.random.default_rng(4)
    angle = np.linspace(20.0, 80.0, 40)
    true = {q: textbook(angle, np.full(40, q), 1.6, 0.25) for q in ("R_s", "R_p")}
    value = np.concatenate([*true.values()]) + rng.normal(0.0, 1e-3, 80)
    out = rng.random(80) < 0.12
    value[out] += rng.uniform(0.05, 0.15, out.sum())
    value = np.clip(value, 0.0, 1.0)
    m = Measurement.from_columns(angle, R_s=value[:40], R_p=value[40:])
    choice = choose(m, loss="huber", instrument=False)
    assert choice.taken.label == "constant"
    assert choice.fit.parameters["k"].value == pytest.approx(0.25, abs=0.02)
    # Outliers are not held against the model, where errors are stated.
    assert choice.describes
    stated = replace(m, sigma=np.full(80, 1e-3))
    robust = fit(stated, "constant", loss="huber")
    assert robust.chi2_reduced > 100.0 and explains(robust)
    assert not any("reduced chi2" in w.text for w in robust.warnings)
    small = fit(replace(m, sigma=np.full(80, 2e-4)), "constant", loss="huber")
    assert any(w.text.startswith("reduced chi2, without the outliers, is ") for w in small.warnings)
    assert any("residuals are 5" in w.text or "residuals are 6" in w.text for w in small.warnings)
    assert not explains(fit(stated, "constant", fixed={"k": 0.25}))
    k_0 = fit(m, "constant", loss="huber", fixed={"k": 0.0})
    assert k_0.bic > choice.fit.bic + 50.0
