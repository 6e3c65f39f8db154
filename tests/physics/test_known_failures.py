"""Places where known methods fail: ours is right there, and the printed form is shown not to be.

The cases are those in which a literal transcription of textbooks into JAX loses the value or the
gradient, and those at which other packages were measured to return NaN, a wrong sign or zero. Truth
is the textbook's quotient of amplitudes in 100 digits (oracle).
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fresnel_jax import fresnel_dielectric, powers, reflectance
from tests.truth import oracle, printed

EPS = float(np.finfo(np.float64).eps)
VALUE_BOUND = 12 * EPS  # as documented in `interface`
GRADIENT_BOUND = 200 * EPS
WRONG = 1e-3  # a relative error beyond which a result is of no use

GLASS_OUT = 1 / 1.5
CRITICAL = float(np.sqrt((1 - GLASS_OUT) * (1 + GLASS_OUT)))


def true_R(c, eta, k=0.0):
    return float(oracle.reflectance(c, eta, k, 1.0))


def true_gradient(c, eta, k=0.0):
    """dR/d(cos, eta, k) of unpolarized light."""
    both = oracle.reflectance_gradients(c, eta, k, 1.0)
    return np.array([float((s + p) / 2) for s, p in zip(*both, strict=True)][:3])


def gradient(function, *arguments):
    variables = tuple(range(len(arguments)))
    return np.array(jax.grad(function, variables)(*map(jnp.asarray, arguments)), float)


def off(found, true):
    """Relative error in the norm; NaN counts as infinite."""
    error = np.linalg.norm(np.asarray(found, float) - true) / np.linalg.norm(true)
    return np.inf if np.isnan(error) else error


VALUES = {  # cos, eta, k and the printed forms that fail
    "matched to 4 eps": (0.37, 1 + 4 * EPS, 0.0, ("pbrt4_complex", "pbrt3_conductor")),
    "matched, k = 1e-12": (0.7, 1 + 4 * EPS, 1e-12, ("pbrt3_conductor",)),
    "matched at 80 degrees": (0.17, 1 - 2 * EPS, 0.0, ("pbrt4_complex", "pbrt3_conductor")),
}


@pytest.mark.parametrize("name", VALUES)
def test_value_where_the_printed_form_fails(name):
    *point, failing = VALUES[name]
    true = true_R(*point)
    assert off(reflectance(*point), true) <= VALUE_BOUND
    for form in failing:
        assert off(getattr(printed, form)(*map(jnp.asarray, point)), true) > WRONG, form


def test_matched_media_reflect_nothing_also_at_grazing_incidence():
    assert fresnel_dielectric(0.0, 1.0) == 0.0 and reflectance(0.0, 1.0) == 0.0
    assert printed.pbrt4_dielectric(0.0, 1.0) == 1.0
    assert np.isfinite(gradient(fresnel_dielectric, 0.0, 1.0)).all()
    assert np.isnan(gradient(printed.pbrt4_dielectric, 0.0, 1.0)).any()


def test_xray_mirror_in_float32():
    """Silicon at 8 keV near its critical angle; other packages: 54 % of such points wrong."""
    point = tuple(map(np.float32, (0.004, 1 - 7.58e-6, 1.75e-7)))
    true = true_R(*point)
    assert off(reflectance(*point), true) <= 12 * np.finfo(np.float32).eps
    for form in (printed.pbrt4_complex, printed.pbrt3_conductor):
        assert off(form(*map(jnp.asarray, point)), true) > WRONG


def test_exactly_critical_value():
    """c = .6, eta = .8: as real numbers the critical angle, as floats a few eps beside it."""
    true = true_R(0.6, 0.8)
    assert off(reflectance(0.6, 0.8), true) <= VALUE_BOUND
    assert off(printed.pbrt4_dielectric(jnp.asarray(0.6), jnp.asarray(0.8)), true) > 1e-9


def test_R_p_next_to_brewsters_angle():
    c = float(1 / np.hypot(1.5, 1.0)) * (1 + 2 * EPS)
    true = float(oracle.powers(c, 1.5, 0.0, 1.0)[1])
    assert off(powers(c, 1.5).R_p, true) <= VALUE_BOUND
    cos_t = np.sqrt(1 - (1 - c * c) / 1.5**2)
    assert off(((1.5 * c - cos_t) / (1.5 * c + cos_t)) ** 2, true) > WRONG


def test_transmittance_of_a_good_mirror_at_grazing_incidence():
    point = (1e-13, 0.05, 4.0)
    true = float(sum(oracle.powers(*point, 1.0)[2:]) / 2)
    assert off(powers(*point).T, true) <= VALUE_BOUND
    assert off(1 - printed.pbrt4_complex(*map(jnp.asarray, point)), true) > WRONG


GRADIENTS = {  # arguments, and the printed forms that fail; without k: derivatives for k = 0
    "total reflection": ((0.3, GLASS_OUT), ("pbrt4_dielectric",)),
    "total reflection, dR/dk": ((0.3, GLASS_OUT, 0.0), ("pbrt3_conductor",)),
    "1e-8 beyond critical": ((CRITICAL * (1 - 1e-8), GLASS_OUT, 0.0), ("pbrt3_conductor",)),
    "4 eps below critical": ((CRITICAL * (1 + 4 * EPS), GLASS_OUT), ("pbrt4_dielectric",)),
    "no eta, only k": ((0.5, 1e-300, 1.0), ("pbrt3_conductor",)),
    "matched to 4 eps": ((0.37, 1 + 4 * EPS, 0.0), ("pbrt4_complex", "pbrt3_conductor")),
}


@pytest.mark.parametrize("name", GRADIENTS)
def test_gradient_where_the_printed_form_fails(name):
    arguments, failing = GRADIENTS[name]
    true = true_gradient(*arguments)[: len(arguments)]
    found = gradient(reflectance, *arguments)
    if np.linalg.norm(true) > 1e-50:  # else 0, but for the 100 digits of the oracle
        assert off(found, true) <= GRADIENT_BOUND
    else:
        assert not found.any()
    for form in failing:
        bad = gradient(getattr(printed, form), *arguments)
        assert np.isnan(bad).any() or off(bad, true) > WRONG, form


def test_dR_dk_in_total_reflection_is_the_one_sided_derivative():
    """-2.7236 at c = .3, eta = 1/1.5; packages return 0, NaN or the other sign."""
    quotient = (true_R(0.3, GLASS_OUT, 1e-7) - 1) / 1e-7
    found = gradient(reflectance, 0.3, GLASS_OUT, 0.0)[2]
    assert found == pytest.approx(quotient, abs=1e-6)  # of the difference quotient's step
    assert found == pytest.approx(-2.723650, abs=1e-6)
    assert np.isnan(gradient(printed.pbrt3_conductor, 0.3, GLASS_OUT, 0.0)[2])


def test_gradient_of_an_xray_mirror_in_float32():
    """Other packages return 0 where the slope is -1e4 and more."""
    point = tuple(map(np.float32, (0.0038, 1 - 7.58e-6, 1.75e-7)))
    true = true_gradient(*point)
    assert np.linalg.norm(true) > 1e4
    assert off(gradient(reflectance, *point), true) <= 200 * np.finfo(np.float32).eps
    for form in (printed.pbrt4_complex, printed.pbrt3_conductor):
        assert off(gradient(form, *point), true) > WRONG


def test_gradient_at_grazing_incidence():
    """cos = 0 is differentiated from above; packages that take the angle return NaN."""
    for point in ((0.0, 1.5, 0.0), (0.0, 0.14, 4.5)):
        N2 = complex(point[1], point[2]) ** 2
        q = np.sqrt(N2 - 1)
        # R = 1 - 4 c Re(..) to first order in c
        slope = -2 * ((1 / q).real + (N2 / q).real)
        assert gradient(reflectance, *point)[0] == pytest.approx(slope, rel=1e-13)
