"""Uniaxial layers: against mpmath, pyElli's 4x4 matrices, isotropic layers, and their own laws."""

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fresnel_jax.layers import Uniaxial, stack
from tests.truth import stack_oracle

pytestmark = pytest.mark.slow

both_tiers = pytest.mark.parametrize(
    "exact", [False, pytest.param(True, marks=pytest.mark.study)], ids=["fast", "exact"]
)


def drawn(layers, count, seed):
    """Return cosine, n_0, n_o, k_o, n_e, k_e, thickness and wavelength; some are hyperbolic."""
    random = np.random.default_rng(seed)
    shape = (layers + 1, count)

    def index():
        k = 10.0 ** random.uniform(-6.0, 1.0, shape) * (random.random(shape) < 0.5)
        return random.uniform(0.05, 4.0, shape), k

    c, n_0 = random.uniform(0.01, 1.0, count), random.uniform(1.0, 1.8, count)
    d = 10.0 ** random.uniform(-3.0, 0.5, (layers, count))
    return c, n_0, *index(), *index(), d, 10.0 ** random.uniform(-0.5, 1.0, count)


@functools.partial(jax.jit, static_argnames="exact")
def parts(at, along, exact):
    """Return what two layers do (R, T, and the parts of r and t), and its derivative."""

    def values(c, n_0, n_o, k_o, n_e, k_e, d, wavelength):
        media = map(Uniaxial, jax.lax.complex(n_o, k_o), jax.lax.complex(n_e, k_e))
        found: Any = stack(
            c, [n_0, *media], thickness_um=list(d), wavelength_um=wavelength, exact=exact
        )
        return jnp.stack([*found[:4], *(x for z in found[4:8] for x in (z.real, z.imag))])

    return jax.jvp(values, at, along)


def truth(c, n_0, n_o, k_o, n_e, k_e, d, wavelength):
    """Return the same of one stack, from characteristic matrices in mpmath."""
    media = zip(map(complex, n_o, k_o), map(complex, n_e, k_e), strict=True)
    found = stack_oracle.stack(c, [n_0, *media], list(d), wavelength)
    return [*found[:4], *(x for z in found[4:] for x in (z.real, z.imag))]


@both_tiers
def test_values_are_those_of_mpmath_and_derivatives_those_of_differences(exact):
    count, step = 16, 1e-6
    at = drawn(2, count, 1)
    random = np.random.default_rng(2)
    along = tuple(random.standard_normal(z.shape) * z for z in at)
    with jax.enable_x64(True):
        values, slopes = map(np.asarray, parts(at, along, exact))
        each = [tuple(x + h * t for x, t in zip(at, along, strict=True)) for h in (step, -step)]
        two = [np.asarray(parts(x, along, exact)[0]) for x in each]
    waves = [(np.hypot(n, k)[:-1] * at[6] / at[7]).sum(0) for n, k in (at[2:4], at[4:6])]
    radians = 1.0 + 2.0 * np.pi * np.maximum(*waves)
    true = np.array([truth(*(z[..., i] for z in at)) for i in range(count)], float).T
    off = np.abs(values - true) / np.maximum(1.0, np.abs(true))
    assert (off < (1e-14 if exact else 2e-14 * radians)).all()
    moved = (two[0] - two[1]) / (2.0 * step)
    assert (np.abs(slopes - moved) < 1e-7 * (np.abs(moved).max(0) + radians)).all()


# Degrees and micrometres; media N_o, N_e; R_s, R_p and r_p / r_s of pyElli 0.23.1, Solver4x4 with
# PropagatorEig: elli.Structure(elli.AIR, [elli.Layer(elli.UniaxialMaterial(..), d)], substrate).
PYELLI = (
    (50.0, 0.633, [1.0, Uniaxial(1.62, 1.74), 3.88], [0.15],
     0.22435438222004345, 0.12712019001083896, -0.5586578645898248 + 0.5044857127756244j),
    (70.0, 0.5, [1.0, Uniaxial(1.9 + 0.3j, 1.6 + 0.05j), Uniaxial(2.2, 1.5 + 0.2j), 1.52],
     [0.08, 0.21],
     0.37823726997669255, 0.0606816999019089, 0.3058084586374604 - 0.2586775614288203j),
    (35.0, 0.7, [1.0, Uniaxial(0.2 + 3.1j, 1.8), Uniaxial(1.76 + 0.001j, 1.75)], [0.02],
     0.4874388933383043, 0.35435593435724266, -0.8320051557168185 - 0.1863934358248446j),
)  # fmt: skip


@both_tiers
def test_the_4x4_matrices_of_pyelli(exact):
    for angle, wavelength, media, d, R_s, R_p, rho in PYELLI:
        with jax.enable_x64(True):
            found: Any = stack(
                np.cos(np.radians(angle)), media,
                thickness_um=d, wavelength_um=wavelength, exact=exact,
            )  # fmt: skip
        np.testing.assert_allclose([found.R_s, found.R_p], [R_s, R_p], rtol=1e-13)
        np.testing.assert_allclose(found.r_p / found.r_s, rho, rtol=1e-13)


def test_both_indices_equal_are_an_isotropic_layer_also_before_a_thick_one():
    c, n_0, n, k, *_, d, wavelength = drawn(2, 50, 3)
    index = n + 1j * k
    options = {"thickness_um": list(np.minimum(d, 0.3)), "coherent": (True, False), "exact": False}
    with jax.enable_x64(True):
        one, other = (
            stack(c, [n_0, film, *index[1:]], wavelength_um=wavelength, **options)
            for film in (index[0], Uniaxial(index[0], index[0]))
        )
    pairs: Any = zip((*one[:4], one.cross), (*other[:4], other.cross), strict=True)
    for a, b in pairs:
        np.testing.assert_allclose(a, b, rtol=1e-11, atol=1e-13)


@pytest.mark.study
def test_the_exact_tier_absorbs_what_is_missing_also_beside_a_thick_layer():
    c, n_0, n_o, k_o, n_e, k_e, d, wavelength = drawn(2, 50, 4)
    media = [n_0, Uniaxial(n_o[0] + 1j * k_o[0], n_e[0] + 1j * k_e[0]), 1.5 + 1e-3j]
    media.append(Uniaxial(n_o[2], n_e[2]))
    for coherent in (True, (True, False)):
        with jax.enable_x64(True):
            found = stack(
                c, media, thickness_um=list(d), wavelength_um=wavelength, coherent=coherent
            )
        for of in "sp":
            R, T, A = (getattr(found, f"{name}_{of}") for name in "RTA")
            np.testing.assert_allclose(R + T + A.sum(0), 1.0, rtol=2e-14)
            assert coherent is not True or (np.asarray(A) >= 0.0).all()


def test_float32_stays_and_no_derivative_is_lost():
    """Along the normal, where p has no field along the axis; where N_e = K; at grazing light."""

    def R_p(c, n_e):
        media = [1.0, Uniaxial(jnp.float32(1.6), n_e), 3.88]
        return stack(c, media, thickness_um=[0.2], wavelength_um=0.5, exact=False).R_p

    c, n_e = np.float32([1.0, 0.6, 0.0]), np.float32([1.7, 0.8, 1.7])
    value, slope = jax.jit(jax.vmap(jax.value_and_grad(R_p, (0, 1))))(c, n_e)
    assert value.dtype == np.float32 and np.isfinite(slope).all() and abs(slope[1][0]) < 1e-6


def test_what_is_refused():
    layer = Uniaxial(1.5, 1.6)
    options: dict[str, Any] = {"thickness_um": [0.1], "wavelength_um": 0.5}
    with pytest.raises(ValueError, match="first medium of index is Uniaxial"):
        stack(0.5, [layer, 1.5, 1.0], **options)
    with pytest.raises(ValueError, match="a list of media is wanted"):
        stack(0.5, layer, **options)
    with pytest.raises(ValueError, match="layer 1 is Uniaxial and incoherent"):
        stack(0.5, [1.0, layer, 1.0], coherent=False, **options)
    with pytest.raises(ValueError, match="roughness_um with Uniaxial"):
        stack(0.5, [1.0, layer, 1.0], roughness_um=[0.0, 0.001], **options)
    with pytest.raises(ValueError, match="index"):
        stack(0.5, [1.0, Uniaxial(1.5, -1.6), 1.0], **options)
    with pytest.raises(ValueError, match="put the lossless medium that the light came from first"):
        stack(0.5 + 0.1j, [1.5 + 0.1j, 2.0, 1.0], **options)
