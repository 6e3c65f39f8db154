"""Starts: even, within bounds, grown term by term; minima told apart."""

import numpy as np
import pytest

from fitting.problem.lanes import Ends
from fitting.samples.parameters import LOG, SQUARE, Parameter, Unknown
from fitting.searching.minima import Around, minima
from fitting.searching.starts import quasi_random, start_at, starts


@pytest.mark.parametrize("dimensions", [1, 2, 5, 12])
def test_points_fill_the_cube_more_evenly_than_chance(dimensions):
    points = quasi_random(256, dimensions, 3)
    assert ((points >= 0.0) & (points < 1.0)).all()
    for row in points:
        # 256 points in 16 boxes: by chance 16 +- 4, and 12 off in one of 200 boxes
        assert np.abs(np.histogram(row, 16, (0.0, 1.0))[0] - 16).max() <= 8
    assert (quasi_random(256, dimensions, 3) == points).all()
    assert (quasi_random(256, dimensions, 4) != points).any()


def test_starts_keep_to_bounds_priors_and_what_is_held():
    width = Parameter("width", "eV", (0.1, 10.0), 1e-3, 1e3, LOG, decades=True)
    k = Parameter("k", "", (1e-3, 10.0), 0.0, 1e3, SQUARE, decades=True)
    eta = Parameter("eta", "", (0.1, 5.0), 1e-4, 1e3, near=1.0)
    unknowns = [
        Unknown(width, 1e-3, 1e3), Unknown(width, 20.0, 30.0), Unknown(width, 3.0, 3.0),
        Unknown(k, 0.0, 0.5), Unknown(eta, 1e-4, 1e3), Unknown(eta, 1.0, 2.0),
        Unknown(eta, 1e-4, 1e3, (1.5, 0.01)), Unknown(width, 1e-3, 0.01),
    ]  # fmt: skip
    y = starts(unknowns, 64, 0)
    x = [np.exp(y[0]), np.exp(y[1]), np.exp(y[2]), np.sqrt(y[3]), *y[4:7], np.exp(y[7])]
    for values, (low, high) in zip(
        x, [(0.1, 10), (20, 30), (3, 3), (1e-3, 0.5), (0.1, 5), (1, 2), (1.48, 1.52), (1e-3, 0.01)],
        strict=True,
    ):  # fmt: skip
        assert (values >= low * (1 - 1e-12)).all() and (values <= high * (1 + 1e-12)).all()
    # as many below 1 as above it, in the logarithm
    assert (x[0] < 1.0).sum() == 32
    # half of the starts of an index crowd about that of the medium before, down to 1e-7
    assert np.abs(x[4] - 1.0).min() < 1e-6 and (np.abs(x[4] - 1.0) < 0.01).sum() >= 16
    given = start_at(unknowns, {"width": 2.0, "eta": 1.7})
    assert np.exp(given[0]) == pytest.approx(2.0) and given[4] == 1.7
    assert np.exp(given[1]) == pytest.approx(20.0) and np.exp(given[2]) == pytest.approx(3.0)


def test_minima_by_cost_and_place():
    y = np.array([[1.0, 1.001, 2.0, 5.0, 1.0, 2.0]])
    cost = np.array([10.0, 10.001, 12.0, 30.0, 9.0, 12.001])
    done = np.array([True, True, True, True, False, True])
    ends = Ends(y, cost, done, np.ones(6, int))
    near = Around(np.array([0.1]), np.array([[20.0]]))
    found = minima(ends, 1.0, 6.0, 0.0, lambda lane: near)
    assert [(m.lane, m.reached) for m in found] == [(0, 2), (2, 2)]
    # a valley that the data do not see the end of is one minimum
    valley = Around(np.array([np.inf]), np.array([[0.0]]))
    assert len(minima(ends, 1.0, 6.0, 0.0, lambda lane: valley)) == 1
    assert minima(ends._replace(done=~done & False), 1.0, 6.0, 0.0, lambda lane: near) == []


def test_what_only_changes_together_is_no_single_minimum():
    """Either parameter may change by 1, but not one without the other."""
    y = np.array([[0.0, 1.0, 1.0], [0.0, 1.0, -1.0]])
    ends = Ends(y, np.array([10.0, 11.0, 11.0]), np.ones(3, bool), np.ones(3, int))
    near = Around(np.array([4.0, 4.0]), 10.0 * np.array([[1.0, -1.0], [0.0, 0.1]]))
    assert [m.lane for m in minima(ends, 1.0, 6.0, 0.0, lambda lane: near)] == [0, 2]
