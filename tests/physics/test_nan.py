"""NaN in is NaN out: an index that is unknown must not become a perfect mirror."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fresnel_jax import (
    amplitudes,
    approximate,
    faceforward,
    fresnel_complex,
    fresnel_conductor,
    fresnel_dielectric,
    polarization,
    powers,
    reflect,
    reflectance,
    refract,
)
from fresnel_jax.bsdf import (
    Dielectric,
    FresnelNone,
    ThinDielectric,
    TrowbridgeReitz,
    conductor,
    specular_reflection,
)
from fresnel_jax.directions import (
    brewster_angle_deg,
    critical_angle_deg,
    local_frame,
    snells_window,
)
from fresnel_jax.dispersion import material
from fresnel_jax.layers import slab
from fresnel_jax.microfacet import half_vector, half_vector_jacobian

pytestmark = pytest.mark.slow

NAN = float("nan")
DTYPES = pytest.mark.parametrize("dtype", [np.float64, np.float32])
# The longer tests have float64 alone: what becomes of a NaN is decided by the same comparisons.
FLOAT32_IN_STUDIES = pytest.mark.parametrize(
    "dtype", [np.float64, pytest.param(np.float32, marks=pytest.mark.study)]
)


def plain(*arguments):
    return reflectance(*arguments, compensated=False)


def deep_slab(c, eta, k=0.0, eta_i=1.0):
    return slab(c, eta, k, thickness_um=3.0, wavelength_um=0.5, eta_i=eta_i)


def depth(*arguments):
    return polarization.penetration_depth(*arguments, wavelength_um=0.5)


# name -> function of (cos, eta), (cos, eta, k) or (cos, eta, k, eta_i), and how many it takes
BOUNDARY = {
    f.__name__: f
    for f in (
        powers,
        reflectance,
        plain,
        amplitudes,
        deep_slab,
        depth,
        polarization.phases,
        polarization.psi_delta,
        polarization.ellipsometric_ratio,
        approximate.schlick,
        approximate.lazanyi_szirmay_kalos,
        approximate.f82,
        approximate.large_index,
        approximate.polynomial,
    )
}


def cases():
    """A NaN in each place, with and without what may be left out, inside total reflection too."""
    for c, n in ((0.6, 1.5), (0.2, 0.7), (1.0, 1.0)):
        for full in ((c, n), (c, n, 0.1), (c, n, 0.0, 1.2), (c, n, 0.1, 1.2)):
            for i in range(len(full)):
                if i == 2 and full[2] == 0.0:
                    continue
                yield tuple(NAN if j == i else x for j, x in enumerate(full))


@FLOAT32_IN_STUDIES
@pytest.mark.parametrize("name", BOUNDARY)
def test_of_one_boundary(name, dtype):
    function = BOUNDARY[name]
    for given in cases():
        # a Python 0 for k selects the lossless program, and stays one
        arrays = [x if i == 2 and x == 0.0 else jnp.full(3, x, dtype) for i, x in enumerate(given)]
        for leaf in jax.tree.leaves(function(*arrays)):
            assert np.isnan(np.asarray(leaf)).all(), (name, given, leaf)


@pytest.mark.parametrize("name", [
    pytest.param(name, marks=[pytest.mark.study] * (name not in ("powers", "psi_delta")))
    for name in BOUNDARY
])  # fmt: skip
def test_of_numbers_instead_of_arrays(name):
    assert np.isnan(np.asarray(jax.tree.leaves(BOUNDARY[name](1.0, NAN, 0.1)))).all()


@pytest.mark.study
@DTYPES
@pytest.mark.parametrize("function", [reflectance, plain, lambda *a: powers(*a).R_p])
def test_gradients(function, dtype):
    programs = {n: jax.jit(jax.grad(function, argnums=tuple(range(n)))) for n in (2, 3, 4)}
    for given in cases():
        arrays = [dtype(x) for x in given]
        gradient = programs[len(arrays)](*arrays)
        assert np.isnan(np.asarray(gradient)).all(), (given, gradient)


def test_without_jit():
    with jax.disable_jit():
        for function in (powers, reflectance, amplitudes):
            assert np.isnan(np.asarray(jax.tree.leaves(function(0.5, NAN)))).all()


@DTYPES
def test_the_sources_names(dtype):
    x, nan = dtype(0.5), dtype(NAN)
    for R in (
        fresnel_dielectric(nan, x),
        fresnel_dielectric(x, nan),
        fresnel_dielectric(-x, nan),
        fresnel_conductor(x, x, nan),
        fresnel_complex(x, jax.lax.complex(nan, x)),
        fresnel_complex(x, jax.lax.complex(x, nan)),
        FresnelNone()(nan),
    ):
        assert np.isnan(R) and R.dtype == dtype


def test_a_material_outside_its_range_is_no_mirror():
    glass = material("BK7")
    R = jax.jit(lambda wavelength: reflectance(0.5, *glass(wavelength)))(jnp.array([0.5, 5.0]))
    assert np.isfinite(R[0]) and np.isnan(R[1])
    matrix = polarization.mueller_reflection(0.5, NAN)
    assert np.isnan(np.asarray(matrix)[0, 0]) and np.isnan(np.asarray(matrix)[3, 3])
    assert np.isnan(np.asarray(polarization.mueller_refraction(NAN, 1.5))[2, 2])


@FLOAT32_IN_STUDIES
def test_directions(dtype):
    up, w = np.array([0, 0, 1], dtype), np.array([0.6, 0.0, 0.8], dtype)
    for i in range(3):
        broken = w.copy()
        broken[i] = NAN
        for found in (
            reflect(broken, up),
            reflect(w, broken),
            refract(broken, up, 1.5).direction,
            refract(w, broken, 1.5).direction,
            faceforward(up, broken),
            half_vector(broken, up, 1.5),
        ):
            assert np.isnan(np.asarray(found)).all() and found.dtype == dtype
        found = refract(broken, up, 1.5)
        assert np.isnan(found.eta) and not found.valid
        assert np.isnan(np.asarray(local_frame(broken).tangent)).any()
        assert np.isnan(half_vector_jacobian(broken, up, 1.5))
        assert np.isnan(half_vector_jacobian(broken, -up, 1.5))
    found = refract(w, up, dtype(NAN))
    assert np.isnan(np.asarray(found.direction)).all() and np.isnan(found.eta) and not found.valid
    for function in (brewster_angle_deg, critical_angle_deg, snells_window):
        assert np.isnan(function(dtype(NAN)))


def models(dtype):
    """Every kind of surface, its parameters as arrays so that one can be replaced by NaN."""
    rough, smooth = TrowbridgeReitz(dtype(0.3), dtype(0.2)), None
    for facets in (rough, smooth):
        yield Dielectric(dtype(1.5), facets)
        yield Dielectric(dtype(0.7), facets)
        yield conductor(dtype(0.2), dtype(3.0), facets)
    yield specular_reflection(dtype(0.5), FresnelNone())
    yield ThinDielectric(dtype(1.5))


# one program for all surfaces of a kind
@jax.jit
def evaluate(model, wo, wi):
    return model.evaluate(wo, wi), model.density(wo, wi)


@jax.jit
def sample(model, wo, u_lobe, u):
    return model.sample(wo, u_lobe, u)


@pytest.mark.study
@FLOAT32_IN_STUDIES
@pytest.mark.parametrize("i", range(8))
def test_surfaces(i, dtype):
    model = list(models(dtype))[i]
    w, v = np.array([0.6, 0.0, 0.8], dtype), np.array([-0.36, 0.48, 0.8], dtype)
    u_lobe, u = dtype(0.5), np.array([0.3, 0.7], dtype)
    leaves, structure = jax.tree.flatten(model)
    assert np.isfinite(np.asarray(evaluate(model, w, v))).all()
    assert sample(model, w, u_lobe, u).valid

    known = evaluate(model, w, v)

    def check(model, o, i):
        value, density = evaluate(model, o, i)
        assert np.isnan(value)
        # what a density does not depend on leaves it as it was: the index of a metal
        assert np.isnan(density) or (np.isfinite(o).all() and density == known[1])
        for u_l in (dtype(0.01), dtype(0.99)):
            found = sample(model, o, u_l, u)
            assert not found.valid
            assert found.value == found.weight == found.density == 0.0

    for j in range(len(leaves)):
        broken = [dtype(NAN) if n == j else x for n, x in enumerate(leaves)]
        model_ = jax.tree.unflatten(structure, broken)
        if isinstance(model, Dielectric) and j >= len(leaves) - 2:
            # one of the scales, which belongs to one lobe
            if j == len(leaves) - 2 and model.distribution is not None:
                assert np.isnan(evaluate(model_, w, v)[0])
        else:
            check(model_, w, v)
    for axis in range(3):
        broken = w.copy()
        broken[axis] = NAN
        check(model, broken, v)
        assert np.isnan(np.asarray(evaluate(model, w, broken))).all()
    if isinstance(model, Dielectric | ThinDielectric):
        assert not sample(model, w, dtype(NAN), u).valid
    if getattr(model, "distribution", None) is not None:
        for place in itertools.product((NAN, 0.5), repeat=2):
            if np.isnan(place).any():
                assert not sample(model, w, u_lobe, np.array(place, dtype)).valid


def test_a_thin_slab_of_an_unknown_index_neither_reflects_nor_transmits():
    assert np.isnan(np.asarray(ThinDielectric(NAN).powers(0.5))).all()


@FLOAT32_IN_STUDIES
def test_roughness_and_normals(dtype):
    facets = TrowbridgeReitz(dtype(0.3))
    w, broken = np.array([0.6, 0.0, 0.8], dtype), np.array([0.6, NAN, 0.8], dtype)
    assert np.isnan(facets.D(broken)) and np.isnan(facets.G1(broken))
    assert np.isnan(facets.G(w, broken)) and np.isnan(facets.Lambda(broken))
    assert np.isnan(facets.D_visible(w, broken)) and np.isnan(facets.D_visible(broken, w))
    below = np.array([0.6, 0.0, NAN], dtype)
    assert np.isnan(facets.D(below)) and np.isnan(facets.D_visible(w, below))
    assert np.isnan(TrowbridgeReitz(dtype(NAN)).D(w))
