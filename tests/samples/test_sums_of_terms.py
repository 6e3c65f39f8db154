"""Gaussian lines, poles, and sums of terms of several kinds as the index of a medium."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fitting import Measurement, Sample, fit, simulate
from fitting.samples.dispersion import Spectrum, parse_model
from fresnel_jax import dispersion, interface

TEXT = "tauc-lorentz + gaussian:2 + pole"
VALUES = {
    "eps_inf": 1.3, "amplitude_ev_1": 80.0, "resonance_ev_1": 4.0, "width_ev_1": 2.0, "gap_ev": 1.5,
    "amplitude_2": 0.3, "resonance_ev_2": 2.5, "width_ev_2": 0.4,
    "amplitude_3": 0.2, "resonance_ev_3": 3.0, "width_ev_3": 0.3,
    "strength_ev2_4": 90.0, "resonance_ev_4": 12.0,
}  # fmt: skip


def test_the_terms_count_through() -> None:
    model = parse_model(TEXT)
    assert [p.name for p in model.parameters(Spectrum(0.3, 0.9))] == [*VALUES]
    assert parse_model(str(model)) == model and model.absorbs
    film = Sample.parse(f"air | {TEXT} 110 nm | Si")
    assert str(film) == f"air | {TEXT} 110 nm | Si" and film.media[1].index == model
    # other models keep their names
    assert str(parse_model("gaussian")) == "gaussian:1" and str(parse_model("pole")) == "pole"


def test_the_index_is_that_of_the_sum() -> None:
    w = np.linspace(0.3, 0.9, 8)
    v = VALUES
    truth = dispersion.Sum(
        (
            dispersion.TaucLorentz(v["amplitude_ev_1"], v["resonance_ev_1"], v["width_ev_1"],
                                   v["gap_ev"]),
            dispersion.Gaussian([0.3, 0.2], [2.5, 3.0], [0.4, 0.3]),
            dispersion.DrudeLorentz(v["strength_ev2_4"], v["resonance_ev_4"], 0.0),
        ),
        v["eps_inf"],
    )  # fmt: skip
    wanted = interface.powers(1.0, *truth(w)).R_s
    R = simulate(TEXT, VALUES, np.zeros(8), w, "R_s")
    np.testing.assert_allclose(R, wanted, rtol=1e-6)  # of float32, if jax is left as it is


def test_cody_lorentz_has_no_tail_unless_it_is_freed() -> None:
    model = parse_model("cody-lorentz:2 + pole")
    parameters = {p.name: p for p in model.parameters(Spectrum(0.3, 0.9))}
    assert [name for name, p in parameters.items() if p.held is not None] == [
        "tail_above_gap_ev", "urbach_ev"]  # fmt: skip
    values: Any = {name: p.start[1] if p.held is None else p.held for name, p in parameters.items()}
    w: Any = np.linspace(0.3, 0.9, 8)
    k = model.index(values | {"gap_ev": 2.0}, w).k
    assert (k[w > 0.62] == 0.0).all() and (k[w < 0.61] > 0.0).all()
    with_tail = values | {"gap_ev": 2.0, "tail_above_gap_ev": 0.1}
    amplitudes, resonances, widths = (
        [values[f"{stem}_ev_{j}"] for j in (1, 2)] for stem in ("amplitude", "resonance", "width")
    )
    edge = dispersion.CodyLorentz(amplitudes, resonances, widths, 2.0, values["cody_ev"], 2.1, 0.05)
    pole = dispersion.DrudeLorentz(values["strength_ev2_3"], values["resonance_ev_3"], 0.0)
    wanted = dispersion.Sum((edge, pole), values["eps_inf"])(w).k
    found = model.index(with_tail, w).k
    np.testing.assert_allclose(found, wanted, rtol=1e-6)
    assert (np.asarray(found) > 0.0).all()


@pytest.mark.parametrize(("text", "wanted"), [
    ("cauchy + gaussian", "cauchy is none of what can be added"),
    ("gaussian + gaussian:2", "each model was wanted once"),
    ("drude + drude-lorentz", "each model was wanted once"),
    ("tauc-lorentz + cody-lorentz", "one gap_ev is that of tauc-lorentz or of cody-lorentz"),
    ("gaussian + gauss", "no dispersion model"),
    ("tauc-lorentz + gaussian:9", "1 to 8 terms"),
    ("gaussian +", "no dispersion model"),
])  # fmt: skip
def test_sums_that_are_none(text: str, wanted: str) -> None:
    with pytest.raises(ValueError, match=wanted):
        Sample.parse(f"air | {text} 100 nm | Si")


@pytest.mark.study
def test_a_line_and_a_pole_are_found() -> None:
    truth = {"eps_inf": 1.5, "amplitude_1": 0.3, "resonance_ev_1": 2.5, "width_ev_1": 0.5,
             "strength_ev2_2": 90.0, "resonance_ev_2": 10.0}  # fmt: skip
    w, angle = np.linspace(0.3, 0.9, 60), np.full(60, 70.0)
    angles = [simulate("gaussian + pole", truth, angle, w, q) for q in ("psi", "delta")]
    found = fit(Measurement.from_columns(angle, w, psi=angles[0], delta=angles[1]),
                "gaussian + pole")  # fmt: skip
    assert found.status == "converged"
    for name, value in truth.items():
        assert found.values[name] == pytest.approx(value, rel=1e-6)
