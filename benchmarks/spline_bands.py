"""How often the bands of a kk-spline hold the index of simulated Tauc-Lorentz surfaces.

``python -m benchmarks.spline_bands --truths 50 --terms 12,24,32`` prints, for each number of
splines, the share of wavelengths whose true eta and k lie within 1.96 standard errors (95 %
wanted), the median of the largest error in standard errors, and chi2 over the degrees of freedom.
"""

from __future__ import annotations

import argparse

import numpy as np

from fitting import Measurement, fit, simulate
from fresnel_jax.dispersion import HC_EV_UM, TaucLorentz

ENERGIES = np.linspace(1.2, 5.5, 40)
ANGLES = (60.0, 70.0)
SIGMA = {"psi": 0.02, "delta": 0.1}


def truth_of(random: np.random.Generator) -> dict[str, float]:
    """Return the parameters of a surface with one Tauc-Lorentz oscillator in the measured range."""
    return {
        "eps_inf": random.uniform(1.0, 2.0),
        "amplitude_ev_1": random.uniform(40.0, 150.0),
        "resonance_ev_1": random.uniform(2.5, 5.0),
        "width_ev_1": random.uniform(0.8, 3.0),
        "gap_ev": random.uniform(0.8, 2.2),
    }


def measured(truth: dict[str, float], random: np.random.Generator) -> Measurement:
    """Return psi and Delta of the surface with noise."""
    wave = np.repeat(HC_EV_UM / ENERGIES[::-1], len(ANGLES))
    angle = np.tile(ANGLES, len(ENERGIES))
    seen = {
        # psi is not negative
        q: np.abs(
            simulate("tauc-lorentz", truth, angle, wave, q)
            + error * random.standard_normal(len(wave))
        )
        for q, error in SIGMA.items()
    }
    return Measurement.from_columns(angle, wave, **seen, sigma=SIGMA)


def index_of(truth: dict[str, float], wavelength_um: np.ndarray) -> np.ndarray:
    """Return eta and k, (2, W)."""
    t = truth
    model = TaucLorentz(
        [t["amplitude_ev_1"]], [t["resonance_ev_1"]], [t["width_ev_1"]], t["gap_ev"], t["eps_inf"]
    )
    return np.array([np.asarray(x) for x in model(wavelength_um)])


def off_of(found, truth: dict[str, float]) -> np.ndarray:
    """Return the errors of eta and k in standard errors, (2, W)."""
    band = found.index()
    eta, k = index_of(truth, band.wavelength_um)
    with np.errstate(invalid="ignore", divide="ignore"):
        off = np.array([(band.eta - eta) / band.sigma_eta, (band.k - k) / band.sigma_k])
    return np.nan_to_num(off)  # below the gap k and its error may both be 0


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--truths", type=int, default=50)
    parser.add_argument("--terms", default="12,16,20,24,32")
    parser.add_argument("--seed", type=int, default=20261123)
    arguments = parser.parse_args()
    print("terms  eta in band  k in band  median of largest |error|/sigma  median chi2/dof")
    for terms in map(int, arguments.terms.split(",")):
        random = np.random.default_rng(arguments.seed)
        off, chi2 = [], []
        for _ in range(arguments.truths):
            truth = truth_of(random)
            m = measured(truth, random)
            found = fit(m, f"kk-spline:{terms}", intervals="quadratic", starts=16)
            off.append(off_of(found, truth))
            chi2.append(found.chi2_reduced)
        size = np.abs(np.array(off))
        inside = (size < 1.96).mean(axis=(0, 2))
        largest = np.median(np.nanmax(size, axis=(1, 2)))
        print(
            f"{terms:5d}  {inside[0]:10.1%}  {inside[1]:9.1%}  {largest:28.2f}  "
            f"{np.median(chi2):15.2f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
