"""What the table of a fitted model says in special cases: valleys, limits, losses, many names."""

from dataclasses import replace

import numpy as np
import pytest
from fitting.output.model_page import model_page
from fitting.output.model_report import table
from simulated import simulated, textbook

from fitting import Measurement, fit_model


@pytest.fixture(scope="module")
def absorber():
    angles = tuple(np.linspace(20.0, 80.0, 20))
    return fit_model(simulated(1.7, 0.8, 1e-3, angles=angles, seed=3), "constant")


@pytest.fixture(scope="module")
def drude():
    """Three parameters of a dispersion, asked of one wavelength."""
    angles = tuple(np.linspace(20.0, 80.0, 20))
    measurement = simulated(0.4, 2.6, 1e-3, angles=angles, wavelength_um=0.6, seed=3)
    return fit_model(measurement, "drude")


def one_line(text):
    return " ".join(text.split())


def test_a_valley_is_one_solution_and_nothing_is_said_of_its_starts(drude):
    assert drude.status == "undetermined"
    assert drude.others or drude.reached < 3  # else nothing were to be kept silent
    assert "are not determined separately" in drude.warnings[0]
    assert not any("other minim" in w or "starts ended" in w for w in drude.warnings)
    for text in (table(drude), model_page(drude, b"", "")):
        assert "or else" not in text and "starts agree" not in text


def test_correlations_are_shown(absorber):
    r = absorber.correlation[0, 1]
    assert f"correlation eta and k {r:+.3f} criteria" in one_line(table(absorber))
    names = tuple("abcdefgh")
    c = np.full((8, 8), 0.1)
    c[5, 2] = c[2, 5] = -0.97
    c[7] = c[:, 7] = np.nan
    many = replace(
        absorber, names=names, units=("",) * 8, values=np.ones(8), sigmas=np.ones(8),
        correlation=c, intervals=np.zeros((8, 2)), interval_kinds=("quadratic",) * 8,
        at_bound=("",) * 8, upper_limits=np.full(8, np.nan),
    )  # fmt: skip
    text = one_line(table(many))
    assert "correlation c and f -0.970, " in text and "(the largest of 21)" in text
    assert text.count("+0.100") == 5


@pytest.mark.parametrize("loss", ["huber", "student"])
def test_the_errors_of_a_robust_fit_are_not_called_those_of_least_squares(absorber, loss):
    text = one_line(table(replace(absorber, loss=loss, noise=1.1)))
    assert "sqrt(chi2/dof)" not in text
    assert f"as the {loss} loss counts it (Huber's estimate)" in text
    page = one_line(model_page(replace(absorber, loss=loss, noise=1.1), b"", ""))
    assert f"as the {loss} loss counts it" in page
    assert "sqrt(chi2/dof)" in one_line(table(absorber))


def test_residuals_of_psi_and_delta_are_said_to_be_of_n_c_s(absorber):
    both = replace(absorber, rms_of={"R_s": 0.001, "NCS": 0.02})
    text = one_line(table(both))
    assert "psi and Delta 0.0200 of cos 2psi, sin 2psi cos Delta, sin 2psi sin Delta" in text
    assert "NCS" not in text
    alone = one_line(table(replace(absorber, rms_of={"NCS": 0.02})))
    assert "(of cos 2psi, sin 2psi cos Delta, sin 2psi sin Delta; unweighted)" in alone


def test_a_k_that_is_only_limited_has_no_bare_error_at_a_wavelength():
    wave = np.tile([0.4, 0.5, 0.6], 4)
    angle = np.repeat([50.0, 65.0, 75.0, 80.0], 3)
    rng = np.random.default_rng(0)
    R = {
        q: textbook(angle, np.full(12, q), 1.6, 0.03) + 2e-3 * rng.standard_normal(12)
        for q in ("R_s", "R_p")
    }
    m = Measurement.from_columns(angle, wave, sigma=2e-3, **R)
    fit = fit_model(m, "cauchy-urbach:1", fixed={"urbach_ev": 5.0})
    assert np.isfinite(fit.upper_limits[fit.names.index("k_edge")])
    rows = [line for line in table(fit).splitlines() if line.strip().startswith("at 0.")]
    assert len(rows) == 3
    k = [row.split(", k ")[1] for row in rows]
    assert all(text == "0" or text.endswith("(compatible with 0)") for text in k)
    page = model_page(fit, b"", "")
    assert page.count("(compatible with 0)") == sum(text != "0" for text in k)
