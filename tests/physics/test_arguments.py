"""What every function of one boundary takes, refuses by name, and makes of a cosine above 1."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fresnel_jax import (
    amplitudes,
    approximate,
    fresnel_dielectric,
    polarization,
    powers,
    reflectance,
)
from fresnel_jax.bsdf import (
    Dielectric,
    FresnelConductor,
    FresnelStack,
    ThinDielectric,
    conductor,
    fresnel_specular,
)
from fresnel_jax.directions import critical_angle_deg
from fresnel_jax.dispersion import Constant, DrudeLorentz, lorentz_drude, material
from fresnel_jax.effective_medium import bruggeman
from fresnel_jax.layers import slab, stack
from fresnel_jax.microfacet import TrowbridgeReitz
from tests.truth import adversarial

DTYPES = pytest.mark.parametrize("dtype", [np.float64, np.float32])
FUNCTIONS = pytest.mark.parametrize(
    "function",
    [
        powers,
        reflectance,
        amplitudes,
        polarization.phases,
        polarization.psi_delta,
        polarization.ellipsometric_ratio,
        polarization.mueller_reflection,
        lambda c, n, *rest: slab(c, n, *rest[:1], thickness_um=3.0, wavelength_um=0.5),
        lambda *a: polarization.penetration_depth(*a, wavelength_um=0.5),
        approximate.schlick,
        approximate.f82,
        approximate.polynomial,
        approximate.large_index,
        approximate.lazanyi_szirmay_kalos,
    ],
    ids=lambda f: f.__name__,
)


@pytest.mark.study
@pytest.mark.parametrize("dtype", [pytest.param(np.float64, marks=pytest.mark.study), np.float32])
@FUNCTIONS
def test_a_cosine_that_rounding_left_above_one_is_one(function, dtype):
    """Value and derivative are those of 1, from below: no branch flips, no search stops."""
    eps = np.finfo(dtype).eps
    for rest in ((0.5, 3.0), (1.5,), (0.7,)):
        rest = [dtype(x) for x in rest]
        at_one = jax.jvp(lambda c, r=rest: function(c, *r), (dtype(1.0),), (dtype(1.0),))
        for above in (1 + eps, 1 + 8 * eps, 1.0005):
            for sign in (1, -1):
                c, dc = dtype(sign * above), dtype(sign)
                found = jax.jvp(lambda c, r=rest: function(c, *r), (c,), (dc,))
                for x, y in zip(jax.tree.leaves(found), jax.tree.leaves(at_one), strict=True):
                    np.testing.assert_array_equal(np.asarray(x), np.asarray(y))


def test_delta_does_not_flip_above_one():
    """It was -pi: a float32 dot product of two unit vectors gives such a cosine."""
    found = polarization.psi_delta(np.float32(1.0000001), np.float32(0.5), np.float32(3.0))
    assert float(found.delta) == pytest.approx(np.pi, rel=1e-6)
    assert float(found.psi) == pytest.approx(np.pi / 4, rel=1e-6)


@DTYPES
def test_a_dielectric_surface_takes_it_too(dtype):
    up = np.array([0.0, 0.0, 1.0 + 4 * np.finfo(dtype).eps], dtype)
    for model in (Dielectric(dtype(1.5)), ThinDielectric(dtype(1.5))):
        found = model.sample(up, dtype(0.9), np.array([0.3, 0.3], dtype))
        assert found.valid and 0.0 < found.weight <= 1.0 + 8 * np.finfo(dtype).eps


@pytest.mark.parametrize(
    "cosine", [60.0, 45, -60.0, np.float64(30.0), np.linspace(0, 90, 91), np.linspace(0, 90, 10**6)]
)
def test_degrees_are_refused(cosine):
    for function in (reflectance, powers, amplitudes, fresnel_dielectric, polarization.psi_delta):
        with pytest.raises(ValueError, match=r"no cosine.*jnp\.cos\(jnp\.deg2rad"):
            function(cosine, 1.5)
    # a traced one cannot be looked at, and counts as 1
    assert float(jax.jit(reflectance)(60.0, 1.5)) == pytest.approx(0.04, rel=1e-14)


NEGATIVE = pytest.mark.parametrize(
    "k", [-1e-3, np.float32(-1.0), np.array([0.1, -0.1]), jnp.array([0.1, -0.1])], ids=repr
)


@NEGATIVE
def test_negative_k_is_refused(k):
    with pytest.raises(ValueError, match="wanted k >= 0.*eta - ik"):
        powers(0.5, 1.5, k)
    with pytest.raises(ValueError, match="wanted k >= 0"):
        reflectance(0.5, 1.5 + 1j * np.asarray(k))
    with pytest.raises(ValueError, match="wanted k >= 0"):
        polarization.absorption_depth(0.5, k)


@NEGATIVE
def test_negative_k_is_refused_elsewhere(k):
    """A mirror of weight 1, and stacks with T = 1.35, came of it."""
    for call in (
        lambda: stack(0.5, [1.0, 1.5 + 1j * k, 1.0], thickness_um=[0.1], wavelength_um=0.5),
        lambda: stack(
            0.5,
            np.stack(np.broadcast_arrays(1.0, 1.5 + 1j * k, 1.0)),
            thickness_um=[0.1],
            wavelength_um=0.5,
        ),
        lambda: conductor(0.2, k),
        lambda: Constant(0.2, k),
        lambda: approximate.schlick(0.5, 1.5, k),
        lambda: approximate.f82(0.5, 1.5, k=k),
        lambda: approximate.polynomial(0.5, 1.5, k, degree=4),
        lambda: approximate.normal_reflectance(1.5, k),
    ):
        with pytest.raises(ValueError, match="wanted k >= 0"):
            call()
    assert np.isfinite(jax.jit(approximate.schlick)(0.5, 1.5, jnp.asarray(k))).all()


def test_degrees_are_refused_elsewhere():
    for call in (
        lambda: stack(60.0, [1.0, 1.5, 1.0], thickness_um=[0.1], wavelength_um=0.5),
        lambda: approximate.schlick(60.0, 1.5),
        lambda: approximate.f82_from_reflectances(60.0, 0.5, 0.6),
    ):
        with pytest.raises(ValueError, match="which is no cosine"):
            call()


@FUNCTIONS
def test_lists_are_arrays(function):
    listed = function([0.5, 0.6], [1.5, 2.0], [0.1, 0.2])
    arrays = function(*(np.array(x) for x in ([0.5, 0.6], [1.5, 2.0], [0.1, 0.2])))
    for x, y in zip(jax.tree.leaves(listed), jax.tree.leaves(arrays), strict=True):
        np.testing.assert_allclose(np.asarray(x), np.asarray(y), rtol=1e-13)


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: reflectance(0.9, 0.0), "eta is 0; wanted > 0"),
        (lambda: powers(0.9, np.array([1.5, -1.0])), "eta is -1"),
        (lambda: powers(0.9, 1.5, eta_i=-1.0), "eta_i is -1"),
        (lambda: reflectance(0.9, 1.5, np.inf), "k is infinite"),
        (lambda: approximate.schlick(0.9, -1.5), "eta is -1.5"),
        (lambda: approximate.schlick(0.9, 1.5, eta_i=0.0), "eta_i is 0"),
        (lambda: approximate.schlick(0.9, 0.0), "eta is 0; wanted > 0"),
        (lambda: approximate.f82(0.9, complex(1.5, np.inf)), "k is infinite"),
        (lambda: powers(0.9, np.inf), "eta is infinite"),
        (lambda: reflectance(0.9, 1.5, eta_i=np.inf), "eta_i is infinite"),
        (lambda: fresnel_dielectric(0.9, np.inf), "eta is infinite"),
        (lambda: FresnelStack([1.0, 1.5, 2.0], [-0.1], 0.5), "thickness_um is -0.1"),
        (lambda: FresnelStack([1.0, 1.5, 2.0], [0.1], -0.5), "wavelength_um is -0.5"),
        (lambda: FresnelConductor(0.0), "eta is 0"),
        (lambda: TrowbridgeReitz(-0.1), "alpha_x is -0.1"),
        (lambda: TrowbridgeReitz(0.1, np.array([0.1, -0.2])), "alpha_y is -0.2"),
        (lambda: Constant(-1.5), "eta is -1.5"),
        (lambda: Constant(1.5)(-0.5), "wavelength_um is -0.5"),
        (lambda: DrudeLorentz(80.0, 0.0, 0.1)(np.array([0.5, 0.0])), "wavelength_um is 0"),
        (lambda: material("gold")(-0.5), "wavelength_um is -0.5"),
        (lambda: material("vacuum")(np.inf), "wavelength_um is infinite"),
        (lambda: bruggeman([1.0, -1.5], [0.0, 0.0], [0.5]), "eta is -1.5"),
        (lambda: bruggeman(np.array([1.0, 1.5]), np.array([0.0, -0.1]), [0.5]), "k is -0.1"),
        (lambda: Dielectric(-1.5), "eta is -1.5"),
        (lambda: FresnelConductor(-1.0, 1.0), "eta is -1"),
        (lambda: critical_angle_deg(-1.0), "eta is -1"),
        # this one was R + T = 1.027
        (lambda: slab(0.9, 1.5, 0.001, thickness_um=-1.0, wavelength_um=0.5), "thickness_um is -1"),
        (
            lambda: slab(0.9, 1.5, 0.0, thickness_um=np.inf, wavelength_um=0.5),
            "thickness_um is inf",
        ),
        (lambda: slab(0.9, 1.5, 0.0, thickness_um=1.0, wavelength_um=0.0), "wavelength_um is 0"),
        (lambda: polarization.penetration_depth(0.9, 1.5, wavelength_um=-1.0), "wavelength_um is"),
        (lambda: polarization.absorption_depth(0.0, 1.0), "wavelength_um is 0"),
        (
            lambda: stack(0.9, [1.0, -2.0, 1.5], thickness_um=[0.1], wavelength_um=0.5),
            "the real part of index is -2",
        ),
        *(
            (lambda media=media: stack(0.9, media, thickness_um=[0.1], wavelength_um=0.5), text)
            for media, text in (
                ([1.0, 0.0, 1.5], "the real part of index is 0"),
                (np.array([1.0, 0.0, 1.5]), "the real part of index is 0"),
                (jnp.array([1.0, 2.0, -1.5]), "the real part of index is -1.5"),
                (jnp.array([1.0, 2.0 - 0.1j, 1.5]), "the imaginary part of index is -0.1"),
                ([1.0, 0.0j, 1.5], "the modulus of index is 0"),
                ([1.0, 2.0, np.inf], "the real part of index is infinite"),
                ([1.0, complex(2.0, np.inf), 1.5], "the imaginary part of index is infinite"),
            )
        ),
        (
            lambda: stack(0.9, [1.0, 2.0, 1.5], thickness_um=[np.inf], wavelength_um=0.5),
            "thickness_um is inf",
        ),
        (
            lambda: stack(0.9, [1.0, 2.0, 1.5], thickness_um=[0.1], wavelength_um=np.inf),
            "wavelength_um is infinite",
        ),
        (
            lambda: stack(0.9, [1.0, 2.0, 1.5], thickness_um=[-0.1], wavelength_um=0.5),
            "thickness_um is -0.1",
        ),
        (
            lambda: stack(0.9, [1.0, 2.0, 1.5], thickness_um=[0.1], wavelength_um=-0.5),
            "wavelength_um is -0.5",
        ),
        (
            lambda: stack(0.9, [1.0, 2.0], thickness_um=[], wavelength_um=0.5, roughness_um=[-0.1]),
            "roughness_um is -0.1",
        ),
    ],
)
def test_values_outside_of_the_domain_are_refused_where_they_can_be_read(call, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        call()


def test_lists_elsewhere():
    assert fresnel_dielectric([0.5, -0.5], [1.5, 1.5]).shape == (2,)
    assert slab(0.5, 1.5, 0.0, thickness_um=[1.0, 2.0], wavelength_um=0.5).R.shape == (2,)
    assert material("gold")([0.5, 0.6]).eta.shape == (2,)
    assert polarization.absorption_depth([0.5, 0.6], [1.0, 2.0]).shape == (2,)
    jitted = jax.jit(lambda x: reflectance([x, 0.5], 1.5))(0.4)
    np.testing.assert_allclose(jitted, reflectance(np.array([0.4, 0.5]), 1.5), rtol=1e-14)


@pytest.mark.parametrize("dtype", ["float16", "bfloat16"])
@FUNCTIONS
def test_half_precision_is_refused_by_name(function, dtype):
    half = jnp.asarray(0.5, dtype)
    with pytest.raises(ValueError, match=f"cos_theta_i is {dtype}.*astype"):
        function(half, 1.5, 0.1)
    with pytest.raises(ValueError, match=f"eta is {dtype}"):
        function(0.5, half, 0.1)


def test_half_precision_of_a_parameter_is_refused_by_its_name():
    half = jnp.asarray(0.5, "float16")
    for name, call in {
        "alpha_x": lambda: TrowbridgeReitz(half),
        "reflection_scale": lambda: Dielectric(1.5, reflection_scale=half),
        "eta_a": lambda: fresnel_specular(1.0, 1.0, half, 1.5),
        "eta": lambda: critical_angle_deg(half),
        "widths_ev": lambda: DrudeLorentz(1.0, 2.0, half),
        "strengths": lambda: lorentz_drude(9.0, half, 1.0, 2.0),
        "fraction": lambda: bruggeman([1.0, 1.5], [0.0, 0.0], half[None]),
    }.items():
        with pytest.raises(ValueError, match=f"^{name} is float16"):
            call()


def test_half_precision_elsewhere():
    half = jnp.asarray([0.6, 0.0, 0.8], "bfloat16")
    for call in (
        lambda: Dielectric(half),
        lambda: Dielectric(1.5).sample(half, 0.5, jnp.ones(2)),
        lambda: material("gold")(half),
        lambda: slab(0.5, 1.5, 0.0, thickness_um=half, wavelength_um=0.5),
        lambda: stack(0.5, [1.0, 1.5, 1.0], thickness_um=half[:1], wavelength_um=0.5),
        lambda: stack(0.5, half, thickness_um=jnp.ones(1), wavelength_um=0.5),
        lambda: stack(half, [1.0, 1.5, 1.0], thickness_um=[0.1], wavelength_um=0.5),
    ):
        with pytest.raises(ValueError, match="bfloat16"):
            call()


@pytest.mark.parametrize("wrong", ["1.5", None, [1.0, "x"], [[1.0], [2.0, 3.0]], {"eta": 1.5}])
def test_what_is_no_number_is_refused_by_name(wrong):
    for call in (lambda: powers(0.5, wrong), lambda: reflectance(0.5, wrong)):
        with pytest.raises(ValueError, match="eta is .*wanted"):
            call()


def test_a_complex_incident_index_is_refused_with_the_way_out():
    with pytest.raises(ValueError, match=r"eta_i is complex.*fresnel_complex\(cos, eta / eta_i\)"):
        powers(0.5, 1.5, 0.0, 1.2 + 0.1j)


def test_values_at_the_edges_of_the_domain_are_taken():
    c, n, k, m = (x[:8] for x in adversarial.hard_sets(np.float64)["two media"])
    assert np.isfinite(np.asarray(powers(-c, n, 0.0 * k, m))).all()
    assert reflectance(np.zeros((0,)), 1.5).shape == (0,)
