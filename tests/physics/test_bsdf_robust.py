"""Rough surfaces at the edges: flags, hard inputs, dtypes, batches. No NaN anywhere."""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import ArrayLike

from fresnel_jax import bsdf
from fresnel_jax.bsdf import Dielectric, Lobes, TrowbridgeReitz

pytestmark = pytest.mark.slow


def direction(z, phi: ArrayLike = 0.4):
    z, phi = np.broadcast_arrays(np.asarray(z, float), phi)
    r = np.sqrt((1.0 - z) * (1.0 + z))
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1)


def sphere(rng, count):
    v = rng.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


@pytest.mark.study
def test_flags_agree_with_what_is_sampled():
    """Index match and vanishing roughness are delta distributions, and say so."""
    eta = np.array([1.0, 1.0, 1.5, 1.5, 1.5, 1.5, 0.5])
    alpha_x = np.array([0.5, 0.0, 9e-4, 0.0, 1e-3, 0.0, 0.3])
    alpha_y = np.array([0.5, 0.0, 9e-4, 0.0, 1e-3, 0.2, 0.3])
    model = Dielectric(eta, TrowbridgeReitz(alpha_x, alpha_y))
    flags = model.flags()
    np.testing.assert_array_equal(flags.specular, [1, 1, 1, 1, 0, 0, 0])
    np.testing.assert_array_equal(flags.glossy, [0, 0, 0, 0, 1, 1, 1])
    np.testing.assert_array_equal(flags.reflection, [0, 0, 1, 1, 1, 1, 1])
    np.testing.assert_array_equal(flags.transmission, True)
    rng = np.random.default_rng(2)
    wo = direction(rng.uniform(-1, 1, (3000, 1)), rng.uniform(0, 6, (3000, 1)))
    u_lobe, u = rng.uniform(size=(3000, 1)), rng.uniform(size=(3000, 1, 2))
    s = eqx.filter_jit(Dielectric.sample)(model, wo, u_lobe, u)
    valid, crossing = np.asarray(s.valid), np.asarray(s.transmission)
    np.testing.assert_array_equal(s.specular, np.broadcast_to(flags.specular, valid.shape))
    np.testing.assert_array_equal(np.any(valid & ~crossing, axis=0), flags.reflection)
    np.testing.assert_array_equal(np.any(valid & crossing, axis=0), flags.transmission)
    f = np.asarray(eqx.filter_jit(Dielectric.evaluate)(model, wo, s.direction))
    p = np.asarray(eqx.filter_jit(Dielectric.density)(model, wo, s.direction))
    np.testing.assert_array_equal(np.any(f > 0, axis=0), flags.glossy)
    np.testing.assert_array_equal(np.any(p > 0, axis=0), flags.glossy)
    # matched media let everything straight through
    np.testing.assert_allclose(np.asarray(s.direction)[:, 0], -wo[:, 0], rtol=0, atol=4e-16)
    np.testing.assert_allclose(np.asarray(s.weight)[:, :2], 1.0, rtol=4e-16)
    mirror = bsdf.conductor(0.4, 2.4, TrowbridgeReitz(alpha_x, alpha_y))
    np.testing.assert_array_equal(mirror.flags().specular, [0, 1, 1, 1, 0, 0, 0])
    assert not np.any(mirror.flags().transmission) and np.all(mirror.flags().reflection)


def hard_inputs(dtype):
    z = np.array([0, 1e-30, 1e-20, 1e-12, 1e-3, 0.5, 1.0])
    turns = np.array([0.0, 0.3, np.pi])  # the last one is opposite to the first
    w = direction(np.concatenate([z, -z])[:, None], turns).reshape(-1, 3)
    ends = [0.0, 0.3, 1 - np.finfo(dtype).epsneg, 1.0]
    u = np.array(list(itertools.product([0.0, 0.5, 1.0], ends, ends)))
    eta = [0.25, 1 / 1.5, 1.0, 1 + 2.4e-7, 4.0]
    alphas = [(0, 0), (5e-4, 5e-4), (0, 0.5), (0.3, 0), (0.05, 0.05), (1, 1)]
    parameters = np.array([(e, *a) for e, a in itertools.product(eta, alphas)])
    return parameters.astype(dtype), w.astype(dtype), u.astype(dtype)


def dielectric(p):
    return Dielectric(p[0], TrowbridgeReitz(p[1], p[2]))


def gold(p):
    return bsdf.conductor(p[0] * 0.4, p[0] * 2.4, TrowbridgeReitz(p[1], p[2]))


def thin(p):
    return bsdf.ThinDielectric(p[0])


@pytest.mark.study
@pytest.mark.parametrize(
    ("build", "dtype"),
    [
        (dielectric, np.float32),
        pytest.param(dielectric, np.float64, marks=pytest.mark.study),
        (gold, np.float32),
        (thin, np.float32),
    ],
)
def test_no_nan_for_any_sample(build, dtype):
    """Values and derivatives; u = 0 and 1, grazing to 0, roughness 0, eta = 1."""
    parameters, w, u = hard_inputs(dtype)
    eps = np.finfo(dtype).eps

    def draw(p, w, u):
        s = build(p).sample(w, u[0], u[1:])
        return s.weight + jnp.sum(s.direction), s

    each = jax.vmap(jax.grad(draw, (0, 1), has_aux=True), (None, None, 0))
    each = jax.jit(jax.vmap(jax.vmap(each, (None, 0, None)), (0, None, None)))
    derivatives, s = each(parameters, w, u)
    assert s.direction.dtype == s.value.dtype == s.weight.dtype == dtype
    for field in (*s, *derivatives):
        assert np.all(np.isfinite(field))
    length = np.linalg.norm(np.asarray(s.direction, np.float64), axis=-1)
    assert np.abs(length - 1).max() < 6 * eps
    assert np.min(s.density) >= 0 and np.max(s.weight) <= 16 * (1 + 8 * eps)
    none = jax.jit(lambda p, w, u: build(p).sample(w, 0.5, u, Lobes.NONE))
    nothing = none(parameters[-1], w, u[0, 1:])
    assert not np.any(nothing.valid)
    for field in nothing:
        assert np.all(np.isfinite(field))


@pytest.mark.parametrize(
    ("build", "dtype"),
    [
        (dielectric, np.float32),
        pytest.param(dielectric, np.float64, marks=pytest.mark.study),
        (gold, np.float32),
    ],
)
def test_no_nan_for_any_pair(build, dtype):
    parameters, w, _ = hard_inputs(dtype)

    def both(p, wo, wi):
        f, density = build(p).evaluate(wo, wi), build(p).density(wo, wi)
        return f + density, (f, density)

    each = jax.vmap(jax.grad(both, (0, 1, 2), has_aux=True), (None, None, 0))
    each = jax.jit(jax.vmap(jax.vmap(each, (None, 0, None)), (0, None, None)))
    derivatives, values = each(parameters, w, w)
    for field in values:
        assert field.dtype == dtype and np.all(np.isfinite(field)) and np.min(field) >= 0.0
    # opposite directions at grazing: in float32 the true derivatives exceed 1e38
    tame = (w[:, 2] == 0.0) | (np.abs(w[:, 2]) > (1e-8 if dtype == np.float32 else 0.0))
    for field in derivatives:
        assert np.all(np.isfinite(np.asarray(field)[:, tame][:, :, tame]))


def test_broadcasting_and_vmap_over_models_agree():
    rng = np.random.default_rng(3)
    wo, wi = sphere(rng, 7)[:, None], sphere(rng, 7)[:, None]
    models = Dielectric(np.array([1.2, 1.5, 0.7]), TrowbridgeReitz(np.array([0.1, 0.5, 0.3])),
                        np.ones(3), np.ones(3))  # fmt: skip
    evaluate = jax.jit(Dielectric.evaluate)
    table = evaluate(models, wo, wi)
    assert table.shape == (7, 3)
    each = jax.vmap(lambda model: evaluate(model, wo[:, 0], wi[:, 0]), out_axes=1)(models)
    np.testing.assert_allclose(each, table, rtol=1e-13)
    with pytest.raises(ValueError, match="wi has shape"):
        models.evaluate(wo, np.ones(2))
    with pytest.raises(ValueError, match="u has shape"):
        models.sample(wo, 0.5, np.ones(3))
