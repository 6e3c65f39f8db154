"""Fields and absorption against depth: tmm, the powers that a stack takes, exact differences."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fresnel_jax.layers import Uniaxial, fields_at_depth, stack

pytestmark = pytest.mark.slow

COSINE, WAVELENGTH = np.cos(np.radians(55.0)), 0.6
INDEX = np.array([1.0, 1.5 + 0.05j, 0.2 + 3.3j, 2.1, 1.52 + 0.001j])
THICKNESS = np.array([0.13, 0.03, 0.2])
DEPTH = np.array([-0.05, 0.0, 0.07, 0.145, 0.3, 0.5])
# E_y of s, E_x and E_z of p, absorption of s and of p at these depths, of `position_resolved` of
# tmm 0.2.0 (for a depth in the last medium with d_list[-1] = 1e9).
TMM = np.array([
    [0.6242570535864183 + 0.17860708318357665j, 0.5255579703389602 + 0.17822430949519846j,
     -0.8144001998280609 + 0.7391896068975019j, 0.0, 0.0],
    [0.8241833794412552 + 0.5511160559929562j, 0.655151692717401 + 0.3389437221332105j,
     -0.296939321574951 + 0.23519586180135293j, 2.692063206859612, 1.8830520399688044],
    [0.7244950676894066 + 0.7294413305905069j, 0.6663266022076832 + 0.5682164435173339j,
     -0.00040747375946560953 - 0.189949068643419j, 2.894639100141735, 2.198936496107745],
    [0.08132921086085662 + 0.2854177263830041j, 0.11948408939911347 + 0.27735794275246556j,
     -0.02817288937830564 + 0.055443985172877575j, 2.122644707227788, 2.2911955480847617],
    [-0.07453939784693725 - 0.23394691813959545j, -0.0875555845086519 - 0.23278522098224902j,
     0.06166562357409146 + 0.10941978213390839j, 0.0, 0.0],
    [0.1693292693553216 + 0.2997007270909651j, 0.1433502938071617 + 0.26689541463311184j,
     -0.09186934130616721 - 0.17066628924388466j, 0.0065766287815778, 0.007179189388094238],
])  # fmt: skip


@jax.jit
def seen(c, index, thickness, wavelength, depth):
    found = fields_at_depth(
        c, index, thickness_um=thickness, wavelength_um=wavelength, depth_um=depth
    )
    return jnp.stack([found.E_y, found.E_x, found.E_z, *(z + 0j for z in found[3:])], axis=-1)


def test_fields_and_absorption_are_those_of_tmm():
    with jax.enable_x64(True):
        found = seen(COSINE, INDEX, THICKNESS, WAVELENGTH, DEPTH)
    np.testing.assert_allclose(found, TMM, rtol=1e-12, atol=1e-14)


def test_derivatives_are_those_of_differences():
    depth = np.array([-0.05, 0.03, 0.07, 0.2])
    at = (COSINE, INDEX[[0, 1, 4]], THICKNESS[:1], np.float64(WAVELENGTH), depth)
    random, step = np.random.default_rng(1), 1e-5
    along = [random.standard_normal(np.shape(x)) * x for x in at]
    along[1][0] = along[1][0].real  # the first medium stays lossless
    with jax.enable_x64(True):
        both = jax.jit(lambda x: jax.jvp(seen, x, tuple(along)))
        slope = both(at)[1]
        each = [tuple(x + h * t for x, t in zip(at, along, strict=True)) for h in (step, -step)]
        difference = (both(each[0])[0] - both(each[1])[0]) / (2.0 * step)
    np.testing.assert_allclose(slope, difference, rtol=1e-7, atol=1e-8 * np.abs(slope).max())


def test_the_integral_over_a_layer_is_what_it_absorbs():
    """s, p and unpolarized, of a uniaxial layer between clear media."""
    z, weights = np.polynomial.legendre.leggauss(40)
    d, c = 0.4, np.array([0.1, 0.5, 0.9])
    options = {"thickness_um": [d], "wavelength_um": 0.5}
    media = [1.3, Uniaxial(1.8 + 0.2j, 1.4 + 0.01j), 1.6]
    with jax.enable_x64(True):
        depth = 0.5 * d * (z[:, None] + 1.0)
        found, powers = jax.jit(lambda c: (
            fields_at_depth(c, media, depth_um=depth, **options),
            stack(c, media, exact=False, **options),
        ))(c)  # fmt: skip
    for a, R, T in (
        (found.absorption_s, powers.R_s, powers.T_s),
        (found.absorption_p, powers.R_p, powers.T_p),
        (found.absorption, powers.R, powers.T),
    ):
        total = 0.5 * d * np.einsum("z,zc->c", weights, a)
        np.testing.assert_allclose(total, 1.0 - R - T, rtol=1e-12)


def test_no_derivative_is_lost_along_the_normal_and_at_grazing_incidence():
    def absorbed(c):
        film = {"thickness_um": [0.1], "wavelength_um": jnp.float32(0.5), "depth_um": 0.03}
        found = fields_at_depth(c, [1.0, 1.5 + 0.3j, 3.0], **film)
        return found.absorption_p

    value, slope = jax.jit(jax.vmap(jax.value_and_grad(absorbed)))(np.float32([1.0, 0.0]))
    assert value.dtype == np.float32 and np.isfinite(value).all() and np.isfinite(slope).all()


def test_what_is_refused():
    options: dict[str, Any] = {"thickness_um": [0.1], "wavelength_um": 0.5, "depth_um": 0.05}
    with pytest.raises(ValueError, match="absorbs, for which fields_at_depth has no formula"):
        fields_at_depth(0.5, [1.0 + 0.1j, 1.5, 1.0], **options)
    with pytest.raises(ValueError, match="L layers lie between"):
        fields_at_depth(0.5, [1.0, 1.0], **options)
