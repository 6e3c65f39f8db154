"""Random materials of every dispersion model, and spectra of them with Gaussian noise."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting import Measurement, simulate

WAVELENGTHS = 60


class Setup(NamedTuple):
    """How a spectrum is measured: quantities and angles, standard errors by quantity."""

    name: str
    angles: tuple[float, ...]
    sigma: dict[str, float]
    thickness_um: float | None = None


SETUPS = (
    Setup("psi, Delta at 65, 70, 75", (65.0, 70.0, 75.0), {"psi": 0.05, "delta": 0.1}),
    Setup("R_s, R_p at 45, 65, 75", (45.0, 65.0, 75.0), {"R_s": 1e-3, "R_p": 1e-3}),
    Setup("R at 0", (0.0,), {"R": 1e-3}),
)
SLAB = Setup("T, R at 0 of 1 mm", (0.0,), {"T": 1e-3, "R": 1e-3}, 1000.0)


def _decades(random: np.random.Generator, low: float, high: float) -> float:
    return float(10.0 ** random.uniform(np.log10(low), np.log10(high)))


def _oscillators(random: np.random.Generator, count: int) -> dict[str, float]:
    """Resonances across the range of .3 to 2 um (.62 to 4.1 eV), apart by more than a width."""
    edges = np.linspace(0.9, 4.5, count + 1)
    out = {}
    for j in range(count):
        out[f"resonance_ev_{j + 1}"] = random.uniform(edges[j] + 0.15, edges[j + 1] - 0.15)
        out[f"strength_ev2_{j + 1}"] = _decades(random, 1.0, 30.0)
        out[f"width_ev_{j + 1}"] = _decades(random, 0.15, 1.0)
    return out


def truth(model: str, random: np.random.Generator) -> dict[str, float]:
    """Return random parameters of a model."""
    name, _, terms = model.partition(":")
    count = int(terms or 1)
    cauchy = {
        "A": random.uniform(1.3, 2.6), "B": random.uniform(0.0, 0.03),
        "C": random.uniform(0.0, 1e-3),
    }  # fmt: skip
    eps_inf = {"eps_inf": random.uniform(1.0, 5.0)}
    free = {"plasma_ev": _decades(random, 3.0, 12.0), "width_ev": _decades(random, 0.02, 0.5)}
    if name == "cauchy":
        return cauchy
    if name == "cauchy-urbach":
        tail = {"k_edge": _decades(random, 0.02, 0.5), "urbach_ev": _decades(random, 0.1, 0.8)}
        return cauchy | tail
    if name == "sellmeier":
        uv = {"strength_1": random.uniform(0.5, 5.0), "resonance_um_1": random.uniform(0.05, 0.22)}
        if count == 1:
            return uv
        return uv | {
            "strength_2": _decades(random, 0.3, 3.0),
            "resonance_um_2": _decades(random, 5, 15),
        }
    if name == "drude":
        return eps_inf | free
    if name == "lorentz":
        return eps_inf | _oscillators(random, count)
    if name == "drude-lorentz":
        return eps_inf | free | _oscillators(random, count)
    return {
        "eps_inf": random.uniform(1.0, 2.5), "amplitude_ev_1": _decades(random, 20.0, 200.0),
        "resonance_ev_1": random.uniform(3.0, 6.0), "width_ev_1": random.uniform(0.5, 3.0),
        "gap_ev": random.uniform(0.8, 2.5),
    }  # fmt: skip


def sample_of(model: str, setup: Setup) -> str:
    """Return the sample: one bare surface, or a plate."""
    d = setup.thickness_um
    return f"air | {model} {d:g} um thick | air" if d else model


def simulated(
    model: str, parameters: dict[str, float], setup: Setup, random: np.random.Generator
) -> Measurement | None:
    """Return a noisy spectrum; None where the random material is none (eta of 0, R of 1)."""
    wavelength = np.linspace(0.3, 1.0 if model.startswith(("cauchy", "sell")) else 2.0, WAVELENGTHS)
    angle, wavelength = (a.ravel() for a in np.meshgrid(setup.angles, wavelength))
    columns, sigma = {}, {}
    for quantity, error in setup.sigma.items():
        value = simulate(sample_of(model, setup), parameters, angle, wavelength, quantity)
        if not np.isfinite(value).all():
            return None
        value = value + error * random.standard_normal(len(value))
        if quantity == "psi":
            value = np.clip(value, 0.0, 90.0)
        columns[quantity], sigma[quantity] = value, error
    return Measurement.from_columns(angle, wavelength, sigma=sigma, **columns)
