"""Phases, psi and Delta of one boundary, and how all functions of the module are called."""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

from fresnel_jax import amplitudes
from fresnel_jax.polarization import (
    absorption_depth,
    ellipsometric_ratio,
    mueller_reflection,
    mueller_refraction,
    penetration_depth,
    phases,
    psi_delta,
)
from tests.truth import adversarial, oracle

BOUND = 12.0  # eps; measured: 5
SIZE = 25

on_hard_sets = pytest.mark.parametrize(
    "dtype, name",
    [
        pytest.param(dtype, name, id=f"{np.dtype(dtype).name}-{name}")
        for dtype in (np.float64, np.float32)
        for name in adversarial.hard_sets(dtype, 1)
    ],
)


def hard_points(dtype, name):
    """Arrays of the set, and its points where both amplitudes are defined and not 0."""
    arrays = adversarial.hard_sets(dtype, SIZE)[name]
    points = []
    for i, point in enumerate(zip(*arrays, strict=True)):
        r_s, r_p, *_ = oracle.amplitudes(*point)
        if r_s != 0 and r_p != 0:
            points.append((i, point, r_s, r_p))
    return arrays, points


def worst(errors) -> float:
    """The largest; NaN counts as infinite."""
    return max((np.inf if e != e else float(e) for e in errors), default=0.0)


def modulo_a_turn(angle):
    """The angle between -pi and pi that differs by whole turns."""
    return angle - 2 * mp.pi * mp.nint(angle / (2 * mp.pi))


def true_delta(r_s, r_p):
    """-arg(r_p / r_s) in [0, pi]; a 100-digit quotient of real numbers may show either sign."""
    return abs(mp.arg(r_p / r_s))


@on_hard_sets
@mp.workdps(oracle.DIGITS)
def test_phases_psi_delta_and_ratio(dtype, name):
    arrays, points = hard_points(dtype, name)
    eps = float(np.finfo(dtype).eps)
    phi_s, phi_p = (np.asarray(x) for x in phases(*arrays))
    psi, delta = (np.asarray(x) for x in psi_delta(*arrays))
    rho = np.asarray(ellipsometric_ratio(*arrays))
    assert phi_s.dtype == phi_p.dtype == psi.dtype == delta.dtype == dtype
    assert rho.real.dtype == dtype
    assert (phi_s <= 0).all() and (phi_s >= -dtype(np.pi)).all()
    assert (delta >= 0).all() and (delta <= dtype(np.pi)).all()
    assert (psi >= 0).all() and (psi <= dtype(np.pi / 4) * (1 + 4 * eps)).all()
    errors = {"s": [], "p": [], "psi": [], "delta": [], "rho": []}
    for i, _, r_s, r_p in points:
        ratio, turn = r_p / r_s, 2 * mp.pi
        errors["s"].append(abs(modulo_a_turn(mp.mpf(float(phi_s[i])) - mp.arg(r_s))) / turn)
        errors["p"].append(abs(modulo_a_turn(mp.mpf(float(phi_p[i])) - mp.arg(r_p))) / turn)
        errors["psi"].append(abs(mp.mpf(float(psi[i])) / mp.atan(abs(ratio)) - 1))
        true = true_delta(r_s, r_p)
        # the oracle's own imaginary part is 1e-100, not 0, for two real amplitudes
        scale = true if true > 1e-60 else mp.mpf(1)
        errors["delta"].append(abs(mp.mpf(float(delta[i])) - true) / scale)
        errors["rho"].append(abs(mp.mpc(complex(rho[i])) - ratio) / abs(ratio))
    assert {key: worst(e) / eps for key, e in errors.items() if worst(e) > BOUND * eps} == {}


@jax.jit
def all_derivatives(*arrays):
    """Of phi_s, psi and Delta with respect to c, n, k, m; shape (3, 4, points)."""

    def along(i):
        tangents = (jnp.full_like(x, 1.0 if i == j else 0.0) for j, x in enumerate(arrays))
        (s, psi, delta) = jax.jvp(
            lambda *a: (phases(*a).phi_s, *psi_delta(*a)), arrays, tuple(tangents)
        )[1]
        return jnp.stack([s, psi, delta])

    return jnp.stack([along(i) for i in range(4)], axis=1)


@on_hard_sets
@mp.workdps(oracle.DIGITS)
def test_derivatives(dtype, name):
    """Of phi_s, psi and Delta, within 12 eps of the norm of the complex logarithmic gradient."""
    arrays, points = hard_points(dtype, name)
    eps, largest = float(np.finfo(dtype).eps), float(np.finfo(dtype).max)
    computed = np.asarray(all_derivatives(*arrays))
    assert np.isfinite(computed).all()
    errors = []
    for i, point, r_s, r_p in points:
        gradients = oracle.amplitude_gradients(*point)
        if gradients is None:
            continue
        d_log_s = [d / r_s for d in gradients[0]]
        d_log_ratio = [b / r_p - a for a, b in zip(d_log_s, gradients[1], strict=True)]
        modulus = abs(r_p / r_s)
        slope = modulus / (1 + modulus**2)
        truths = (
            ([mp.im(d) for d in d_log_s], max(map(abs, d_log_s))),
            ([mp.re(d) * slope for d in d_log_ratio], max(map(abs, d_log_ratio)) * slope),
            ([-mp.im(d) for d in d_log_ratio], max(map(abs, d_log_ratio))),
        )
        for values, (truth, norm) in zip(computed, truths, strict=True):
            if norm < largest * eps:  # beyond, a derivative leaves the range of the type
                off = max(
                    abs(mp.mpf(float(v)) - t) for v, t in zip(values[:, i], truth, strict=True)
                )
                errors.append(off / norm)
    assert worst(errors) <= BOUND * eps


def test_phases_are_continuous_where_principal_values_jump():
    """From glass to a weak absorber, and along paths from total reflection to metals."""
    angles = np.linspace(0.0, np.pi / 2, 181)
    glass, absorber = phases(np.cos(angles), 1.5), phases(np.cos(angles), 1.5, 1e-12)
    np.testing.assert_allclose(absorber.phi_s, glass.phi_s, atol=1e-10)
    principal = np.angle(amplitudes(np.cos(angles[:-1]), 1.5, 1e-12).r_s)
    assert (principal < -3.0).all() and (np.asarray(glass.phi_s) == -np.pi).all()
    # index and absorption from a rarer medium to a metal, at fixed and at changing angle
    path = np.linspace(0.0, 1.0, 20001)
    for cosine in (0.9, 0.5, 0.1, path):
        for phase in phases(cosine, 0.7 + 2 * path, 3 * path**2 + 1e-3, 1.5):
            assert np.abs(np.diff(np.asarray(phase))).max() < 0.1  # a jump would be pi


@pytest.mark.study
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_around_brewsters_angle_of_glass(dtype):
    """No angle of a float meets it: Delta is pi or 0, without noise, and psi keeps its slope."""
    eta = dtype(1.5)
    with mp.workdps(60):
        brewster = 1 / mp.sqrt(1 + mp.mpf(float(eta)) ** 2)
        nearest = dtype(float(brewster))
        cosines = np.array([np.nextafter(nearest, dtype(x)) for x in (1.0, nearest, 0.0)], dtype)
        steeper = np.array([mp.mpf(float(c)) > brewster for c in cosines])
    psi, delta = psi_delta(cosines, eta)
    assert (np.asarray(delta) == np.where(steeper, dtype(np.pi), dtype(0.0))).all()
    assert (np.asarray(psi) > 0).all() and (np.asarray(psi) < 2 * np.finfo(dtype).eps).all()
    slope_of_psi = jax.vmap(jax.grad(lambda c: psi_delta(c, eta).psi))(cosines)
    slope_of_delta = jax.vmap(jax.grad(lambda c: psi_delta(c, eta).delta))(cosines)
    assert (np.asarray(slope_of_delta) == 0.0).all()
    # d rho / dc at Brewster's angle is -(1 + eta^2)^2 sqrt(1 + eta^2) / (2 eta^4) by hand
    by_hand = (1 + 1.5**2) ** 2.5 / (2 * 1.5**4)
    np.testing.assert_allclose(
        slope_of_psi, np.where(steeper, by_hand, -by_hand), rtol=20 * np.finfo(dtype).eps
    )


@pytest.mark.parametrize("k", [1e-30, 1e-12, 1e-3])
def test_delta_passes_through_a_right_angle_for_every_absorber(k):
    """At the principal angle of a weak absorber: Re rho = 0, so that psi is about k."""
    with mp.workdps(120):
        cosine = mp.findroot(
            lambda c: mp.re(
                oracle.amplitudes(c, 1.5, k, 1)[1] / oracle.amplitudes(c, 1.5, k, 1)[0]
            ),
            (mp.mpf("0.55"), mp.mpf("0.56")),
            solver="secant",
            tol=mp.mpf(10) ** -150,
        )
    around = float(cosine) + np.array([-1e-6, 0.0, 1e-6])
    delta = np.asarray(psi_delta(around, 1.5, k).delta)
    assert delta[0] < delta[2]
    assert delta[0] >= 0.0 and delta[2] <= np.pi
    if k == 1e-3:  # the others are narrower than the spacing of floats
        assert abs(delta[1] - np.pi / 2) < 1e-12


def test_undefined_phases_are_pinned():
    """Matched media reflect nothing: phi_s is -pi with derivative 0, psi and Delta have a limit."""
    angle = 0.6

    @jax.jit
    def of_matched_media(c):
        slope = jax.grad(lambda n, k: phases(c, n, k, 1.5).phi_s, (0, 1))(1.5, 0.0)
        return psi_delta(c, 1.5, 0.0, 1.5), phases(c, 1.5, 0.0, 1.5).phi_s, slope

    (psi, delta), phi_s, slope = of_matched_media(np.cos(angle))
    np.testing.assert_allclose(psi, np.arctan(np.cos(2 * angle)), rtol=1e-15)
    assert delta == np.pi and phi_s == -np.pi and slope == (0.0, 0.0)

    # the critical angle itself: infinite, returned as 0
    def at_the_critical_angle(c):
        return psi_delta(c, 1.5, 0.0, 1.5).delta + phases(c, 1.5).phi_p

    assert np.isfinite(jax.jit(jax.grad(at_the_critical_angle))(0.0))


@pytest.mark.parametrize("relative", [0.2, 0.41, 1 / 1.51, 0.8, 0.99])
def test_phase_difference_in_total_reflection_has_its_maximum_where_theory_says(relative):
    """sin^2 = 2 n^2 / (1 + n^2), tan(Delta / 2) = (1 - n^2) / (2 n): Born and Wolf, sec. 1.5.4."""
    sine_squared = 2 * relative**2 / (1 + relative**2)
    cosine = np.sqrt(1 - sine_squared)

    def delta(c):
        return psi_delta(c, relative).delta

    np.testing.assert_allclose(
        delta(cosine), 2 * np.arctan((1 - relative**2) / (2 * relative)), rtol=4e-15
    )
    critical = np.sqrt(1 - relative**2)
    inside = np.linspace(0.0, critical, 4001)[1:-1]
    values = np.asarray(delta(inside))
    assert values.max() <= float(delta(cosine)) * (1 + 1e-14)
    assert abs(inside[values.argmax()] - cosine) <= critical / 4000
    slopes = jax.vmap(jax.grad(delta))(np.array([cosine * 0.999, cosine, cosine * 1.001]))
    assert slopes[0] > 0 > slopes[2] and abs(slopes[1]) < 1e-12


def test_fresnels_rhomb():
    """n = 1.51: Delta of 45 degrees at 48 deg 37' and at 54 deg 37' (Born and Wolf, sec. 1.5.4)."""
    angles = np.deg2rad([48 + 37 / 60, 54 + 37 / 60])
    delta = np.rad2deg(psi_delta(np.cos(angles), 1.0, 0.0, 1.51).delta)
    np.testing.assert_allclose(delta, 45.0, atol=0.05)  # angles are printed to 1'


def test_phases_in_total_reflection_are_those_of_the_textbook():
    angle, n = 0.9, 1 / 1.5
    phi_s, phi_p = phases(np.cos(angle), 1.0, 0.0, 1.5)
    root = np.sqrt(np.sin(angle) ** 2 - n**2)
    np.testing.assert_allclose(phi_s, -2 * np.arctan(root / np.cos(angle)), rtol=1e-14)
    np.testing.assert_allclose(phi_p, -2 * np.arctan(root / (n**2 * np.cos(angle))), rtol=1e-14)


def test_calls_broadcast_compile_and_refuse():
    cosines = np.linspace(0.1, 1.0, 5)
    eta = np.linspace(1.2, 2.0, 3)[:, None]
    psi, _ = psi_delta(cosines, eta, 0.1)
    assert psi.shape == (3, 5)
    assert mueller_reflection(cosines, eta).shape == (3, 5, 4, 4)
    assert mueller_refraction(cosines, eta).shape == (3, 5, 4, 4)
    complex_index = psi_delta(cosines, eta + 0.1j).psi
    np.testing.assert_array_equal(psi, complex_index)
    mapped = jax.jit(jax.vmap(lambda n: psi_delta(cosines, n, 0.1).psi))(eta[:, 0])
    np.testing.assert_allclose(mapped, psi, rtol=1e-14)
    np.testing.assert_array_equal(phases(-cosines, 1.5), phases(cosines, 1.5))
    with pytest.raises(ValueError, match="do not broadcast"):
        psi_delta(np.ones(3), np.ones(2))
    with pytest.raises(ValueError, match="lossless"):
        mueller_refraction(0.5, 1.5 + 0.1j)
    with pytest.raises(ValueError, match="wavelength_um"):
        penetration_depth(np.ones(2), 1.5, wavelength_um=np.ones(3))
    with pytest.raises(ValueError, match="wavelength_um"):
        absorption_depth(np.ones(3), np.ones(2))
