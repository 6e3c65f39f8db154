"""Half vectors of reflection and refraction, and the Jacobians of their densities."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

from fresnel_jax import directions, microfacet
from tests.physics.spherical import direction

half_vector, local_frame = jax.jit(microfacet.half_vector), jax.jit(directions.local_frame)
half_vector_jacobian = jax.jit(microfacet.half_vector_jacobian)
reflect, refract = jax.jit(directions.reflect), jax.jit(directions.refract)
ETAS = [0.25, 1 / 1.5, 0.99, 1.01, 1.5, 4.0]


@pytest.mark.parametrize("eta", ETAS)
@pytest.mark.parametrize("z", [0.9, 0.3, -0.3])
def test_half_vector_is_the_facet_that_scattered(eta, z):
    rng = np.random.default_rng(0)
    w = direction(z, 0.3)
    m = direction(rng.uniform(0.2, 1.0, 500), rng.uniform(0.0, 2 * np.pi, 500))
    facing = (m @ w) * z > 0.05  # closer to grazing, eta - 1 = .01 leaves fewer digits
    mirrored = np.asarray(reflect(w, m))
    kept = facing & (mirrored[:, 2] * z > 0.0)
    np.testing.assert_allclose(half_vector(w, mirrored, eta)[kept], m[kept], rtol=0, atol=1e-13)
    bent, _, valid = (np.asarray(a) for a in refract(w, m, eta))
    kept = facing & valid & (bent[:, 2] * z < 0.0) & (np.abs(np.sum(bent * m, -1)) > 0.05)
    assert kept.any() or (z < 0) == (eta > 1)
    # an eps of the directions over |eta - 1|
    np.testing.assert_allclose(
        half_vector(w, bent, eta)[kept], m[kept], rtol=0, atol=1e-15 / abs(eta - 1) + 1e-14
    )


@pytest.mark.parametrize("eta", [0.999999, 1 + 1e-8, 1.5])
def test_half_vector_is_exact_for_the_directions_as_given(eta):
    """Next to index match the two directions cancel to |eta - 1|, but not their digits."""
    for sign in (1, -1):
        wo, m = sign * direction(0.7, 0.2), direction(0.8, 0.5)
        wi = np.asarray(refract(wo, m, eta).direction)
        with mpmath.workdps(50):
            outside, inside = (wo, wi) if wo[2] > 0 else (wi, wo)
            h = [mpmath.mpf(float(a)) + mpmath.mpf(eta) * mpmath.mpf(float(b))
                 for a, b in zip(outside, inside, strict=True)]  # fmt: skip
            length = mpmath.sqrt(sum(a * a for a in h)) * mpmath.sign(h[2])
            exact = np.array([float(a / length) for a in h])
        # compiled as one loop, even the plain sum would be right here: it becomes a fused
        # multiply-add; one operation at a time, it is wrong by 1e-8
        for function in (half_vector, microfacet.half_vector):
            np.testing.assert_allclose(function(wo, wi, eta), exact, rtol=0, atol=1e-15)


@pytest.mark.parametrize("eta", ETAS)
@pytest.mark.parametrize("across", [False, True])
def test_half_vector_jacobian_against_finite_differences(eta, across):
    """The area that m covers while wi covers a small square, wo fixed."""
    rng = np.random.default_rng(1)
    wo = direction(rng.uniform(0.3, 1.0, 200), rng.uniform(0.0, 2 * np.pi, 200))
    m = direction(rng.uniform(0.7, 1.0, 200), rng.uniform(0.0, 2 * np.pi, 200))
    if across:
        wi, _, valid = (np.asarray(a) for a in refract(wo, m, eta))
        good = valid & (wi[:, 2] < -0.1) & (np.sum(wo * m, -1) > 0.1)
    else:
        wi = np.asarray(reflect(wo, m))
        good = (wi[:, 2] > 0.1) & (np.sum(wo * m, -1) > 0.1)
    assert good.sum() > 8
    # one shape, one compilation: rows that are not wanted are replaced by a wanted one
    kept = np.where(good, np.arange(200), np.flatnonzero(good)[0])
    wo, wi = wo[kept], wi[kept]
    frame = local_frame(wi)
    h = 1e-4

    def m_at(s, t):
        moved = wi + s * np.asarray(frame.tangent) + t * np.asarray(frame.bitangent)
        moved /= np.linalg.norm(moved, axis=-1, keepdims=True)
        h_ = wo + wi * 0 + moved if not across else wo + eta * moved  # wo lies outside
        h_ /= np.linalg.norm(h_, axis=-1, keepdims=True)
        return h_ * np.sign(h_[:, 2:])

    along = [(m_at(h, 0) - m_at(-h, 0)) / (2 * h), (m_at(0, h) - m_at(0, -h)) / (2 * h)]
    area = np.linalg.norm(np.cross(*along), axis=-1)
    # second differences: h^2 times the curvature of the map, which grows as 1 / |eta - 1|^2
    rtol = 1e-6 if not across else 1e-6 + 2e-7 / (eta - 1) ** 2
    jacobian = half_vector_jacobian(wo, wi, eta)
    np.testing.assert_allclose(jacobian, area, rtol=rtol)
    # the density of wo for wi fixed has the other side's index and cosine (an error of one source)
    swapped = half_vector_jacobian(wi, wo, eta)
    half = np.asarray(half_vector(wo, wi, eta))
    c_o, c_i = np.abs(np.sum(wo * half, -1)), np.abs(np.sum(wi * half, -1))
    expected = c_i * eta**2 / c_o if across else np.ones_like(c_o)
    np.testing.assert_allclose(jacobian / swapped, expected, rtol=1e-9)


def test_jacobian_at_index_match_is_zero_and_finite():
    w = direction(0.6, 0.1)
    assert float(microfacet.half_vector_jacobian(w, -w, 1.0)) == 0.0
    np.testing.assert_array_equal(microfacet.half_vector(w, -w, 1.0), [0.0, 0.0, 1.0])
    slope = jax.jit(jax.jacfwd(lambda w: microfacet.half_vector_jacobian(w, -w, 1.0)))
    derivative = slope(jnp.asarray(w))
    assert np.all(np.isfinite(derivative))
