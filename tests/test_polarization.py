"""Phases, psi and Delta, Mueller matrices and depths of one boundary."""

from pathlib import Path

import adversarial
import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import oracle
import pytest

from fresnel_jax import amplitudes, powers
from fresnel_jax.polarization import (
    absorption_depth,
    ellipsometric_ratio,
    mueller_reflection,
    mueller_refraction,
    penetration_depth,
    phases,
    psi_delta,
)

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
    psi, delta = psi_delta(np.cos(angle), 1.5, 0.0, 1.5)
    np.testing.assert_allclose(psi, np.arctan(np.cos(2 * angle)), rtol=1e-15)
    assert delta == np.pi
    assert phases(np.cos(angle), 1.5, 0.0, 1.5).phi_s == -np.pi
    gradient = jax.grad(lambda n, k: phases(np.cos(angle), n, k, 1.5).phi_s, (0, 1))(1.5, 0.0)
    assert gradient == (0.0, 0.0)
    # the critical angle itself: infinite, returned as 0
    cosine, eta, eta_i = 0.0, 1.5, 1.5
    for function in (lambda c: psi_delta(c, eta, 0.0, eta_i).delta, lambda c: phases(c, 1.5).phi_p):
        assert np.isfinite(jax.grad(function)(cosine))


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


METALS = {"Ag": (0.055, 3.32), "Au": (0.43, 2.455), "W": (3.5, 2.73)}


def test_mueller_matrices_agree_with_the_table():
    """Mitsuba 3.9.1 in float32 (its key `doc` tells the frame); cos < 0: light from inside."""
    table = np.load(Path(__file__).parent / "reference" / "mueller.npz")
    c = table["c"]
    outside, inside = c > 0, c < 0
    rounding = 6e-7  # five float32 eps
    pairs = [
        (mueller_reflection(c[outside], 1.5), table["diel_1.5_R"][outside]),
        (mueller_reflection(c[inside], 1.0, 0.0, 1.5), table["diel_1.5_R"][inside]),
        (mueller_refraction(c[outside], 1.5), table["diel_1.5_T"][outside]),
        (mueller_refraction(c[inside], 1.0, 1.5), table["diel_1.5_T"][inside]),
    ]
    pairs += [
        (mueller_reflection(c[outside], *index), table[f"{name}_R"][outside])
        for name, index in METALS.items()
    ]
    for computed, true in pairs:
        assert computed.dtype == np.float32
        np.testing.assert_allclose(computed, true, atol=rounding)


def stokes(e_s, e_p):
    """Stokes vectors of fields as the module's docstring defines them."""
    cross = e_s * np.conj(e_p)
    i, q = abs(e_s) ** 2 + abs(e_p) ** 2, abs(e_s) ** 2 - abs(e_p) ** 2
    return np.stack([i, q, 2 * cross.real, 2 * cross.imag], axis=-1)


@pytest.mark.parametrize("medium", [(1.5, 0.0, 1.0), (1.0, 0.0, 1.5), (0.2, 3.3, 1.0)])
def test_mueller_matrix_carries_stokes_vectors_like_fields(medium):
    random = np.random.default_rng(7)
    e_s, e_p = random.normal(size=(2, 50)) + 1j * random.normal(size=(2, 50))
    cosines = random.uniform(0.05, 1.0, 50)
    a = amplitudes(cosines, *medium)
    r_s, r_p, t_s, t_p = (np.asarray(x) for x in a)
    incident = stokes(e_s, e_p)[..., None]
    reflected = np.asarray(mueller_reflection(cosines, *medium)) @ incident
    np.testing.assert_allclose(reflected[..., 0], stokes(r_s * e_s, r_p * e_p), atol=1e-13)
    if medium[1]:
        return
    eta, _, eta_i = medium
    sines = eta_i * np.sqrt(1 - cosines**2) / eta
    projected = eta * np.sqrt(np.maximum(1 - sines**2, 0.0)) / (eta_i * cosines)
    refracted = np.asarray(mueller_refraction(cosines, eta, eta_i)) @ incident
    true = projected[:, None] * stokes(t_s * e_s, t_p * e_p)
    np.testing.assert_allclose(refracted[..., 0], true, atol=1e-12)


def test_positive_v_turns_counterclockwise_for_who_looks_into_the_beam():
    """Fields over time, seen along -z by an observer towards whom the beam (+z) comes."""
    z = np.array([0.0, 0.0, 1.0])
    s = np.array([1.0, 0.0, 0.0])
    p = np.cross(s, z)  # p, s, propagation are right-handed
    e_s, e_p = 1.0, -1j
    assert stokes(np.array(e_s), np.array(e_p))[3] > 0
    early, late = (
        np.real(e_s * np.exp(-1j * wt)) * s + np.real(e_p * np.exp(-1j * wt)) * p
        for wt in (0.0, 0.1)
    )
    # counterclockwise about the axis that points at the observer
    assert np.cross(early, late) @ z > 0


def test_mueller_matrices_keep_energy_and_polarise_at_brewsters_angle():
    cosines = np.linspace(0.0, 1.0, 41)
    unpolarised = np.array([1.0, 0.0, 0.0, 0.0])
    for eta, eta_i in ((1.5, 1.0), (1.0, 1.5)):
        reflected = mueller_reflection(cosines, eta, 0.0, eta_i) @ unpolarised
        refracted = mueller_refraction(cosines, eta, eta_i) @ unpolarised
        np.testing.assert_allclose(reflected[:, 0] + refracted[:, 0], 1.0, rtol=1e-14)
        np.testing.assert_allclose(reflected[:, 1] + refracted[:, 1], 0.0, atol=1e-14)
    at_brewster = mueller_reflection(1 / np.hypot(1.0, 1.5), 1.5) @ unpolarised
    np.testing.assert_allclose(at_brewster[1], at_brewster[0], rtol=1e-14)
    np.testing.assert_allclose(
        mueller_reflection(1.0, 0.2, 3.0),
        float(powers(1.0, 0.2, 3.0).R_s) * np.diag([1.0, 1.0, -1.0, -1.0]),
        atol=1e-15,
    )
    # total reflection: nothing refracted, with derivative 0; no diattenuation, only a retardation
    assert not np.asarray(mueller_refraction(0.5, 1.0, 1.5)).any()
    slope = jax.jacfwd(lambda c: mueller_refraction(c, 1.0, 1.5))(0.5)
    assert (np.asarray(slope) == 0.0).all()
    M = np.asarray(mueller_reflection(0.5, 1.0, 0.0, 1.5))
    np.testing.assert_allclose(M @ M.T, np.eye(4), atol=4e-15)


def test_mueller_elements_are_the_ellipsometric_numbers():
    """M01, M22, M32 over M00 are N, C and -S of the ellipsometric angles."""
    cosines = np.linspace(0.05, 1.0, 20)
    M = np.asarray(mueller_reflection(cosines, 0.3, 2.1))
    psi, delta = (np.asarray(x) for x in psi_delta(cosines, 0.3, 2.1))
    N, C = np.cos(2 * psi), np.sin(2 * psi) * np.cos(delta)
    S = np.sin(2 * psi) * np.sin(delta)
    for (i, j), number in (((0, 1), N), ((2, 2), C), ((3, 2), S)):
        np.testing.assert_allclose(M[:, i, j] / M[:, 0, 0], number, atol=1e-14)


def test_derivatives_of_mueller_matrices_against_differences():
    step = 1e-6

    def reflection(c, n, m):
        return mueller_reflection(c, n, 0.0, m)

    for function, arguments in (
        (mueller_reflection, (0.4, 1.2, 0.7, 1.1)),
        (reflection, (0.4, 1.0, 1.5)),  # total reflection
        (mueller_refraction, (0.9, 1.1, 1.5)),
    ):
        point, directions = np.array(arguments), np.eye(len(arguments))
        derivative = jax.jacfwd(lambda x, f=function: f(*x))(point)
        moved = jax.vmap(lambda x, f=function: f(*x))
        ends = np.concatenate([point + step * directions, point - step * directions])
        up, down = np.split(np.asarray(moved(ends)), 2)
        difference = np.moveaxis((up - down) / (2 * step), 0, -1)
        np.testing.assert_allclose(derivative, difference, atol=3e-9)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_depths(dtype):
    eps = float(np.finfo(dtype).eps)
    c, n, k, m = adversarial.hard_sets(dtype, SIZE)["around critical"]
    wavelength = dtype(0.5)
    depth = np.asarray(penetration_depth(wavelength, c, n, k, m))
    assert depth.dtype == dtype
    with mp.workdps(60):
        for i in range(SIZE):
            cc, nn, mm = (mp.mpf(float(x[i])) for x in (c, n, m))
            square = mm**2 * (1 - cc**2) - nn**2
            if square <= 0:
                assert depth[i] == np.inf
            else:
                true = mp.mpf(0.5) / (4 * mp.pi * mp.sqrt(square))
                assert abs(mp.mpf(float(depth[i])) / true - 1) < 12 * eps
    # at normal incidence in an absorber it is the absorption depth
    np.testing.assert_allclose(
        penetration_depth(wavelength, dtype(1.0), dtype(1.5), dtype(1e-3)),
        absorption_depth(wavelength, dtype(1e-3)),
        rtol=4 * eps,
    )
    assert absorption_depth(wavelength, dtype(1e-3)).dtype == dtype


def test_depth_is_where_the_power_has_fallen_to_1_over_e():
    """The field exp(i k_0 Q z) with Q from Snell's law, followed to that depth."""
    wavelength, angle, index = 0.6, 0.7, 0.3 + 2.0j
    depth = float(penetration_depth(wavelength, np.cos(angle), index))
    q = np.sqrt(index**2 - np.sin(angle) ** 2)
    field = np.exp(2j * np.pi / wavelength * q * depth)
    np.testing.assert_allclose(abs(field) ** 2, np.exp(-1.0), rtol=1e-14)


def test_derivatives_of_depths():
    assert absorption_depth(0.5, 0.0) == np.inf
    assert jax.grad(absorption_depth, 1)(0.5, 0.0) == 0.0
    np.testing.assert_allclose(
        jax.grad(absorption_depth, 1)(0.5, 2.0), -0.5 / (16 * np.pi), rtol=1e-15
    )
    assert jax.grad(penetration_depth, 1)(0.5, 0.9, 1.5) == 0.0
    step = 1e-6
    up, down = (float(penetration_depth(0.5, 0.4 + d, 1.0, 0.0, 1.5)) for d in (step, -step))
    slope = jax.grad(penetration_depth, 1)(0.5, 0.4, 1.0, 0.0, 1.5)
    np.testing.assert_allclose(slope, (up - down) / (2 * step), rtol=1e-8)


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
        penetration_depth(np.ones(3), np.ones(2), 1.5)
    with pytest.raises(ValueError, match="wavelength_um"):
        absorption_depth(np.ones(3), np.ones(2))
