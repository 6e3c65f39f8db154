"""Every argument that is an index takes a real, a complex one or an `Index`, and no other tuple."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fresnel_jax import approximate, bsdf, directions, interface, layers, performance, polarization
from fresnel_jax.dispersion import Index, material

GOLD = material("gold")(0.55)
GLASS = Index(jnp.asarray(1.5), jnp.asarray(0.0))
ONE_BOUNDARY = [
    interface.powers,
    interface.reflectance,
    interface.amplitudes,
    interface.fresnel_conductor,
    polarization.phases,
    polarization.ellipsometric_ratio,
    polarization.psi_delta,
    polarization.mueller_reflection,
    lambda c, *index: polarization.penetration_depth(c, *index, wavelength_um=0.55),
    lambda c, *index: layers.slab(c, *index, thickness_um=0.01, wavelength_um=0.55),
    approximate.schlick,
    approximate.lazanyi_szirmay_kalos,
    approximate.f82,
    approximate.large_index,
    approximate.polynomial,
    lambda c, *index: approximate.normal_reflectance(*index),
    lambda c, *index: approximate.gulbrandsen_parameters(*index),
    lambda c, *index: bsdf.FresnelConductor(*index)(c),
]
FURTHER = (
    polarization.phases, polarization.ellipsometric_ratio, polarization.mueller_reflection,
    approximate.lazanyi_szirmay_kalos, approximate.f82, approximate.large_index,
)  # fmt: skip


# Of functions that hand their index on in the same way, one.
@pytest.mark.parametrize("function", [
    pytest.param(f, marks=[pytest.mark.study] * (f in FURTHER)) for f in ONE_BOUNDARY
])  # fmt: skip
def test_three_spellings_are_one_index(function):
    """`reflectance(.9, gold)` without the star was [1.0, .18], two lossless media, for .792."""
    pair = function(0.9, *GOLD)
    for index in (GOLD, GOLD.complex):
        for a, b in zip(*map(jax.tree.leaves, (function(0.9, index), pair)), strict=True):
            np.testing.assert_array_equal(a, b)
    traced = jax.jit(lambda n: function(0.9, n))(GOLD)
    for a, b in zip(*map(jax.tree.leaves, (traced, pair)), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-6)
    with pytest.raises(ValueError, match="eta is a tuple of 2"):
        function(0.9, tuple(GOLD))
    with pytest.raises(ValueError, match="already contains k"):
        function(0.9, GOLD, 0.1)


def test_the_gradient_by_an_index_is_an_index():
    by_pair = jax.grad(interface.reflectance, argnums=(1, 2))(0.9, *GOLD)
    by_index = jax.grad(interface.reflectance, argnums=1)(0.9, GOLD)
    assert isinstance(by_index, Index)
    np.testing.assert_allclose(by_index, by_pair, rtol=1e-6)


@pytest.mark.parametrize("exact", [pytest.param(True, marks=pytest.mark.study), False])
def test_media_of_a_stack(exact):
    want = layers.stack(
        0.9, [1.0, GOLD.complex, 1.5], thickness_um=[0.01], wavelength_um=0.55, exact=exact
    )
    got = layers.stack(
        0.9, [1.0, GOLD, GLASS], thickness_um=[0.01], wavelength_um=0.55, exact=exact
    )
    np.testing.assert_allclose(got.R, want.R, rtol=1e-6)
    every = Index(jnp.array([1.0, GOLD.eta, 1.5]), jnp.array([0.0, GOLD.k, 0.0]))
    np.testing.assert_allclose(
        layers.stack(0.9, every, thickness_um=[0.01], wavelength_um=0.55, exact=exact).R,
        want.R,
        rtol=1e-6,
    )
    with pytest.raises(ValueError, match="an entry of index is a tuple of 2"):
        layers.stack(0.9, [1.0, tuple(GOLD), 1.5], thickness_um=[0.01], wavelength_um=0.55)
    term = bsdf.FresnelStack([1.0, GOLD, 1.5], [0.01], 0.55, exact=exact)
    np.testing.assert_allclose(term(0.9), want.R, rtol=1e-6)


LOSSLESS = [
    lambda n: interface.reflectance(0.9, 2.0, eta_i=n),
    lambda n: approximate.schlick(0.9, 2.0, eta_i=n),
    lambda n: interface.fresnel_dielectric(0.9, n),
    lambda n: polarization.mueller_refraction(0.9, n),
    directions.critical_angle_deg,
    directions.brewster_angle_deg,
    lambda n: bsdf.FresnelDielectric(n)(0.9),
    lambda n: bsdf.Dielectric(n).eta,
    lambda n: bsdf.fresnel_specular(1.0, 1.0, 1.0, n).eta,
]


@pytest.mark.parametrize("function", LOSSLESS)
def test_where_a_lossless_medium_is_wanted_its_index_is_taken_and_a_metal_refused(function):
    np.testing.assert_array_equal(function(GLASS), function(1.5))
    with pytest.raises(ValueError, match="lossless"):
        function(GOLD)
    assert np.isnan(jax.jit(function)(GOLD)).any()


def test_an_index_is_no_wavelength_and_no_array():
    with pytest.raises(ValueError, match="as two arrays"):
        performance.in_blocks(lambda n: n, Index(np.ones(2), np.ones(2)))
    with pytest.raises(ValueError, match="wavelength_um is an Index"):
        layers.stack(0.9, [1.0, 1.5], thickness_um=[], wavelength_um=GLASS)
