"""The Kramers-Kronig spline against principal values in 25 digits, and Tauc-Lorentz truths."""

import bisect
import functools
import itertools

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from scipy.optimize import nnls

from fitting.samples.dispersion import knots_over
from fresnel_jax.dispersion import HC_EV_UM, KramersKronigSpline, TaucLorentz, material
from fresnel_jax.indices.kramers_kronig import b_splines

BOUND = 200.0  # eps of the larger of 1 and the largest amplitude
KNOTS = (0.0, 0.3, 1.0, 1.2, 1.9, 2.0, 2.05, 3.5, 6.0, 11.0)
AMPLITUDES = (3.0, 0.0, 12.0, 5.0, 0.7, 20.0)


def truncated_powers(x, amplitudes, knots):
    """The spline as the divided differences that define B-splines."""
    total = mp.mpf(0)
    for j, amplitude in enumerate(amplitudes):
        t = [mp.mpf(float(u)) for u in knots[j : j + 5]]
        divided = [max(u - x, mp.mpf(0)) ** 3 for u in t]
        for order in range(1, 5):
            divided = [
                (divided[i + 1] - divided[i]) / (t[i + order] - t[i])
                for i in range(len(divided) - 1)
            ]
        total += mp.mpf(float(amplitude)) * (t[4] - t[0]) * divided[0]
    return total


@functools.cache
def cubics(amplitudes, knots):
    """The same spline as the cubic through four of its points in each interval, for quadrature."""
    pieces = []
    for low, high in itertools.pairwise(mp.mpf(float(u)) for u in knots):
        nodes = [low + (high - low) * i / 3 for i in range(4)]
        row = [truncated_powers(x, amplitudes, knots) for x in nodes]
        newton = [row[0]]
        for order in range(1, 4):
            row = [(b - a) / (nodes[i + order] - nodes[i])
                   for i, (a, b) in enumerate(itertools.pairwise(row))]  # fmt: skip
            newton.append(row[0])
        pieces.append((nodes, newton))
    return pieces


def real_part(E, amplitudes, knots):
    """(2 / pi) P int x eps_2(x) / (x^2 - E^2) dx by quadrature, the pole taken out."""
    knots = tuple(float(u) for u in knots)
    pieces = cubics(tuple(amplitudes), knots)

    def f(x):
        if not knots[0] <= x < knots[-1]:
            return mp.mpf(0)
        nodes, newton = pieces[bisect.bisect_right(knots, x) - 1]
        total = newton[3]
        for node, coefficient in zip(nodes[2::-1], newton[2::-1], strict=True):
            total = total * (x - node) + coefficient
        return total

    E, first, last = mp.mpf(E), mp.mpf(knots[0]), mp.mpf(knots[-1])
    at_pole = E * f(E)

    def integrand(x):
        if x == E:
            return mp.diff(lambda y: y * f(y), E) / (2 * E)
        return (x * f(x) - at_pole) / (x * x - E * E)

    breaks = sorted({*map(mp.mpf, knots), *([E] if first < E < last else [])})
    total = mp.quad(integrand, breaks)
    if at_pole:
        # P int dx / (x^2 - E^2) = ln|(x - E) / (x + E)| / (2 E)
        total += (
            at_pole
            * (mp.log(abs((last - E) / (last + E))) - mp.log(abs((first - E) / (first + E))))
            / (2 * E)
        )
    return 2 / mp.pi * total


ENERGIES = (0.05, 0.3, 1.0, 1.0 + 1e-9, 1.5, 1.95, 2.0, 2.05, 3.5 - 1e-6, 6.0, 11.0, 11.0 + 1e-7,
            14.0, 60.0)  # fmt: skip


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_permittivity_against_quadrature_at_knots_between_and_outside(dtype):
    eps = float(np.finfo(dtype).eps)
    wavelengths = (HC_EV_UM / np.array(ENERGIES)).astype(dtype)
    model = KramersKronigSpline(
        np.array(AMPLITUDES, dtype), KNOTS, dtype(1.5), np.array([30.0, 2.0], dtype),
        np.array([20.0, 0.0], dtype),
    )  # fmt: skip
    eta, k = jax.jit(lambda x: model(x))(wavelengths)
    assert eta.dtype == k.dtype == dtype
    knots = np.array(KNOTS, dtype).astype(float)
    for wavelength, n, kk in zip(wavelengths, eta, k, strict=True):
        with mp.workdps(25):
            E = mp.mpf(float(np.float64(HC_EV_UM).astype(dtype) / wavelength))
            poles = mp.mpf(30) / (400 - E * E) - 2 / (E * E)
            re = mp.mpf("1.5") + real_part(E, AMPLITUDES, knots) + poles
            im = truncated_powers(E, AMPLITUDES, knots)
            found = mp.mpc(float(n), float(kk)) ** 2
            off = abs(found - mp.mpc(re, im))
            assert off <= eps * (BOUND * 20.0 + 20 * abs(poles)), (float(E), float(off) / eps)


@pytest.mark.study
def test_derivatives_at_knots_too():
    def permittivity(energy, amplitudes):
        n, k = KramersKronigSpline(amplitudes, KNOTS)(HC_EV_UM / energy)
        return jnp.stack([n * n - k * k, 2.0 * n * k])

    amplitudes = jnp.array(AMPLITUDES)
    slope = jax.jit(jax.jacfwd(permittivity))
    curvature = jax.jit(jax.jacfwd(jax.jacfwd(permittivity)))
    by_amplitude = jax.jit(jax.jacrev(permittivity, argnums=1))
    for energy in (0.7, 2.0, 2.05 + 1e-10):
        with mp.workdps(25):

            def re(E):
                return real_part(E, AMPLITUDES, KNOTS)

            step = mp.mpf("1e-6")
            E = mp.mpf(energy)
            true = (re(E + step) - re(E - step)) / (2 * step)
        assert float(slope(energy, amplitudes)[0]) == pytest.approx(float(true), rel=1e-4)
        assert np.isfinite(curvature(energy, amplitudes)).all()
        # linear in the amplitudes: Euler
        found = by_amplitude(energy, amplitudes) @ amplitudes
        expected = permittivity(energy, amplitudes) - jnp.array([1.0, 0.0])
        np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-11)


@pytest.mark.study
def test_tauc_lorentz_truths():
    """Where the absorption agrees, so does the refraction: nobody told the spline."""
    random = np.random.default_rng(5)
    for _ in range(2):
        gap, E_0 = random.uniform(0.5, 2.5), random.uniform(3.0, 5.0)
        truth = TaucLorentz([random.uniform(40, 150)], [E_0], [random.uniform(0.8, 3.0)], gap, 1.0)
        knots = np.concatenate([gap + np.arange(0.0, 9.0, 0.1), np.geomspace(12.0, 900.0, 30)])
        # five points to an interval
        energies = np.interp(np.arange(0, len(knots) - 1, 0.2), np.arange(len(knots)), knots)
        n, k = (np.asarray(x) for x in truth(HC_EV_UM / energies))
        basis = np.asarray(b_splines(jnp.asarray(energies), knots))
        amplitudes = nnls(basis, 2 * n * k)[0]
        look = HC_EV_UM / np.linspace(0.3, 8.0, 60)
        found, true = KramersKronigSpline(amplitudes, knots)(look), truth(look)
        np.testing.assert_allclose(found.eta, true.eta, atol=0.004)
        np.testing.assert_allclose(found.k, true.k, atol=0.004)


@pytest.mark.study
@pytest.mark.parametrize("name, step, off", [("silicon", 0.1, 0.02), ("gold", 0.25, 0.03)])
def test_tabulated_silicon_and_gold(name, step, off):
    """One spline gives n and k of the tables together: they obey the relations, and so does it."""
    table = material(name)
    low, high = (HC_EV_UM / x for x in table.range_um[::-1])
    low, high = max(low, 0.7), min(high, 5.8)
    energies = np.linspace(low * 1.001, high * 0.999, 300)
    eps = (lambda i: (i.eta + 1j * i.k) ** 2)(table(HC_EV_UM / energies))
    inside = np.arange(max(low - 3 * step, 0.1), high + 3 * step, step)
    beyond = np.geomspace(high + 4 * step, 20.0, 5)
    knots = np.concatenate([np.linspace(0.0, inside[0], 4)[:-1], inside, beyond])

    def permittivity(parameters):
        model = KramersKronigSpline(
            parameters[:-3], knots, parameters[-3], parameters[-2:], (25.0, 0.0)
        )
        n, k = model(HC_EV_UM / energies)
        return jnp.concatenate([n * n - k * k, 2 * n * k])

    count = len(knots) - 4 + 3
    # linear in all parameters; the last pole, of free electrons, has a negative strength
    start = jnp.ones(count)
    columns = np.asarray(jax.jit(jax.jacfwd(permittivity))(start)) * ([1.0] * (count - 1) + [-1.0])
    weight = np.tile(1 / np.abs(eps), 2)
    found = nnls(columns * weight[:, None], np.concatenate([eps.real, eps.imag]) * weight)[0]
    residual = (columns @ found - np.concatenate([eps.real, eps.imag])) * weight
    assert np.sqrt(np.mean(residual**2)) < off


def test_sum_rule_and_signs():
    """Far above all absorption eps falls as 1 - plasma^2 / E^2 with the f-sum's plasma energy."""
    model = KramersKronigSpline(AMPLITUDES, KNOTS)
    x = np.linspace(0.0, 11.0, 200_001)
    basis = jax.jit(lambda x: b_splines(x, np.array(KNOTS)))(x)
    absorption = np.asarray(basis) @ np.array(AMPLITUDES)
    assert absorption.min() >= 0.0
    plasma2 = 2.0 / np.pi * np.trapezoid(x * absorption, x)
    eta, k = model(HC_EV_UM / 1e4)
    assert float(k) == 0.0
    assert (1.0 - float(eta) ** 2) * 1e8 == pytest.approx(plasma2, rel=1e-4)


@pytest.mark.parametrize("arguments, says", [
    (((1.0,), (1.0, 2.0, 3.0, 4.0)), "five or more"),
    (((1.0,), (1.0, 2.0, 2.0, 4.0, 5.0)), "above the one before"),
    (((1.0, 2.0), (1.0, 2.0, 3.0, 4.0, 5.0)), "four fewer"),
    (((1.0,), (1.0, 2.0, 3.0, 4.0, 5.0), 1.0, (1.0, 2.0), (7.0,)), "poles_ev"),
])  # fmt: skip
def test_refusals(arguments, says):
    with pytest.raises(ValueError, match=says):
        KramersKronigSpline(*arguments)


@pytest.mark.parametrize("terms", [2, 3, 4, 8, 12, 24, 60])
def test_knots_of_a_fit_reach_beyond_the_measured_energies(terms):
    knots = np.array(knots_over(terms, 1.2, 5.5))
    assert len(knots) == terms + 4  # a cubic B-spline for each term
    assert (np.diff(knots) > 0.0).all() and knots[0] > 0.0
    assert knots[0] < 1.2 and knots[-1] > 5.5
    if terms >= 4:
        assert knots[-1] >= 3.0 * 5.5 - 1e-9
    with pytest.raises(ValueError, match="the data have one wavelength"):
        knots_over(terms, 1.2, 1.2)
