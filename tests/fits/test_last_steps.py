"""The last steps to a minimum, where the solver of many lanes has left off."""

from types import SimpleNamespace

import numpy as np

from fitting.problem.lanes import Ends
from fitting.problem.slopes import Slopes
from fitting.searching.last_steps import followed, polished
from fitting.uncertainty.covariance import uncertainty_at


def a_bent_valley(highest=2.0):
    """Return a fit of residuals 10 (y_1 - y_0^2) and 1 - y_0 (H. H. Rosenbrock, 1960)."""

    def slopes(y):
        residual = np.array([10.0 * (y[1] - y[0] ** 2), 1.0 - y[0]])
        jacobian = np.array([[-20.0 * y[0], 10.0], [-1.0, 0.0]])
        nothing = np.empty(0)  # these residuals are of no curve
        return Slopes(nothing, residual, jacobian, nothing, nothing, nothing)

    return SimpleNamespace(
        u=SimpleNamespace(
            spec=SimpleNamespace(loss="squares", priors=False), free=np.array([True, True]),
            moving=[], size=2,
        ),
        asked=SimpleNamespace(scaled=False), dof=1, seen=SimpleNamespace(stated=True), pooled=None,
        limits=(np.array([-2.0, -2.0]), np.array([2.0, highest])),
        slopes=slopes, cost=lambda s, y, noise: float(s.residual @ s.residual),
        lost=lambda s, y: np.array([False, False]), looked=0, squares=1.0,
    )  # fmt: skip


def test_the_bottom_of_a_bent_valley_is_reached_where_a_full_step_leads_up_its_side():
    start = np.array([-1.2, 1.0])
    fit = a_bent_valley()
    uphill = start + uncertainty_at(fit, fit.slopes(start), start, 1.0).step
    assert fit.cost(fit.slopes(uphill), uphill, 1.0) > fit.cost(fit.slopes(start), start, 1.0)
    y, s = polished(fit, start, 1.0)
    np.testing.assert_allclose(y, 1.0, atol=1e-6)
    assert fit.cost(s, y, 1.0) < 1e-10


def test_a_valley_is_followed_within_the_bounds():
    start = np.array([-1.2, 0.4])
    fit = a_bent_valley(highest=0.5)
    y, s = polished(fit, start, 1.0)
    assert y[1] <= 0.5
    # With y_1 at its bound .5 the residual 1 - y_0 pulls y_0 a little above the root of .5
    grid = np.linspace(0.0, 1.0, 100_001)
    lowest = (100.0 * (0.5 - grid**2) ** 2 + (1.0 - grid) ** 2).min()
    assert abs(fit.cost(s, y, 1.0) - lowest) < 1e-6


def test_a_start_goes_on_while_it_falls_by_more_than_it_is_above_the_best():
    """Every start has a course of its own, which its place says; at rest it stays where it is."""
    courses = np.array([
        [1279.0, 645.0, 521.0, 488.5, 488.5],  # falls fast from far above
        [700.0, 650.0, 610.0, 500.0, 400.0],  # too slowly: by 90 in two looks, and 94 above
        [515.0, 514.9, 514.8, 514.7, 514.7],  # is below the best
        [600.0, np.inf, np.inf, np.inf, np.inf],
    ])  # fmt: skip

    def held(y, noise, steps):
        which, stage = y.astype(int)
        after = np.minimum(stage + 1, 4)
        rests = (after == 4) & (which != 1)
        return Ends(np.stack([which, after]), courses[which, stage], rests, np.full(len(which), 60))

    fit = SimpleNamespace(held=held, in_order=lambda y: y)
    start = np.stack([np.arange(4), np.zeros(4, int)])
    assert followed(fit, start, 1.0, 516.0).cost.tolist() == [488.5, 610.0, 514.7, np.inf]
    assert followed(fit, start, 1.0, np.inf).cost.tolist() == [488.5, 400.0, 514.7, np.inf]
