"""The largest difference of two models over wavelengths and angles: a dense grid, then refinement.

Nothing is assumed of the difference (it has kinks at critical angles, at absolute values, and noise
where it is rounding): each of the best cells of the grid is sampled ever more finely around the
largest value found. The samples are sheared along the ridge that they show: the cusp at a critical
angle moves with the wavelength, and cells along the axes missed its top by 1e-4. A peak narrower
than the grid is missed; the grid is therefore dense where R changes fast, towards grazing
incidence, critical and Brewster's angles, and at knots of tables.
"""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

_WAVELENGTHS = 97
_ANGLES = 181
_DECADES = 10.0 ** np.arange(-7.0, 0.6, 0.5)  # degrees from a special angle
# distances from a special wavelength, as parts of the range of wavelengths
FROM_SPECIAL = 0.1 * np.concatenate([-_DECADES, [0.0], _DECADES])
_BLOCKS = (8, 12)  # the best cell of each block of the grid is refined
_EPS = float(np.finfo(float).eps)
_SAMPLES = 9  # per axis and round
_ROUNDS_BEFORE, _ROUNDS = 4, 24
_NARROWING = 3.0  # of a cell per round: to 3e-12 of a cell of the grid
# A cell is left when ten times what its last two rounds added would not reach the largest found. At
# a cusp, where the gain falls by sqrt(3) a round, four times are left to come.
_PATIENCE = 10.0


class Place(NamedTuple):
    """A difference, and where it is found."""

    error: float
    wavelength_um: float
    angle_deg: float


def wavelength_grid(low: float, high: float, knots: Iterable[float] = ()) -> np.ndarray:
    inside = [x for x in knots if low < x < high]
    return np.unique(np.concatenate([np.linspace(low, high, _WAVELENGTHS), inside]))


def crossings(function: Callable[[np.ndarray], np.ndarray], grid: np.ndarray) -> np.ndarray:
    """Where `function` changes sign between two points of the grid, to an eps."""

    def brackets(points):
        values = function(points)
        i = np.flatnonzero(np.signbit(values[:-1]) != np.signbit(values[1:]))
        return zip(points[i], points[i + 1], strict=True)

    found = []
    for low, high in brackets(grid):
        for _ in range(6):
            (low, high), *_ = (*brackets(np.linspace(low, high, 513)), (low, high))
        found.append(0.5 * (low + high))
    return np.array(found)


def angle_grid(low: float, high: float, relative_index: np.ndarray) -> np.ndarray:
    """Angles in degrees, (rows, angles), for real parts of relative indices, (rows, indices)."""
    common = np.concatenate([np.linspace(low, high, _ANGLES), 90.0 - _DECADES])
    critical = np.degrees(np.arcsin(np.minimum(relative_index, 1.0)))
    brewster = np.degrees(np.arctan(relative_index))
    special = np.concatenate([critical, brewster], axis=1)
    around = special[:, :, None] + np.concatenate([-_DECADES, [0.0], _DECADES])
    rows = np.broadcast_to(common, (len(special), len(common)))
    return np.sort(np.clip(np.hstack([rows, around.reshape(len(special), -1)]), low, high), axis=1)


def cosine(angle_deg: np.ndarray) -> np.ndarray:
    # exact to an eps also next to 90 degrees, where cos(radians(angle)) is not
    return np.sin(np.radians(90.0 - angle_deg))


def _best_cells(difference, errors, wavelengths, angles):
    """Wavelength, half width, angle, half width of the best cells: arrays of one length.

    Angles are refined at every wavelength first: the wavelength whose angles happened to lie best
    would win otherwise.
    """
    blocks = np.array_split(np.arange(angles.shape[1]), _BLOCKS[1])
    best = np.stack([x[0] + np.argmax(errors[:, x], axis=1) for x in blocks], axis=1)
    neighbours = (np.clip(best + x, 0, angles.shape[1] - 1) for x in (-1, 0, 1))
    before, angle, after = (np.take_along_axis(angles, x, 1) for x in neighbours)
    width = np.maximum(angle - before, after - angle)
    steps, low, high = np.linspace(-1.0, 1.0, _SAMPLES), angles.min(), angles.max()
    for _ in range(_ROUNDS_BEFORE):
        along = np.clip(angle[:, :, None] + width[:, :, None] * steps, low, high)
        tried = difference(wavelengths[:, None, None], along)
        place = np.argmax(tried, axis=2)[:, :, None]
        angle, errors = (np.take_along_axis(x, place, 2)[:, :, 0] for x in (along, tried))
        width = width / _NARROWING
    step = np.diff(wavelengths, append=wavelengths[-1], prepend=wavelengths[0])
    rows = np.array_split(np.arange(len(wavelengths)), min(_BLOCKS[0], len(wavelengths)))
    i = np.stack([x[0] + np.argmax(errors[x], axis=0) for x in rows])
    j = np.broadcast_to(np.arange(i.shape[1]), i.shape)
    i, j = i.ravel(), j.ravel()
    return wavelengths[i], np.maximum(step[i], step[i + 1]), angle[i, j], 3.0 * width[i, j]


def largest(
    difference: Callable[[np.ndarray, np.ndarray], np.ndarray],
    wavelengths: np.ndarray,
    angles: np.ndarray,
    enough: float = np.inf,
) -> Place:
    """The largest of `difference(wavelength_um, angle_deg)` and its place.

    `wavelengths` has shape (w,), `angles` (w, a); `difference` broadcasts its arguments.
    The search ends with the first difference found that exceeds `enough`.
    """
    errors = difference(wavelengths[:, None], angles)
    i, j = np.unravel_index(np.argmax(errors), errors.shape)
    best = Place(float(errors[i, j]), float(wavelengths[i]), float(angles[i, j]))
    if best.error > enough:
        return best
    centre, width, angle, angle_width = _best_cells(difference, errors, wavelengths, angles)
    low, high = angles.min(), angles.max()
    steps = np.linspace(-1.0, 1.0, _SAMPLES)
    slope, earlier = np.zeros(len(centre)), np.full((2, len(centre)), -np.inf)
    for _ in range(_ROUNDS):
        if best.error > enough or len(centre) == 0:
            break
        each = np.arange(len(centre))
        across = np.clip(centre[:, None] + width[:, None] * steps, wavelengths[0], wavelengths[-1])
        along = (angle + slope * (across.T - centre)).T[:, :, None]
        along = np.clip(along + np.multiply.outer(angle_width, steps)[:, None], low, high)
        tried = difference(across[:, :, None], along)
        i = np.argmax(tried.max(axis=2), axis=1)
        ridge = np.take_along_axis(along, tried.argmax(axis=2)[:, :, None], 2)[:, :, 0]
        centre, angle, found = across[each, i], ridge[each, i], tried.max(axis=(1, 2))
        before, after = np.maximum(i - 1, 0), np.minimum(i + 1, _SAMPLES - 1)
        run = across[each, after] - across[each, before]
        rise = ridge[each, after] - ridge[each, before]
        slope = np.where(run > 0.0, rise / np.where(run > 0.0, run, 1.0), 0.0)
        # a top at the edge of its cell is still being climbed to: the cell moves and keeps its size
        inside = (i > 0) & (i < _SAMPLES - 1) | np.isin(centre, wavelengths[[0, -1]])
        width = np.where(inside, width / _NARROWING, width)
        place = np.argmax(tried[each, i], axis=1)
        inside = (place > 0) & (place < _SAMPLES - 1) | np.isin(angle, (low, high))
        angle_width = np.where(inside, angle_width / _NARROWING, angle_width)
        top = int(np.argmax(found))
        if found[top] > best.error:
            best = Place(float(found[top]), float(centre[top]), float(angle[top]))
        going = found + _PATIENCE * (found - earlier[0]) > best.error * (1.0 + _EPS)
        earlier = np.stack([earlier[1], found])[:, going]
        centre, width, angle, angle_width, slope = (
            x[going] for x in (centre, width, angle, angle_width, slope)
        )
    return best
