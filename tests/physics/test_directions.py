"""Sides, frames and the angles that mark them, against counting and 50-digit arithmetic."""

import jax
import mpmath
import numpy as np
import pytest

from fresnel_jax import directions
from fresnel_jax.interface import powers

UP = np.array([0.0, 0.0, 1.0])
DTYPES = [np.float32, np.float64]

refract = jax.jit(directions.refract)


def unit_vectors(rng, count, dtype=np.float64):
    v = rng.normal(size=(count, 3))
    return (v / np.linalg.norm(v, axis=-1, keepdims=True)).astype(dtype)


def directions_with_cosine(z, rng, dtype=np.float64):
    z = np.clip(z, -1.0, 1.0)
    phi = rng.uniform(0.0, 2.0 * np.pi, z.shape)
    r = np.sqrt((1.0 - z) * (1.0 + z))
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1).astype(dtype)


# Frames and sides ---------------------------------------------------------------------------------


def test_faceforward_and_entering():
    n = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    v = np.array([[0.6, 0.0, 0.8], [0.6, 0.0, -0.8], [1.0, 0.0, 0.0]])
    np.testing.assert_array_equal(directions.faceforward(n, v), n * [[1], [-1], [1]])
    np.testing.assert_array_equal(directions.entering(v, n), [True, False, True])


@pytest.mark.parametrize("dtype", DTYPES)
def test_local_frame_is_orthonormal_for_every_normal(dtype):
    rng = np.random.default_rng(10)
    tilt = 10.0 ** -np.arange(0.0, 12.0)
    special = np.concatenate([np.eye(3), -np.eye(3), np.stack([tilt, 0 * tilt, -1 + 0 * tilt], -1),
                              np.stack([1 + 0 * tilt, tilt, -tilt], -1)])  # fmt: skip
    special /= np.linalg.norm(special, axis=-1, keepdims=True)
    n = np.concatenate([unit_vectors(rng, 2000), special]).astype(dtype)
    frame = directions.local_frame(n)
    axes = np.stack([np.asarray(a, np.float64) for a in frame], axis=-2)
    eps = np.finfo(dtype).eps
    product = axes @ np.swapaxes(axes, -1, -2)
    assert np.abs(product - np.eye(3)).max() < 6 * eps  # n itself is unit to 2 eps
    np.testing.assert_allclose(np.linalg.det(axes), 1.0, rtol=0, atol=10 * eps)
    v = unit_vectors(rng, n.shape[0], dtype)
    local = directions.to_local(v, frame)
    assert local.dtype == dtype
    np.testing.assert_allclose(local[:, 2], np.sum(v * n, -1), rtol=0, atol=3 * eps)
    np.testing.assert_allclose(directions.to_world(local, frame), v, rtol=0, atol=10 * eps)


# Angles -------------------------------------------------------------------------------------------


def test_critical_angle_on_both_sides():
    # water 48.6 degrees; glass to air 41.8
    np.testing.assert_allclose(directions.critical_angle_deg(1.333), 48.6066, rtol=0, atol=1e-4)
    np.testing.assert_allclose(directions.critical_angle_deg(1.5), 41.8103, rtol=0, atol=1e-4)
    for eta in (1.333, 1 / 1.333):
        angle = np.deg2rad(directions.critical_angle_deg(eta))
        side = -1.0 if eta > 1 else 1.0  # light comes from the denser side
        for offset, reaches in ((-1e-9, True), (1e-9, False)):
            w = np.array([np.sin(angle + offset), 0.0, side * np.cos(angle + offset)])
            assert bool(refract(w, UP, eta).valid) == reaches
            assert (float(powers(w[2], 1.0 if eta > 1 else eta, eta_i=max(eta, 1.0)).T) > 0) == (
                reaches
            )


@pytest.mark.parametrize("eta", [0.25, 0.7, 1 - 1e-9, 1 + 1e-14, 1 + 1e-6, 1.333, 2.42, 4.0])
def test_angles_against_many_digits(eta):
    with mpmath.workdps(50):
        m = mpmath.mpf(eta)
        sine = min(m, 1 / m)
        exact = {
            directions.critical_angle_deg: mpmath.degrees(mpmath.asin(sine)),
            directions.snells_window: 1 - mpmath.sqrt(1 - sine**2),
            directions.brewster_angle_deg: mpmath.degrees(mpmath.atan(m)),
        }
        for function, value in exact.items():
            assert abs(float(function(eta)) / value - 1) < 4 * np.finfo(np.float64).eps


def test_brewster_angle_reflects_no_p_light():
    for eta in (0.7, 1.333, 2.42):
        angle = np.deg2rad(directions.brewster_angle_deg(eta))
        assert float(powers(np.cos(angle), eta).R_p) < 1e-30


def test_snells_window_of_water():
    np.testing.assert_allclose(directions.snells_window(1.333), 0.339, rtol=0, atol=5e-4)
    # the share of the inner hemisphere that is reached from outside, counted
    rng = np.random.default_rng(11)
    w = directions_with_cosine(-rng.uniform(0.0, 1.0, 200_000), rng)
    share = np.mean(refract(w, UP, 1.333).valid)
    assert abs(share - float(directions.snells_window(1.333))) < 5 * np.sqrt(0.339 * 0.661 / 2e5)
    # and from outside every ray ends up within it
    t = refract(-w, UP, 1.333).direction
    assert np.max(t[:, 2]) <= -np.cos(np.deg2rad(directions.critical_angle_deg(1.333))) + 1e-15


def test_angles_at_index_match_have_finite_derivatives():
    assert float(directions.critical_angle_deg(1.0)) == 90.0
    assert float(directions.snells_window(1.0)) == 1.0
    for angle in (directions.critical_angle_deg, directions.snells_window):
        assert np.isfinite(jax.grad(angle)(1.0))
        h = 1e-6
        np.testing.assert_allclose(
            jax.grad(angle)(1.5), (angle(1.5 + h) - angle(1.5 - h)) / (2 * h), rtol=1e-8
        )


def test_float32_is_kept_beside_python_numbers():
    w = np.array([0.6, 0.0, 0.8], np.float32)
    assert refract(w, UP.astype(np.float32), 1.5).direction.dtype == np.float32
    assert directions.critical_angle_deg(np.float32(1.5)).dtype == np.float32
