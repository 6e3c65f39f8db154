"""What the table of a fitted model says in special cases: valleys, limits, losses, many names."""

from dataclasses import replace

import numpy as np
import pytest

from fitting import Measurement, choose, fit, simulate
from fitting.data.measurement import concatenate
from fitting.output.page import fit_page
from fitting.output.summary import reach
from fitting.results.diagnostics import Finding
from fitting.results.result_parts import Alternative, Estimate
from tests.truth.simulated import simulated, textbook


@pytest.fixture(scope="module")
def absorber():
    angles = tuple(np.linspace(20.0, 80.0, 20))
    return fit(simulated(1.7, 0.8, 1e-3, angles=angles, seed=3), "constant", errors="scaled")


@pytest.fixture(scope="module")
def drude():
    """Three parameters of a dispersion, asked of one wavelength."""
    angles = tuple(np.linspace(20.0, 80.0, 20))
    return fit(simulated(0.4, 2.6, 1e-3, angles=angles, wavelength_um=0.6, seed=3), "drude")


def one_line(text):
    return " ".join(str(text).split())


def test_a_valley_is_one_solution_and_nothing_is_said_of_its_starts(drude):
    assert drude.status == "undetermined"
    assert drude.alternatives or drude.reached < 3  # else nothing were to be kept silent
    assert drude.warnings[0].code == "not_seen"
    assert not {"other_minima", "few_starts_agree"} & {w.code for w in drude.warnings}
    for text in (str(drude), fit_page(drude, b"")):
        assert "are not determined separately" in one_line(text)
        assert "also fits" not in text and "starting points led" not in text


def test_a_sample_without_parameters_can_be_chosen_and_shown():
    m = simulated(1.5, 0.0, 1e-3, angles=tuple(np.linspace(20.0, 80.0, 20)), seed=3)
    choice = choose(m, "1.5 or 1.7", errors="scaled", intervals="quadratic")
    assert choice.taken.label == "1.5" and choice.fit.dof == choice.fit.n_data
    n, size = choice.fit.n_data, choice.fit.chi2_reduced
    least = n * np.log(size)  # -2 log(likelihood) of the likeliest noise, up to a constant
    assert choice.fit.bic == pytest.approx(least, abs=1e-6)
    assert choice.fit.aicc == pytest.approx(least + 2.0 * n / (n - 2), abs=1e-6)
    for text in (one_line(choice), one_line(fit_page(choice.fit, b""))):
        assert "no parameter was fitted" in text or "none was fitted" in text
        assert "starting points" not in text
    assert one_line(repr(choice.fit)).endswith("converged>")


def test_a_sample_without_parameters_may_have_a_fixed_angle_offset():
    """The offset that stands for a parameter there could not be fixed and bounded as well."""
    angle = np.linspace(20.0, 80.0, 20)
    R = {q: simulate("1.5", {"angle_offset": 0.4}, angle, 0.6, q) for q in ("R_s", "R_p")}
    m = Measurement.from_columns(angle, 0.6, sigma=1e-3, **R)
    choice = choose(m, "1.5 or 1.7", fixed={"angle_offset": 0.4}, intervals="quadratic")
    assert choice.taken.label == "1.5" and choice.fit.rms < 1e-9


def test_correlations_are_shown(absorber):
    r = absorber.correlation[0, 1]
    assert f"correlation eta and k {r:+.3f} criteria" in one_line(absorber)
    c = np.full((8, 8), 0.1)
    c[5, 2] = c[2, 5] = -0.97
    c[7] = c[:, 7] = np.nan
    np.fill_diagonal(c, 1.0)
    each = Estimate(name="a", value=1.0, sigma=1.0, interval=np.zeros(2), interval_kind="quadratic")
    many = replace(
        absorber, covariance=c, parameters={name: replace(each, name=name) for name in "abcdefgh"}
    )
    text = one_line(many)
    assert "correlation c and f -0.970, " in text and "(the largest of 21)" in text
    assert text.count("+0.100") == 5


@pytest.mark.parametrize("loss", ["huber", "student"])
def test_the_errors_of_a_robust_fit_are_not_called_those_of_least_squares(absorber, loss):
    robust = replace(absorber, loss=loss, noise=1.1)
    for text in (one_line(robust), one_line(fit_page(robust, b""))):
        assert "sqrt(chi2/dof)" not in text
        assert f"as the {loss} loss weighs them (Huber" in text
    assert "sqrt(chi2/dof)" in one_line(absorber)


@pytest.mark.parametrize(
    ("errors", "said"),
    [
        ({"taken": "stated", "factor": 1.0}, "from the stated errors of the data as they are"),
        ({"taken": "scaled", "factor": 2.5}, "times sqrt(chi2/dof) = 2.5"),
        ({"taken": "scaled", "factor": 5.0, "widened": 2.0}, "sqrt(chi2/dof) = 2.5; multiplied by "
         "2, since the residuals are autocorrelated"),
        ({"taken": "floor", "factor": 1.1, "added": 0.0123}, "a common error of the data (0.012), "
         "added in squares"),
        ({"taken": "equal", "factor": 0.1}, "scatter of the data about the fit (equal weights)"),
    ],
)  # fmt: skip
def test_the_table_says_what_the_standard_errors_are_made_of(absorber, errors, said):
    stated = absorber.errors._replace(stated=True, widened=1.0, added=0.0)
    assert said in one_line(replace(absorber, errors=stated._replace(**errors)))


def test_residuals_of_psi_and_delta_are_said_to_be_of_n_c_s(absorber):
    both = replace(absorber, rms_of={"R_s": 0.001, "NCS": 0.02})
    text = one_line(both)
    assert "psi and Delta, as cos 2psi, sin 2psi cos Delta, sin 2psi sin Delta, 0.0200" in text
    assert "NCS" not in text
    alone = one_line(replace(absorber, rms_of={"NCS": 0.02}))
    assert "of cos 2psi, sin 2psi cos Delta, sin 2psi sin Delta; unweighted)" in alone


def test_a_k_that_is_only_limited_has_no_bare_error_at_a_wavelength():
    wave = np.tile([0.4, 0.5, 0.6], 4)
    angle = np.repeat([50.0, 65.0, 75.0, 80.0], 3)
    rng = np.random.default_rng(0)
    R = {
        q: textbook(angle, np.full(12, q), 1.6, 0.03) + 2e-3 * rng.standard_normal(12)
        for q in ("R_s", "R_p")
    }
    m = Measurement.from_columns(angle, wave, sigma=2e-3, **R)
    found = fit(m, "cauchy-urbach:1", fixed={"urbach_ev": 5.0})
    assert np.isfinite(found.parameters["k_edge"].upper_limit)
    rows = [line for line in str(found).splitlines() if line.strip().startswith("at 0.")]
    assert len(rows) == 3
    k = [row.split(", k ")[1] for row in rows]
    assert all(text == "0" or text.endswith("(compatible with 0)") for text in k)
    page = fit_page(found, b"")
    assert page.count("(compatible with 0)") == sum(text != "0" for text in k)


def test_a_second_solution_is_told_with_its_errors(absorber):
    half = 0.25 * reach(absorber) * np.array([-1.0, 1.0])
    other = {
        name: replace(e, value=e.value + 1.0, sigma=0.25, interval=e.value + 1.0 + half)
        for name, e in absorber.parameters.items() if e.free
    }  # fmt: skip
    two = replace(absorber, others=(Alternative(parameters=other, delta_chi2=2.345, reached=3),))
    eta, k = (absorber.values[name] + 1.0 for name in ("eta", "k"))
    assert f"also fits eta {eta:.2f} +- 0.25, k {k:.2f} +- 0.25 (chi2 higher by 2.3)" in one_line(
        two
    )


def test_findings_of_a_batch_that_come_in_several_kinds_keep_their_numbers():
    waves = (0.4, 0.5, 0.6)
    m = [simulated(0.5, 2.2, 1e-3, wavelength_um=w, seed=i) for i, w in enumerate(waves)]
    found = fit(concatenate(*m))
    told = replace(
        found,
        findings=(
            Finding("no_degrees_of_freedom", np.array([False, True, False]),
                    {"n_data": np.array([2, 2, 2]), "unknowns": 2, "stated": True}),
            Finding("implausible_offset", np.array([True, True, True]),
                    {"value": np.array([3.0, 4.0, 5.0])}),
        ),
    )  # fmt: skip
    lines = [line.strip() for line in str(told).splitlines() if "converged" in line]
    rows = [line for line in lines if line[:3] in ("0.4", "0.5", "0.6")]
    assert [row.partition("converged")[2].split() for row in rows] == [["2"], ["1", "2"], ["2"]]
    text = one_line(told)
    assert "(at 0.5 um)." in text
    assert "(at 0.4 um; with other numbers at 2 more wavelengths)." in text
