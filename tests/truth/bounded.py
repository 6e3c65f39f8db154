"""What the ends of intervals beside k = 0 should be, from the profile of chi2 over k^2 (or k)."""

import numpy as np
from scipy.stats import norm

from fitting.uncertainty.beside_zero import other_roots

# A grid of estimates, over which a share of repeats is a sum.
_X = np.linspace(-12.0, 12.0, 240_001)
WIDE = norm.ppf(0.975)


def share_held(v, rise):
    """How often an estimate about v >= 0, with an error of 1, has at most this rise at v."""
    x = v + _X
    at_v = (x - v) ** 2 - np.minimum(x, 0.0) ** 2
    return float(norm.pdf(_X)[at_v <= rise].sum() * (_X[1] - _X[0]))


def own_root(x, upper):
    """The root of the rise at an end of v for an estimate x: by bisection of `share_held`."""
    low, high = norm.ppf(0.95), WIDE
    if not upper and x <= low:
        return high  # the interval begins at 0
    for _ in range(40):
        root = 0.5 * (low + high)
        end = (x + np.hypot(x, root) if x < 0.0 else x + root) if upper else x - root
        inside = end <= 0.0 or share_held(end, root**2) > 0.95
        low, high = (low, root) if inside else (root, high)
    return root


def roots(v, rise, eta, sigma_eta):
    """The roots of the rise at the ends of eta and of v, ((low, high), (low, high)).

    v: a grid from 0 on beyond the upper end; rise: of chi2, eta: the best one, at each. sigma_eta:
    for known v. The rise is that of a parabola through 0, and x is exact where 0 is not the best.
    """
    best, near = rise.argmin(), rise < 2.0 * WIDE**2
    if best > 0:
        x = np.sqrt(rise[0])
        sigma = v[best] / x
    else:
        square, slope = np.linalg.lstsq(np.stack([v**2, v], 1)[near], rise[near], rcond=None)[0]
        sigma = 1.0 / np.sqrt(square)
        x = -0.5 * max(slope, 0.0) * sigma
    along = np.polyfit(v[near], eta[near], 1)[0] * sigma
    r = np.array(along / np.hypot(along, sigma_eta))
    of_eta = tuple(float(root) for root in other_roots(np.array(x), r))
    return of_eta, (own_root(x, False), own_root(x, True))
