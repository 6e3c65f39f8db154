"""Where the next oscillator of a medium is: at the lines that explain most of the residuals.

The index changes in proportion to the strength of a weak oscillator, and a datum depends on the
index at its own wavelength only. So two derivatives, with respect to eps_1 and eps_2 of the medium,
give the effect of an oscillator of any resonance and width on all data. From a grid of these the
ones are taken that lower the sum of squares most when the other parameters are fitted as well.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fitting.problem.problem import Problem
from fitting.problem.unknowns import terms_of
from fitting.samples.parameters import LOG
from fresnel_jax.dispersion import HC_EV_UM

# Widths of the grid, evenly in the logarithm from half the step between two measured energies to
# the largest energy; resonances within the spectrum, two for each step up to this number; and
# resonances outside.
_WIDTHS, _PLACES, _BESIDE = 12, 256, 8
_BELOW, _ABOVE = 0.7, 1.7
# Directions of the other parameters with less than this part of the largest effect are rounding,
# and so is what is left of the effect of a line below this part of its square.
_SEEN, _LEFT = 1e-9, 1e-12
# Of 2,000 residuals every second one is looked at, of 3,000 every third, and so on.
_MANY = 1000


def oscillators(fit: Problem) -> list[list[int]]:
    """Return the rows in y of strength, resonance and width of every free Lorentz oscillator."""
    names, moving = fit.u.spec.moving, fit.u.moving
    return [
        term for term in terms_of(names)
        if len(term) == 3 and ".strength_ev2_" in names[term[0]]
        and all(moving[i].free and moving[i].parameter.coordinate == LOG for i in term)
    ]  # fmt: skip


class Responses(NamedTuple):
    """Effect of a change of eps of a medium, at the wavelength of each datum; R residuals.

    energy: (R,), in eV. residual: (R,). by_eps: (R,), the derivative by eps_1 minus i times that
    by eps_2: the real part of its product with a change of eps is the change of the residual.
    by_rest: (R, q), derivatives by the free parameters other than those of the oscillator.
    """

    energy: np.ndarray
    residual: np.ndarray
    by_eps: np.ndarray
    by_rest: np.ndarray


def oscillator(energy: np.ndarray, resonance: Any, width: Any) -> np.ndarray:
    """Return eps of an oscillator of strength 1 eV^2."""
    return 1.0 / (resonance**2 - energy**2 - 1j * energy * width)


def by_eps(fit: Problem, y: np.ndarray, term: list[int]) -> Responses:
    """Return the responses at y (p,), where the oscillator ``term`` has hardly any strength.

    The derivatives by its strength at two resonances and widths, whose eps differ in phase at every
    energy (one far above the spectrum, one broad), give those by eps_1 and by eps_2.
    """
    every = HC_EV_UM / fit.whole.seen.points.wavelength_um[:, 0]
    low, high = every.min(), every.max()
    columns, shapes = [], []
    for resonance, width in ((5.0 * high, 1e-2 * low), (np.sqrt(low * high), 10.0 * high)):
        at = y.copy()
        at[term[1:]] = np.log([resonance, width])
        at = np.clip(at, *fit.limits)
        slopes = fit.slopes(at)
        energy = every[slopes.row]
        strength, *of = np.exp(at[term])
        columns.append(slopes.jacobian[:, term[0]] / strength)
        shapes.append(oscillator(energy, *of))
    (a, b), (c, d) = ((s.real, s.imag) for s in shapes)
    determinant = a * d - b * c
    by_1 = (d * columns[0] - b * columns[1]) / determinant
    by_2 = (a * columns[1] - c * columns[0]) / determinant
    rest = [i for i, w in enumerate(fit.u.moving) if w.free and i not in term]
    known = energy, slopes.residual, by_1 - 1j * by_2, slopes.jacobian[:, rest]
    return Responses(*(a[:: max(len(energy) // _MANY, 1)] for a in known))


def _grid(energy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return resonances and widths (eV) over the measured energies, with their spacing."""
    measured = np.unique(energy)
    low, high, count = measured[0], measured[-1], len(measured)
    inside = np.interp(
        np.linspace(0.0, count - 1.0, min(2 * count, _PLACES)), np.arange(count), measured
    )
    beside = (
        np.linspace(_BELOW * low, low, _BESIDE, endpoint=False),
        np.linspace(_ABOVE * high, high, _BESIDE, endpoint=False),
    )
    step = np.median(np.diff(measured)) if count > 1 else 0.1 * high
    return np.concatenate([beside[0], inside, beside[1][::-1]]), np.geomspace(
        0.5 * step, high, _WIDTHS
    )


def _summits(gain: np.ndarray) -> np.ndarray:
    """Return flat places where ``gain`` (W, E) is above 0 and above its neighbours, highest first.

    If there is none, it is the highest place.
    """
    edge = np.pad(gain, 1, constant_values=-1.0)
    beside = [edge[1:-1, :-2], edge[1:-1, 2:], edge[:-2, 1:-1], edge[2:, 1:-1]]
    top = (gain > 0.0) & np.logical_and.reduce([gain >= b for b in beside])
    count = max(int(top.sum()), 1)
    return np.argsort(np.where(top, -gain, 0.0), axis=None, kind="stable")[:count]


def likely_lines(fit: Problem, y: np.ndarray, term: list[int], count: int) -> np.ndarray:
    """Return starts (p, count): y (p,) with the oscillators that explain most of its residuals.

    term: rows of the oscillator to be placed, which has hardly any strength at y. If there are
    fewer than ``count`` places, some are repeated; y itself is returned if its derivatives are not
    finite.
    """
    known = by_eps(fit, y, term)
    if not all(np.isfinite(a).all() for a in known):
        return np.repeat(y[:, None], count, 1)
    left, sizes, _ = np.linalg.svd(known.by_rest, full_matrices=False)
    followed = left[:, sizes > _SEEN * sizes.max(initial=0.0)]
    residual = known.residual - followed @ (followed.T @ known.residual)
    places, widths = _grid(known.energy)
    toward, by = np.column_stack([followed, residual]), known.by_eps
    strength = np.empty((len(widths), len(places)))
    gain = np.empty_like(strength)
    distance = places[:, None] ** 2 - known.energy**2
    pull, square = np.real(by) * distance, distance * distance
    for i, width in enumerate(widths):
        # The real part of by_eps times `oscillator`: complex numbers take three times as long.
        loss = known.energy * width
        change = (pull - np.imag(by) * loss) / (square + loss * loss)
        # what is left of it when the other parameters follow
        whole, seen = np.einsum("pr,pr->p", change, change), change @ toward
        size = np.maximum(whole - np.einsum("pq,pq->p", seen[:, :-1], seen[:, :-1]), _LEFT * whole)
        strength[i] = np.maximum(-seen[:, -1] / np.maximum(size, 1e-300), 0.0)
        gain[i] = strength[i] ** 2 * size
    width_at, place_at = np.unravel_index(np.resize(_summits(gain), count), gain.shape)
    out = np.repeat(y[:, None], count, 1)
    for row, best in zip(
        term, (strength[width_at, place_at], places[place_at], widths[width_at]), strict=True
    ):
        out[row] = np.log(np.maximum(best, 1e-300))
    return np.clip(out, fit.limits[0][:, None], fit.limits[1][:, None])
