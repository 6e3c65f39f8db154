"""Graded layers against their differential equation."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fresnel_jax.layers import Uniaxial, graded_layer, stack

C, N_0, SUBSTRATE, D, WAVELENGTH = 0.5, 1.0, 3.88 + 0.02j, 1.0, 0.55


def profile(z, bend, xp=np):
    """A polymer whose surface swells and absorbs."""
    return 1.5 + bend * xp.exp(-3.0 * z) + 0.01j * xp.cos(z)


def truth(bend):
    """R_s and R_p by a Runge-Kutta method of order 8."""
    k0, K2, out = 2.0 * np.pi / WAVELENGTH, N_0**2 * (1.0 - C * C), []
    q = np.sqrt(SUBSTRATE**2 - K2)
    for s in (True, False):

        def slope(z, fields, s=s):
            u, w = fields
            e = profile(z, bend) ** 2
            electric = w if s else e * w
            return [1j * k0 * electric, 1j * k0 * ((e - K2) * u if s else (1.0 - K2 / e) * u)]

        start = [1.0 + 0j, q if s else q / SUBSTRATE**2]
        found = solve_ivp(slope, [D, 0.0], start, method="DOP853", rtol=1e-13, atol=1e-14)
        u, w = found.y[:, -1]
        y = N_0 * C if s else C / N_0
        out.append(abs((y * u - w) / (y * u + w)) ** 2)
    return np.array(out)


@functools.partial(jax.jit, static_argnums=1)
def reflected(bend, layers):
    """R_s and R_p, and their derivatives by the parameter of the profile."""

    def both(bend):
        media, d = graded_layer(lambda z: profile(z, bend, jnp), D, layers=layers)
        found = stack(
            C, [N_0, *media, SUBSTRATE], thickness_um=d, wavelength_um=WAVELENGTH, exact=False
        )
        return jnp.stack([found.R_s, found.R_p])

    return jax.jvp(both, (bend,), (jnp.ones_like(bend),))


def test_the_error_is_as_stated_and_falls_with_the_fourth_power():
    step = 1e-3
    true = truth(0.2)
    moved = (truth(0.2 + step) - truth(0.2 - step)) / (2.0 * step)
    with jax.enable_x64(True):
        few, many = (reflected(0.2, layers) for layers in (32, 64))
    few, many = (np.array([np.abs(x[0] - true), np.abs(x[1] - moved)]) for x in (few, many))
    assert many[0].max() < 1e-5 and many[1].max() < 1e-4
    assert 10.0 < few[0].max() / many[0].max() < 25.0


def test_a_constant_index_is_one_layer():
    media, d = graded_layer(lambda z: 1.5, 0.3, layers=4)
    assert len(media) == len(d) == 4 and isinstance(media[0], Uniaxial)
    np.testing.assert_allclose([np.asarray(x) for m in media for x in m], 1.5, rtol=1e-6)
    np.testing.assert_allclose(sum(d), 0.3, rtol=1e-6)
    for layers in (0, 3, 4.0):
        with pytest.raises(ValueError, match="an even number above 0"):
            graded_layer(lambda z: 1.5, 0.3, layers=layers)  # type: ignore
