"""Tables of an index and what lies between their rows."""

import jax
import numpy as np
import pytest
from scipy import interpolate

from fresnel_jax.dispersion import Tabulated

both_types = pytest.mark.parametrize("dtype", [np.float64, np.float32])


def test_tables_are_met_exactly_and_never_overshoot():
    """Against scipy's interpolant with the same slopes, and by what it is chosen for."""
    random = np.random.default_rng(11)
    knots = np.cumsum(random.uniform(0.01, 0.2, 40)) + 0.2
    eta, k = random.uniform(0.2, 4.0, 40), np.sort(10.0 ** random.uniform(-25, 1, 40))[::-1]
    table = Tabulated(knots, eta, k)
    at_knots = table(knots)
    np.testing.assert_array_equal(at_knots.eta, eta)
    np.testing.assert_array_equal(at_knots.k, k)
    fine = np.linspace(knots[0], knots[-1], 4001)
    result = table(fine)
    np.testing.assert_allclose(
        result.eta, interpolate.PchipInterpolator(knots, eta)(fine), rtol=1e-13
    )
    np.testing.assert_allclose(
        result.k, interpolate.PchipInterpolator(knots, k)(fine), rtol=1e-9, atol=1e-15
    )
    left = np.clip(np.searchsorted(knots, fine, side="right") - 1, 0, 38)
    for values, column in ((result.eta, eta), (result.k, k)):
        bounds = np.sort([column[left], column[left + 1]], axis=0)
        assert (np.asarray(values) >= bounds[0] * (1 - 1e-15)).all()
        assert (np.asarray(values) <= bounds[1] * (1 + 1e-15)).all()
    assert (np.diff(np.asarray(result.k)) <= 0).all()  # over 26 decades
    slope = jax.jit(jax.vmap(jax.grad(lambda w: table(w).eta)))
    inner = knots[1:-1]
    np.testing.assert_allclose(slope(inner * (1 - 1e-13)), slope(inner), atol=1e-7)


@pytest.mark.parametrize("order", [1, -1])
def test_no_overshoot_at_the_ends_of_a_table(order):
    """A small step before a large one the other way: the parabola through the three overshoots."""
    knots, eta = np.array([0.4, 0.5, 0.6, 0.7]), np.array([1.5, 1.52, 1.0, 0.9])
    knots, eta = (knots, eta) if order == 1 else (1.1 - knots[::-1], eta[::-1])
    fine = np.linspace(knots[0], knots[-1], 3001)
    values = np.asarray(Tabulated(knots, eta)(fine).eta)
    assert values.max() <= 1.52 * (1 + 1e-15)
    expected = interpolate.PchipInterpolator(knots, eta)(fine)
    np.testing.assert_allclose(values, expected, rtol=1e-13)


def test_a_flat_table_has_finite_derivatives():
    """Both secants are 0 there, and so is the denominator of their harmonic mean."""
    flat = Tabulated(np.array([0.4, 0.6, 0.8, 1.0]), np.full(4, 1.5))
    by_table, by_wavelength = jax.jit(jax.grad(lambda t, w: t(w).eta, (0, 1)))(flat, 0.7)
    assert by_wavelength == 0.0
    assert np.isfinite(by_table.eta).all() and np.isfinite(by_table.wavelength_um).all()
    np.testing.assert_allclose(by_table.eta, [0.0, 0.5, 0.5, 0.0], atol=1e-15)


def test_interpolation_error_falls_with_the_step():
    """As the cube of the step where the function is monotone, the slopes being second-order."""

    def largest_error(rows):
        knots = np.linspace(0.3, 1.0, rows)
        fine = np.linspace(0.35, 0.95, 2001)
        return np.abs(
            np.asarray(Tabulated(knots, 1 + knots**-2.0)(fine).eta) - 1 - fine**-2.0
        ).max()

    coarse, fine = largest_error(41), largest_error(81)
    assert 6.5 < coarse / fine < 20.0
    assert fine < 2e-5


@both_types
def test_small_tables_and_types(dtype):
    line = Tabulated(np.array([0.4, 0.8], dtype), np.array([1.0, 2.0], dtype))
    eta, k = line(np.array([0.4, 0.5, 0.8], dtype))
    assert eta.dtype == dtype
    np.testing.assert_allclose(eta, [1.0, 1.25, 2.0], rtol=4 * np.finfo(dtype).eps)
    assert not np.asarray(k).any()
    # k whose products of slopes underflow in float32
    knots, k = np.array([0.4, 0.6, 0.8, 1.0]), np.array([1e-22, 3e-23, 1e-24, 1e-25])
    between = np.array([0.5, 0.7, 0.9])
    tiny = Tabulated(knots.astype(dtype), np.ones(4, dtype), k.astype(dtype))
    true = interpolate.PchipInterpolator(knots, k * 1e25)(between) * 1e-25
    np.testing.assert_allclose(tiny(between.astype(dtype)).k, true, rtol=64 * np.finfo(dtype).eps)


def test_the_slope_at_the_ends_is_that_within():
    """d_0 + (d_0 - d_1) h_0 / (h_0 + h_1) with the slopes d and steps h of the first two pieces."""
    table = Tabulated([0.4, 0.5, 0.7, 0.9], [1.5, 1.45, 1.42, 1.41])
    by_hand, slope = -0.5 - 0.35 / 3.0, jax.jit(jax.grad(lambda w: table(w).eta))
    for wavelength in (0.4, 0.4 + 1e-12, 0.4 - 1e-16):
        assert float(slope(wavelength)) == pytest.approx(by_hand)
    last, inside = (float(slope(w)) for w in (0.9, 0.9 - 1e-12))
    assert last == pytest.approx(inside, rel=1e-9)
