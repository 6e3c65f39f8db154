"""How the interface is called: broadcasting, dtypes, transformations, singular points, errors."""

import functools

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

from fresnel_jax import (
    amplitudes,
    fresnel_complex,
    fresnel_conductor,
    fresnel_dielectric,
    powers,
    reflectance,
)
from tests.truth import adversarial, oracle

EPS = np.finfo(np.float64).eps
DTYPES = pytest.mark.parametrize("dtype", [np.float64, np.float32])


def test_arguments_broadcast():
    angles, indices = np.linspace(0, 1, 5), np.array([[1.3], [1.5], [2.4]])
    assert reflectance(angles, indices).shape == (3, 5)
    assert powers(angles, indices, 0.5, np.ones((2, 1, 1))).T_p.shape == (2, 3, 5)
    assert amplitudes(0.5, indices).r_s.shape == (3, 1)
    assert fresnel_dielectric(angles, indices).shape == (3, 5)


@DTYPES
def test_dtype_is_kept(dtype):
    x = np.asarray([0.5], dtype)
    assert reflectance(x, 1.5).dtype == dtype
    assert all(result.dtype == dtype for result in powers(x, 1.5, 0.1, 1.2))
    assert fresnel_dielectric(x, 1.5).dtype == fresnel_conductor(x, 1, 2).dtype == dtype
    assert amplitudes(x, 1.5).r_p.dtype == np.result_type(dtype, np.complex64)
    assert (
        fresnel_complex(x, np.asarray(1.5 + 0.1j, np.result_type(dtype, np.complex64))).dtype
        == dtype
    )


def test_python_numbers_and_integers():
    assert float(reflectance(1, 2)) == pytest.approx(1 / 9, rel=1e-15)
    assert reflectance(np.array([1, 0]), np.array([2, 2])).dtype == np.float64
    assert float(fresnel_conductor(1, 1, 1)) == pytest.approx(0.2, rel=1e-15)


@pytest.mark.parametrize("function", [powers, amplitudes])
@pytest.mark.parametrize("name", ["two media", "critical", "huge index", "matched, tiny k"])
def test_compiled_vmapped_and_eager_agree(function, name):
    points = tuple(x[:8] for x in adversarial.hard_sets(np.float64)[name])
    compiled = jax.jit(function)(*points)
    vmapped = jax.vmap(function)(*points)
    loop = np.stack([function(*(x[i] for x in points)) for i in range(8)], axis=1)
    with jax.disable_jit():
        eager = function(*points)
    # Compiled code may contract products and sums; both are within 12 eps of the truth.
    tolerance = dict(rtol=24 * EPS, atol=EPS**2)
    for j, result in enumerate(compiled):
        for other in (vmapped[j], loop[j], eager[j]):
            np.testing.assert_allclose(np.asarray(other), np.asarray(result), **tolerance)


@pytest.mark.parametrize("structure", ["k and eta_i given", "no k", "no eta_i", "neither"])
def test_programs_for_simpler_scenes_agree(structure):
    """A Python 0 for k or 1 for eta_i selects a smaller program with the same result."""
    c, n, k, m = adversarial.hard_sets(np.float64)["two media"]
    k = np.zeros_like(k) if structure in ("no k", "neither") else k
    m = np.ones_like(m) if structure in ("no eta_i", "neither") else m
    full = powers(c, n, k, m)
    k = 0.0 if structure in ("no k", "neither") else k
    m = 1 if structure in ("no eta_i", "neither") else m
    for one, other in zip(powers(c, n, k, m), full, strict=True):
        np.testing.assert_allclose(np.asarray(one), np.asarray(other), rtol=24 * EPS, atol=EPS**2)
    gradient = jax.vmap(jax.grad(lambda c, n, *rest: powers(c, n, *rest).R_p, argnums=1))
    if structure == "neither":
        one, other = gradient(c, n), gradient(c, n, jnp.zeros_like(n), jnp.ones_like(n))
        np.testing.assert_allclose(np.asarray(one), np.asarray(other), rtol=1e-13, atol=1e-29)


@functools.partial(jax.jit, static_argnums=0)
def hessians(power, *points):
    """Compiled once for all sets of points, which have one shape."""
    gradient = jax.grad(lambda *x: powers(*x)[power], argnums=(0, 1, 2, 3))
    return tuple(jax.vmap(f(gradient, argnums=(0, 1)))(*points) for f in (jax.jacfwd, jax.jacrev))


# R_s and T_p stand for R_p and T_s: T is 1 - R, and each power takes three seconds to compile.
@pytest.mark.parametrize("name", ["metal", "two media", "grazing"])
@pytest.mark.parametrize(
    "power", [0, *(pytest.param(i, marks=pytest.mark.study) for i in (1, 2)), 3]
)
def test_second_derivatives(name, power):
    """Forward and reverse over reverse, against numerical derivatives in 100 digits."""
    points = [x[:4] for x in adversarial.hard_sets(np.float64)[name]]
    forward_over_reverse, reverse_over_reverse = hessians(power, *points)
    mp.mp.dps = oracle.DIGITS
    step = mp.mpf(10) ** -30
    for i, point in enumerate(zip(*points, strict=True)):
        rows = []
        for j in range(2):
            ends = []
            for sign in (1, -1):
                shifted = [mp.mpf(float(x)) for x in point]
                shifted[j] += sign * step
                ends.append(gradient_at(shifted, power))
            rows.append([(a - b) / (2 * step) for a, b in zip(*ends, strict=True)])
        scale = max(abs(float(x)) for row in rows for x in row)
        for hessian in (forward_over_reverse, reverse_over_reverse):
            ours = np.array([[hessian[v][j][i] for v in range(4)] for j in range(2)])
            # no bound is promised for second derivatives; 1e-9 of the largest is what fits need
            np.testing.assert_allclose(ours, np.array(rows, float), rtol=0, atol=1e-9 * scale)


def gradient_at(point, power):
    gradient = oracle.reflectance_gradients(*point)[power % 2]
    return gradient if power < 2 else [-g for g in gradient]


@pytest.mark.study
def test_second_derivatives_of_the_lossless_program():
    hessian, full = (
        jax.jit(jax.hessian(lambda x: reflectance(*x)))(jnp.array(point))
        for point in ([0.3, 1.7], [0.3, 1.7, 0.0, 1.0])
    )
    np.testing.assert_allclose(np.asarray(hessian), np.asarray(full)[:2, :2], rtol=1e-13)


@DTYPES
def test_derivatives_at_singular_points(dtype):
    """Infinite or undefined derivatives are returned as 0, as the docstring says."""
    gradient = jax.grad(lambda c, n, k, m: powers(c, n, k, m).R_s, argnums=(0, 1, 2, 3))
    zero, one = dtype(0), dtype(1)
    # matched media at cos = 0, where R is 0 along matched media and 1 along cos = 0
    assert all(float(g) == 0.0 for g in gradient(zero, one, zero, one))
    # Q = 0 exactly: an index of zero at normal incidence
    assert all(np.isfinite(float(g)) for g in gradient(one, zero, zero, one))


def test_derivative_at_grazing_is_the_one_from_above():
    # R_s = 1 - 4 c Re(1/Q) + ... with Q = sqrt(n^2 - 1)
    at_zero = jax.grad(lambda c: powers(c, 1.5).R_s)(0.0)
    assert float(at_zero) == pytest.approx(-4 / np.sqrt(1.25), rel=1e-14)
    below = jax.grad(lambda c: powers(c, 1.5).R_s)(-0.3)
    assert float(below) == -float(jax.grad(lambda c: powers(c, 1.5).R_s)(0.3))


def test_absorption_lowers_total_reflection():
    """dR/dk at k = 0 is one-sided and not 0 there; several codes return 0, or the wrong sign."""
    c, n, k, m = 0.5, 1.0, 0.0, 1.5
    ours = jax.grad(lambda k: powers(c, n, k, m).R_s)(k)
    true = oracle.reflectance_gradients(c, n, k, m)[0][2]
    assert float(true) < -1.0
    assert float(ours) == pytest.approx(float(true), rel=1e-14)


def test_complex_index_is_differentiated():
    real = jax.grad(lambda n, k: reflectance(0.4, n, k), argnums=(0, 1))(1.3, 0.2)
    complex_gradient = jax.grad(lambda eta: fresnel_complex(0.4, eta))(1.3 + 0.2j)
    # JAX's convention: dR/dn - i dR/dk
    assert complex(complex_gradient) == pytest.approx(complex(real[0], -real[1]), rel=1e-14)


def test_shapes_that_do_not_broadcast():
    for function in (powers, reflectance, amplitudes, fresnel_dielectric):
        with pytest.raises(ValueError, match=r"\(3,\), \(4,\).*do not broadcast.*eta\[:, None\]"):
            function(np.ones(3), np.ones(4))


def test_complex_arguments_other_than_eta():
    with pytest.raises(ValueError, match="k is complex, a real number is wanted"):
        powers(0.5, 1.5, 0.1j)
    with pytest.raises(ValueError, match="already contains k"):
        amplitudes(0.5, 1.5 + 0.1j, 0.1)
