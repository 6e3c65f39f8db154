"""Smooth interfaces: lobe choice, flags, total reflection, radiance scaling, gradients."""

import pathlib

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import ArrayLike

from fresnel_jax import bsdf, directions
from fresnel_jax.bsdf import Lobes, TransportMode
from fresnel_jax.interface import fresnel_dielectric, powers

pytestmark = pytest.mark.slow

REFERENCE = pathlib.Path(__file__).parents[1] / "truth" / "reference"
MODES = list(TransportMode)
GOLD = (0.43, 2.455)
U = np.array([0.5, 0.5])
UP = np.array([0.0, 0.0, 1.0])


def direction(z, phi: ArrayLike = 0.4):
    z, phi = np.broadcast_arrays(np.asarray(z, float), phi)
    r = np.sqrt((1.0 - z) * (1.0 + z))
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1)


COSINES = np.array([1.0, 0.9, 0.5, 0.1, -0.1, -0.5, -0.9, -1.0])

MODELS = {
    "dielectric": lambda: bsdf.Dielectric(1.5),
    "inverse": lambda: bsdf.Dielectric(1 / 1.5),
    "matched": lambda: bsdf.Dielectric(1.0),
    "thin": lambda: bsdf.ThinDielectric(1.5),
    "gold": lambda: bsdf.conductor(*GOLD),
    "no Fresnel": lambda: bsdf.specular_reflection(0.8, bsdf.FresnelNone()),
    "mirror of glass": lambda: bsdf.specular_reflection(1.0, bsdf.FresnelDielectric(1.5)),
    "transmission": lambda: bsdf.specular_transmission(0.7, 1.0, 1.5),
    "fresnel specular": lambda: bsdf.fresnel_specular(0.9, 0.8, 1.2, 1.5),
    "vanishing roughness": lambda: bsdf.Dielectric(1.5, bsdf.TrowbridgeReitz(5e-4)),
}


def both_lobes(model, wo, mode=TransportMode.RADIANCE, lobes=Lobes.ALL):
    """The samples of u_lobe = 0 and u_lobe -> 1: with probability weights, the expectation."""
    last = np.nextafter(1.0, 0.0)
    return [model.sample(wo, u, U, lobes, mode) for u in (0.0, last)]


# Dielectrics --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["dielectric", "inverse", "thin", "vanishing roughness"])
def test_lobe_is_chosen_in_proportion_to_power(name):
    model, wo = MODELS[name](), direction(0.3)
    u = (np.arange(100_000) + 0.5) / 100_000
    sample = jax.tree.map(np.asarray, jax.jit(lambda m, u: m.sample(wo, u, U))(model, u))
    R = float(model.powers(0.3)[0] if name == "thin" else fresnel_dielectric(0.3, model.eta))
    assert abs(np.mean(~np.asarray(sample.transmission)) - R) <= 1e-5
    np.testing.assert_allclose(sample.density, np.where(sample.transmission, 1 - R, R), rtol=1e-12)
    # the factor cancels: every path carries the same weight
    scale = np.where(sample.transmission, np.asarray(sample.eta) ** -2.0, 1.0)
    np.testing.assert_allclose(sample.weight, scale, rtol=1e-14)


def test_variance_of_an_equal_split_against_the_fresnel_split():
    """Figure 9.15: (1 - 2R)^2 against 0, here without radiance scaling."""
    model, wo = bsdf.Dielectric(1.5), direction(0.3)
    R = float(fresnel_dielectric(0.3, 1.5))
    equal = [
        2.0 * float(model.sample(wo, 0.5, U, lobes, TransportMode.IMPORTANCE).weight)
        for lobes in (Lobes.REFLECTION, Lobes.TRANSMISSION)
    ]
    np.testing.assert_allclose(np.mean(equal), 1.0, rtol=1e-14)
    np.testing.assert_allclose(np.var(equal), (1 - 2 * R) ** 2, rtol=1e-13)
    u = np.linspace(0.0, 0.999, 500)
    fresnel = model.sample(wo, u, U, mode=TransportMode.IMPORTANCE).weight
    assert np.var(fresnel) < 1e-30


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("lobes", [Lobes.NONE, Lobes.REFLECTION, Lobes.TRANSMISSION, Lobes.ALL])
@pytest.mark.parametrize("name", MODELS)
def test_lobes_that_are_off_are_never_sampled(name, lobes, mode):
    model, wo = MODELS[name](), direction(COSINES)
    samples = both_lobes(model, wo, mode, lobes)
    for sample in samples:
        for flag, kind in ((Lobes.REFLECTION, False), (Lobes.TRANSMISSION, True)):
            if flag not in lobes:
                assert not np.any(np.asarray(sample.valid) & (sample.transmission == kind))
        dead = ~np.asarray(sample.valid)
        for field in (sample.value, sample.density, sample.weight):
            assert not np.any(np.asarray(field)[dead])
        assert np.all(np.isfinite(sample.direction))
        if lobes is not Lobes.ALL:  # one lobe: certain, wherever it exists
            np.testing.assert_array_equal(np.asarray(sample.density)[~dead], 1.0)
    if lobes is Lobes.NONE:
        assert not np.any(samples[0].valid)


@pytest.mark.parametrize("name", MODELS)
def test_flags_agree_with_what_is_sampled(name):
    model, wo = MODELS[name](), direction(COSINES)
    flags = model.flags()
    seen = {False: False, True: False}
    for sample in both_lobes(model, wo):
        for kind in seen:
            seen[kind] |= bool(np.any(np.asarray(sample.valid) & (sample.transmission == kind)))
        assert np.all(sample.specular == flags.specular) and np.all(flags.glossy == ~flags.specular)
    assert seen[False] == bool(flags.reflection) and seen[True] == bool(flags.transmission)
    assert bool(flags.specular)


def test_third_edition_transmission_and_fresnel_specular():
    wo = direction(np.array([0.8, -0.95]))
    eta_a, eta_b = 1.2, 1.5
    T = np.array(
        [float(powers(0.8, eta_b, eta_i=eta_a).T), float(powers(0.95, eta_a, eta_i=eta_b).T)]
    )
    ratio = np.array([eta_a / eta_b, eta_b / eta_a])  # eta_i / eta_t of the code, for radiance
    model = bsdf.specular_transmission(0.7, eta_a, eta_b)
    for mode, factor in ((TransportMode.RADIANCE, ratio**2), (TransportMode.IMPORTANCE, 1.0)):
        sample = model.sample(wo, 0.0, U, mode=mode)
        assert np.all(sample.transmission) and np.all(sample.density == 1.0)
        cosine = np.abs(sample.direction[:, 2])
        np.testing.assert_allclose(sample.value, 0.7 * T * factor / cosine, rtol=1e-13)
    both = bsdf.fresnel_specular(0.9, 0.8, eta_a, eta_b)
    first, last = both_lobes(both, wo, TransportMode.IMPORTANCE)
    np.testing.assert_allclose(first.density, 1 - T, rtol=1e-12)  # reflection with probability F
    np.testing.assert_allclose(last.density, T, rtol=1e-13)
    np.testing.assert_allclose(first.weight, 0.9, rtol=1e-15)
    np.testing.assert_allclose(last.weight, 0.8, rtol=1e-15)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_total_reflection_leaves_one_lobe_whatever_u(dtype):
    wo = direction(-0.5).astype(dtype)
    u = np.array([0.0, 0.5, 1 - np.finfo(dtype).epsneg, 1.0], dtype)
    glass = bsdf.Dielectric(1.5)
    sample, none = jax.jit(
        lambda wo, u, U: [glass.sample(wo, u, U, x) for x in (Lobes.ALL, Lobes.TRANSMISSION)]
    )(wo, u, U.astype(dtype))
    assert np.all(sample.valid) and not np.any(sample.transmission)
    np.testing.assert_array_equal(sample.weight, 1.0)
    assert not np.any(none.valid)


def test_weight_keeps_its_digits_next_to_total_reflection():
    # T = 5e-6: the rest of R to 1 in float32 has one digit of it
    critical = np.sqrt(1 - 1 / 1.5**2)
    wo = direction(-critical * (1 + 1e-12)).astype(np.float64)
    sample = bsdf.Dielectric(1.5).sample(wo, 1.0, U)
    assert bool(sample.valid) and bool(sample.transmission) and float(sample.density) < 1e-5
    np.testing.assert_allclose(sample.weight, 1.5**2, rtol=1e-15)


@pytest.mark.parametrize("cosine", [1.0, 0.7, 0.2, -0.2, -0.7, -0.9, -1.0])
def test_equilibrium_radiance_goes_through_unchanged(cosine):
    """With L = n^2 on both sides the surface gives back n_o^2, from either side."""
    eta = 1.5
    wo = direction(cosine)
    total = 0.0
    for sample in both_lobes(bsdf.Dielectric(eta), wo):
        n_i = np.where(np.asarray(sample.direction)[2] < 0, eta, 1.0)
        total += float(sample.density * sample.weight) * n_i**2
    if abs(cosine) < np.sqrt(1 - 1 / eta**2) and cosine < 0:
        total /= 2  # total reflection: both draws are the one lobe
    np.testing.assert_allclose(total, eta**2 if cosine < 0 else 1.0, rtol=1e-14)


def test_specular_brdf_is_reciprocal_and_the_btdf_is_not():
    """delta(wi - T(wo)) / (cos_i eta_i^2) is the same from both ends, so f / eta_o^2 must be."""
    wo, eta = direction(np.array([0.9, 0.5, 0.1])), 1.5
    there = bsdf.Dielectric(eta).sample(wo, 0.5, U, Lobes.REFLECTION)
    back = bsdf.Dielectric(eta).sample(there.direction, 0.5, U, Lobes.REFLECTION)
    np.testing.assert_allclose(back.direction, wo, rtol=0, atol=1e-15)
    np.testing.assert_allclose(back.value, there.value, rtol=1e-15)
    there = bsdf.Dielectric(eta).sample(wo, 0.5, U, Lobes.TRANSMISSION)
    back = bsdf.Dielectric(eta).sample(there.direction, 0.5, U, Lobes.TRANSMISSION)
    np.testing.assert_allclose(back.direction, wo, rtol=0, atol=1e-14)
    # coefficients of delta / (cos_i eta_i^2)
    f_there = np.asarray(there.value) * np.abs(there.direction[:, 2]) * eta**2
    f_back = np.asarray(back.value) * np.abs(back.direction[:, 2]) * 1.0
    np.testing.assert_allclose(f_there / 1.0, f_back / eta**2, rtol=1e-13)
    assert np.all(f_back > 2.0 * f_there)


def test_importance_is_radiance_times_the_squared_index():
    for name in ("dielectric", "inverse"):
        model, wo = MODELS[name](), direction(COSINES)
        last = np.nextafter(1.0, 0.0)
        radiance, importance = (model.sample(wo, last, U, mode=mode) for mode in MODES)
        etap = np.asarray(radiance.eta)
        np.testing.assert_allclose(importance.value, etap**2 * radiance.value, rtol=1e-14)


@pytest.mark.study
def test_expected_gradient_of_a_smooth_interface():
    """Lobe choice detached: the mean over lobes is the derivative of R L(wr) + T L(wt) / etap^2."""
    wo = direction(0.6)

    def light(w):
        return jnp.exp(0.4 * w[0] - 0.3 * w[2])

    @jax.jit
    def expected(eta):
        t = directions.refract(wo, UP, eta)
        face = powers(0.6, eta)
        return face.R * light(directions.reflect(wo, UP)) + face.T * light(t.direction) / eta**2

    def estimate(eta, u):
        sample = bsdf.Dielectric(eta).sample(wo, u, U)
        return sample.weight * light(sample.direction), sample.density

    h = 1e-5
    difference = (expected(1.5 + h) - expected(1.5 - h)) / (2 * h)
    slope = jax.jit(jax.grad(estimate, has_aux=True))
    each = [slope(1.5, u) for u in (0.0, 0.999)]
    mean = sum(gradient * probability for gradient, probability in each)
    np.testing.assert_allclose(mean, difference, rtol=1e-8)

    def by_quotient(eta, u):
        sample = bsdf.Dielectric(eta).sample(wo, u, U)
        cosine = jnp.abs(sample.direction[2])
        return sample.value * cosine / sample.density * light(sample.direction), sample.density

    of_quotient = jax.jit(jax.grad(by_quotient, has_aux=True))
    for u, (gradient, _) in zip((0.0, 0.999), each, strict=True):
        np.testing.assert_allclose(of_quotient(1.5, u)[0], gradient, rtol=1e-12)
