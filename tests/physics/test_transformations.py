"""jit = eager, vmap = batch, and dtype out = dtype in, for every function of directions, BSDFs,
facets, polarization and materials."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fresnel_jax import bsdf, directions, dispersion, microfacet, polarization
from fresnel_jax.layers import slab

pytestmark = pytest.mark.slow

N = 12


def points(dtype):
    random = np.random.default_rng(20261121)

    def direction():
        v = random.normal(size=(N, 3))
        return (v / np.linalg.norm(v, axis=1, keepdims=True)).astype(dtype)

    def uniform(low, high, *shape):
        return random.uniform(low, high, (N, *shape)).astype(dtype)

    return {
        "wo": direction(), "wi": direction(), "normal": direction(), "cos": uniform(0, 1),
        "eta": uniform(1.1, 2.5), "k": uniform(0, 2), "alpha": uniform(0.05, 1),
        "u_lobe": uniform(0, 1), "u": uniform(0, 1, 2), "wavelength": uniform(0.45, 0.65),
    }  # fmt: skip


def glass(eta, alpha):
    return bsdf.Dielectric(eta, bsdf.TrowbridgeReitz(alpha, alpha))


FUNCTIONS = {
    "reflect": (directions.reflect, "wo normal"),
    "refract": (directions.refract, "wi normal eta"),
    "faceforward": (directions.faceforward, "normal wo"),
    "entering": (directions.entering, "wi normal"),
    "local_frame": (directions.local_frame, "normal"),
    "to_local": (lambda v, n: directions.to_local(v, directions.local_frame(n)), "wo normal"),
    "to_world": (lambda v, n: directions.to_world(v, directions.local_frame(n)), "wo normal"),
    "critical_angle_deg": (directions.critical_angle_deg, "eta"),
    "brewster_angle_deg": (directions.brewster_angle_deg, "eta"),
    "snells_window": (directions.snells_window, "eta"),
    "half_vector": (microfacet.half_vector, "wo wi eta"),
    "half_vector_jacobian": (microfacet.half_vector_jacobian, "wo wi eta"),
    "phases": (polarization.phases, "cos eta k"),
    "ellipsometric_ratio": (polarization.ellipsometric_ratio, "cos eta k"),
    "psi_delta": (polarization.psi_delta, "cos eta k"),
    "mueller_reflection": (polarization.mueller_reflection, "cos eta k"),
    "mueller_refraction": (polarization.mueller_refraction, "cos eta"),
    "penetration_depth": (
        lambda um, *x: polarization.penetration_depth(*x, wavelength_um=um), "wavelength cos eta k",
    ),
    "absorption_depth": (polarization.absorption_depth, "wavelength k"),
    "slab": (
        lambda c, n, k, um: slab(c, n, 1e-6 * k, thickness_um=3e3, wavelength_um=um),
        "cos eta k wavelength",
    ),
    "gold": (lambda um: tuple(dispersion.material("gold")(um)), "wavelength"),
    "BK7": (lambda um: tuple(dispersion.material("BK7")(um)), "wavelength"),
    "glass sample": (lambda n, a, w, v, u: glass(n, a).sample(w, v, u), "eta alpha wo u_lobe u"),
    "glass evaluate": (lambda n, a, w, v: glass(n, a).evaluate(w, v), "eta alpha wo wi"),
    "glass density": (lambda n, a, w, v: glass(n, a).density(w, v), "eta alpha wo wi"),
    "metal sample": (
        lambda n, k, a, w, v, u: bsdf.conductor(n, k, bsdf.TrowbridgeReitz(a, a)).sample(w, v, u),
        "eta k alpha wo u_lobe u",
    ),
    "metal evaluate": (
        lambda n, k, a, w, v: bsdf.conductor(n, k, bsdf.TrowbridgeReitz(a, a)).evaluate(w, v),
        "eta k alpha wo wi",
    ),
    "smooth glass sample": (
        lambda n, w, v, u: bsdf.Dielectric(n).sample(w, v, u),
        "eta wo u_lobe u",
    ),
    "pane sample": (lambda n, w, v, u: bsdf.ThinDielectric(n).sample(w, v, u), "eta wo u_lobe u"),
}  # fmt: skip


def assert_alike(found, expected, dtype):
    found, expected = jax.tree.leaves(found), jax.tree.leaves(expected)
    assert len(found) == len(expected) > 0
    for a, b in zip(map(np.asarray, found), map(np.asarray, expected), strict=True):
        assert a.dtype == b.dtype
        if np.issubdtype(a.dtype, np.inexact):
            assert a.real.dtype == dtype
            # compiled as one loop, products and sums may be rounded once instead of twice
            scale = np.maximum(np.abs(b), 1e-3)
            np.testing.assert_array_less(np.abs(a - b), 300 * np.finfo(dtype).eps * scale)
        else:
            np.testing.assert_array_equal(a, b)


# They are made of what the others are made of.
FURTHER = ("BK7", "ellipsometric_ratio", "metal sample", "metal evaluate", "smooth glass sample")


# Under the strict switches every call is traced in float64 too (test_strict_switches).
@pytest.mark.parametrize("dtype", [np.float32, pytest.param(np.float64, marks=pytest.mark.study)])
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.study] * (n in FURTHER)) for n in FUNCTIONS]
)
def test_jit_eager_vmap_and_dtype(name, dtype):
    function, wanted = FUNCTIONS[name]
    arguments = [jnp.asarray(points(dtype)[x]) for x in wanted.split()]
    batch = function(*arguments)
    assert_alike(jax.jit(function)(*arguments), batch, dtype)
    assert_alike(jax.jit(jax.vmap(function))(*arguments), batch, dtype)
