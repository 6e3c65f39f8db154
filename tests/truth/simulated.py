"""Measurements of a known truth, by formulas that share nothing with the package; the gold scan."""

from pathlib import Path

import numpy as np

from fitting.data.measurement import Measurement
from tests.truth.textbook import reflectances

GOLD = Path(__file__).resolve().parents[2] / "examples" / "data" / "gold_532nm.csv"


def textbook(angle_deg, quantity, eta, k):
    """Reflectance by the complex amplitudes as printed in textbooks."""
    found = reflectances(np.cos(np.radians(angle_deg)), eta + 1j * k)
    return np.select(
        [quantity == "R_s", quantity == "R_p"], [found["R_s"], found["R_p"]], found["R"]
    )


def simulated(eta, k, noise, *, angles=(30.0, 45.0, 60.0, 70.0, 80.0), wavelength_um=None, seed=0):
    """A measurement of R_s and R_p with normal noise, from the textbook formulas."""
    rng = np.random.default_rng(seed)
    angles = np.array(angles)
    values = {
        q: textbook(angles, np.full(len(angles), q), eta, k) + noise * rng.normal(size=len(angles))
        for q in ("R_s", "R_p")
    }
    return Measurement.from_columns(
        angles, wavelength_um, sigma=noise or None, source="simulated", **values
    )
