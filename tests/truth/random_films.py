"""Random films, simulated, with Gaussian noise; and the lowest chi2 that a fit of one names."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting import Fit, Measurement, simulate
from fitting.samples.known_media import known_medium
from tests.truth.random_spectra import truth

LOW_NM, HIGH_NM = 5.0, 20_000.0
MODELS = ("cauchy:3", "cauchy-urbach:2", "drude-lorentz:1")
SUBSTRATES = ("BK7", "Si", "silver")
MEASURED = {
    "R": {"R": 1e-3}, "T": {"T": 1e-3}, "R, T": {"R": 1e-3, "T": 1e-3},
    "psi, Delta": {"psi": 0.05, "delta": 0.1},
}  # fmt: skip
# Numbers of wavelengths: each of them takes a program of its own for every cell, 10 s to compile.
SIZES = (128, 512)


class Case(NamedTuple):
    """One simulated film: what it is, what was measured, and the truth by parameter."""

    cell: tuple[str, str, str]
    measurement: Measurement
    truth: dict[str, float]
    fringe_nm: float

    @property
    def sample(self) -> str:
        """What is fitted."""
        model, substrate, _ = self.cell
        return f"air | {model} {LOW_NM:g}..{HIGH_NM:g} nm | {substrate}"


def _parameters(model: str, random: np.random.Generator, shortest_um: float) -> dict[str, float]:
    """Return a random material that a film of it is seen through at some wavelengths."""
    p = truth(model, random)
    if model.startswith("cauchy-urbach"):
        p = {k: v for k, v in p.items() if k != "C"}
        p |= {"k_edge": 10.0 ** random.uniform(-3.0, -0.7), "edge_ev": 1.2398 / shortest_um}
    if model.startswith("drude-lorentz"):
        # a transparent conductor: free electrons in the infrared, a resonance in the ultraviolet
        p |= {
            "eps_inf": random.uniform(1.5, 4.0), "plasma_ev": 10.0 ** random.uniform(-0.7, 0.4),
            "width_ev": 10.0 ** random.uniform(-1.3, -0.3),
            "resonance_ev_1": random.uniform(3.5, 8.0), "width_ev_1": random.uniform(0.05, 1.0),
        }  # fmt: skip
    return p


def simulated(seed: int, noise: float = 1.0) -> Case | None:
    """Return a random film; None where the random material is none. noise: a factor on it."""
    random = np.random.default_rng([7, seed])
    model, substrate = random.choice(MODELS), random.choice(SUBSTRATES)
    names = list(MEASURED) if substrate == "BK7" else ["R", "psi, Delta"]
    measured = str(random.choice(names))
    low = random.uniform(0.35, 0.5)
    high = min(low * random.uniform(1.5, 3.0), 0.99 * known_medium(substrate).range_um[1])  # type: ignore
    thickness = float(np.exp(random.uniform(np.log(LOW_NM), np.log(HIGH_NM))))
    p = _parameters(model, random, low)
    angle = 0.0 if measured != "psi, Delta" else random.uniform(55.0, 75.0)
    # five points to the narrowest fringe of an index of 2.5, as a spectrometer that is up to it
    fringes = 2.0 * 2.5 * thickness * 1e-3 * (1.0 / low - 1.0 / high)
    count = next((n for n in SIZES if n > 5.0 * fringes), SIZES[-1])
    wavelength = 1.0 / np.linspace(1.0 / high, 1.0 / low, count)
    values = p | {"thickness_nm": thickness}
    sample = f"air | {model} {thickness:.6g} nm | {substrate}"
    columns, sigma = {}, {}
    for quantity, usual in MEASURED[measured].items():
        error = noise * usual
        value = simulate(sample, values, angle, wavelength, quantity)
        if not np.isfinite(value).all():
            return None
        value = value + error * random.standard_normal(count)
        value = np.clip(value, 0.0, 90.0) if quantity == "psi" else value
        value = value % 360.0 if quantity == "delta" else value
        columns[quantity], sigma[quantity] = value, error
    m = Measurement.from_columns(angle, wavelength, sigma=sigma, **columns)
    index = 2.0  # a fringe, for the tolerance of the order
    return Case((str(model), str(substrate), measured), m, values, 1e3 * low / (2.0 * index))


def lowest_chi2(found: Fit) -> float:
    """Return the lowest chi2 of a fit with stated errors, of what is shown or listed.

    What is shown is a film without fringes where those of the lowest minimum may be noise.
    """
    rise = min([0.0, *(float(a.delta_chi2) for a in found.alternatives)])
    # In units of chi2 / dof of the lowest one where that is above 1.
    return min(found.cost / (1.0 - rise / found.dof), found.cost + rise)


NOISE = 0.3, 3.0


def drawn(seed: int) -> Case | None:
    """Return a random film with random noise; None where the random material is none."""
    noise = float(np.exp(np.random.default_rng([11, seed]).uniform(*np.log(NOISE))))
    return simulated(seed, noise)
