"""Beckmann's facets against their definition: 40 digits, areas, and the mean of drawn weights."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

from fresnel_jax import bsdf
from fresnel_jax.bsdf import Beckmann
from tests.physics.spherical import direction

ROUGHNESS = [(0.3, 0.3), (0.5, 0.1), (1.0, 1.0)]
WEIGHT = 4.0 / np.e * np.sqrt(np.pi)  # largest ratio of D times that of S


@jax.jit
def described(surface, w):
    return surface.D(w), surface.Lambda(w), surface.G1(w)


@jax.jit
def scattered(alpha, wo, wi):
    model = bsdf.Reflector(bsdf.FresnelNone(), Beckmann(alpha[0], alpha[1]))
    return model.evaluate(wo, wi), model.density(wo, wi)


@jax.jit
def drawn(alpha, wo, u):
    model = bsdf.Reflector(bsdf.FresnelNone(), Beckmann(alpha[0], alpha[1]))
    return model.sample(wo, 0.5, u)


def textbook(w, alpha_x, alpha_y):
    """(D, Lambda) of Walter et al. 2007, eq. 25 and 26 (exact), stretched for two roughnesses."""
    with mpmath.workdps(40):
        x, y, z = (mpmath.mpf(float(a)) for a in w)
        a_x, a_y = mpmath.mpf(alpha_x), mpmath.mpf(alpha_y)
        d = mpmath.exp(-((x / a_x) ** 2 + (y / a_y) ** 2) / z**2) / (mpmath.pi * a_x * a_y * z**4)
        a = z / mpmath.hypot(a_x * x, a_y * y)
        smith = (mpmath.exp(-a * a) / (a * mpmath.sqrt(mpmath.pi)) - mpmath.erfc(a)) / 2
        return float(d), float(smith), float(1 / (1 + smith))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("alphas", ROUGHNESS)
def test_against_the_printed_forms(alphas, dtype):
    alphas, eps = np.array(alphas, dtype), float(np.finfo(dtype).eps)
    z, phi = np.meshgrid([1e-6, 1e-3, 0.2, 0.5, 0.9, 0.9999], [0.0, 0.7, 2.0, 4.6])
    w = direction(z, phi).reshape(-1, 3).astype(dtype)
    found = described(Beckmann(*alphas), w)
    assert all(x.dtype == dtype for x in found)
    want = np.array([textbook(v, *alphas.astype(float)) for v in w]).T
    e = ((w[:, :2].astype(float) / alphas) ** 2).sum(1) / w[:, 2].astype(float) ** 2
    tiny = float(np.finfo(dtype).tiny)
    assert (abs(found[0] - want[0]) <= (8.0 + 4.0 * e) * eps * want[0] + tiny).all()
    assert (abs(found[1] - want[1]) <= 8.0 * eps * (1.0 + want[1])).all()
    np.testing.assert_allclose(found[2], want[2], rtol=8.0 * eps)


def hemisphere(alphas):
    """Nodes and solid angles, dense where the facets are: slopes alpha (tan t) (cos, sin)."""
    nodes, weights = np.polynomial.legendre.leggauss(64)
    t, w_t = (nodes + 1) * np.pi / 4, weights * np.pi / 4
    r, phi = np.meshgrid(np.tan(t), (np.arange(64) + 0.5) * (2 * np.pi / 64), indexing="ij")
    p, q = alphas[0] * r * np.cos(phi), alphas[1] * r * np.sin(phi)
    z = 1 / np.sqrt(1 + p * p + q * q)
    solid_angle = z**3 * np.prod(alphas) * r * (1 + r * r) * w_t[:, None] * (2 * np.pi / 64)
    return np.stack([-p * z, -q * z, z], -1).reshape(-1, 3), solid_angle.ravel()


@pytest.mark.parametrize("alphas", ROUGHNESS)
def test_areas_and_the_mean_of_drawn_weights(alphas):
    m, solid_angle = hemisphere(alphas)
    d = described(Beckmann(*alphas), m)[0]
    assert np.sum(d * m[..., 2] * solid_angle) == pytest.approx(1.0, rel=1e-10)
    alphas = np.array(alphas)
    square = (np.arange(64) + 0.5) / 64
    u = np.stack(np.meshgrid(square, square), -1).reshape(-1, 2)
    for z in (1.0, 0.6, 0.1):
        w = direction(z, 0.9)
        # G1 is defined by: the visible facets fill the projected area (PBRT 4th ed. eq. 9.17)
        seen = np.maximum(0.0, m @ w) * solid_angle * d
        assert np.sum(seen) * described(Beckmann(*alphas), w)[2] == pytest.approx(z, rel=1e-3)
        # the mean weight is the reflected power: the integral of f cos over m, d wi = 4 w.m d m
        wi = 2.0 * (m @ w)[..., None] * m - w
        f = np.asarray(scattered(alphas, w, wi)[0])
        power = np.sum(f * np.maximum(0.0, wi[..., 2]) * 4.0 * np.abs(m @ w) * solid_angle)
        sample = jax.tree.map(np.asarray, drawn(alphas, w, u))
        assert np.mean(sample.weight) == pytest.approx(float(power), rel=1e-2)
        assert np.max(sample.weight) < WEIGHT
        value, density = scattered(alphas, w, sample.direction)
        valid = sample.valid
        ratio = value * np.abs(sample.direction[..., 2]) / density
        np.testing.assert_allclose(ratio[valid], sample.weight[valid], rtol=1e-9)


@pytest.mark.parametrize("dtype", [np.float64, pytest.param(np.float32, marks=pytest.mark.study)])
def test_derivatives_are_finite_and_right(dtype):
    z = np.array([1.0, 0.5, 1e-3, -0.3], dtype)
    w, step = direction(z, 0.3).astype(dtype), 1e-6

    def values(alpha, w):
        return jnp.stack(described(Beckmann(alpha, dtype(0.3)), w)[::2])

    of_both = jax.jit(jax.vmap(jax.jacfwd(values, (0, 1)), (None, 0)))
    for a in np.array([0.2, 1e-4], dtype):
        assert all(np.isfinite(x).all() for x in of_both(a, w))
    if dtype is np.float64:
        want = (values(0.2 + step, w[1:3]) - values(0.2 - step, w[1:3])) / (2 * step)
        found = of_both(0.2, w)[0][1:3].T
        np.testing.assert_allclose(found, want, rtol=1e-6, atol=1e-9)
