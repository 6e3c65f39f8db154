"""Derivatives of oscillators from hard X-rays to radio waves, against 60 digits."""

import jax
import mpmath as mp
import numpy as np
import pytest

from fresnel_jax.dispersion import HC_EV_UM, DrudeLorentz


def _true(wavelength, strength, resonance, width):
    energy = mp.mpf(HC_EV_UM) / wavelength
    return mp.sqrt(1 + strength / (resonance**2 - energy**2 - 1j * energy * width))


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("resonance", [0.0, 4.0])
def test_derivatives_at_any_wavelength(resonance, dtype):
    """In float32 those at 1e-5 um had the wrong sign, and those at 3e8 um were not finite."""
    with mp.workdps(60):
        for wavelength in (1e-5, 1e-3, 0.2, 5.0, 1e4, 3e8):
            numbers = [dtype(x) for x in (wavelength, 81.0, resonance, 0.07)]

            def index(*x):
                found = DrudeLorentz(*x[1:])(x[0])
                return found.eta, found.k

            found = np.array(jax.jacrev(index, argnums=(0, 1, 3))(*numbers), float)
            at = [mp.mpf(float(x)) for x in numbers]
            for j, i in enumerate((0, 1, 3)):
                order = tuple(int(i == n) for n in range(4))
                true = mp.diff(_true, at, order, h=mp.mpf(10) ** -40)
                # Of a complex number the smaller part has the rounding of the larger one.
                allowed = 64 * np.finfo(dtype).eps * abs(true) + 1e-36
                np.testing.assert_array_less(
                    abs(found[0, j] - float(true.real)), float(allowed), err_msg=f"{wavelength} {i}"
                )
                np.testing.assert_array_less(
                    abs(found[1, j] - float(true.imag)), float(allowed), err_msg=f"{wavelength} {i}"
                )
