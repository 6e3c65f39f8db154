"""Oscillators: where the next one of a medium is, and others far above the spectrum.

The next one is at the lines that explain most of the residuals. The index changes in proportion to
the strength of a weak oscillator, and a datum depends on the index at its own wavelength only. So
two derivatives, with respect to eps_1 and eps_2 of the medium, give the effect of an oscillator of
any resonance and width on all data. From a grid of these the ones are taken that lower the sum of
squares most when the other parameters are fitted as well.

Of an oscillator above the spectrum the data hardly tell the resonance. Below it an oscillator adds
S / (E0^2 - E^2) to eps. The data see the value and the slope of that, and the value alone may also
come from eps_inf: resonances from just above the spectrum to far in the ultraviolet describe them
nearly as well, along a valley so narrow and curved that a solver rests on its way. One fit rested
20.7 of chi2 above the end of the valley. Other resonances are therefore tried beside the lowest
minima, each with the strength, and the eps_inf, that keep the slope and the value.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fitting.problem.lanes import LANES, Ends, best_of, joined
from fitting.problem.problem import Problem
from fitting.problem.unknowns import terms_of
from fitting.samples.parameters import LOG, from_parameter, value_and_slope
from fitting.searching.last_steps import followed
from fitting.searching.minima import lowest_ends
from fresnel_jax.dispersion import HC_EV_UM

# Widths of the grid, evenly in the logarithm from half the step between two measured energies to
# the largest energy; resonances within the spectrum, two for each step up to this number; and
# resonances outside.
_WIDTHS, _PLACES, _BESIDE = 12, 256, 8
_BELOW, _ABOVE = 0.7, 1.7
# Directions of the other parameters with less than this part of the largest effect are rounding,
# and so is what is left of the effect of a line below this part of its square.
_SEEN, _LEFT = 1e-9, 1e-12
# Of 2,000 wavelengths every second one is looked at, of 3,000 every third, and so on.
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
    distinct, place = np.unique(energy, return_inverse=True)
    some = place % max(len(distinct) // _MANY, 1) == 0
    return Responses(*(a[some] for a in known))


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


def _condensed(known: Responses, toward: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return energies, by_eps and ``toward`` (R, q) of two data at each energy, or as they are.

    What changes of eps at one energy do to all data there has two directions at most: of several
    angles and quantities these, from Gram and Schmidt's method, are enough.
    """
    # one energy after the other, and where each begins
    order = np.argsort(known.energy, kind="stable")
    energy, begins, count = np.unique(known.energy[order], return_index=True, return_counts=True)
    if 2 * len(energy) >= len(order):
        return known.energy, known.by_eps, toward
    by, toward = known.by_eps[order], toward[order]

    def along(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the size of x (R,) at each energy, and its direction."""
        size = np.sqrt(np.add.reduceat(x * x, begins))
        return size, x / np.repeat(np.where(size > 0.0, size, 1.0), count)

    size, first = along(np.real(by))
    turn = np.add.reduceat(first * np.imag(by), begins)
    rest, second = along(np.imag(by) - first * np.repeat(turn, count))
    seen = [np.add.reduceat(one[:, None] * toward, begins) for one in (first, second)]
    return np.tile(energy, 2), np.concatenate([size + 1j * turn, 1j * rest]), np.concatenate(seen)


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
    energy, by, toward = _condensed(known, np.column_stack([followed, residual]))
    strength = np.empty((len(widths), len(places)))
    gain = np.empty_like(strength)
    distance = places[:, None] ** 2 - energy**2
    pull, square = np.real(by) * distance, distance * distance
    for i, width in enumerate(widths):
        # The real part of by_eps times `oscillator`: complex numbers take three times as long.
        loss = energy * width
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


# Resonances that are tried, in units of that of each of so many of the lowest minima.
_FACTORS, _PARENTS = (0.5, 0.65, 0.8, 0.9, 1.12, 1.25, 1.6, 2.2), 4
# Resonances nearer to the spectrum, as a factor on its largest energy, are not far above it.
_FAR = 1.02
# Number of rounds, and the fall of chi2 from which on another one follows.
_ROUNDS, _FALL = 3, 1e-3


def with_far_oscillators(fit: Problem, ends: Ends, noise: float) -> Ends:
    """Return the ends, and those with other resonances of the oscillators above the spectrum."""
    if fit.lanes < LANES or not oscillators(fit):
        return ends
    for _ in range(_ROUNDS if best_of(ends) is not None else 0):
        least = float(ends.cost.min())
        start = _other_resonances(fit, lowest_ends(ends)[:, :_PARENTS])
        if not start.shape[1]:
            break
        ends = joined([ends, followed(fit, start, noise, least)])
        if not ends.cost.min() < least - _FALL * fit.unit(least):
            break
    return ends


def _other_resonances(fit: Problem, y: np.ndarray) -> np.ndarray:
    """Return y (p, L) with each oscillator above the spectrum at other resonances, (p, S)."""
    energy = HC_EV_UM / fit.seen.points.wavelength_um[fit.seen.measured, 0]
    amid = float(np.median(energy))
    row = {name: i for i, name in enumerate(fit.u.spec.moving)}
    out = [y[:, :0]]
    for strength, resonance, _ in oscillators(fit):
        place = fit.u.spec.moving[strength].rpartition(".")[0]
        background = row.get(f"{place}.eps_inf")
        for factor in _FACTORS:
            S, E0 = np.exp(y[[strength, resonance]])
            far = np.minimum(E0, factor * E0) > _FAR * energy.max()
            S, E0, moved = S[far], E0[far], y[:, far]
            before, after = E0**2 - amid**2, (factor * E0) ** 2 - amid**2
            moved[resonance] = np.log(factor * E0)
            moved[strength] = np.log(S * (after / before) ** 2)
            if background is not None:
                kind = fit.u.moving[background].parameter.coordinate
                eps, _ = value_and_slope(kind, moved[background])
                eps = eps + S / before - S * after / before**2
                moved[background] = from_parameter(kind, eps)
            out.append(moved)
    low, high = (a[:, None] for a in fit.limits)
    return np.clip(np.concatenate(out, 1), low, high)
