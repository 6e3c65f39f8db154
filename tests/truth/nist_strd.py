"""The nonlinear regression problems of NIST's Statistical Reference Datasets, with their models.

Data, two starts each, certified values with their standard deviations, and least sums of squares
are those that NIST publishes (`reference/nist_strd.json`); the models are written down here.
https://www.itl.nist.gov/div898/strd/nls/nls_main.shtml
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

_TABLE = Path(__file__).with_name("reference") / "nist_strd.json"


def _saturating(b, x):
    return b[0] * (1.0 - jnp.exp(-b[1] * x))


def _chwirut(b, x):
    return jnp.exp(-b[0] * x) / (b[1] + b[2] * x)


def _three_decays(b, x):
    return sum(b[i] * jnp.exp(-b[i + 1] * x) for i in (0, 2, 4))


def _two_peaks(b, x):
    peaks = (b[i] * jnp.exp(-(((x - b[i + 1]) / b[i + 2]) ** 2)) for i in (2, 5))
    return b[0] * jnp.exp(-b[1] * x) + sum(peaks)


def _cubic_ratio(b, x):
    above = b[0] + x * (b[1] + x * (b[2] + x * b[3]))
    return above / (1.0 + x * (b[4] + x * (b[5] + x * b[6])))


def _enso(b, x):
    waves = ((12.0, b[1], b[2]), (b[3], b[4], b[5]), (b[6], b[7], b[8]))
    phases = ((2.0 * jnp.pi * x / period, c, s) for period, c, s in waves)
    return b[0] + sum(c * jnp.cos(phase) + s * jnp.sin(phase) for phase, c, s in phases)


MODELS: dict[str, Callable[[Any, Any], Any]] = {
    "Misra1a": _saturating,
    "Chwirut2": _chwirut,
    "Chwirut1": _chwirut,
    "Lanczos3": _three_decays,
    "Gauss1": _two_peaks,
    "Gauss2": _two_peaks,
    "DanWood": lambda b, x: b[0] * x ** b[1],
    "Misra1b": lambda b, x: b[0] * (1.0 - (1.0 + 0.5 * b[1] * x) ** -2),
    "Kirby2": lambda b, x: (b[0] + x * (b[1] + x * b[2])) / (1.0 + x * (b[3] + x * b[4])),
    "Hahn1": _cubic_ratio,
    "Nelson": lambda b, x: b[0] - b[1] * x[0] * jnp.exp(-b[2] * x[1]),
    "MGH17": lambda b, x: b[0] + b[1] * jnp.exp(-x * b[3]) + b[2] * jnp.exp(-x * b[4]),
    "Lanczos1": _three_decays,
    "Lanczos2": _three_decays,
    "Gauss3": _two_peaks,
    "Misra1c": lambda b, x: b[0] * (1.0 - (1.0 + 2.0 * b[1] * x) ** -0.5),
    "Misra1d": lambda b, x: b[0] * b[1] * x / (1.0 + b[1] * x),
    "Roszman1": lambda b, x: b[0] - b[1] * x - jnp.arctan(b[2] / (x - b[3])) / jnp.pi,
    "ENSO": _enso,
    "MGH09": lambda b, x: b[0] * (x * x + x * b[1]) / (x * x + x * b[2] + b[3]),
    "Thurber": _cubic_ratio,
    "BoxBOD": _saturating,
    "Rat42": lambda b, x: b[0] / (1.0 + jnp.exp(b[1] - b[2] * x)),
    "MGH10": lambda b, x: b[0] * jnp.exp(b[1] / (x + b[2])),
    "Eckerle4": lambda b, x: b[0] / b[1] * jnp.exp(-0.5 * ((x - b[2]) / b[1]) ** 2),
    "Rat43": lambda b, x: b[0] * (1.0 + jnp.exp(b[1] - b[2] * x)) ** (-1.0 / b[3]),
    "Bennett5": lambda b, x: b[0] * (b[1] + x) ** (-1.0 / b[2]),
}


class NistProblem(NamedTuple):
    """A problem of p parameters and n values: starts (2, p), certified and errors (p,).

    data: x (n,), or (2, n) of two predictors, and y (n,), of Nelson its logarithm.
    """

    name: str
    difficulty: str
    starts: np.ndarray
    certified: np.ndarray
    errors: np.ndarray
    sum_of_squares: float
    data: tuple[np.ndarray, np.ndarray]

    @property
    def names(self) -> list[str]:
        """The names of the parameters, b1, b2, ..."""
        return [f"b{i + 1}" for i in range(len(self.certified))]

    def residuals(self, values: Any, data: Any) -> Any:
        """Return model minus measured values; values: by name, or in the order of the names."""
        b = [values[n] for n in self.names] if isinstance(values, dict) else values
        return MODELS[self.name](b, data[0]) - data[1]


def nist_problems() -> dict[str, NistProblem]:
    """Return the 27 problems by name, as NIST orders them by difficulty."""
    table = json.loads(_TABLE.read_text(encoding="utf-8"))["problems"]
    out = {}
    for name, of in table.items():
        starts, certified, errors, x, y = (
            np.array(of[key], float) for key in ("starts", "certified", "errors", "x", "y")
        )
        data = x, np.log(y) if name == "Nelson" else y
        out[name] = NistProblem(
            name, of["difficulty"], starts, certified, errors, of["sum_of_squares"], data
        )
    return out


def digits(values: Any, certified: Any) -> float:
    """Return the number of digits of the worst value that agree: -log10 of its relative error.

    At most 11, as many as are certified.
    """
    off = np.max(np.abs(np.asarray(values) / certified - 1.0))
    return float(min(-np.log10(max(off, 1e-300)), 11.0)) if np.isfinite(off) else 0.0
