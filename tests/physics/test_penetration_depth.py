"""Depths to which light enters absorbing media, and rarer ones in total reflection."""

import jax
import mpmath as mp
import numpy as np
import pytest

from fresnel_jax.polarization import absorption_depth, penetration_depth
from tests.truth import adversarial

SIZE = 25


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_depths(dtype):
    eps = float(np.finfo(dtype).eps)
    c, n, k, m = adversarial.hard_sets(dtype, SIZE)["around critical"]
    wavelength = dtype(0.5)
    depth = np.asarray(penetration_depth(c, n, k, m, wavelength_um=wavelength))
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
        penetration_depth(dtype(1.0), dtype(1.5), dtype(1e-3), wavelength_um=wavelength),
        absorption_depth(wavelength, dtype(1e-3)),
        rtol=4 * eps,
    )
    assert absorption_depth(wavelength, dtype(1e-3)).dtype == dtype


def test_depth_is_where_the_power_has_fallen_to_1_over_e():
    """The field exp(i k_0 Q z) with Q from Snell's law, followed to that depth."""
    wavelength, angle, index = 0.6, 0.7, 0.3 + 2.0j
    depth = float(penetration_depth(np.cos(angle), index, wavelength_um=wavelength))
    q = np.sqrt(index**2 - np.sin(angle) ** 2)
    field = np.exp(2j * np.pi / wavelength * q * depth)
    np.testing.assert_allclose(abs(field) ** 2, np.exp(-1.0), rtol=1e-14)


def test_derivatives_of_depths():
    assert absorption_depth(0.5, 0.0) == np.inf
    assert jax.grad(absorption_depth, 1)(0.5, 0.0) == 0.0
    np.testing.assert_allclose(
        jax.grad(absorption_depth, 1)(0.5, 2.0), -0.5 / (16 * np.pi), rtol=1e-15
    )
    assert jax.grad(penetration_depth)(0.9, 1.5, wavelength_um=0.5) == 0.0
    step = 1e-6
    up, down = (
        float(penetration_depth(0.4 + d, 1.0, 0.0, 1.5, wavelength_um=0.5)) for d in (step, -step)
    )
    slope = jax.grad(penetration_depth)(0.4, 1.0, 0.0, 1.5, wavelength_um=0.5)
    np.testing.assert_allclose(slope, (up - down) / (2 * step), rtol=1e-8)
