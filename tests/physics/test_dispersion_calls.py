"""How dispersion models are called: ranges, types, shapes, pytrees, refusals."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fresnel_jax import reflectance
from fresnel_jax.dispersion import (
    BrendelBormann,
    Cauchy,
    Constant,
    DrudeLorentz,
    Material,
    Sellmeier,
    Tabulated,
    drude,
    material,
)

GLASS = Sellmeier([1.03961212, 0.231792344, 1.01046945], [0.00600069867, 0.0200179144, 103.560653])


def test_wavelengths_outside_are_refused_or_nan():
    glass = Material(GLASS, (0.3, 2.5), "BK7")
    with pytest.raises(ValueError, match=r"BK7 is known from 0.3 to 2.5 um.*of 3 um came"):
        glass(np.array([0.5, 3.0]))
    with pytest.raises(ValueError, match=r"550 nm is 0.55"):
        glass(550.0)
    with pytest.raises(ValueError, match="nan um came"):
        glass(np.nan)
    wavelengths = jnp.array([0.1, 0.5, 3.0])
    eta, k = eqx.filter_jit(glass)(wavelengths)
    np.testing.assert_array_equal(np.isnan(eta), [True, False, True])
    np.testing.assert_array_equal(np.isnan(k), [True, False, True])
    # what lies outside, here on a pole, does not reach the derivative of what lies inside
    on_pole = Material(Sellmeier([1.0], [0.25]), (0.6, 2.5), "pole")
    slopes = jax.jit(jax.grad(lambda w: on_pole(w).eta[1]))(jnp.array([0.5, 0.7, 3.0]))
    assert slopes[1] != 0.0 and np.isfinite(slopes).all()
    # its own derivative is not known either, whatever asks for it
    for model in (glass, Material(Constant(1.5), (0.3, 2.5)), material("gold")):
        for derivative in (jax.jacfwd, jax.jacrev):
            of_all = jax.jit(derivative(lambda w, m=model: jnp.stack(m(w))))
            slopes = np.asarray(of_all(wavelengths))
            own = slopes[:, range(3), range(3)]
            np.testing.assert_array_equal(np.isnan(own), 2 * [[True, False, True]])
            assert not slopes[:, ~np.eye(3, dtype=bool)].any()
    # ends that were computed in other units
    assert np.isfinite(glass(2500.0 * 1e-3 * (1 + 2e-16)).eta)
    assert np.isfinite(Material(GLASS, (0.24797, 2.5))(np.float32(0.24797)).eta)
    # the formula itself extrapolates, a table does not
    assert np.isfinite(glass.model(3.0).eta)
    table = Tabulated([0.3, 0.7, 1.4], [1.0, 1.6, 1.2])
    with pytest.raises(ValueError, match=r"the table is known from 0.3 to 1.4 um"):
        table(1.5)
    assert np.isnan(jax.jit(lambda t, w: t(w).eta)(table, 1.5))
    assert np.isfinite(Material(GLASS, None)(20.0).eta)


def test_models_are_pytrees_that_map_and_compile():
    widths = jnp.array([[0.05], [0.1], [0.2]])
    models = jax.vmap(lambda g: DrudeLorentz([80.0], [0.0], g))(widths)
    eta, k = jax.jit(jax.vmap(lambda m, w: m(w), (0, None)))(models, jnp.array([0.5, 0.6]))
    assert eta.shape == k.shape == (3, 2)
    one = DrudeLorentz([80.0], [0.0], [0.1])(np.array([0.5, 0.6]))
    np.testing.assert_allclose(eta[1], one.eta, rtol=1e-14)
    # a metal's reflectance, differentiated with respect to the damping of its electrons
    slope = jax.jit(jax.grad(lambda m: reflectance(0.8, *m(0.6))))(drude(9.0, 0.05))
    assert np.isfinite(slope.widths_ev).all() and slope.widths_ev[0] < 0


def test_types_and_shapes_of_what_comes_back():
    single = jax.tree.map(lambda x: x.astype(np.float32), GLASS)
    assert GLASS(np.float32(0.5)).eta.dtype == np.float32
    assert single(np.float64(0.5)).eta.dtype == np.float64
    assert single(0.5).eta.dtype == np.float32 and GLASS(0.5).eta.dtype == np.float64
    assert GLASS([1, 2]).eta.dtype == np.float64
    assert Constant(1.5)(np.ones((2, 3), np.float32)).k.shape == (2, 3)
    assert Constant(1.5)(np.ones(2, np.float32)).eta.dtype == np.float32
    with jax.enable_x64(False):  # no warning (an error here) that float64 is not to be had
        assert GLASS(np.array([0.5])).eta.dtype == np.float32


@pytest.mark.parametrize(
    "build, text",
    [
        (lambda: Sellmeier([1.0, 2.0], [0.1]), r"strengths \(2,\), poles_um2 \(1,\)"),
        (lambda: Sellmeier([1.0], [0.1], 1.0, [0.1]), "as many powers as coefficients"),
        (lambda: Cauchy([1.5, 0.1], [0]), "as many powers as coefficients"),
        (lambda: DrudeLorentz([1.0], [0.0, 1.0], [0.1, 0.1]), "resonances_ev"),
        (lambda: BrendelBormann(1.0, 0.1, [1.0], [1.0], [0.1], [0.1, 0.2]), "deviations_ev"),
        (lambda: Tabulated([0.4, 0.3], [1.5, 1.5]), "ascending"),
        (lambda: Tabulated([0.3], [1.5]), "at least two"),
        (lambda: Tabulated([0.3, 0.4], [1.5]), "eta has shape"),
        (lambda: Tabulated([0.3, 0.4], [1.5, 1.5], [0.1, -0.1]), "k holds a value"),
        (lambda: Tabulated([0.3, 0.4], [1.5, np.nan]), "eta holds a value"),
        (lambda: Material(GLASS, (2.5, 0.3)), "the shorter one first"),
    ],
)
def test_wrong_parameters_are_refused(build, text):
    with pytest.raises(ValueError, match=text):
        build()
