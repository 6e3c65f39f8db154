"""Whether the residuals of a fit are noise, without autocorrelation along wavelength or angle.

    T = sum over neighbours of e_i e_j        (P. A. P. Moran, Biometrika 37, 17 (1950))

Neighbours are next to each other along one curve: in wavelength at one angle, and in angle at one
wavelength. If the signs of the e are random, those of the products along a line of neighbours are,
too, whatever the sizes of the e (these may differ from point to point; outliers are cut at three
standard deviations). So the distribution of T for given sizes is that of a sum of numbers with
random signs; where a few of them make most of the sum it is simulated. A fit removes from its
residuals what looks like the model, which makes neighbours less alike: the test rather misses a
pattern than invents one. The number of products that are positive, half by chance, is tested too.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import bdtrc

from fitting.data.measurement import Measurement
from fitting.residuals.noise import rounding
from fitting.residuals.residuals import residuals, weighted_residuals

# Noise is called a pattern by chance in one fit of four hundred, for each of two directions.
_CHANCE, _NORMAL = 2.5e-3, 2.81
# Number of draws of random signs for this many of the largest products; the sum of the others is
# taken as normal.
_DRAWS, _DRAWN = 20000, 100
# The same for the signs alone, which show a pattern that a few large residuals hide in T.
_SIGN_CHANCE = 5e-4
# With fewer neighbours random signs are all the same more often than that.
_LEAST = 10


class Pattern(NamedTuple):
    """along: "wavelength" or "angle"; correlation: of neighbours; chance: its limit for noise.

    alike, pairs: how many pairs of neighbours have the same sign, and how many there are.
    """

    along: str
    correlation: float
    chance: float
    alike: int = 0
    pairs: int = 0


def _usable(m: Measurement, fitted: np.ndarray, curve: np.ndarray, stated: bool) -> np.ndarray:
    """Return residuals with the weights of the fit, cut at 3 standard deviations; 0 if rounding.

    They are not divided by the deviation of each curve: the noise of one curve shifts the fit along
    a quieter one, where with 20 times less noise 3 % of the fits would be called a pattern.
    """
    off, out = residuals(m, fitted), weighted_residuals(m, fitted, stated)
    for c, q in {*zip(curve.tolist(), m.quantity.tolist(), strict=True)}:
        here = (curve == c) & (m.quantity == q)
        if np.sqrt(np.mean(off[here] ** 2)) <= rounding(m.value[here][None])[0]:
            out[here] = 0.0
    size = np.abs(out[out != 0.0])
    deviation = 1.4826 * np.median(size) if len(size) else 1.0
    return np.clip(out / deviation, -3.0, 3.0)


def _neighbours(groups: tuple[np.ndarray, ...], along: np.ndarray) -> np.ndarray:
    """Return pairs (P, 2) next to each other along one axis, within equal ``groups``."""
    order = np.lexsort((along, *groups))
    first, second = order[:-1], order[1:]
    same = np.ones(len(first), bool)
    for group in groups:
        same &= group[first] == group[second]
    # Repeats of a point are no step along the axis, but have the same sign if the model is wrong.
    return np.stack([first[same], second[same]], axis=1)


def repeats(*place: np.ndarray) -> np.ndarray:
    """Return of each datum how often its place came before."""
    which = np.unique(np.stack(place), axis=1, return_inverse=True)[1].ravel()
    order = np.argsort(which, kind="stable")
    first = np.searchsorted(which[order], which[order])
    out = np.empty(len(which), int)
    out[order] = np.arange(len(which)) - first
    return out


def _by_chance(products: np.ndarray) -> float:
    """Return the sum that products with random signs exceed with probability _CHANCE."""
    size = np.sort(np.abs(products))[::-1]
    large, rest = size[:_DRAWN], size[_DRAWN:]
    if (large**2).sum() ** 2 > 50.0 * (large**4).sum():
        return _NORMAL * float(np.sqrt((size**2).sum()))
    random = np.random.default_rng(0)
    signs = random.integers(0, 2, (_DRAWS, len(large)), dtype=np.int8)
    sums = (2.0 * signs - 1.0) @ large
    sums += np.sqrt((rest**2).sum()) * random.standard_normal(_DRAWS)
    return float(np.quantile(sums, 1.0 - _CHANCE))


def pattern(
    measurement: Measurement, fitted: np.ndarray, curve: np.ndarray, stated: bool = True
) -> Pattern | None:
    """Return the pattern in the residuals of a fit; None if they look like noise.

    measurement, fitted: (N,) data and the model at each. curve: (N,) number of the curve (a
    quantity of a file) of each datum. stated: whether errors, if there are any, are to be used.
    By chance .5 % of the fits to data with independent symmetric noise are called a pattern, for
    any number and sizes of errors (mean of 36 kinds of data, with 800 to 2000 fits each: .3 %, at
    most .8 %; twice that where rows are repeated), and none with fewer than 11 neighbours.
    """
    m = measurement
    if len(m) <= _LEAST or not np.isfinite(fitted).all():
        return None
    e = _usable(m, np.asarray(fitted), curve, stated)
    wavelength = np.where(np.isfinite(m.wavelength_um), m.wavelength_um, -1.0)
    light = np.where(np.isfinite(m.polarizer_deg), m.polarizer_deg, -1.0)
    _, kind = np.unique(m.quantity, return_inverse=True)
    together = (light, kind, curve)
    ways = [
        ("wavelength", wavelength, (m.angle_deg, *together)),
        ("angle", m.angle_deg, (wavelength, *together)),
    ]
    scan = repeats(m.angle_deg, wavelength, *together)
    if scan.any():
        # Of scans in one table each by itself, too: one may lie above the curve, the other below.
        ways += [(name, along, (*groups, scan)) for name, along, groups in ways]
    found = []
    for name, along, groups in ways:
        first, second = _neighbours(groups, along).T
        products = e[first] * e[second]
        pairs, alike = int(np.count_nonzero(products)), int((products > 0.0).sum())
        if pairs <= _LEAST:
            continue
        total, size = products.sum(), np.sqrt((e[first] ** 2).sum() * (e[second] ** 2).sum())
        # So many random signs or more are positive with less than this probability.
        by_signs = bdtrc(alike - 1, pairs, 0.5) < _SIGN_CHANCE
        if not by_signs and total <= 2.0 * np.sqrt((products**2).sum()):
            continue
        if total > (chance := _by_chance(products)) or by_signs:
            found.append(Pattern(name, float(total / size), chance / float(size), alike, pairs))
    return max(found, key=lambda p: p.correlation / p.chance, default=None)
