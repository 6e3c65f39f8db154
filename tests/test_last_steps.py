"""The last steps to a minimum, where the solver of many lanes has left off."""

from types import SimpleNamespace

import numpy as np

from fitting.searching.film_parts import PARTS, parts
from fitting.searching.last_steps import polished


def a_bent_valley(highest=2.0):
    """Return a fit of residuals 10 (y_1 - y_0^2) and 1 - y_0 (H. H. Rosenbrock, 1960)."""

    def slopes(y):
        residual = np.array([10.0 * (y[1] - y[0] ** 2), 1.0 - y[0]])
        return SimpleNamespace(
            residual=residual, jacobian=np.array([[-20.0 * y[0], 10.0], [-1.0, 0.0]])
        )

    def known(s, y, noise):
        return SimpleNamespace(step=np.linalg.solve(s.jacobian, -s.residual))

    return SimpleNamespace(
        u=SimpleNamespace(
            spec=SimpleNamespace(loss="squares"), free=np.array([True, True]), moving=[]
        ),
        asked=SimpleNamespace(scaled=False), dof=1,
        limits=(np.array([-2.0, -2.0]), np.array([2.0, highest])),
        slopes=slopes, known=known, cost=lambda s, y, noise: float(s.residual @ s.residual),
    )  # fmt: skip


def test_the_bottom_of_a_bent_valley_is_reached_where_a_full_step_leads_up_its_side():
    start = np.array([-1.2, 1.0])
    fit = a_bent_valley()
    uphill = start + fit.known(fit.slopes(start), start, 1.0).step
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


def test_parts_of_a_spectrum_hold_every_row_once():
    waves = np.repeat(np.linspace(0.4, 0.8, 70), 2)
    points = SimpleNamespace(wavelength_um=np.append(waves, [0.8] * 4)[:, None])
    seen = SimpleNamespace(points=points, measured=np.arange(len(waves) + 4) < len(waves))
    found = parts(seen)
    assert len(found) == PARTS
    assert (np.sum(found, axis=0) == np.append(np.ones(140), np.zeros(4))).all()
    few = SimpleNamespace(wavelength_um=waves[:, None][:60])
    assert parts(SimpleNamespace(points=few, measured=np.ones(60, bool))) == []
