"""Mueller matrices of one reflection and of one refraction."""

from pathlib import Path

import jax
import numpy as np
import pytest

from fresnel_jax import amplitudes, powers
from fresnel_jax.polarization import mueller_reflection, mueller_refraction, psi_delta

METALS = {"Ag": (0.055, 3.32), "Au": (0.43, 2.455), "W": (3.5, 2.73)}


def test_mueller_matrices_agree_with_the_table():
    """Mitsuba 3.9.1 in float32 (its key `doc` tells the frame); cos < 0: light from inside."""
    table = np.load(Path(__file__).parents[1] / "truth" / "reference" / "mueller.npz")
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


def test_mueller_matrices_keep_energy_and_polarize_at_brewsters_angle():
    cosines = np.linspace(0.0, 1.0, 41)
    unpolarized = np.array([1.0, 0.0, 0.0, 0.0])
    for eta, eta_i in ((1.5, 1.0), (1.0, 1.5)):
        reflected = np.asarray(mueller_reflection(cosines, eta, 0.0, eta_i)) @ unpolarized
        refracted = np.asarray(mueller_refraction(cosines, eta, eta_i)) @ unpolarized
        np.testing.assert_allclose(reflected[:, 0] + refracted[:, 0], 1.0, rtol=1e-14)
        np.testing.assert_allclose(reflected[:, 1] + refracted[:, 1], 0.0, atol=1e-14)
    at_brewster = np.asarray(mueller_reflection(1 / np.hypot(1.0, 1.5), 1.5)) @ unpolarized
    np.testing.assert_allclose(at_brewster[1], at_brewster[0], rtol=1e-14)
    np.testing.assert_allclose(
        mueller_reflection(1.0, 0.2, 3.0),
        float(powers(1.0, 0.2, 3.0).R_s) * np.diag([1.0, 1.0, -1.0, -1.0]),
        atol=1e-15,
    )
    # total reflection: nothing refracted, with derivative 0; no diattenuation, only a retardation
    assert not np.asarray(mueller_refraction(0.5, 1.0, 1.5)).any()
    slope = jax.jit(jax.jacfwd(lambda c: mueller_refraction(c, 1.0, 1.5)))(0.5)
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


@pytest.mark.study
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
        derivative = jax.jit(jax.jacfwd(lambda x, f=function: f(*x)))(point)
        moved = jax.jit(jax.vmap(lambda x, f=function: f(*x)))
        ends = np.concatenate([point + step * directions, point - step * directions])
        up, down = np.split(np.asarray(moved(ends)), 2)
        difference = np.moveaxis((up - down) / (2 * step), 0, -1)
        np.testing.assert_allclose(derivative, difference, atol=3e-9)
