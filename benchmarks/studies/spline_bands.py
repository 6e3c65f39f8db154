"""How often the bands of a kk-spline hold the index of simulated Tauc-Lorentz materials.

``python -m benchmarks.studies.spline_bands --truths 60 --models kk-spline:24,kk-spline`` prints,
for wavelengths by their distance from the gap, the share whose true eta and k lie within 1.96
standard errors (95 % wanted), and the median of these errors; then chi2 over the degrees of
freedom. Gap, resonance, width and strength of each material are random; with ``--film`` it is a
film on silicon or on glass, of random thickness, and the share of thicknesses within their
intervals is printed.
"""

from __future__ import annotations

import argparse
import itertools
from typing import NamedTuple

import numpy as np

from fitting import Fit, Measurement, fit, simulate
from fresnel_jax.dispersion import HC_EV_UM, TaucLorentz

WAVELENGTHS = 40
ANGLES = (60.0, 70.0)
SIGMA = {"psi": 0.02, "delta": 0.1}
# Photon energy minus the gap, eV.
PLACES = (-9.0, -0.25, -0.1, 0.0, 0.1, 0.25, 0.5, 1.0, 2.0, 9.0)
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


def table(model: str, found: list[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> None:
    """Print the shares of one model by the distance from the gap."""
    above, off, sigma = (np.concatenate(part, -1) for part in zip(*found, strict=True))
    print(f"{model}\n   eV above the gap  points  eta in band  k in band  sigma eta    sigma k")
    for low, high in [*itertools.pairwise(PLACES), (PLACES[0], PLACES[-1])]:
        here = (above >= low) & (above < high)
        inside = (np.abs(off[:, here]) < 1.96).mean(1)
        size = np.median(sigma[:, here], 1)
        print(
            f"   {low:6.2f} to {high:5.2f}  {here.sum():7d}  {inside[0]:11.1%}  {inside[1]:9.1%}  "
            f"{size[0]:9.5f}  {size[1]:9.5f}"
        )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--truths", type=int, default=60)
    parser.add_argument("--models", default="kk-spline")
    parser.add_argument("--film", action="store_true")
    parser.add_argument("--seed", type=int, default=20261123)
    arguments = parser.parse_args()
    for model in arguments.models.split(","):
        random = np.random.default_rng(arguments.seed)
        found, chi2, right = [], [], []
        for _ in range(arguments.truths):
            truth = truth_of(random, arguments.film)
            result = fitted(truth, measured(truth, random), model)
            found.append(off_of(result, truth))
            chi2.append(result.chi2_reduced)
            if truth.thickness_nm:
                low, high = result.parameters["thickness_nm"].interval
                right.append(low <= truth.thickness_nm <= high)
        table(model, found)
        if right:
            print(f"   interval of the thickness holds the true one: {np.mean(right):.1%}")
        print(f"   chi2 / dof: median {np.median(chi2):.2f}, largest {max(chi2):.2f}", flush=True)


if __name__ == "__main__":
    main()
