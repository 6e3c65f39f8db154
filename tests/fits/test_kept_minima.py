"""What is kept of the arrivals of a curve: the lowest minima, each once."""

import numpy as np
import pytest

from fitting.bare_surface.descent import Solved
from fitting.bare_surface.estimate import Estimated
from fitting.bare_surface.kept_minima import OTHERS, with_arrival
from fitting.bare_surface.other_solutions import _distinct


def arrival(x, cost, done=1.0):
    fields = dict.fromkeys(Solved._fields, 1.0) | {"x": x, "w": 0.5, "cost": cost, "done": done}
    return np.array([[fields[name]] for name in Solved._fields])


def kept(*arrivals):
    found = np.full((1 + OTHERS, len(Solved._fields), 1), np.nan)
    found[0] = arrivals[0]
    for one in arrivals[1:]:
        found = with_arrival(found, one)
    return [Solved(*one[:, 0]) for one in found]


def test_the_lowest_come_first_and_the_highest_is_dropped():
    found = kept(*(arrival(x, cost) for x, cost in ((1.0, 5.0), (2.0, 3.0), (3.0, 4.0))))
    assert [s.cost for s in found[:3]] == [3.0, 4.0, 5.0]
    assert found[0].evaluations == 3.0  # of all starts
    many = kept(*(arrival(float(i), 9.0 - i) for i in range(1, 8)))
    assert [s.cost for s in many] == [2.0, 3.0, 4.0, 5.0]


def test_one_minimum_is_kept_once():
    again = kept(arrival(1.0, 5.0), arrival(1.0 + 1e-6, 4.999))
    assert again[0].cost == 5.0  # which is lower is a matter of rounding
    assert np.isnan(again[1].cost)


def test_what_came_to_rest_replaces_what_was_cut_off_beside_it():
    found = kept(arrival(1.0, 5.0, done=0.0), arrival(1.0 + 1e-6, 4.999))
    assert found[0].done == 1.0
    assert found[0].cost == 4.999
    assert np.isnan(found[1].cost)


@pytest.mark.parametrize(("eta", "k", "another"), [
    (1.5, 0.5, False), (1.5 + 0.5e-3, 0.5 + 0.5e-3, False), (1.5, 0.6, True), (1.52, 0.5, True),
    (np.nan, 0.5, False),
])  # fmt: skip
def test_another_solution_differs_in_eta_or_in_k_by_more_than_the_errors(eta, k, another):
    # eta and k^2 known to .001, without correlation
    information = np.array([[[1e6, 0.0], [0.0, 1e6]]])
    own = dict.fromkeys(Estimated._fields, np.zeros(1)) | {
        "eta": np.array([1.5]), "k": np.array([0.5]), "sigma_eta": np.array([1e-3]),
        "information": information, "variance": np.ones(1),
    }  # fmt: skip
    best = Estimated(**own)
    other = best._replace(eta=np.array([eta]), k=np.array([k]))
    assert _distinct(best, other).tolist() == [another]
