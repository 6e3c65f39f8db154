"""What a fit leaves: noise is not called a pattern, a misfit is; what is said of either."""

from dataclasses import replace

import numpy as np
import pytest

from fitting import Measurement, choose, fit, read_csv
from fitting.residuals.pattern import pattern
from fitting.residuals.residuals import residuals, weighted_residuals
from fitting.samples.sample import Sample
from tests.truth.simulated import GOLD, simulated, textbook

pytestmark = pytest.mark.slow

LARGE = "3 angles, 40 wavelengths"
LAYOUTS = {
    "12 angles": (np.linspace(20.0, 80.0, 12), np.full(12, np.nan)),
    "14 wavelengths": (np.zeros(14), np.linspace(0.4, 1.0, 14)),
    "3 angles, 40 wavelengths": (
        np.repeat([55.0, 65, 75], 40),
        np.tile(np.linspace(0.4, 1, 40), 3),
    ),
}


def flat(layout):
    """R_s and R_p of .5 and numbers of their curves."""
    angle, wavelength = LAYOUTS[layout]
    half = np.full(len(angle), 0.5)
    wave = wavelength if np.isfinite(wavelength).all() else None
    m = Measurement.from_columns(angle, wave, R_s=half, R_p=half)
    return m, np.repeat([0, 1], len(angle))


@pytest.mark.study
@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("law", ["normal", "t", "unlike"])
def test_noise_is_called_a_pattern_in_less_than_one_fit_of_a_hundred(layout, law):
    m, curve = flat(layout)
    rng = np.random.default_rng(5)
    n = len(m)
    size = {"normal": np.ones(n), "t": np.ones(n), "unlike": np.geomspace(0.05, 1.0, n)}[law]
    # as a fit of a level and a slope would leave it
    X = np.stack([np.ones(n), m.angle_deg + np.nan_to_num(m.wavelength_um)], axis=1)
    Q = np.linalg.qr(X + 1e-9 * rng.standard_normal(X.shape))[0]
    found = 0
    for _ in range(500):
        noise = 1e-3 * size * (rng.standard_t(3, n) if law == "t" else rng.standard_normal(n))
        left = noise - Q @ (Q.T @ noise)
        found += pattern(replace(m, value=0.5 + left), np.full(n, 0.5), curve) is not None
    # .5 % are due; with 1 % more than 10 of 500 would come in one study of seventy
    assert found <= 10


@pytest.mark.parametrize(("layout", "outliers"), [*((x, 0.0) for x in LAYOUTS), (LARGE, 0.1)])
def test_a_misfit_as_large_as_the_noise_is_seen(layout, outliers):
    m, curve = flat(layout)
    rng = np.random.default_rng(5)
    along = m.angle_deg / 60.0 if layout == "12 angles" else m.wavelength_um / 0.6
    left = 1e-3 * np.sin(2.0 * np.pi * along) + 2e-4 * rng.standard_normal(len(m))
    left = left + 0.1 * (rng.random(len(m)) < outliers)
    found = pattern(replace(m, value=0.5 + left), np.full(len(m), 0.5), curve)
    assert found is not None
    assert found.along == ("angle" if layout == "12 angles" else "wavelength")
    assert found.correlation > found.chance > 0.0


def test_rounding_is_no_misfit():
    """A smooth curve printed with four digits leaves the same rounding for many neighbours."""
    wave = np.linspace(0.4, 1.0, 200)
    true = 0.04 + 5e-4 / wave**2
    printed = Measurement.from_columns(np.zeros(200), wave, R=np.round(true, 4))
    curve = np.zeros(200, int)
    assert pattern(printed, true, curve) is None
    assert pattern(replace(printed, value=true + 1e-5 * np.sin(20.0 * wave)), true, curve)
    assert pattern(replace(printed, value=true + 1e-9 * np.sin(20.0 * wave)), true, curve) is None


def test_delta_goes_round_and_angles_have_a_common_unit():
    angle = np.array([60.0, 70.0])
    m = Measurement.from_columns(angle, 0.5, psi=[30.0, 15.0], delta=[359.0, 1.0])
    fitted = np.where(m.quantity == "psi", m.value - 0.5, [1.0, 359.0, 1.0, 359.0])
    wanted = np.select([m.quantity == "psi", m.angle_deg == 60.0], [0.5, -2.0], 2.0)
    np.testing.assert_allclose(residuals(m, fitted), wanted)
    psi = np.where(m.angle_deg == 60.0, 29.5, 14.5)
    arcs = np.where(m.quantity == "psi", 2.0 * 0.5, np.sin(np.radians(2.0 * psi)) * wanted)
    np.testing.assert_allclose(weighted_residuals(m, fitted), np.radians(arcs), rtol=1e-12)
    known = replace(m, sigma=np.full(4, 0.25))
    np.testing.assert_allclose(weighted_residuals(known, fitted), wanted / 0.25)
    np.testing.assert_allclose(weighted_residuals(known, fitted, False), np.radians(arcs))


def said(fit):
    return [w for w in fit.warnings if w.code == "residuals_in_order"]


@pytest.fixture(scope="module")
def stepped():
    """Glass whose index has a line that no constant has; without errors."""
    wave = np.tile(np.linspace(0.4, 1.0, 20), 3)
    angle = np.repeat([50.0, 65.0, 75.0], 20)
    eta = 1.6 + 0.02 * np.sin(12.0 * wave)
    rng = np.random.default_rng(3)
    R = {
        q: textbook(angle, np.full(60, q), eta, 0.0) + 2e-4 * rng.standard_normal(60)
        for q in ("R_s", "R_p")
    }
    return Measurement.from_columns(angle, wave, **R)


def test_a_fit_says_that_its_model_does_not_describe_the_data(stepped):
    wrong = fit(stepped, "constant", fixed={"k": 0.0})
    assert wrong.status == "misfit" and wrong.rms < 0.01
    assert len(said(wrong)) == 1 and "along the wavelength" in said(wrong)[0].text
    # Errors that are stated too large hide it in chi2, but not in the order.
    coarse = replace(stepped, sigma=np.full(len(stepped), 0.05))
    assert said(fit(coarse, "constant", fixed={"k": 0.0}))
    noise = 1e-3 * np.random.default_rng(1).standard_normal(len(stepped))
    R = textbook(stepped.angle_deg, stepped.quantity, 1.6, 0.3) + noise
    assert not said(fit(replace(stepped, value=R), "constant"))


def test_the_gold_scan_drifts_off_its_best_index():
    """Its residuals go to -.1 at grazing incidence, with an rms of .03 and no word else."""
    model = fit(read_csv(GOLD), "constant", errors="equal")
    one = fit(read_csv(GOLD), errors="equal")
    for found in (model, one):
        assert found.rms < 0.05
        assert "along the angle" in said(found)[0].text
    correlation = said(one)[0].values["correlation"]
    assert f"(lag-1 correlation {correlation:.2f};" in said(one)[0].text
    assert 0.2 < correlation < 0.9


def test_one_index_of_noise_has_no_such_warning():
    angles = tuple(np.linspace(10.0, 85.0, 40))
    each = [simulated(0.6, 3.0, 1e-3, angles=angles, seed=seed) for seed in range(100)]
    R = {q: np.concatenate([m.value[m.quantity == q] for m in each]) for q in ("R_s", "R_p")}
    # Each repeat is a wavelength: of curves of a batch the order is not looked at.
    wave = np.repeat(np.linspace(0.4, 0.8, 100), 40)
    found = fit(Measurement.from_columns(np.tile(angles, 100), wave, sigma=1e-3, **R))
    assert sum(len(said(one)) for one in found) <= 3  # .3 are due


def test_each_wavelength_is_looked_at_by_itself():
    angle = np.linspace(20.0, 80.0, 20)
    rng = np.random.default_rng(1)
    good = textbook(angle, np.full(20, "R_s"), 1.5, 0.4) + 1e-4 * rng.standard_normal(20)
    wrong = textbook(angle, np.full(20, "R_s"), 1.5, 0.4) + 1e-3 * np.sin(angle / 5.0)
    m = Measurement.from_columns(
        np.tile(angle, 2), np.repeat([0.5, 0.6], 20), R_s=np.concatenate([good, wrong])
    )
    few = m.where(np.arange(40) % 4 == 0)  # five of each: too few to say
    assert [bool(said(fit(m)[i])) for i in (0, 1)] == [False, True]
    assert not any(said(fit(few)[i]) for i in (0, 1))


@pytest.mark.study
def test_the_curves_of_a_few_solutions_stand_at_their_data():
    """Three wavelengths with angles, channels, gaps and repeats of their own, in no order."""
    random = np.random.default_rng(2)
    count = 120
    m = Measurement.from_columns(
        np.round(random.uniform(5.0, 85.0, count)), random.choice([0.4, 0.5, 0.6], count),
        R_s=np.full(count, 0.5), R_p=np.where(random.random(count) < 0.5, np.nan, 0.2),
    )  # fmt: skip
    of = {0.4: (1.5, 0.0), 0.5: (0.5, 2.2), 0.6: (3.0, 0.4)}
    for w, index in of.items():
        here = m.wavelength_um == w
        m = replace(m, value=np.where(here, textbook(m.angle_deg, m.quantity, *index), m.value))
    np.testing.assert_allclose(fit(m).fitted, m.value, atol=1e-13)


@pytest.mark.study
def test_auto_says_that_no_candidate_describes_the_data(stepped, monkeypatch):
    from fitting.choice import selection as select

    monkeypatch.setattr(select, "_first_stage", lambda wavelengths: ["constant"])
    monkeypatch.setattr(select, "MOST_TERMS", 0)
    monkeypatch.setattr(select, "_absorbs", lambda candidate: False)
    kept = select.fit_checked
    monkeypatch.setattr(
        select, "fit_checked",
        lambda m, sample, *rest: kept(m, Sample.parse("constant"), *rest),
    )  # fmt: skip
    choice = choose(stepped, instrument=False)
    assert not choice.describes
    assert choice.fit.warnings[0].text.startswith("no candidate describes these data")
    assert choice.taken.fit is choice.fit and not choice.to_dict()["describes_data"]
    stated = choose(replace(stepped, sigma=np.full(len(stepped), 1e-4)), instrument=False)
    assert not stated.describes
    size = np.sqrt(stated.fit.chi2_reduced)
    assert f"its residuals are {size:.2g} times these" in stated.fit.warnings[0].text
    glass = simulated(1.7, 0.8, 1e-3, angles=tuple(np.linspace(20.0, 80.0, 20)), seed=3)
    glass = replace(glass, sigma=np.full(len(glass), np.nan))
    good = choose(glass, instrument=False)
    assert good.describes and not any("describe" in w.code for w in good.fit.warnings)
