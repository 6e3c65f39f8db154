"""The choice of a model: what BIC says, and what is preferred between equals."""

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from fitting import simulate
from fitting.choice import candidates
from fitting.choice import selection as select
from fitting.choice.candidates import MARGIN, Candidate, Key, simplest
from fitting.data.measurement import Measurement
from fitting.results.diagnostics import Finding
from fitting.results.result_parts import Prediction
from tests.estimates import outcome
from tests.truth.simulated import simulated, textbook

WAVES = np.linspace(0.4, 1.0, 40)


def candidate(model, size, bic, status="converged"):
    return Candidate(Key(model), outcome(size, bic, status))


def test_a_parameter_needs_strong_evidence():
    small, large = candidate("small", 1, 0.0), candidate("large", 2, -MARGIN + 0.01)
    assert simplest([small, large]) is small
    assert simplest([small, candidate("large", 2, -MARGIN - 0.01)]).label == "large"


def test_between_equals_the_lower_bic_decides():
    first, second = candidate("cauchy:2", 2, 1.0), candidate("sellmeier:1", 2, 0.5)
    assert simplest([first, second]) is second


@pytest.mark.parametrize("status", ["undetermined", "not converged"])
def test_what_the_data_do_not_see_is_never_taken(status):
    unseen, seen = candidate("unseen", 1, -100.0, status), candidate("seen", 3, 0.0)
    assert simplest([unseen, seen]) is seen
    assert simplest([unseen]) is unseen  # unless there is nothing else


def below_the_stated_errors(model, size, bic, errors="auto", codes=()):
    codes = codes or ("chi2_small", "residuals_in_order")
    told = tuple(Finding(code, np.True_, {}) for code in codes)
    return candidates.candidate(Key(model), replace(outcome(size, bic), findings=told), errors)


def test_deviations_below_the_stated_errors_earn_no_parameters():
    """Of models that leave no more than such deviations the smallest, whatever others gain."""
    rough = candidate("rough", 1, 900.0)
    enough = below_the_stated_errors("enough", 3, 500.0)
    more = below_the_stated_errors("more", 9, 0.0)
    choice = candidates.decide([rough, enough, more])
    assert choice.taken is enough
    assert [r.code for r in choice.reasons] == ["choice_within_errors"]
    assert "smaller than the stated errors" in choice.reasons[0].text
    # Where the best one leaves nothing but noise, or stated errors are not believed, BIC decides.
    noise = below_the_stated_errors("noise", 9, 0.0, codes=("chi2_small",))
    assert simplest([enough, noise]) is noise
    assert simplest([
        below_the_stated_errors(c.label, c.size, c.fit.bic, "scaled") for c in (enough, more)
    ]).label == "more"  # fmt: skip


@pytest.fixture
def spectrum():
    """40 wavelengths at three angles; what is in it does not matter where the fits are made up."""
    angles = np.repeat([55.0, 65.0, 75.0], len(WAVES))
    R = textbook(angles, np.full(len(angles), "R"), 1.5, 0.0)
    return Measurement.from_columns(angles, np.tile(WAVES, 3), R=R, sigma=1e-3)


def made_up(monkeypatch, spectrum, bics, errors=None, sizes=None):
    """Replace the fits: BIC by the label of the candidate, 1000 for all others."""
    calls = []

    def fit_checked(measurements, sample, settings, asked):
        instrument = tuple(n for n in settings.free if n in ("scale", "angle_offset"))
        label = Key(str(sample), instrument, settings.fixed.get("k") == 0.0).label
        assert settings.shared  # candidates of one family run in one program
        calls.append(label)
        size = (sizes or {}).get(label, 1 + len(label))
        error = (errors or {}).get(label, 1e-3)
        return outcome(min(size, 8), bics.get(label, 1000.0), error=error, data=spectrum)

    monkeypatch.setattr(select, "fit_checked", fit_checked)
    return calls


def test_oscillators_are_tried_only_where_light_is_absorbed_and_while_they_help(
    monkeypatch, spectrum
):
    calls = made_up(monkeypatch, spectrum, {"cauchy:2": 0.0})
    select.choose(spectrum)
    assert "lorentz:1" in calls
    assert "lorentz:2" not in calls
    assert "cauchy:2, scale" in calls
    assert "cauchy:2, angle_offset" in calls
    calls = made_up(monkeypatch, spectrum, {"lorentz:1": 500.0, "lorentz:2": 0.0, "lorentz:3": 9.0})
    choice = select.choose(spectrum)
    assert choice.taken.label == "lorentz:2"
    assert "lorentz:3" in calls
    assert "lorentz:4" not in calls


def test_more_oscillators_are_tried_where_nothing_so_far_describes_the_data(monkeypatch, spectrum):
    """A metal of many features, for which a polynomial is the best of the small models."""
    bics = {"cauchy:3": 500.0, "drude-lorentz:2": 0.0}
    calls = made_up(monkeypatch, spectrum, bics, {"cauchy:3": 0.05})
    assert select.choose(spectrum, instrument=False).taken.label == "drude-lorentz:2"
    assert "drude-lorentz:3" in calls


def test_an_urbach_tail_is_tried_with_the_third_term_of_cauchy(monkeypatch, spectrum):
    """As a photoresist has one; no other model but this one describes such data."""
    bics = {"cauchy-urbach:2": 500.0, "cauchy-urbach:3": 0.0}
    calls = made_up(monkeypatch, spectrum, bics, {"cauchy-urbach:2": 0.05})
    assert select.choose(spectrum, instrument=False).taken.label == "cauchy-urbach:3"
    calls = made_up(monkeypatch, spectrum, {"cauchy-urbach:2": 500.0})
    select.choose(spectrum, instrument=False)
    assert "cauchy-urbach:3" not in calls


@pytest.mark.parametrize(("wave", "wanted"), [(0.0, True), (2e-3, False)])
def test_without_errors_what_is_left_must_look_like_noise(spectrum, wave, wanted):
    rng = np.random.default_rng(0)
    left = 1e-3 * rng.standard_normal(len(spectrum)) + wave * np.sin(20.0 * spectrum.wavelength_um)
    unknown = outcome(2, 0.0, data=spectrum)
    found = replace(
        unknown, chi2_reduced=np.nan, curve=np.zeros(len(spectrum), int),
        evaluator=Level(spectrum.value - left),
    )  # fmt: skip
    assert select.explains(found) is wanted


class Level:
    """An evaluator that knows the fitted values."""

    def __init__(self, value):
        self.value = value

    def predict(self, measurement=None):
        return Prediction(self.value, 0.0 * self.value)


def test_a_nuisance_parameter_that_helps_is_kept_for_the_next(monkeypatch, spectrum):
    best = "cauchy:2, scale, angle_offset"
    calls = made_up(monkeypatch, spectrum, {"cauchy:2": 200.0, "cauchy:2, scale": 100.0, best: 0.0})
    assert select.choose(spectrum).taken.label == best
    assert select.choose(spectrum, instrument=False).taken.label == "cauchy:2"
    assert calls.count("cauchy:2, angle_offset") == 0


def test_what_is_said_of_models_that_fit_alike():
    one = Candidate(Key("cauchy:2", ("scale",)), outcome(2, 0.0))

    def said(everyone):
        return [reason.sentence for reason in candidates._near(one, everyone)]

    larger, as_large = candidate("cauchy:3", 3, -2.0), candidate("sellmeier:1", 2, 1.0)
    (text,) = said([larger, one])
    assert text.startswith(
        'the data do not distinguish "cauchy:2, scale" from "cauchy:3" (BIC differs'
    )
    assert text.endswith("since it has the fewest parameters.")
    (reason,) = candidates._near(one, [larger, one])
    assert reason.tries == (("To see the other:", f"--sample '{larger.fit.sample}'"),)
    (text,) = said([larger, one, as_large])
    assert '"cauchy:3" and "sellmeier:1" (BIC' in text
    assert text.endswith("has the fewest parameters and, of the 2 with as few, the lowest BIC.")
    # Taken for another reason, which is said elsewhere.
    for better in (candidate("constant", 1, 4.0), candidate("sellmeier:1", 2, -1.0)):
        (text,) = said([better, one])
        assert text.endswith("(BIC differs by less than 6).")


def test_names_that_only_some_models_have_are_refused(spectrum):
    for settings in ({"fixed": {"A": 1.5}}, {"bounds": {"k": (0.0, 1.0)}}, {"free": ("edge_ev",)}):
        with pytest.raises(ValueError, match="not a parameter of every model"):
            select.choose(spectrum, **settings)


@pytest.mark.parametrize(("k", "label"), [(0.0, "constant, k = 0"), (0.8, "constant")])
def test_glass_is_told_from_an_absorber(k, label):
    angles = tuple(np.linspace(20.0, 80.0, 20))
    measurement = simulated(1.7, k, 1e-3, angles=angles, wavelength_um=0.6, seed=3)
    done = []
    choice = select.choose(measurement, progress=done.append, instrument=False)
    assert choice.taken.label == label
    assert choice.fit is choice.taken.fit
    assert choice.fit.parameters["eta"].value == pytest.approx(1.7, abs=5e-3)
    assert done[:2] == ["constant, k = 0", "constant"]
    # Without k the index fits as well, and with it no worse: both may be taken then.
    further = ["constant", "constant, k = 0"] if k == 0.0 else ["constant"]
    assert sorted(done[2:]) == sorted(f"{name}, searched thoroughly" for name in further)
    rows = choice.table()
    assert [row[1] for row in rows if row[0] == ">"] == [label]
    assert rows[1][3] == "+0.0"


@pytest.mark.study
def test_dispersion_is_seen_in_a_spectrum():
    waves = np.array([0.4, 0.6, 0.8])
    angles = np.repeat([50.0, 65.0, 75.0, 80.0], 3)
    rng = np.random.default_rng(0)
    data = {}
    for q in ("R_s", "R_p"):
        eta = 1.5 + 0.008 / np.tile(waves, 4) ** 2
        data[q] = textbook(angles, np.full(12, q), eta, 0.0) + 1e-3 * rng.standard_normal(12)
    m = Measurement.from_columns(angles, np.tile(waves, 4), sigma=1e-3, **data)
    choice = select.choose(m, instrument=False)
    assert choice.taken.label in ("cauchy:2", "sellmeier:1")
    assert choice.taken.size == 2
    assert any("do not distinguish" in r.text for r in choice.reasons)


@pytest.mark.study
def test_the_model_of_one_of_two_films():
    """Its parameters have the name of its place."""
    waves, sample = np.array([0.45, 0.8]), "air | {} 50..300 nm | SiO2 12 nm held | Si"
    truth = {"film_1.eta": 2.1, "film_1.k": 0.0, "film_1.thickness_nm": 140.0}
    angles, waves = (a.ravel() for a in np.meshgrid([55.0, 65.0, 75.0], waves))
    random, seen = np.random.default_rng(2), cast(Any, {})
    for quantity in ("psi", "delta"):
        exact = simulate(sample.format("constant"), truth, angles, waves, quantity)
        seen[quantity] = exact + 0.05 * random.standard_normal(len(exact))
    m = Measurement.from_columns(angles, waves, sigma=dict.fromkeys(seen, 0.05), **seen)
    choice = select.choose(m, sample.format("auto"), instrument=False)
    assert choice.taken.label == "constant, k = 0"
    assert choice.fit.parameters["film_1.k"].value == 0.0
    assert choice.fit.parameters["film_1.thickness_nm"].value == pytest.approx(140.0, abs=0.5)
