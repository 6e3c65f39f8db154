"""Profile likelihoods by brute force, which the intervals of model fits are held to.

One parameter is held, the others are fitted by scipy's least_squares from several starts, and the
place where the least cost has risen by the square of Student's t (or 1.96) is found by bisection.
"""

import numpy as np
from scipy import stats
from scipy.optimize import brentq, least_squares

from fitting import Measurement
from tests.truth.textbook import reflectances

ANGLES = np.linspace(20.0, 80.0, 13)
NORMAL = stats.norm.ppf(0.975) ** 2


def textbook(index, angle, quantity):
    found = reflectances(np.cos(np.radians(angle)), index)
    return np.where(quantity == "R_s", found["R_s"], found["R_p"])


def constant(x, wavelength):
    return x[0] + 1j * x[1] + 0.0 * wavelength


def cauchy(x, wavelength):
    return x[0] + x[1] / wavelength**2


def measured(index, x, angle, wavelength, noise, seed, quantities=("R_s", "R_p"), scale=1.0):
    angle, wavelength = (a.ravel() for a in np.meshgrid(angle, wavelength))
    random = np.random.default_rng(seed)
    columns = {
        q: scale * textbook(index(x, wavelength), angle, np.array(q))
        + noise * random.standard_normal(len(angle))
        for q in quantities
    }
    return Measurement.from_columns(angle, wavelength, sigma=noise, **columns)


def residuals(m, index, scaled=False):
    def of(x):
        R = textbook(index(x, m.wavelength_um), m.angle_deg, m.quantity)
        return ((x[2] * R if scaled else R) - m.value) / m.sigma

    return of


def floor(of, j, c, starts, low, high):
    """The least sum of squares with unknown j held at c."""
    others = [i for i in range(len(low)) if i != j]

    def held(z):
        x = np.empty(len(low))
        x[j], x[others] = c, z
        return of(x)

    inside = [np.clip(s[others], low[others] + 1e-12, high[others] - 1e-12) for s in starts]
    tight = {"xtol": 1e-14, "ftol": 1e-14, "gtol": 1e-14, "x_scale": np.abs(inside[0]) + 0.01}
    fits = [least_squares(held, z, bounds=(low[others], high[others]), **tight) for z in inside]
    return 2.0 * min(f.cost for f in fits)


def by_hand(of, starts, low, high, rise, step):
    """The intervals (P, 2) of all unknowns. rise: one for all ends, or of each, (P, 2)."""
    starts, low, high = np.array(starts), np.array(low), np.array(high)
    rises = np.broadcast_to(rise, (len(low), 2))
    best = starts[0]
    least = min(floor(of, j, best[j], starts, low, high) for j in range(len(best)))
    out = np.empty((len(best), 2))
    for j in range(len(best)):
        for side, (sign, limit) in enumerate(((-1.0, low[j]), (1.0, high[j]))):

            def above(c, j=j, side=side):
                return floor(of, j, c, starts, low, high) - least - rises[j, side]

            a = b = best[j]
            while True:
                b = b + sign * step[j]
                if sign * (b - limit) >= 0.0:
                    b = limit
                    if above(b) <= 0.0:
                        out[j, side] = limit
                        break
                if above(b) > 0.0:
                    out[j, side] = brentq(above, a, b, xtol=1e-5 * step[j])
                    break
                a = b
    return out  # fmt: skip


def assert_same(found, theirs, part=3e-3):
    """Within 3e-3 of half the width: the root of the rise is right to 1e-3 at the ends, and a floor
    that flattens makes more of that."""
    half = 0.5 * (theirs[:, 1] - theirs[:, 0])
    off = np.abs(found - theirs) / half[:, None]
    assert off.max() < part, (found, theirs)
