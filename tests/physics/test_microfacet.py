"""Trowbridge-Reitz facets against the textbook's trigonometric forms and conservation of area."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

from fresnel_jax.microfacet import TrowbridgeReitz
from tests.physics.spherical import direction

ROUGHNESS = [(0.05, 0.05), (0.3, 0.3), (0.5, 0.1), (1.0, 1.0), (0.0, 0.5)]
DTYPES = [np.float32, np.float64]

distribution = jax.jit(lambda surface, m: surface.D(m))
visible = jax.jit(lambda surface, w, m: surface.D_visible(w, m))
sampled = jax.jit(lambda surface, w, u: surface.sample_visible(w, u))
masking = jax.jit(lambda surface, w: (surface.Lambda(w), surface.G1(w)))


def textbook(w, alpha_x, alpha_y):
    """(D, Lambda) in the angles of PBRT 4th ed. eq. 9.16 and 9.21, 40 digits."""
    with mpmath.workdps(40):
        x, y, z = (mpmath.mpf(float(a)) for a in w)
        a_x, a_y = (mpmath.mpf(max(a, 1e-4)) for a in (alpha_x, alpha_y))
        theta, phi = mpmath.atan2(mpmath.hypot(x, y), z), mpmath.atan2(y, x)
        e = mpmath.tan(theta) ** 2 * ((mpmath.cos(phi) / a_x) ** 2 + (mpmath.sin(phi) / a_y) ** 2)
        d = 1 / (mpmath.pi * a_x * a_y * mpmath.cos(theta) ** 4 * (1 + e) ** 2)
        alpha2 = (a_x * mpmath.cos(phi)) ** 2 + (a_y * mpmath.sin(phi)) ** 2
        smith = (mpmath.sqrt(1 + alpha2 * mpmath.tan(theta) ** 2) - 1) / 2
        return float(d), float(smith)


def hemisphere(surface):
    """Nodes and solid-angle weights, dense where the facets are: slopes x = alpha_x tan, ...

    With m ~ (-p, -q, 1) and (p / alpha_x, q / alpha_y) = r (cos, sin), r = tan t, the map is smooth
    and D is a smooth function of t.
    """
    a_x, a_y = (float(a) for a in surface.bounded())
    nodes, weights = np.polynomial.legendre.leggauss(200)
    t, w_t = (nodes + 1) * np.pi / 4, weights * np.pi / 4
    phi = (np.arange(256) + 0.5) * (2 * np.pi / 256)
    r, phi = np.meshgrid(np.tan(t), phi, indexing="ij")
    p, q = a_x * r * np.cos(phi), a_y * r * np.sin(phi)
    z = 1 / np.sqrt(1 + p * p + q * q)
    m = np.stack([-p * z, -q * z, z], -1)
    # dp dq = a_x a_y r dr dphi, d omega = z^3 dp dq, dr = (1 + r^2) dt
    solid_angle = z**3 * a_x * a_y * r * (1 + r * r) * w_t[:, None] * (2 * np.pi / 256)
    return m, solid_angle


@pytest.mark.parametrize("alphas", ROUGHNESS)
def test_against_the_trigonometric_forms(alphas):
    surface = TrowbridgeReitz(*alphas)
    z, phi = np.meshgrid([1e-6, 1e-3, 0.2, 0.7, 0.999999, 1 - 1e-14], [0.0, 0.7, 2.0, 4.6])
    w = direction(z, phi).reshape(-1, 3)
    w /= np.linalg.norm(w, axis=-1, keepdims=True)
    d, smith = np.array([textbook(v, *alphas) for v in w]).T
    np.testing.assert_allclose(distribution(surface, w), d, rtol=1e-14)
    computed, g1 = masking(surface, w)
    np.testing.assert_allclose(computed, smith, rtol=1e-14)
    np.testing.assert_array_equal(masking(surface, -w)[0], computed)
    np.testing.assert_allclose(g1, 1 / (1 + smith), rtol=1e-14)
    expected = 1 / (1 + smith[:, None] + smith)
    np.testing.assert_allclose(surface.G(w[:, None], w), expected, rtol=1e-14)
    # more is seen than if masking and shadowing were independent, less than by either alone
    g1 = np.asarray(g1)
    assert np.all(expected >= g1[:, None] * g1 * (1 - 1e-14))
    assert np.all(expected <= np.minimum(g1[:, None], g1) * (1 + 1e-14))


def test_values_at_the_pole_and_at_grazing():
    surface = TrowbridgeReitz(0.4, 0.2)
    pole, grazing = np.array([0.0, 0.0, 1.0]), np.array([0.6, 0.8, 0.0])
    np.testing.assert_allclose(surface.D(pole), 1 / (np.pi * 0.08), rtol=1e-15)
    assert float(surface.Lambda(pole)) == 0.0 and float(surface.G1(pole)) == 1.0
    assert float(surface.G1(grazing)) == 0.0 and float(surface.G(grazing, grazing)) == 0.0
    assert float(surface.D(-pole)) == 0.0 and float(surface.D_visible(pole, -pole)) == 0.0
    # D_visible at exactly cos = 0 is the limit
    m = direction(0.8, 0.5)
    limit = surface.D_visible(np.array([0.6, 0.8, 1e-9]), m)
    np.testing.assert_allclose(surface.D_visible(grazing, m), limit, rtol=1e-8)
    # Lambda keeps its digits where sqrt(1 + x) - 1 has none left
    tilted = np.array([1e-9, 0.0, 1.0])
    np.testing.assert_allclose(surface.Lambda(tilted), (0.4 * 1e-9) ** 2 / 4, rtol=1e-14)


@pytest.mark.parametrize("alphas", ROUGHNESS)
def test_facets_project_to_the_unit_area(alphas):
    surface = TrowbridgeReitz(*alphas)
    m, solid_angle = hemisphere(surface)
    total = np.sum(distribution(surface, m) * m[..., 2] * solid_angle)
    np.testing.assert_allclose(total, 1.0, rtol=1e-10)


@pytest.mark.parametrize("alphas", ROUGHNESS[:4])
@pytest.mark.parametrize("z", [1.0, 0.6, 0.1, -0.4])
def test_visible_facets_fill_the_projected_area(alphas, z):
    """G1 is defined by: the integral of G1 D max(0, w . m) is cos_w (PBRT 4th ed. eq. 9.17)."""
    surface = TrowbridgeReitz(*alphas)
    m, solid_angle = hemisphere(surface)
    w = direction(z, 0.9)
    projected = np.maximum(0.0, m @ w * np.sign(z)) * solid_angle
    area = np.sum(masking(surface, w)[1] * distribution(surface, m) * projected)
    # max(0, .) has a kink that the rule for smooth functions sees
    np.testing.assert_allclose(area, abs(z), rtol=2e-5)
    density = np.sum(visible(surface, w, m) * solid_angle)
    np.testing.assert_allclose(density, 1.0, rtol=2e-5)


@jax.jit
def normals_and_jacobians(surface, w, u):
    jacobian = jax.vmap(jax.jacfwd(surface.sample_visible, 1), (None, 0))(w, u)
    return surface.sample_visible(w, u), jacobian


@pytest.mark.parametrize("alphas", ROUGHNESS)
@pytest.mark.parametrize("z", [1.0, 0.7, 1e-3, 0.0, -0.2])
def test_sampled_normals_have_the_stated_density(alphas, z):
    """A map from the unit square has density 1 / |dm/du1 x dm/du2|: exact, without statistics."""
    surface, w = TrowbridgeReitz(*alphas), jnp.asarray(direction(z, 0.4))
    u = jax.random.uniform(jax.random.key(0), (2000, 2), minval=1e-3, maxval=0.999)
    m, jacobian = normals_and_jacobians(surface, w, u)
    stretch = np.linalg.norm(np.cross(jacobian[..., 0], jacobian[..., 1]), axis=-1)
    density = np.asarray(visible(surface, w, m))
    assert np.all(m[:, 2] > 0.0) and np.all(np.sign(z or 1.0) * (m @ w) >= 0.0)
    np.testing.assert_allclose(np.linalg.norm(m, axis=-1), 1.0, rtol=0, atol=1e-15)
    # the normals of the 1e-4 axis are known to 1e-12 of their width
    np.testing.assert_allclose(density * stretch, 1.0, rtol=1e-8 if 0.0 in alphas else 1e-11)


@pytest.mark.parametrize("dtype", DTYPES)
def test_samples_are_finite_at_every_corner(dtype):
    corners = np.array([0.0, 1e-30, 0.25, 0.5, 1 - np.finfo(dtype).epsneg, 1.0], dtype)
    u = np.stack(np.meshgrid(corners, corners), -1).reshape(-1, 1, 1, 2)
    z = np.array([1.0, 0.5, 1e-7, 1e-30, 0.0, -0.0, -1e-7, -1.0])
    w = direction(z, 0.3).astype(dtype)[:, None]
    alphas = np.array([0.0, 1e-4, 1e-3, 0.1, 1.0], dtype)

    def sample(alpha_x, w, u):
        return TrowbridgeReitz(alpha_x, dtype(0.2)).sample_visible(w, u)

    m = np.asarray(jax.jit(sample)(alphas, w, u))
    assert m.dtype == dtype and np.all(np.isfinite(m)) and np.all(m[..., 2] >= 0.0)
    # 3 numbers rounded twice
    assert np.abs(np.linalg.norm(m.astype(np.float64), axis=-1) - 1).max() < 4 * np.finfo(dtype).eps
    shape = m.shape[:-1]
    flat = [np.broadcast_to(a, shape + a.shape[k:]).reshape(-1, *a.shape[k:])
            for a, k in ((alphas, 1), (w, 2), (u, 3))]  # fmt: skip
    for jacobian in jax.jit(jax.vmap(jax.jacfwd(sample, (0, 1))))(*flat):
        assert np.all(np.isfinite(jacobian))


@pytest.mark.parametrize("dtype", DTYPES)
def test_normals_of_the_far_end_of_u(dtype):
    """u2 next to 1, where 2 - u2 (1 + z) cancels: 7,700 eps; 13 with a sum of positive terms."""
    random = np.random.default_rng(20261122)
    size, eps = 500, float(np.finfo(dtype).eps)
    w = direction(random.uniform(0.0, 1.0, size), random.uniform(0.0, 6.3, size)).astype(dtype)
    u = np.stack([random.random(size), 1 - 10 ** random.uniform(-6, -1, size)], -1).astype(dtype)
    alphas = (10 ** random.uniform(-3, 0, (2, size))).astype(dtype)
    found = np.asarray(sampled(TrowbridgeReitz(*alphas), w, u), float)
    errors = [
        max(abs(mpmath.mpf(x) - y) for x, y in zip(m, normal_of_the_cap(*point), strict=True)) / eps
        for m, *point in zip(found, *(x.astype(float) for x in (w, u, *alphas)), strict=True)
    ]
    # the few that are far off are at a root of both x and y of the half vector
    assert np.quantile(np.array(errors, float), 0.98) < 20


def test_the_change_of_a_normal_next_to_the_pole():
    """dv - m (m . dv) was off by 73 eps in z, which changes by .004; now by .001 eps."""
    z, azimuth, u2 = 0.054751205846035905, 5.598518879697236, 0.9834856599392402
    a, b, u1 = 0.001086940114871141, 0.0014324086835117782, 0.8314189009998526
    w, surface = direction(z, azimuth), TrowbridgeReitz(a, b)
    slope = jax.jvp(lambda u2: sampled(surface, w, jnp.stack([u1, u2])), (u2,), (1.0,))[1]
    with mpmath.workdps(60):
        for i in range(3):
            true = mpmath.diff(lambda x, i=i: normal_of_the_cap(w, (u1, x), a, b)[i], u2)
            assert abs(float(slope[i]) - true) < 4 * np.finfo(float).eps


def normal_of_the_cap(w, u, alpha_x, alpha_y):
    """As Dupuy and Benyoub print it: a point of the cap z > -w_z plus w, 40 digits or more."""
    with mpmath.workdps(max(40, mpmath.mp.dps)):
        w, (u1, u2) = mpmath.matrix([mpmath.mpf(x) for x in w]), map(mpmath.mpf, u)
        a, b = mpmath.mpf(alpha_x), mpmath.mpf(alpha_y)
        w = mpmath.matrix([a * w[0], b * w[1], w[2]])
        w /= mpmath.norm(w)
        height = (1 - u2) * (1 + w[2]) - w[2]
        radius, turn = mpmath.sqrt(1 - height**2), 2 * mpmath.pi * u1
        half = w + mpmath.matrix([radius * mpmath.cos(turn), radius * mpmath.sin(turn), height])
        m = mpmath.matrix([a * half[0], b * half[1], half[2]])
        return list(m / mpmath.norm(m))


def test_infinite_derivative_at_u_zero_is_given_as_zero():
    surface, u = TrowbridgeReitz(0.3), jnp.array([0.2, 0.0])
    jacobian = jax.jit(jax.jacfwd(surface.sample_visible, 1))(jnp.array(direction(0.6, 0.1)), u)
    np.testing.assert_array_equal(jacobian[:, 0], 0.0)  # u[0] turns a circle of radius 0
    assert np.all(np.isfinite(jacobian))


def test_derivatives_at_the_pole_against_differences():
    """The tangent-frame method has 0 / 0 at w = z, the textbook's D at m = z."""
    surface, pole = TrowbridgeReitz(0.1, 0.3), jnp.array([0.0, 0.0, 1.0])
    u, h = jnp.array([0.3, 0.4]), 1e-5
    step = jnp.array([h, 0.0, 0.0])

    @jax.jit
    def normal(w, alpha_x):
        return TrowbridgeReitz(alpha_x, 0.3).sample_visible(w, u)

    by_direction, by_roughness = jax.jit(jax.jacfwd(normal, (0, 1)))(pole, 0.1)
    difference = (normal(pole + step, 0.1) - normal(pole - step, 0.1)) / (2 * h)
    np.testing.assert_allclose(by_direction[:, 0], difference, rtol=0, atol=1e-9)
    difference = (normal(pole, 0.1 + h) - normal(pole, 0.1 - h)) / (2 * h)
    np.testing.assert_allclose(by_roughness, difference, rtol=0, atol=1e-8)
    # D = 1 / (pi a b q^2), q = (x / a)^2 + (y / b)^2 + z^2
    peak = 1 / (np.pi * 0.03)
    gradient, curvature, smith = jax.jit(
        lambda m: (
            jax.grad(surface.D)(m),
            jax.hessian(surface.D)(m),
            jax.hessian(surface.Lambda)(m),
        )
    )(pole)
    np.testing.assert_allclose(gradient, [0.0, 0.0, -4 * peak], rtol=0, atol=1e-10)
    np.testing.assert_allclose(curvature[0, 0], -4 * peak / 0.1**2, rtol=1e-12)
    np.testing.assert_allclose(smith[0, 0], 0.1**2 / 2, rtol=1e-12)


def test_thresholds_of_smoothness():
    alpha_x = np.array([0.0, 9.9e-4, 1e-3, 0.0, 0.5])
    alpha_y = np.array([0.0, 9.9e-4, 0.0, 1e-3, 0.0])
    np.testing.assert_array_equal(
        TrowbridgeReitz(alpha_x, alpha_y).effectively_smooth(), [True, True, False, False, False]
    )
    np.testing.assert_array_equal(TrowbridgeReitz(alpha_x).alpha_y, alpha_x)


def test_float32_is_kept_and_wrong_shapes_are_named():
    w = direction(0.6, 0.1).astype(np.float32)
    surface = TrowbridgeReitz(0.3)
    for value in (surface.D(w), surface.Lambda(w), surface.G(w, w), surface.D_visible(w, w)):
        assert value.dtype == np.float32
    np.testing.assert_allclose(surface.D(w), textbook(w, 0.3, 0.3)[0], rtol=2e-6)
    with pytest.raises(ValueError, match=r"u has shape \(3,\); wanted \(\.\.\., 2\)"):
        surface.sample_visible(w, np.zeros(3))
    with pytest.raises(ValueError, match=r"m has shape \(2,\)"):
        surface.D(np.zeros(2))


def test_vmap_over_surfaces():
    surfaces = TrowbridgeReitz(np.array([0.1, 0.5]), np.array([0.2, 0.4]))
    w, m = direction(0.6, 0.1), direction(0.9, 1.0)
    values = jax.jit(jax.vmap(lambda surface: surface.D_visible(w, m)))(surfaces)
    np.testing.assert_allclose(values, visible(surfaces, w, m), rtol=1e-15)
    gradient = jax.jit(jax.grad(lambda surface: jnp.sum(surface.D_visible(w, m))))(surfaces)
    h = 1e-6
    above, below = (
        visible(TrowbridgeReitz(np.array([0.1, 0.5]), np.array([0.2, 0.4]) + step), w, m)
        for step in (h, -h)
    )
    difference = (above - below) / (2 * h)
    np.testing.assert_allclose(gradient.alpha_y, difference, rtol=1e-7)
