"""What warnings say to try: each text is run, as an option of the command and as an argument."""

import shlex
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fitting import Measurement, fit, read_csv, simulate
from fitting.command import cli
from fitting.outcomes.findings import with_formula
from fitting.residuals.error_model import UNLIKELY, beyond_chance
from fitting.results.diagnostics import Warning
from fitting.results.sentences import SENTENCES, keywords
from fitting.samples.sample import Sample
from tests.truth.simulated import simulated, textbook

ANGLES = tuple(np.linspace(20.0, 80.0, 20))
GLASS = simulated(1.5, 0.0, 1e-3, angles=ANGLES, seed=3)
METAL = simulated(0.4, 2.6, 1e-3, angles=ANGLES, seed=3)
FILM, FREE_FILM = "air | constant 60..400 nm | 3.9", "air | free 50..150 nm | 3.9"


def over_angle(angle, quantity: Any = "R", value=None, sigma: Any = 1e-3):
    quantities = [quantity] if isinstance(quantity, str) else quantity
    each: dict[str, Any] = {
        q: textbook(np.array(angle), np.full(len(angle), q), 1.5, 0.0) for q in quantities
    }
    each = each if value is None else {quantity: value}
    return Measurement.from_columns(np.array(angle), 0.6, sigma=sigma, **each)


def rising(quantity):
    return over_angle(ANGLES, quantity, np.linspace(0.9, 0.1, 20), sigma=None)


def ellipses():
    wave = np.linspace(0.5, 0.7, 5)
    return Measurement.from_columns(70.0, wave, psi=30.0 - 5.0 * wave, delta=120.0 + 40.0 * wave)


def spectrum():
    """Reflectance of glass along the normal, and at one more angle."""
    angle, wave = (a.ravel() for a in np.meshgrid([30.0, 60.0], np.linspace(0.5, 0.7, 5)))
    return Measurement.from_columns(angle, wave, R_s=textbook(angle, np.full(10, "R_s"), 1.5, 0.0))


def p_at_two_angles():
    """Reflectances that two indices explain."""
    angles = np.array([60.0, 75.0])
    return over_angle(angles, "R_p", textbook(angles, np.full(2, "R_p"), 1.8, 0.0))


def off_by_five_degrees():
    true = simulated(0.4, 2.6, 1e-4, angles=ANGLES, seed=3)
    columns: dict[str, Any] = {q: true.value[true.quantity == q] for q in ("R_s", "R_p")}
    return Measurement.from_columns(np.array(ANGLES) - 5.0, 0.6, sigma=1e-4, **columns)


def too_good():
    true = simulated(1.5, 0.5, 1e-5, angles=ANGLES)
    return replace(true, sigma=np.full(len(true), 1e-3))


def p_above_s():
    """No boundary reflects more of p than of s."""
    each = {"R_s": np.array([0.15]), "R_p": np.array([0.18])}
    return Measurement.from_columns(60.0, 0.6, sigma=1e-3, **each)


def along_the_normal():
    wave = np.linspace(0.4, 0.8, 15)
    return Measurement.from_columns(0.0, wave, R=0.04 + 0.02 * wave, sigma=1e-3)


def two_angles():
    angle, wave = (a.ravel() for a in np.meshgrid([60.0, 70.0], np.linspace(0.5, 0.7, 5)))
    return Measurement.from_columns(angle, wave, psi=30.0 - 5.0 * wave, delta=120.0 + 40.0 * wave)


AT_600_NM = over_angle(ANGLES, ("R_s", "R_p"))
ONE, SEVERAL = {"sample": "constant"}, {"own": (), "spectrum": True}
HELD = {"hold": ("eta", 1.5)}
# What is fitted, and how; and where no small fit has the warning, what stands in its advice.
CASES = [
    ("not_converged", GLASS, ONE, {"more": 8}),
    ("few_starts_agree", GLASS, ONE, {"more": 8}),
    ("better_minimum_met", GLASS, ONE, {"more": 8}),
    ("gain_instead", GLASS, {}, {"sample": "constant"}),
    ("circle", over_angle([0.0]), {}, None),
    ("same_at_45_degrees", over_angle([45.0], ("R_s", "R_p")), {}, None),
    ("combination", GLASS, {}, {"eta": 1.5, "k": 0.0}),
    ("one_value", GLASS, {}, {}),
    ("not_seen", GLASS, ONE, {"hold": ("eta", 1.5)}),
    ("thin_film", AT_600_NM, {"sample": FILM}, {"thickness": "thickness_nm", "value": 90.0}),
    (
        "fringes_in_noise",
        AT_600_NM,
        {"sample": FILM},
        {"parameter": "thickness_nm", "without": 90.0},
    ),
    (
        "range_left",
        spectrum(),
        {"sample": "cauchy:2"},
        {"parameters": ("A", "B"), "values": (7.0, -0.1), "ends": (6.0, 0.0), "gain": 9.0},
    ),
    ("rising_index", spectrum(), {"sample": "cauchy:2"}, {"indices": ("eta",)}),
    ("low_index", GLASS, ONE, {"first": ("eta",)}),
    ("other_minima", p_at_two_angles(), {}, None),
    ("other_minima", ellipses(), {}, SEVERAL),
    ("does_not_describe", rising("R_s"), {}, None),
    ("does_not_describe", rising("R"), {}, None),
    ("does_not_describe", ellipses(), ONE, {"measured": ("NCS",)}),
    ("residuals_in_order", rising("R_s"), {}, None),
    (
        "residuals_in_order",
        spectrum(),
        ONE,
        {"along": "wavelength", "powers": True, "as_it_is": True},
    ),
    ("chi2_large", METAL, {}, {"no_sample": False, "measured": ()}),
    ("alike", METAL, {}, {"rise": 3.0, "measured": ("R",)}),
    ("compatible_with_zero", GLASS, {}, None),
    ("quadratic_misleads", GLASS, {}, {}),
    ("prior_contradicted", GLASS, {**ONE, "priors": {"eta": (1.6, 1e-2)}}, None),
    ("chi2_small", too_good(), {"errors": "stated"}, None),
    ("implausible_offset", off_by_five_degrees(), {"free": "angle_offset"}, None),
    ("pseudo_index", ellipses(), {}, None),
    ("choice_within_errors", GLASS, ONE, {}),
    ("candidates_do_not_describe", GLASS, ONE, {"factor": 3.0}),
    ("explained_by", GLASS, ONE, {"explanations": [("leak",)]}),
    (
        "explained_by",
        AT_600_NM,
        ONE,
        {"explanations": [("a layer, in the sample 'air | 1.46 1..30 nm | constant'",)]},
    ),
    ("errors_differ", GLASS, ONE, {}),
    ("errors_of_each", GLASS, ONE, {}),
    ("misses_without_freedom", p_above_s(), {}, None),
    ("shared_not_seen", two_angles(), {"sample": FREE_FILM}, {
        "parameter": "thickness_nm", "held": "air | free 90 nm held | 3.9",
        "formula": "air | cauchy-urbach:2 50..150 nm | 3.9",
    }),
    ("other_thickness", two_angles(), {"sample": FREE_FILM}, {
        "other": "air | free 80..100 nm | 3.9",
    }),
    ("by_the_model_alone", along_the_normal(), {"sample": "cauchy-urbach:2"}, None),
    ("does_not_describe", spectrum(), {"sample": "cauchy:2"}, {"absorbing": "cauchy-urbach:2"}),
    ("chi2_doubtful", METAL, {}, {}),
    ("at_bound", GLASS, {**ONE, "bounds": {"eta": (1.4, 1.499)}}, None),
    ("at_bound", GLASS, {**ONE, "bounds": {"eta": (1.501, 2.0)}}, None),
    ("open_interval", GLASS, ONE, HELD),
    ("poorly_determined", GLASS, ONE, HELD),
    ("correlated", GLASS, ONE, HELD),
    ("errors_floor", GLASS, ONE, {}),
    ("errors_relative", GLASS, ONE, {}),
    ("errors_cover", GLASS, ONE, {}),
    ("flat_curve", over_angle(np.linspace(5.0, 25.0, 20), sigma=1e-5), {}, None),
    ("pseudo_index_misfit", ellipses(), {}, {"delta": False}),
    ("choice_alike", spectrum(), {}, {"other": "constant"}),
]  # fmt: skip


# What says how a result is to be read, and why no option follows from it.
WITHOUT_ADVICE = {
    "refused": "the reason in it says which values of the file are none",
    "perfect_mirror": "no option brings what the data do not have",
    "no_reflection": "the index is that of the medium outside, as shown",
    "no_slope": "the intervals hold, as shown",
    "not_quadratic": "the intervals hold, as shown",
    "choice_undetermined": "the warnings of the fit that is shown say what to fix",
}
# These share the programs of two samples of glass; the others are compiled by the study.
SHARED = ("not_converged", "few_starts_agree", "better_minimum_met", "one_value", "low_index",
          "chi2_large", "compatible_with_zero", "quadratic_misleads", "chi2_small",
          "choice_within_errors", "other_minima", "errors_differ",
          "errors_of_each", "candidates_do_not_describe", "chi2_doubtful", "at_bound",
          "open_interval", "poorly_determined", "correlated", "errors_floor", "errors_relative",
          "errors_cover")  # fmt: skip


@pytest.mark.parametrize(
    ("code", "m", "how", "values"),
    [
        pytest.param(
            *case, marks=[pytest.mark.study] * (case[0] not in SHARED or case[3] is SEVERAL)
        )
        for case in CASES
    ],
)
def test_what_a_warning_says_to_try_can_be_run(code, m, how, values):
    if values is None:
        found = fit(m, **how)
        told = [*found.warnings, *found.notes] if not found.shape else found.notes
        warning = next(w for w in told if w.code == code)
    else:
        warning = Warning(code, {}, values)
    for why, option in warning.tries:
        assert f"ry {option} (in Python: {keywords(option)})." in warning.advice
        assert why in warning.advice
        asked = eval(f"dict({keywords(option)})")  # as it is copied into fit(...)
        arguments = cli.parser().parse_args(["file.csv", *shlex.split(option)])
        given = cli._fit_options(arguments) | {"sample": arguments.sample}
        assert {n: v for n, v in given.items() if n in asked} == {
            n: [v] if n == "free" else v for n, v in asked.items()
        }
        again = fit(m, **{k: v for k, v in how.items() if k not in asked and k != "free"}, **asked)
        assert np.all(again.status != "refused")


def test_every_advice_is_tested():
    advised = {code for code, (_, tries) in SENTENCES.items() if tries}
    of_files = {"sigma_missing", "no_degrees_of_freedom", "residuals_of_files"}
    assert {code for code, *_ in CASES} | of_files == advised
    assert SENTENCES.keys() - advised == WITHOUT_ADVICE.keys()


def test_missing_errors_can_be_given_as_the_warning_says(tmp_path):
    files = [tmp_path / "s.csv", tmp_path / "p.csv"]
    files[0].write_text(
        "angle_deg,R_s,sigma_R_s\n30,0.0577,0.001\n50,0.112,0.001\n60,0.1766,0.001\n"
    )
    files[1].write_text("angle_deg,R_p\n30,0.0252\n50,0.0033\n60,0.0017\n")
    (note,) = (n for n in fit([*map(read_csv, files)]).notes if n.code == "sigma_missing")
    assert "--sigma 0.002 (in Python: sigma=0.002)" in note.text
    given = fit([read_csv(file, sigma=0.002) for file in files])
    assert "sigma_missing" not in [n.code for n in given.notes]
    assert cli.main([*map(str, files), "--sigma", "0.002", "--quiet"]) in (0, 1)


def test_each_of_several_files_can_be_fitted_as_the_note_says(tmp_path):
    files = [tmp_path / "s.csv", tmp_path / "p.csv"]
    files[0].write_text("angle_deg,R_s,R_p\n30,0.0577,0.0252\n50,0.112,0.0033\n60,0.1766,0.0017\n")
    files[1].write_text("angle_deg,R_s,R_p\n30,0.0677,0.0352\n50,0.122,0.0133\n60,0.1866,0.0117\n")
    measurements = [*map(read_csv, files)]
    (note,) = (n for n in fit(measurements).notes if n.code == "residuals_of_files")
    ((_, option),) = note.tries
    assert len(eval(keywords(option))) == 2  # as it is copied
    assert cli.main([*map(str, files), option, "--quiet"]) in (0, 1)


@pytest.mark.parametrize(
    ("quantities", "sigma", "tries"),
    [
        (("R_s", "R_p"), None, "--sigma 0.002"),
        (("R_s", "R_p"), 1e-3, ""),
        pytest.param(None, None, "--sigma 0.05", marks=pytest.mark.study),
    ],
)
def test_errors_of_data_without_freedom_are_asked_for_in_their_unit(quantities, sigma, tries):
    if quantities is None:
        m = Measurement.from_columns(70.0, 0.6, psi=30.0, delta=140.0)
    else:
        m = over_angle([60.0], quantities, sigma=sigma)
    (told,) = (w for w in fit(m).warnings if w.code == "no_degrees_of_freedom")
    assert [option for _, option in told.tries] == [tries] * bool(tries)


@pytest.mark.parametrize(
    ("sample", "absorbs", "other"),
    [
        ("cauchy:2", True, "cauchy-urbach:3"),
        ("air | sellmeier 50..300 nm | Si", True, "air | cauchy-urbach:3 50..300 nm | Si"),
        ("air | lorentz 50..300 nm | BK7", False, "air | cauchy:3 50..300 nm | BK7"),
        ("air | lorentz 50..300 nm | BK7", True, ""),
        ("1.5 | cauchy", False, ""),
    ],
)
def test_another_formula_is_advised_in_the_same_sample(sample, absorbs, other):
    assert with_formula(Sample.parse(sample), absorbs) == other


@pytest.mark.study
def test_a_clear_formula_that_misses_absorbing_data_hears_of_an_absorbing_one():
    waves, angle = np.tile(np.linspace(0.4, 0.8, 21), 2), np.repeat([0.0, 60.0], 21)
    truth = {"A": 1.5, "B": 0.01, "C": 0.0, "k_edge": 0.6, "urbach_ev": 0.8, "edge_ev": 3.1}
    R = simulate("cauchy-urbach", truth, angle, waves, "R_s")
    m = Measurement.from_columns(angle, waves, R_s=R, sigma=1e-3)
    found = fit(m, "cauchy:2")
    told = {w.code: w.tries[-1][1] for w in found.warnings if w.tries}
    assert found.status == "misfit"
    assert told["does_not_describe"] == "--sample 'cauchy-urbach:3'"
    described = fit(m, **eval(f"dict({keywords(told['does_not_describe'])})"))
    assert described.status == "converged" and described.rms < 1e-2 * found.rms


def test_a_misfit_of_delta_says_how_to_read_it_folded(tmp_path):
    """Of fewer than 20 wavelengths the reader does not see whether Delta is folded."""
    told = Warning("does_not_describe", {}, {"measured": ("NCS", "delta", "psi")}).advice
    assert '--delta-range 180 (in Python: delta_range="180")' in told
    folded = Warning("does_not_describe", {}, {"measured": ("NCS", "delta_folded")}).advice
    assert "delta" not in folded
    told = Warning("pseudo_index_misfit", {}, {"delta": True}).advice
    assert '--delta-range 180 (in Python: delta_range="180")' in told
    file = tmp_path / "scan.csv"
    file.write_text("wavelength_nm,psi,delta\n400,30,170\n500,25,179\n600,20,165\n")
    assert {*read_csv(file, angle_deg=70, delta_range="180").quantity} == {"psi", "delta_folded"}


@pytest.mark.parametrize("dof", [1, 2, 5, 20])
def test_few_right_fits_hear_that_their_errors_look_too_large(dof):
    chi2 = np.random.default_rng(1).chisquare(dof, 100_000)
    share = beyond_chance(chi2 / dof, dof)[1].mean()
    assert share == pytest.approx(UNLIKELY, abs=4.0 * np.sqrt(UNLIKELY / 1e5))


def test_an_index_that_no_solid_has_is_marked():
    values = {"count": 1, "parameters": ("eta", "k"), "values": (0.64, 0.1), "delta_chi2": 0.1,
              "thicknesses": (), "ranges": (), **SEVERAL}  # fmt: skip
    assert "no candidate in the visible" in Warning("other_minima", {}, values).text
    for eta, k in ((1.5, 0.0), (0.2, 3.1), (1.3, 0.01)):
        assert (
            "no candidate" not in Warning("other_minima", {}, {**values, "values": (eta, k)}).text
        )


def test_numbers_in_warnings_have_the_digits_of_their_intervals():
    rows = {"parameters": ["d", "A"], "intervals": [[193.988, 194.141], [1.0, np.inf]],
            "by_sigma": [[193.94, 194.22], [np.nan, np.nan]]}  # fmt: skip
    told = Warning("not_quadratic", {}, rows).sentence
    assert "d: 193.99 to 194.14 (by its standard error 193.94 to 194.22)" in told
    offset = {"wavelength_offset": (-50.0, np.nan, np.nan, np.nan)}
    explanations = [("wavelength_offset", 0.07, False, offset, {})]
    told = Warning("explained_by", {}, {"explanations": explanations}).sentence
    assert "wavelength_offset -50, rms 0.07, still no noise" in told and "nan" not in told


def test_parameters_of_the_callers_own_may_have_any_name():
    told = Warning("prior_contradicted", {}, {"priors": {"\u03c4 of fall": (1.0, 0.1, 2.0, 10.0)}})
    assert 'priors={"\u03c4 of fall": (1, 2)}' in told.advice


def test_what_is_fitted_already_is_not_advised():
    angle = np.array(ANGLES)
    R = textbook(angle, np.full(20, "R_s"), 1.5, 0.0) + 0.01 * np.sin(angle / 8.0)
    m = over_angle(ANGLES, "R_s", R, sigma=None)
    for free, tries in ((), "--free angle_offset"), ("scale", ""):
        found = fit(m, "constant", fixed={"k": 0.0}, free=free, intervals="quadratic")
        (told,) = (w for w in found.warnings if w.code == "residuals_in_order")
        assert " ".join(option for _, option in told.tries) == tries
    # no scale changes psi and Delta
    of_ellipses = {"along": "wavelength", "powers": False, "as_it_is": True}
    tries = Warning("residuals_in_order", {}, of_ellipses).tries
    assert [option for _, option in tries] == ["--free angle_offset"]
