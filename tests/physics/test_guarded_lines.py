"""Careful lines, each with the points that show what is lost without it."""

import jax
import mpmath as mp
import numpy as np
import pytest

from fresnel_jax import fresnel_dielectric, powers, reflectance
from fresnel_jax.dispersion import HC_EV_UM, DrudeLorentz
from tests.truth import oracle

DTYPES = pytest.mark.parametrize("dtype", [np.float64, np.float32])


def mean_gradient(point, variables):
    gradients = oracle.reflectance_gradients(*point)
    with mp.workdps(oracle.DIGITS):
        return [(gradients[0][v] + gradients[1][v]) / 2 for v in variables]


@DTYPES
@pytest.mark.parametrize("with_m", [False, True])
def test_lossless_gradients_of_small_indices(dtype, with_m):
    """Next to normal incidence Y is Q^2 - s^2 N^2: the sum around c n - m cancels there.

    In units of relative changes of the arguments; with the other branch the sign was wrong.
    """
    random = np.random.default_rng(20261122)
    size, eps = 150, float(np.finfo(dtype).eps)
    m = random.uniform(1.0, 4.0, size).astype(dtype) if with_m else np.ones(size, dtype)
    n = (m * 10.0 ** random.uniform(-3, -0.5, size)).astype(dtype)
    critical2 = (1 - (n / m).astype(float)) * (1 + (n / m).astype(float))
    c = 1.0 - (1.0 - np.sqrt(critical2)) * random.uniform(0.0, 1.0, size)
    c = np.minimum(c.astype(dtype), 1)
    variables = (0, 1, 3) if with_m else (0, 1)
    given = (c, n, m) if with_m else (c, n)
    function = (lambda c, n, m: reflectance(c, n, eta_i=m)) if with_m else reflectance
    found = jax.jit(jax.vmap(jax.grad(function, argnums=tuple(range(len(given))))))(*given)
    for i in range(size):
        point = (c[i], n[i], 0.0, m[i])
        q2 = mp.mpf(float(n[i])) ** 2 - mp.mpf(float(m[i])) ** 2 * (1 - mp.mpf(float(c[i])) ** 2)
        if q2 <= 0:
            continue  # total reflection, whose derivatives are 0, has a test of its own
        true = mean_gradient(point, variables)
        units = [mp.mpf(float(point[v])) for v in variables]
        norm = mp.norm([u * g for u, g in zip(units, true, strict=True)])
        error = mp.norm(
            [u * (mp.mpf(float(x[i])) - g) for x, u, g in zip(found, units, true, strict=True)]
        )
        assert error <= (200 + 4 * (m[i] / n[i]) ** 2) * eps * norm, (point, found, true)


@DTYPES
def test_from_inside_near_the_critical_angle(dtype):
    """`fresnel_dielectric` exchanges the indices: 1 / eta is off by 2e8 eps of R there."""
    random = np.random.default_rng(1)
    eta = random.uniform(1.05, 3.0, 200).astype(dtype)
    eps = float(np.finfo(dtype).eps)
    critical = np.sqrt((1 - 1 / eta.astype(float)) * (1 + 1 / eta.astype(float)))
    c = (critical * (1 + 10.0 ** random.uniform(-15, -2, 200))).astype(dtype)
    found = np.asarray(fresnel_dielectric(-c, eta))
    for i in range(200):
        R_s, R_p, *_ = oracle.powers(c[i], 1.0, 0.0, eta[i])
        true = (R_s + R_p) / 2
        assert abs(mp.mpf(float(found[i])) - true) <= 8 * eps * true


@pytest.mark.study
@DTYPES
def test_no_reflectance_above_one(dtype):
    random = np.random.default_rng(7)
    size = 200_000
    c = (10.0 ** random.uniform(-9, -2, size)).astype(dtype)
    n, m = (random.uniform(low, 4.0, size).astype(dtype) for low in (0.05, 1.0))
    k = (10.0 ** random.uniform(-6, 1, size)).astype(dtype)
    for given in ((c, n), (c, n, k), (c, n, 0.0, m), (c, n, k, m)):
        assert (np.asarray(reflectance(*given)) <= 1.0).all()
        assert (np.asarray(reflectance(*given, compensated=False)) <= 1.0).all()
        for power in powers(*given):
            assert ((np.asarray(power) >= 0.0) & (np.asarray(power) <= 1.0)).all()


@DTYPES
def test_beside_a_narrow_resonance(dtype):
    """E_j^2 - E^2 is factored: the difference of the squares has twice the error of E."""
    random = np.random.default_rng(3)
    eps = float(np.finfo(dtype).eps)
    resonance = random.uniform(1.0, 5.0, 300).astype(dtype)
    aside = random.choice([-1, 1], 300) * 10.0 ** random.uniform(-5, -2, 300)
    wavelength = (HC_EV_UM / (resonance * (1 + aside))).astype(dtype)
    widths = (np.abs(aside) * 0.1).astype(dtype)
    strength = dtype(1e-3)
    for i in range(300):
        found = DrudeLorentz(strength, resonance[i], widths[i])(wavelength[i])
        with mp.workdps(50):
            # E as rounded: what that rounding costs is stated apart
            energy = mp.mpf(float(dtype(HC_EV_UM) / wavelength[i]))
            E_j, width = mp.mpf(float(resonance[i])), mp.mpf(float(widths[i]))
            distance = E_j**2 - energy**2 - 1j * energy * width
            true = mp.sqrt(1 + mp.mpf(float(strength)) / distance)
            ours = mp.mpc(float(found.eta), float(found.k))
            assert abs(ours - true) <= 12 * eps * abs(true)


@DTYPES
@pytest.mark.parametrize("with_m", [False, True])
def test_reflectance_at_the_critical_angle_of_small_indices(dtype, with_m):
    """m^2 s^2 is summed as m^2 (1 - c)(1 + c): as m^2 - (m c)^2 it had 27 eps at n = m / 100."""
    random = np.random.default_rng(20261123)
    size, eps = 400, float(np.finfo(dtype).eps)
    m = random.uniform(1.0, 20.0, size).astype(dtype) if with_m else np.ones(size, dtype)
    sine = 10.0 ** random.uniform(np.log10(2.0 * np.sqrt(eps)), -0.3, size)
    c = np.sqrt((1.0 - sine) * (1.0 + sine)).astype(dtype)
    # Of these cosines, as they are rounded, the index at whose critical angle they lie.
    near = [m_ * mp.sqrt((1 - mp.mpf(float(c_))) * (1 + c_)) for c_, m_ in zip(c, m, strict=True)]
    n = np.array(near, float) * (1.0 + eps * random.integers(0, 9, size))
    n = n.astype(dtype)
    found = reflectance(c, n, eta_i=m) if with_m else reflectance(c, n)
    with mp.workdps(oracle.DIGITS):
        true = [oracle.reflectance(c[i], n[i], 0.0, m[i]) for i in range(size)]
        errors = [abs(mp.mpf(float(x)) - t) / t for x, t in zip(found, true, strict=True)]
    assert max(errors) <= 8 * eps
