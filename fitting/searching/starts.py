"""Many starts of one fit, side by side.

One random start found the best minimum of a spectral model in a third to a half of the cases, 64 in
all of them, at hardly any cost: the starts are lanes of one program.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fitting.problem.lanes import LANES
from fitting.samples.parameters import LOG, Unknown, from_parameter, plain_name, start_range


def quasi_random(count: int, dimensions: int, seed: int) -> np.ndarray:
    """Return ``count`` points (dimensions, count) that fill the unit cube evenly.

    Multiples of powers of the inverse of the positive root of x^(d + 1) = x + 1, modulo 1, from a
    random origin (M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018).
    """
    root = 2.0
    for _ in range(60):
        root = (1.0 + root) ** (1.0 / (dimensions + 1))
    steps = root ** -np.arange(1.0, dimensions + 1)
    origin = np.random.default_rng(seed).random(dimensions)
    return (origin[:, None] + steps[:, None] * np.arange(count)) % 1.0


def starts(unknowns: Sequence[Unknown], count: int, seed: int) -> np.ndarray:
    """Return starts in the solver's coordinates, (p, count)."""
    # A parameter that is free only in other fits of the program takes no dimension here.
    usual = [w.low == w.high == w.parameter.held for w in unknowns]
    cube = iter(quasi_random(count, usual.count(False), seed))
    rows = []
    for unknown, held in zip(unknowns, usual, strict=True):
        parameter = unknown.parameter
        u = np.zeros(count) if held else next(cube)
        if not unknown.free:
            x = np.full(count, unknown.low)
        else:
            low, high = start_range(unknown)
            if parameter.decades and low < high:
                low = max(low, 1e-9 * high)
                x = low * (high / low) ** u
            else:
                x = low + (high - low) * u
            if parameter.near is not None and unknown.prior is None:
                # Every other start lies near that value, on either side.
                side = np.where(u < 0.5, -1.0, 1.0)
                distance = 10.0 ** (-7.0 * (2.0 * u % 1.0))
                crowded = parameter.near * (1.0 + 0.5 * side * distance)
                x = np.where(np.arange(count) % 2, x, crowded)
            x = np.clip(x, unknown.low, unknown.high)
        rows.append(from_parameter(parameter.coordinate, x))
    return np.stack(rows)


def start_at(unknowns: Sequence[Unknown], values: Mapping[str, float]) -> np.ndarray:
    """Return one start (p,) at these values by name, and in the middle of the other ranges."""
    middle = starts(unknowns, 1, 0)[:, 0]
    for i, unknown in enumerate(unknowns):
        name = unknown.parameter.name
        if name in values and unknown.free:
            x = min(max(values[name], unknown.low), unknown.high)
            middle[i] = float(from_parameter(unknown.parameter.coordinate, x))
    return middle


def with_given_start(
    points: np.ndarray, unknowns: Sequence[Unknown], labels: Mapping[str, str],
    start: Mapping[str, float] | None,
) -> np.ndarray:  # fmt: skip
    """Return starts (p, L), and after them that of the caller, if there is one."""
    if start is None:
        return points
    given = {plain_name(n): float(v) for n, v in start.items()}
    unknown = {w.parameter.name: w for w in unknowns if w.free}
    out = {}
    for name, label in labels.items():
        value = given.pop(label, None)
        if value is None or name not in unknown:
            continue
        w = unknown[name]
        positive = w.parameter.coordinate == LOG
        if not w.low <= value <= w.high or (positive and value <= 0.0):
            above = "above 0 " if positive and w.low <= 0.0 else f"from {w.low:g} "
            raise ValueError(
                f"the start of {label} is {value:g}; a number {above}to {w.high:g} was wanted."
            )
        out[name] = value
    if given:
        raise ValueError(
            f"start names {', '.join(given)}; the parameters of this fit are "
            f"{', '.join(labels.values())}."
        )
    return np.append(points, start_at(unknowns, out)[:, None], 1)


def usual_starts(free: int, film: bool = False) -> int:
    """Return how many starts find the best minimum, by the number of free parameters.

    film: whether a thickness is among them, which has minima of its own.
    """
    return LANES if free <= 5 else (8 if film else 4) * LANES
