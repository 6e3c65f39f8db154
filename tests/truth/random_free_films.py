"""Random films on known substrates, for fits that know nothing of the index of the film."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting import Measurement, simulate

MEASURED = {
    "psi, Delta at 3 angles": ((55.0, 65.0, 75.0), {"psi": 1.0, "delta": 2.0}),
    "psi, Delta at 2 angles": ((60.0, 72.0), {"psi": 1.0, "delta": 2.0}),
    "R, T of s, p at 2 angles": ((0.0, 50.0), dict.fromkeys(("R_s", "R_p", "T_s", "T_p"), 0.01)),
}


class Case(NamedTuple):
    """One simulated film. cell: whether it absorbs, its substrate, what was measured."""

    cell: tuple[str, str, str]
    measurement: Measurement
    sample: str
    thickness_nm: float


def simulated(seed: int) -> Case:
    """Return a random film."""
    random = np.random.default_rng([11, seed])
    waves = np.linspace(0.4, 0.9, int(random.integers(8, 41)))
    thickness = float(np.exp(random.uniform(np.log(40.0), np.log(400.0))))
    truth = {"A": random.uniform(1.4, 2.6), "B": random.uniform(0.0, 0.02)}
    absorbs, substrate = random.random() < 0.4, str(random.choice(["Si", "BK7", "silver"]))
    measured = str(random.choice(list(MEASURED)[: 3 if substrate == "BK7" else 2]))
    model = "cauchy:2"
    if absorbs:
        model = "cauchy-urbach:2"
        truth |= {"k_edge": random.uniform(0.01, 0.3), "urbach_ev": random.uniform(0.1, 0.5)}
        truth |= {"edge_ev": 1.2398 / waves[0]}
    angles, errors = MEASURED[measured]
    size = 10.0 ** random.uniform(-1.7, -0.7)
    wave, angle = (a.ravel() for a in np.meshgrid(waves, angles))
    sample, columns, sigma = f"air | {model} {thickness:.9g} nm | {substrate}", {}, {}
    for quantity, share in errors.items():
        sigma[quantity] = share * size
        value = simulate(sample, truth | {"thickness_nm": thickness}, angle, wave, quantity)
        value = value + sigma[quantity] * random.standard_normal(len(value))
        columns[quantity] = value % 360.0 if quantity == "delta" else value
    m = Measurement.from_columns(angle, wave, sigma=sigma, **columns)
    wanted = f"air | free {thickness / 1.5:.4g}..{thickness * 1.5:.4g} nm | {substrate}"
    return Case(("absorbs" if absorbs else "clear", substrate, measured), m, wanted, thickness)
