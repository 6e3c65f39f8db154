"""A small run of the accuracy search, and the places that earlier searches found."""

import numpy as np
import pytest

from benchmarks import search_functions
from benchmarks.accuracy_search import FUNCTIONS, search
from benchmarks.search_quantities import PROGRAMS, QUANTITIES, errors

DTYPES = pytest.mark.parametrize("dtype", [np.float64, np.float32])

# Left to `make accuracy-search`: these compile, or their truths take, a minute each.
SLOW = ("stack", "BrendelBormann")

FOUND = [
    # R_p was 14.3 eps off, psi's gradient 650 eps
    ("R and T of s and p", 0.025124871623660606, 2.5913305176464387, 2.7328098188650033e-06,
     1.619801270789544),
    ("gradient of psi and Delta", 0.043154755027216454, 0.05000543104864758, 10.0,
     1.4443759724348906),
    ("R and T of s and p", 0.9999999999999984, 2.210995265956301, 0.0, 1.865632072519508),
    ("R and T of s and p", 0.9999998807907104, 1.047820806503296, 0.055474746972322464,
     0.047678861767053604),
    ("R and T of s and p", 0.024690748941673578, 94199.39447348083, 1.9874574374271377, 1.0),
    ("R and T of s and p", 0.9999994447723466, 1.000029459812154, 0.0, 1.0),
]  # fmt: skip


@DTYPES
@pytest.mark.parametrize("case", FOUND)
def test_places_that_were_found(case, dtype):
    name, *point = case
    points = [np.array([x], dtype) for x in point]
    for program in PROGRAMS if point[2] == 0.0 else ("all given", "no eta_i"):
        if ("eta_i" in program and point[3] != 1.0) or (program == "neither" and point[3] != 1.0):
            continue
        assert errors(name, program, points, dtype) <= QUANTITIES[name].bound_at(points)


@DTYPES
@pytest.mark.parametrize("name", QUANTITIES)
def test_a_short_search(name, dtype):
    for i, program in enumerate(PROGRAMS):
        random = np.random.default_rng([20261122, i])
        worst, place, _ = search(name, program, dtype, random, 512)
        assert worst <= 1.0, (program, place)


@pytest.mark.study
@DTYPES
@pytest.mark.parametrize("name", [x for x in FUNCTIONS if not any(y in x for y in SLOW)])
def test_a_short_search_of_every_other_function(name, dtype):
    entry = FUNCTIONS[name]
    bounds = {False: entry.bound, True: entry.gradient_bound}
    kinds = [gradient for gradient, bound in bounds.items() if bound is not None]
    for gradient in kinds:
        random = np.random.default_rng(20261122)
        worst, place, _ = search_functions.search(entry, gradient, dtype, random, 128)
        assert worst <= 1.0, (gradient, place)
