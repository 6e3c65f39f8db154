"""Random Tauc-Lorentz materials, psi and Delta of them, and how far a free-form index is off."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting import Fit, Measurement, fit, simulate
from fresnel_jax.dispersion import HC_EV_UM, TaucLorentz

WAVELENGTHS = 40
ANGLES = (60.0, 70.0)
SIGMA = {"psi": 0.02, "delta": 0.1}
SUBSTRATES = ("Si", "1.5")


class Truth(NamedTuple):
    """A material with one Tauc-Lorentz oscillator, and the sample that it is measured on.

    model: its parameters by name. sample: text with {} for the model. highest_ev: of the data.
    """

    model: dict[str, float]
    sample: str = "{}"
    thickness_nm: float | None = None
    highest_ev: float = 5.5


def truth_of(random: np.random.Generator, film: bool = False) -> Truth:
    """Return a truth whose gap and resonance lie in the measured range."""
    model = {
        "eps_inf": random.uniform(1.0, 2.0),
        "amplitude_ev_1": random.uniform(40.0, 150.0),
        "resonance_ev_1": random.uniform(2.5, 5.0),
        "width_ev_1": random.uniform(0.8, 3.0),
        "gap_ev": random.uniform(0.8, 2.2),
    }
    if not film:
        return Truth(model)
    thickness, substrate = random.uniform(40.0, 200.0), random.choice(SUBSTRATES)
    # silicon is known up to 4.96 eV
    return Truth(model, f"air | {{}} 30..250 nm | {substrate}", thickness, 4.9)


def measured(truth: Truth, random: np.random.Generator) -> Measurement:
    """Return psi and Delta of the sample with noise."""
    energies = np.linspace(1.2, truth.highest_ev, WAVELENGTHS)
    wave = np.repeat(HC_EV_UM / energies[::-1], len(ANGLES))
    angle = np.tile(ANGLES, WAVELENGTHS)
    values = truth.model | ({"thickness_nm": truth.thickness_nm} if truth.thickness_nm else {})
    seen = {}
    for q, error in SIGMA.items():
        exact = simulate(truth.sample.format("tauc-lorentz"), values, angle, wave, q)
        seen[q] = exact + error * random.standard_normal(len(wave))
    # psi is not negative, and Delta an angle
    seen = {"psi": np.abs(seen["psi"]), "delta": seen["delta"] % 360.0}
    return Measurement.from_columns(angle, wave, **seen, sigma=SIGMA)


def fitted(truth: Truth, m: Measurement, model: str) -> Fit:
    """Return the fit of a free-form index; a film begins at its thickness, with bands in view."""
    begin = {"thickness_nm": truth.thickness_nm} if truth.thickness_nm else None
    return fit(m, truth.sample.format(model), intervals="quadratic", starts=16, start=begin)


def index_of(truth: Truth, wavelength_um: np.ndarray) -> np.ndarray:
    """Return eta and k, (2, W)."""
    t = truth.model
    model = TaucLorentz(
        [t["amplitude_ev_1"]], [t["resonance_ev_1"]], [t["width_ev_1"]], t["gap_ev"], t["eps_inf"]
    )
    return np.array([np.asarray(x) for x in model(wavelength_um)])


def off_of(found: Fit, truth: Truth) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return eV above the gap (W,), errors in standard errors and standard errors, (2, W)."""
    band = found.index()
    sigma = np.array([band.sigma_eta, band.sigma_k])
    with np.errstate(invalid="ignore", divide="ignore"):
        off = (np.array([band.eta, band.k]) - index_of(truth, band.wavelength_um)) / sigma
    # below the gap k and its error may both be 0
    return HC_EV_UM / band.wavelength_um - truth.model["gap_ev"], np.nan_to_num(off), sigma
