"""Tauc-Lorentz against the Kramers-Kronig integral and the published closed form; Urbach's tail."""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

from fresnel_jax.dispersion import HC_EV_UM, Cauchy, CauchyUrbach, TaucLorentz

pytestmark = pytest.mark.slow

BOUND = 64.0  # eps of the larger of 1 and the permittivity


def imaginary_part(x, A, E_0, C, gap):
    """Jellison and Modine's eq. 4."""
    if x <= gap:
        return mp.mpf(0)
    return A * E_0 * C * (x - gap) ** 2 / (((x * x - E_0 * E_0) ** 2 + C * C * x * x) * x)


def integrated(E, A, E_0, C, gap):
    """(2 / pi) P int x eps_2(x) / (x^2 - E^2) dx, the pole taken out: its own integral is 0."""
    E, A, E_0, C, gap = map(mp.mpf, (E, A, E_0, C, gap))
    at_pole = E * imaginary_part(E, A, E_0, C, gap)

    def integrand(x):
        return (x * imaginary_part(x, A, E_0, C, gap) - at_pole) / (x * x - E * E)

    far = 100 * (E_0 + E)
    pieces = sorted({mp.mpf(0), gap, E, E_0, E_0 + C, E_0 + 5 * C + E, far})
    return 2 / mp.pi * (mp.quad(integrand, pieces) + mp.quad(integrand, [far, mp.inf]))


def published(E, A, E_0, C, gap):
    """Jellison and Modine's closed form with its erratum, eps_inf left out.

    Their alpha = sqrt(4 E_0^2 - C^2) occurs as its square and in quotients that are even in it, so
    that the form goes on where C > 2 E_0 and alpha is imaginary.
    """
    E, A, E_0, C, gap = map(mp.mpf, (E, A, E_0, C, gap))
    alpha2, gamma2 = 4 * E_0**2 - C**2, E_0**2 - C**2 / 2
    alpha = mp.sqrt(abs(alpha2))
    zeta4 = (E**2 - gamma2) ** 2 + alpha2 * C**2 / 4
    a_ln = (gap**2 - E_0**2) * E**2 + gap**2 * C**2 - E_0**2 * (E_0**2 + 3 * gap**2)
    a_atan = (E**2 - E_0**2) * (E_0**2 + gap**2) + gap**2 * C**2
    edge, turned = E_0**2 + gap**2, 2 * (gap**2 - gamma2) / C
    if alpha2 > 0:
        angles = mp.pi - mp.atan((2 * gap + alpha) / C) + mp.atan((alpha - 2 * gap) / C)
        ln = mp.log((edge + alpha * gap) / (edge - alpha * gap)) / alpha
        other = (mp.pi - 2 * mp.atan(turned / alpha)) / alpha
    else:
        angles = mp.atan((C + alpha) / (2 * gap)) + mp.atan((C - alpha) / (2 * gap))
        ln = 2 * mp.atan(alpha * gap / edge) / alpha
        other = mp.log((turned + alpha) / (turned - alpha)) / alpha
    ratio = abs(E - gap) * (E + gap) / mp.sqrt((E_0**2 - gap**2) ** 2 + gap**2 * C**2)
    return (
        A * C * a_ln / (2 * mp.pi * zeta4 * E_0) * ln
        - A * a_atan / (mp.pi * zeta4 * E_0) * angles
        + 2 * A * E_0 * gap * (E**2 - gamma2) / (mp.pi * zeta4) * other
        - A * E_0 * C * (E**2 + gap**2) / (mp.pi * zeta4 * E) * mp.log(abs(E - gap) / (E + gap))
        + 2 * A * E_0 * C * gap / (mp.pi * zeta4) * mp.log(ratio)
    )


def random_oscillators(dtype, count, seed=1):
    random = np.random.default_rng(seed)
    E_0 = random.uniform(0.5, 12, count)
    columns = (
        10 ** random.uniform(-1, 1.3, count),  # E
        10 ** random.uniform(0, 2.3, count),  # A
        E_0,
        E_0 * random.uniform(0.02, 1.99, count),  # C
        E_0 * random.uniform(0, 1, count),  # gap
    )
    return [tuple(map(float, row)) for row in np.stack(columns, -1).astype(dtype)]


@jax.jit
def index_of_one(A, E_0, C, gap, wavelength):
    return TaucLorentz(A, E_0, C, gap, 1.5)(wavelength)


@pytest.mark.parametrize("numbers", [
    (3.0, 100.0, 4.0, 1.5, 2.0),
    (1.2, 50.0, 3.0, 0.5, 1.0),
    (8.0, 120.0, 4.5, 3.0, 2.2),
    (1.9, 80.0, 4.0, 2.0, 2.0),  # below the gap, where the index is real
    (1.2, 50.0, 3.0, 6.001, 1.0),  # beyond C = 2 E_0, where the oscillator does not swing
    (3.0, 50.0, 3.0, 8.5, 1.0),
    (0.3, 120.0, 4.5, 60.0, 2.2),
])  # fmt: skip
def test_published_form_and_ours_are_the_kramers_kronig_integral(numbers):
    E, A, E_0, C, gap = numbers
    true = float(integrated(*numbers))
    with mp.workdps(30):
        assert float(published(*numbers)) == pytest.approx(true, rel=1e-13)
    eta, k = TaucLorentz([A], [E_0], [C], gap, 1.5)(HC_EV_UM / E)
    permittivity = complex(eta, k) ** 2
    jitted = index_of_one(A, E_0, C, gap, HC_EV_UM / E)
    np.testing.assert_allclose(jitted, (eta, k), rtol=1e-14)
    assert permittivity.real == pytest.approx(1.5 + true, rel=1e-13)
    assert permittivity.imag == pytest.approx(float(imaginary_part(*numbers)), rel=1e-12)


@pytest.mark.parametrize("count", [20, pytest.param(80, marks=pytest.mark.study)])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_random_oscillators_against_the_published_form(dtype, count):
    eps = np.finfo(dtype).eps
    for E, A, E_0, C, gap in random_oscillators(dtype, count):
        wavelength = dtype(HC_EV_UM / E)
        eta, k = TaucLorentz(*(jnp.asarray(x, dtype) for x in (A, E_0, C, gap)))(wavelength)
        assert eta.dtype == k.dtype == dtype
        with mp.workdps(50):
            energy = mp.mpf(HC_EV_UM) / mp.mpf(float(wavelength))
            re = 1 + published(energy, A, E_0, C, gap)
            im = imaginary_part(energy, *map(mp.mpf, (A, E_0, C, gap)))
            found = mp.mpc(float(eta), float(k)) ** 2
            # The rounding of the energy, times the slope of a resonance, comes on top.
            slope = abs(mp.diff(lambda x: published(x, A, E_0, C, gap), energy) * energy)  # noqa: B023
            allowed = eps * (BOUND * max(1, abs(mp.mpc(re, im))) + 4 * slope)
            assert abs(found - mp.mpc(re, im)) <= allowed, (E, A, E_0, C, gap)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize(
    "kind", ["narrow", "width near 2 E_j", "width above 2 E_j", "wide", "gap above"]
)
@pytest.mark.parametrize("count", [15, pytest.param(40, marks=pytest.mark.study)])
def test_extreme_oscillators_stay_within_the_stated_bound(kind, dtype, count):
    """Sums of logarithms at the poles were off by 6.7e5, 1.6e4 and 4.9e3 eps here."""
    random, eps = np.random.default_rng(4), np.finfo(dtype).eps
    for _ in range(count):
        c = {
            "narrow": 10.0 ** random.uniform(-4, -1),
            "width near 2 E_j": 2.0 - 10.0 ** random.uniform(-4, -1),
            "width above 2 E_j": 2.0 + 10.0 ** random.uniform(-4, -1),
            "wide": 10.0 ** random.uniform(0.31, 3),
            "gap above": random.uniform(0.1, 1.9),
        }[kind]
        g = random.uniform(1.0, 2.0) if kind == "gap above" else random.uniform(0.0, 1.0)
        E_0 = random.uniform(0.5, 8.0)
        E = E_0 * 10.0 ** random.uniform(-0.5, 0.5)
        numbers = [float(dtype(x)) for x in (10.0 ** random.uniform(0, 2.3), E_0, c * E_0, g * E_0)]
        A, E_0, C, gap = numbers
        wavelength = dtype(HC_EV_UM / E)
        eta, k = TaucLorentz(*(jnp.asarray(x, dtype) for x in numbers))(wavelength)
        with mp.workdps(80):
            energy = mp.mpf(HC_EV_UM) / mp.mpf(float(wavelength))
            true = mp.mpc(
                1 + published(energy, A, E_0, C, gap),
                imaginary_part(energy, *map(mp.mpf, numbers)),
            )
            found = mp.mpc(float(eta), float(k)) ** 2
            factor = 10 if gap > E_0 else 1
            bound = BOUND * factor * max(1, abs(true)) * eps
            assert abs(found - true) <= bound, (E, *numbers)


def test_gap_is_exact_and_smooth():
    model = TaucLorentz([100.0, 30.0], [4.0, 7.0], [1.5, 2.0], 2.0, 1.2)
    energies = jnp.array([0.5, 1.0, 1.999, 2.0, 2.001, 5.0])
    eta, k = model(HC_EV_UM / energies)
    assert (k[:3] == 0.0).all() and (k[4:] > 0.0).all() and (eta > 1.0).all()
    at_gap = jax.jacfwd(lambda w: jnp.stack(model(w)))(HC_EV_UM / 2.0)
    assert np.isfinite(at_gap).all()
    for pair in (model(0.62), TaucLorentz([100.0], [4.0], [1.5], 0.0)(0.62)):
        assert np.isfinite(pair).all()
    # one with two oscillators is the sum of the permittivities
    parts = [TaucLorentz([a], [e], [c], 2.0, 0.6)(0.3)
             for a, e, c in ((100.0, 4.0, 1.5), (30.0, 7.0, 2.0))]  # fmt: skip
    total = sum(complex(*map(float, p)) ** 2 for p in parts)
    assert complex(*map(float, model(0.3))) ** 2 == pytest.approx(total, rel=1e-13)


@pytest.mark.study
def test_gradients_against_differences_of_the_published_form():
    def ours(a, e, c, g, wavelength):
        n, k = TaucLorentz(a, e, c, g)(wavelength)
        return n * n - k * k

    gradient = jax.jit(jax.grad(ours, argnums=(0, 1, 2, 3)))
    for E, A, E_0, C, gap in random_oscillators(np.float64, 12, seed=4):
        found = gradient(A, E_0, C, gap, HC_EV_UM / E)
        with mp.workdps(40):
            energy = mp.mpf(HC_EV_UM) / mp.mpf(HC_EV_UM / E)
            for i in range(4):

                def moved(x, i=i, energy=energy, at=(A, E_0, C, gap)):
                    return published(energy, *at[:i], x, *at[i + 1 :])

                true = float(mp.diff(moved, (A, E_0, C, gap)[i]))
                # BOUND of the value, over the distance that it changes within
                assert float(found[i]) == pytest.approx(true, rel=1e-9, abs=1e-10)


@pytest.mark.study
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_derivatives_by_the_width_go_on_through_twice_the_resonance(dtype):
    """Where alpha is 0, beside it, and on to widths at which a pole lies near 0; by quadrature."""
    eps = float(np.finfo(dtype).eps)

    @jax.jit
    @jax.value_and_grad
    def ours(c, w):
        n, k = TaucLorentz(jnp.full((), 50.0, dtype), dtype(3.0), c, dtype(1.0), dtype(1.5))(w)
        return n * n - k * k

    for C in (6.0, 6.0 * (1 + 2 * eps), 6.0 * (1 - 2 * eps), 6.2, 9.5, 30.0):
        C, wavelength = dtype(C), dtype(HC_EV_UM / 1.2)
        value, slope = ours(C, wavelength)
        with mp.workdps(20):
            numbers = (mp.mpf(HC_EV_UM) / mp.mpf(float(wavelength)), 50, 3, mp.mpf(float(C)), 1)
            step = numbers[3] * mp.mpf(10) ** -7
            high, low = (integrated(*numbers[:3], numbers[3] + d, 1) for d in (step, -step))
            # 1.5 + the transform, whose terms are ten times as large
            allowed = BOUND * eps * max(1, abs(1.5 + integrated(*numbers)))
            assert abs(mp.mpf(float(value)) - 1.5 - integrated(*numbers)) <= allowed, C
            off = mp.mpf(float(slope)) - (high - low) / (2 * step)
            assert abs(off * numbers[3]) <= allowed, C


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_urbach_tail(dtype):
    wavelength = np.linspace(0.3, 0.8, 6).astype(dtype)
    model = CauchyUrbach([1.5, 0.01], 0.02, 0.15, 4.0)
    eta, k = model(wavelength)
    assert eta.dtype == k.dtype == dtype
    np.testing.assert_array_equal(eta, Cauchy([1.5, 0.01])(wavelength).eta)
    for w, found in zip(wavelength, k, strict=True):
        energy = mp.mpf(HC_EV_UM) / mp.mpf(float(w))
        true = mp.mpf("0.02") * mp.exp((energy - 4) / mp.mpf("0.15"))
        # the energy is rounded, and its distance from the edge counts in units of the width
        allowed = (4 + 2 * float(energy) / 0.15) * float(np.finfo(dtype).eps)
        assert float(found) == pytest.approx(float(true), rel=allowed)
    # e-fold per Urbach energy, k_edge at the edge
    at_edge = CauchyUrbach([1.5], 0.02, 0.15, 4.0)(HC_EV_UM / np.array([4.0, 3.85]))
    np.testing.assert_allclose(at_edge.k, [0.02, 0.02 / np.e], rtol=1e-13)


def test_lengths_are_checked():
    with pytest.raises(ValueError, match="widths_ev"):
        TaucLorentz([1.0, 2.0], [3.0, 4.0], [1.0], 2.0)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_far_below_the_gap(dtype):
    """Terahertz to radio waves: eta and its slope, where two logarithms cancel."""
    numbers = (100.0, 4.0, 1.5, 1.25)
    model = TaucLorentz(*(jnp.asarray(x, dtype) for x in numbers))
    for wavelength in map(dtype, (4.0, 30.0, 300.0, 1e3, 1e4, 1e6)):
        with mp.workdps(120):

            def true(w):
                return mp.sqrt(1 + published(mp.mpf(HC_EV_UM) / w, *numbers))

            w = mp.mpf(float(wavelength))
            eta, slope = true(w), mp.diff(true, w, h=w * mp.mpf(10) ** -30)
        bound = 4.0 * float(np.finfo(dtype).eps)
        assert float(model(wavelength).eta) == pytest.approx(float(eta), rel=bound)
        found = float(jax.grad(lambda x: model(x).eta)(wavelength))
        # In float32 it is lost beyond 1e5 um, where eta changes by 1e-13 of itself.
        allowed = 1e-3 if wavelength < 1e5 or dtype is np.float64 else 0.2
        assert found == pytest.approx(float(slope), rel=allowed), wavelength
