"""Where the next oscillator of a medium belongs: the lines that explain most of what is left.

The index changes in proportion to the strength of a weak oscillator, and a datum with the index at
its own wavelength alone: two derivatives, with respect to eps_1 and eps_2 of the medium, give what
an oscillator of any resonance and width does to all data. Of a grid of those the ones are taken
that lower the sum of squares most, the other parameters free to follow.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fitting.observe import NCS
from fitting.parameters import LOG, value_and_slope
from fresnel_jax.dispersion import HC_EV_UM

if TYPE_CHECKING:
    from fitting.search import Solving

# Widths of the grid, evenly in the logarithm from a half of the step between two energies to the
# whole spectrum; and energies, up to so many, over the spectrum and a little beside it.
_WIDTHS, _PLACES = 12, 256
_BELOW, _ABOVE = 0.7, 1.7
# Columns of the other parameters that are smaller than this, of the largest one, are rounding.
_SEEN = 1e-9


def oscillators(fit: Solving) -> list[list[int]]:
    """Return the rows in y of strength, resonance and width of every free Lorentz oscillator."""
    row = {name: i for i, name in enumerate(fit.u.spec.moving)}
    out = []
    for name in row:
        head, found, number = name.rpartition("strength_ev2_")
        if not found:
            continue
        rows = [row.get(f"{head}{n}_ev_{number}") for n in ("resonance", "width")]
        term = [row[name], *(i for i in rows if i is not None)]
        of = [fit.u.moving[i] for i in term]
        if len(term) == 3 and all(w.free and w.parameter.coordinate == LOG for w in of):
            out.append(term)
    return out


def _energies(fit: Solving) -> np.ndarray:
    """Return the photon energy of every residual, (R,), in the order of `Slopes.residual`."""
    seen, out = fit.seen, []
    energy = HC_EV_UM / seen.points.wavelength_um[:, 0]
    out += [energy[w[:, 0] > 0.0] for w in seen.weights]
    if NCS in seen.channels:
        some = np.abs(seen.ncs_weights[..., 0]).sum((0, 1)) > 0.0
        out += [energy[some]] * 3
    return np.concatenate(out)


def _oscillator(energy: np.ndarray, resonance: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Return eps of an oscillator of strength 1."""
    return 1.0 / (resonance**2 - energy**2 - 1j * energy * width)


def _by_eps(fit: Solving, y: np.ndarray, term: list[int], energy: np.ndarray):
    """Return residuals (R,), their derivatives by eps_1 - i eps_2 (R,) and by all of y (R, p)."""
    low, high = energy.min(), energy.max()
    columns, shapes = [], []
    # Two oscillators whose eps differ in phase at every energy: far above, and broad.
    for resonance, width in ((5.0 * high, 1e-2 * low), (np.sqrt(low * high), 10.0 * high)):
        at = y.copy()
        at[term[1:]] = np.log([resonance, width])
        at = np.clip(at, *fit.limits)
        slopes = fit.slopes(at)
        strength, resonance, width = np.exp(at[term])
        columns.append(slopes.jacobian[:, term[0]] / strength)
        shapes.append(_oscillator(energy, resonance, width))
    (a, b), (c, d) = ((s.real, s.imag) for s in shapes)
    determinant = a * d - b * c
    by_1 = (d * columns[0] - b * columns[1]) / determinant
    by_2 = (a * columns[1] - c * columns[0]) / determinant
    return slopes.residual, by_1 - 1j * by_2, slopes.jacobian


def likely_lines(fit: Solving, y: np.ndarray, term: list[int], count: int) -> np.ndarray:
    """Return starts (p, count): y (p,) with the oscillators that explain most of its residuals.

    term: rows of the oscillator that is looked for, whose strength at y is next to nothing.
    """
    energy = _energies(fit)
    residual, by_eps, jacobian = _by_eps(fit, y, term, energy)
    rest = [i for i, w in enumerate(fit.u.moving) if w.free and i not in term]
    left, sizes, _ = np.linalg.svd(jacobian[:, rest], full_matrices=False)
    known = left[:, sizes > _SEEN * sizes.max(initial=0.0)]
    measured = np.unique(energy)
    inside = np.interp(
        np.linspace(0.0, len(measured) - 1.0, min(2 * len(measured), _PLACES)),
        np.arange(len(measured)), measured,
    )  # fmt: skip
    low, high = measured[0], measured[-1]
    places = np.concatenate([
        np.linspace(_BELOW * low, low, 8, endpoint=False), inside,
        np.linspace(_ABOVE * high, high, 8, endpoint=False)[::-1],
    ])  # fmt: skip
    step = np.median(np.diff(measured)) if len(measured) > 1 else 0.1 * high
    widths = np.geomspace(0.5 * step, high, _WIDTHS)
    strength = np.empty((_WIDTHS, len(places)))
    gain = np.empty_like(strength)
    for i, width in enumerate(widths):
        change = (by_eps * _oscillator(energy, places[:, None], width)).real
        change -= (change @ known) @ known.T
        size = np.maximum((change * change).sum(1), 1e-300)
        strength[i] = -(change @ residual) / size
        gain[i] = np.where(strength[i] > 0.0, strength[i] ** 2 * size, 0.0)
    # One line of each height along the energies, the best ones first.
    edge = np.pad(gain, ((1, 1), (1, 1)), constant_values=-1.0)
    beside = [edge[1:-1, :-2], edge[1:-1, 2:], edge[:-2, 1:-1], edge[2:, 1:-1]]
    top = (gain > 0.0) & np.logical_and.reduce([gain >= b for b in beside])
    order = np.argsort(np.where(top, -gain, np.where(gain > 0.0, 0.0, 1.0)), axis=None)
    width_at, place_at = np.unravel_index(np.resize(order[: max(top.sum(), 1)], count), gain.shape)
    out = np.repeat(y[:, None], count, 1)
    best = strength[width_at, place_at], places[place_at], widths[width_at]
    for i, values in zip(term, best, strict=True):
        out[i] = np.log(np.maximum(values, 1e-300))
    return np.clip(out, fit.limits[0][:, None], fit.limits[1][:, None])
