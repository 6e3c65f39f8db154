"""Ends of eta and k beside k = 0, between those of two rises, for a quadratic cost."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import norm

from fitting.bare_surface.bounded_k import _Beside, _between, _on_the_edge
from tests.truth.bounded import WIDE

R = 0.97  # the correlation of eta and v
NARROW = norm.ppf(0.95)


def end_of_eta(x, root, side):
    """Where the rise has this root: v without the bound is x, eta 0, with errors of 1."""

    def rise(e):
        v = max(x + R * e, 0.0)
        off = e * e - 2.0 * R * e * (v - x) + (v - x) ** 2
        return off / (1.0 - R * R) - min(x, 0.0) ** 2

    best = -R * min(x, 0.0)
    return brentq(lambda e: rise(e) - root**2, best, best + side * 9.0, xtol=1e-13)


@pytest.mark.parametrize("x", [-2.0, -0.3, 0.9])
def test_beyond_the_usual_rise_the_end_lies_on_the_edge(x):
    """Where v is smaller (eta, too), a root of 2.05 is due. In proportion it would lie up to a
    third of a standard error of eta for known v too far out."""
    both = [np.array([[end_of_eta(x, r, -1.0), end_of_eta(x, r, 1.0)]]) for r in (NARROW, WIDE)]
    roots = np.array([2.05]), np.array([1.8])
    sigma = np.sqrt(1.0 - R * R)
    b = _Beside(np.array([x]), np.array([R]), np.array([sigma]))
    found = _between(roots, *both) + _on_the_edge(b, roots)
    assert found[0, 0] == pytest.approx(end_of_eta(x, 2.05, -1.0), abs=1e-9)
    # Between the two rises in proportion to the root, which is not quite linear beside the bound.
    assert found[0, 1] == pytest.approx(end_of_eta(x, 1.8, 1.0), abs=0.01)
