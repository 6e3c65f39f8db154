"""What a model shows against the library's own functions, and each nuisance by hand."""

import numpy as np
import pytest

from fitting import simulate
from fresnel_jax import powers
from fresnel_jax.dispersion import Cauchy, DrudeLorentz
from fresnel_jax.layers import slab
from fresnel_jax.polarization import psi_delta

CAUCHY = {"A": 1.5, "B": 0.012, "C": 0.0}


def grid():
    points = np.meshgrid([45.0, 65.0, 75.0], np.linspace(0.4, 0.9, 14))
    return tuple(a.ravel() for a in points)


def test_predict_is_the_library():
    angle, wavelength = grid()
    c = np.cos(np.radians(angle))
    index = Cauchy([1.5, 0.012, 0.0])(wavelength)
    one = powers(c, *index)
    for q in ("R_s", "R_p", "T_s", "T_p", "R", "T"):
        found = simulate("cauchy", CAUCHY, angle, wavelength, q)
        np.testing.assert_allclose(found, getattr(one, q), rtol=1e-13, atol=1e-16)
    both = slab(c, *index, 100.0, wavelength)
    found = simulate("air | cauchy 100 um thick | air", CAUCHY, angle, wavelength, "T")
    np.testing.assert_allclose(found, both.T, rtol=1e-13)
    metal = {"eps_inf": 2.0, "plasma_ev": 8.0, "width_ev": 0.1, "strength_ev2_1": 3.0,
             "resonance_ev_1": 2.5, "width_ev_1": 0.6}  # fmt: skip
    index = DrudeLorentz([64.0, 3.0], [0.0, 2.5], [0.1, 0.6], 2.0)(wavelength)
    angles = psi_delta(c, *index)
    for q, true in (("psi", angles.psi), ("delta", angles.delta)):
        found = simulate("drude-lorentz", metal, angle, wavelength, q)
        np.testing.assert_allclose(found, np.degrees(true), rtol=1e-11)


def test_nuisances_act_as_they_say():
    angle, wavelength = np.array([30.0, 60.0]), np.full(2, 0.5)
    values = {"eta": 1.5, "k": 0.1}

    def seen(quantity, at=angle, **extra):
        return simulate("constant", values | extra, at, wavelength, quantity)

    np.testing.assert_allclose(
        seen("R_s", scale=0.9, background=0.01), 0.9 * seen("R_s") + 0.01, rtol=1e-14
    )
    np.testing.assert_allclose(seen("R_p", angle_offset=0.5), seen("R_p", angle + 0.5), rtol=1e-13)
    mixed = 0.98 * seen("R_p") + 0.02 * seen("R_s")
    np.testing.assert_allclose(seen("R_p", leak=0.02), mixed, rtol=1e-13)
    np.testing.assert_allclose(seen("R", leak=0.02), seen("R"), rtol=1e-13)
    # a Gaussian beam by brute force
    x = np.linspace(-9.0, 9.0, 4001)
    weight = np.exp(-x * x / 2.0) / np.exp(-x * x / 2.0).sum()
    for i in range(2):
        many = simulate("constant", values, angle[i] + 0.8 * x, 0.5, "R_p")
        assert seen("R_p", divergence=0.8)[i] == pytest.approx(weight @ many, rel=1e-9)


def test_refusals():
    with pytest.raises(ValueError, match="has no parameter 'D'"):
        simulate("cauchy", CAUCHY | {"D": 1.0}, 45.0, 0.5, "R")
    with pytest.raises(ValueError, match="needs a value of B"):
        simulate("cauchy:2", {"A": 1.5}, 45.0, 0.5, "R")
    for quantity in ("Delta", ["psi", "Delta"], "r_s"):  # once a number without meaning
        with pytest.raises(ValueError, match=r"no quantity .*; one of R_s, .*, psi, delta was"):
            simulate("Si", {}, 60.0, 0.5, quantity)
