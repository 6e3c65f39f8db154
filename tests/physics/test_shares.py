"""The BSDFs' own R and T and points of the circle, against many digits of the textbook forms."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

from fresnel_jax._numerics.arithmetic import sine_cosine
from fresnel_jax.boundary.shares import shares
from tests.truth import oracle


def textbook(c, n, m):
    """(R, T) of unpolarized light from m into n."""
    R_s, R_p, T_s, T_p = oracle.powers(c, n, 0.0, m)
    return (R_s + R_p) / 2, (T_s + T_p) / 2


def hard_points(dtype):
    """(c, n, m): grazing, near index match, and both sides of the critical angle."""
    rng = np.random.default_rng(5)
    m = np.exp(rng.uniform(-1.4, 1.4, 400)).astype(dtype)
    n = np.exp(rng.uniform(-1.4, 1.4, 400)).astype(dtype)
    c = rng.uniform(0.01, 1.0, 400).astype(dtype)
    close = 10.0 ** rng.uniform(-7.0, -1.0, 100)
    n[:100] = m[:100] * (1.0 + close * rng.choice([-1.0, 1.0], 100))
    c[50:200] = 10.0 ** rng.uniform(-9.0, -1.0, 150)
    denser = np.maximum(n, m)[200:300], np.minimum(n, m)[200:300]
    m[200:300], n[200:300] = denser
    critical = np.sqrt(1.0 - (n[200:300].astype(float) / m[200:300]) ** 2)
    away = 10.0 ** rng.uniform(np.log10(np.finfo(dtype).eps), -2.0, 100)
    c[200:300] = np.minimum(critical * (1.0 + away * rng.choice([-1.0, 1.0], 100)), 1.0)
    return c, n, m


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_shares_keep_their_digits(dtype):
    eps = float(np.finfo(dtype).eps)
    c, n, m = hard_points(dtype)
    true = [textbook(*x) for x in zip(c, n, m, strict=True)]
    both = jax.jit(shares, static_argnums=3)
    for exactly in (True, False):
        found = jax.tree.map(np.asarray, both(c, n, m, exactly))
        assert found.R.dtype == found.T.dtype == dtype
        for i, (R, T) in enumerate(true):
            assert abs(float(found.R[i]) - R) <= 12 * eps * R
            whole = T if exactly or m[i] <= n[i] else 1
            assert abs(float(found.T[i]) - T) <= 12 * eps * whole
    inside = both(-c, n, m, True)
    assert np.array_equal(inside.R, both(c, n, m, True).R)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_transmission_where_only_the_lowest_digits_decide(dtype):
    """The pairs, among 1e6, next to the critical angle: doubled precision loses 5 digits of T."""
    wide = np.float64 if dtype == np.float32 else np.longdouble
    n = np.random.default_rng(12).uniform(0.3, 0.95, 1_000_000).astype(dtype)
    c = np.sqrt((1 - n.astype(wide)) * (1 + n.astype(wide))).astype(dtype)
    left = np.abs(n.astype(wide) ** 2 - (1 - c.astype(wide)) * (1 + c.astype(wide)))
    nearest = np.argsort(left)[:200]
    c, n = c[nearest], n[nearest]
    T = jax.jit(shares, static_argnums=3)(c, n, np.ones_like(n), True).T
    true = np.array([float(textbook(*x, 1.0)[1]) for x in zip(c, n, strict=True)])
    assert np.any(true > 0.0) and np.any(true == 0.0)
    np.testing.assert_allclose(T, true, rtol=12 * float(np.finfo(dtype).eps))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_shares_at_singular_points(dtype):
    c = jnp.asarray([0.0, 1.0, 0.3, 0.0, 0.2], dtype)
    n, m = (
        jnp.asarray([1.5, 1.5, 1.5, 1.0, 1.0], dtype),
        jnp.asarray([1.5, 1.5, 1.5, 1.5, 1.5], dtype),
    )
    for exactly in (True, False):
        R, T = jax.jit(shares, static_argnums=3)(c, n, m, exactly)
        assert np.array_equal(R, [0.0, 0.0, 0.0, 1.0, 1.0])
        assert np.array_equal(T, [1.0, 1.0, 1.0, 0.0, 0.0])


def test_derivatives_of_shares_against_many_digits():
    c, n, m = (x[300:] for x in hard_points(np.float64))  # ordinary points
    jacobian = jax.jit(jax.vmap(jax.jacfwd(lambda *x: shares(*x, True), argnums=(0, 1, 2))))
    slopes = jax.tree.map(np.asarray, jacobian(c, n, m))
    for i in range(len(c)):
        s, p = oracle.reflectance_gradients(c[i], n[i], 0.0, m[i])
        true = np.array([float((s[x] + p[x]) / 2) for x in (0, 1, 3)])  # but for k
        # in total reflection the derivatives are 0, and the oracle has 100 digits
        error = 200 * np.finfo(float).eps * np.linalg.norm(true) + 1e-90
        for found, sign in ((slopes.R, 1.0), (slopes.T, -1.0)):
            np.testing.assert_allclose([x[i] for x in found], sign * true, rtol=0, atol=error)


@pytest.mark.study
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_points_of_the_circle(dtype):
    rng = np.random.default_rng(2)
    u = np.concatenate([rng.random(500) - 0.5, np.arange(-4, 5) / 8]).astype(dtype)
    sine, cosine = jax.jit(sine_cosine)(u)
    assert cosine.dtype == sine.dtype == dtype
    eps = float(np.finfo(dtype).eps)
    for x, a, b in zip(u, cosine, sine, strict=True):
        turn = 2 * mpmath.mpf(float(x))
        assert abs(float(a) - mpmath.cospi(turn)) <= eps
        assert abs(float(b) - mpmath.sinpi(turn)) <= eps
    # d cos(2 pi u) / du = -2 pi sin(2 pi u), to the series' last term
    slope = jax.jit(jax.vmap(jax.grad(lambda x: sine_cosine(x)[1])))(u[:500])
    np.testing.assert_allclose(slope, -2 * np.pi * sine[:500], atol=40 * eps)
