"""Fits whose sample or instrument does not describe the data: their status, and what would."""

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.studies import misfit_study
from benchmarks.studies.misfit_study import CASES, measured, table, verdict
from fitting import Measurement, choose, fit, fit_many, read_csv, simulate
from fitting.outcomes.findings import MISFITS

pytestmark = pytest.mark.slow

# All are padded to 32, as the gold scan is.
ANGLES, GRAZING = np.linspace(20.0, 84.0, 32), np.linspace(30.0, 87.0, 24)


def silicon(leak, seed=0, stated=True):
    """R_s and R_p of silicon at 532 nm behind a polarizer that leaks; stated errors too small."""
    rng, data = np.random.default_rng(seed), {}
    s, p = (simulate("free", {"eta": 4.16, "k": 0.04}, GRAZING, 0.532, q) for q in ("R_s", "R_p"))
    for name, own, other in (("R_s", s, p), ("R_p", p, s)):
        data[name] = own + leak * (other - own) + 0.003 * rng.standard_normal(24)
    return data, {"R_s": 0.017, "R_p": 3e-4} if stated else None


def codes(found):
    return [w.code for w in found.warnings]


@pytest.fixture(scope="module")
def leaking():
    data, sigma = silicon(0.05)
    return fit(Measurement.from_columns(GRAZING, 0.532, sigma=sigma, **data), "free")


def test_a_leak_is_a_misfit_and_is_named_with_the_index_that_it_leaves(leaking):
    assert leaking.status == "misfit"
    assert codes(leaking)[:2] == ["does_not_describe", "explained_by"]
    (leak,) = leaking.warnings[1].values["explanations"]
    what, rms, describes, new, after = leak
    assert (what, describes) == ("leak", True)
    assert rms == pytest.approx(0.003, rel=0.4)  # the noise, of 48 data
    assert abs(new["leak"][0] - 0.05) < 3.0 * new["leak"][1]
    for name, truth in (("eta", 4.16), ("k", 0.04)):
        *_, low, high = after[name]
        assert low <= truth <= high
    assert "better by leak: leak 0.05" in leaking.warnings[1].text
    assert json.dumps(leaking.to_dict())


def test_intervals_of_a_misfit_cover_those_of_all_error_models(leaking):
    data, sigma = silicon(0.05)
    m = Measurement.from_columns(GRAZING, 0.532, sigma=sigma, **data)
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
    many = fit_many(GRAZING, 0.532, **both)
    assert many.status.tolist() == ["converged", "misfit"]
    assert many[1].status == "misfit"
    assert "does_not_describe" in codes(many[1])
    alone = Measurement.from_columns(GRAZING, 0.532, **good)
    assert fit(alone, "free").status == "converged"


def test_residuals_in_order_within_the_stated_errors_are_no_misfit():
    wave = np.linspace(0.4, 0.8, 32)
    value = simulate("cauchy:2", {"A": 1.5, "B": 0.01}, 0.0, wave, "R") + 2e-4 * np.cos(12.0 * wave)
    # With a fixed parameter no causes in the sample are looked for: programs of their own.
    found = [
        fit(Measurement.from_columns(0.0, wave, R=value, sigma=s), "cauchy:2", fixed={"B": 0.01})
        for s in (1e-3, 2e-5, None)
    ]
    assert all("residuals_in_order" in codes(f) for f in found)
    assert [f.status for f in found] == ["converged", "misfit", "misfit"]


SHIPPED = sorted((Path(__file__).resolve().parents[2] / "examples" / "data").glob("*.csv"))
FILM = "air | cauchy:2 20..500 nm | {}"
# Of the measured files those that one of these samples is of, whether it describes them or not.
SHARED = {
    "au_532nm_sp/au_532nm_sp_wide.csv": ("free", {}),
    "lsat_psi_delta_658nm/LSAT_test_data.txt": ("free", {"psi_unit": "deg"}),
    "glass_slab_RT/clear_glass_3mm_RT.csv": ("air | free 3 mm thick | air", {}),
    "diamond_film_on_glass/diamond_286nm_on_glass_R.csv": (FILM.format(1.53), {}),
    "metal_mirror/reflection_EKSMA_Al.csv": ("drude", {}),
    "ep4_polymer_psi_delta/corefine_polyBrush_ellipsometry.dat": (
        "air | 1.5 1..100 nm | 3.8397+0.0167i", {},
    ),
}  # fmt: skip


def check_agreement(found):
    """No fit converged of which a warning says that the sample does not describe the data."""
    misfit = np.zeros(np.shape(found.status), bool)
    for f in found.findings:
        if f.code in MISFITS:
            misfit |= f.at
    status = np.asarray(found.status)
    assert not (misfit & (status == "converged")).any()
    assert (misfit | (status != "misfit")).all()
    if any(n.code == "pseudo_index_misfit" for n in found.notes):
        assert (status == "misfit").any()
    for index in np.ndindex(status.shape):
        one = found[index] if status.shape else found
        said = "does not describe" in " ".join(w.text for w in one.warnings)
        assert said <= (one.status in ("misfit", "undetermined"))


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
@pytest.mark.parametrize("errors", ["auto", "equal"])
def test_status_and_warnings_of_every_shipped_file_agree(path, errors):
    check_agreement(fit(read_csv(path), "free", errors=errors))


@pytest.mark.study
@pytest.mark.parametrize("name", [*SHARED])
def test_status_and_warnings_of_measured_files_agree(measured_files, name):
    sample, how = SHARED[name]
    m = read_csv(measured_files / name, **how)
    # The headline alone is looked at: a few starts find it.
    check_agreement(fit(m, sample, intervals="quadratic", starts=8))


def test_status_and_warnings_of_simulated_fits_agree(leaking):
    check_agreement(leaking)
    rng, wave = np.random.default_rng(1), np.linspace(0.4, 0.8, 5)
    angles = np.array([55.0, 65.0, 75.0])
    angle, each = (a.ravel() for a in np.meshgrid(angles, wave))
    truth = {"A": 1.5, "B": 0.01, "thickness_nm": 40.0}
    values = {
        q: simulate("air | cauchy:2 10..90 nm | Si", truth, angle, each, q)
        + 0.02 * rng.standard_normal(15)
        for q in ("psi", "delta")
    }
    # psi and Delta of a film, as those of a bare boundary at every wavelength.
    m = Measurement.from_columns(angle, each, sigma=0.02, **values)
    found = fit(m, "free", intervals="quadratic", starts=8)
    assert (np.asarray(found.status) == "misfit").any()
    check_agreement(found)


def test_a_choice_that_does_not_describe_the_data_is_a_misfit():
    wave, rng = np.linspace(0.45, 0.8, 24), np.random.default_rng(2)
    shown = simulate("air | cauchy:2 300 nm held | Si", {"A": 2.0, "B": 0.01}, 0.0, wave, "R")
    m = Measurement.from_columns(0.0, wave, R=shown + 1e-3 * rng.standard_normal(24), sigma=1e-3)
    taken = choose(m, ["Si", "1.52"])
    assert not taken.describes
    assert taken.fit.status == taken.taken.fit.status == "misfit"
    check_agreement(taken.fit)


@pytest.mark.study
def test_an_oxide_is_named_with_its_thickness_and_the_index_below_it():
    rng, angle = np.random.default_rng(0), np.linspace(20.0, 84.0, 30)
    values = {
        q: simulate("air | SiO2 12 nm held | 3.9+0.03i", {}, angle, 0.6, q)
        + 1e-3 * rng.standard_normal(30)
        for q in ("R_s", "R_p")
    }
    # A start of this sample's names is none of the sample with the layer.
    m = Measurement.from_columns(angle, 0.6, sigma=1e-3, **values)
    found = fit(m, "free", start={"eta": 3.5, "k": 0.1})
    assert found.status == "misfit"
    (told,) = (w for w in found.warnings if w.code == "explained_by")
    ((what, _, describes, new, after),) = told.values["explanations"]
    assert what.startswith("a layer of index 1.46") and describes
    # Of the layer the optical thickness is known, and silica has 1.458.
    assert new["thickness_nm"][0] == pytest.approx(12.0, abs=0.7)
    assert after["eta"][0] == pytest.approx(3.9, abs=0.01)


def test_a_cause_at_the_end_of_its_range_that_still_misses_is_not_named():
    """Angles 25 degrees off, of which a fit allows 20."""
    angle = np.linspace(5.0, 45.0, 41)
    R_s = simulate("1.5", {}, angle + 25.0, 0.6, "R_s")
    R_s = R_s + 1e-4 * np.random.default_rng(0).standard_normal(41)
    m = Measurement.from_columns(angle, 0.6, R_s=R_s, sigma=1e-4)
    others = {"k": 0.0, "scale": 1.0, "background": 0.0, "leak": 0.0}
    found = fit(m, "constant", fixed=others, intervals="quadratic")
    assert found.status == "misfit"
    assert "explained_by" not in codes(found)


# What is named of misfits that R_s and R_p of a bare surface show, and of films.
NAMED = {
    "scale 2 %, bare s p": "scale", "angle .3, bare s p": "angle_offset",
    "leak 3 %, bare s p": "leak", "roughness, bare s p": "a layer of index 1.46 on top",
    "back face, R T": "a back face", "gradient, R": "a gradient of the index",
    "oxide, psi Delta": "a layer of index 1.46 on the substrate",
    "angle .3, psi Delta": "angle_offset",
}  # fmt: skip


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[pytest.mark.study] * ("bare" not in n)) for n in NAMED],
)
def test_a_random_misfit_is_told_and_its_cause_named(name, monkeypatch):
    """Of a film each cause compiles its own program."""
    monkeypatch.setattr(misfit_study, "ANGLES", ANGLES)  # whose programs are compiled
    case = CASES[name]
    m, truth = measured(case, np.random.default_rng([4, list(CASES).index(name)]))
    found = fit(m, case.fitted)
    assert found.status == "misfit"
    (told,) = (w for w in found.warnings if w.code == "explained_by")
    each = {what.partition(",")[0]: after for what, *_, after in told.values["explanations"]}
    assert NAMED[name] in each
    for parameter, (_, _, low, high) in each[NAMED[name]].items():
        # Twice the 95 % interval. That roughness has index 1.8, and the layer that is named 1.46.
        half = 0.5 * (high - low) * (6.0 if "roughness" in name else 1.0)
        assert low - half <= truth[parameter] <= high + half
    check_agreement(found)


@pytest.mark.study
def test_a_slit_is_tried_where_nothing_else_describes_the_data():
    case = CASES["slit 12 nm, R"]
    found = fit(measured(case, np.random.default_rng([4, 99, 0]))[0], case.fitted)
    (told,) = (w for w in found.warnings if w.code == "explained_by")
    assert [(what, fits) for what, _, fits, *_ in told.values["explanations"]] == [
        ("bandwidth", True)
    ]


def test_the_study_counts_a_misfit_that_is_told(leaking):
    case, truth = CASES["leak 3 %, bare s p"], {"eta": 4.16, "k": 0.04}
    v = verdict(leaking, case, truth)
    assert (v.right, v.told, v.shows, v.covered) == (False, "told", True, True)
    assert verdict(leaking, case, {"eta": 3.7, "k": 1.5}).right
    *rows, _, silent, held = table([("leak", v)])
    assert rows[-1].startswith("| all | 0 | 1 | 0 | 0 |")
    assert "0 (aim 0)" in silent and "100 %" in held


def test_a_chi2_that_few_right_fits_have_is_told_without_a_cause():
    rng = np.random.default_rng(5)
    data = {
        q: simulate("free", {"eta": 2.1, "k": 0.9}, ANGLES, 0.532, q) + 2e-3 * rng.normal(size=32)
        for q in ("R_s", "R_p")
    }
    alone = fit(Measurement.from_columns(ANGLES, 0.532, sigma=2e-3, **data))
    for reduced, told in ((1.2, False), (1.4, True)):
        sigma = 2e-3 * float(np.sqrt(alone.chi2_reduced / reduced))  # for exactly this chi2/dof
        found = fit(Measurement.from_columns(ANGLES, 0.532, sigma=sigma, **data))
        assert (found.status, "chi2_doubtful" in codes(found)) == ("converged", told)
    (doubt,) = (w for w in found.warnings if w.code == "chi2_doubtful")
    assert doubt.text.startswith("reduced chi2 is 1.4, which one right fit in 49 has by chance")
