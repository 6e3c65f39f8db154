"""Gaussian lines and sums of terms, against 50 digits, the integral, and the terms themselves."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

from fresnel_jax.dispersion import HC_EV_UM, DrudeLorentz, Gaussian, Sum, TaucLorentz


def truth(energy, amplitude, resonance, width):
    """Return the susceptibility of a line by its definition, with erfi for Dawson's integral."""
    s = width / (2 * mp.sqrt(mp.log(2)))
    u, v = (energy - resonance) / s, (energy + resonance) / s
    dawson = [mp.sqrt(mp.pi) / 2 * mp.exp(-x * x) * mp.erfi(x) for x in (u, v)]
    re = 2 * amplitude / mp.sqrt(mp.pi) * (dawson[1] - dawson[0])
    return re, amplitude * (mp.exp(-u * u) - mp.exp(-v * v)), u


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_lines_against_50_digits(dtype: type) -> None:
    eps, draw = np.finfo(dtype).eps, np.random.default_rng(3).uniform
    rows = np.array([(draw(0.3, 7), 10 ** draw(-3, 1), draw(1, 6), 10 ** draw(-1.5, 0.5))
                     for _ in range(60)], dtype)  # fmt: skip
    wavelength = np.asarray(HC_EV_UM / rows[:, 0], dtype)

    def permittivity(w, a, e, c):
        return Gaussian(a, e, c).susceptibility(jnp.asarray(HC_EV_UM, dtype) / w)

    found = jax.vmap(permittivity)(*map(jnp.asarray, (wavelength, *rows[:, 1:].T)))
    for w, numbers, re, im in zip(wavelength, rows, *map(np.asarray, found), strict=True):
        with mp.workdps(50):
            energy = mp.mpf(float(dtype(HC_EV_UM) / w))
            wanted_re, wanted_im, u = truth(energy, *(mp.mpf(float(x)) for x in numbers[1:]))
            size = max(1.0, float(numbers[1]))
            # rounding of the differences E - E_j, in widths, comes on top
            moved = 4.0 * float(energy / numbers[3])
            assert abs(re - float(wanted_re)) < (100.0 + moved) * eps * size
            if wanted_im > np.finfo(dtype).tiny:
                bound = 8.0 + 4.0 * float(u) ** 2 + 4.0 * abs(float(u)) * moved
                assert abs(im / float(wanted_im) - 1.0) < bound * eps


def test_they_obey_kramers_and_kronig() -> None:
    """Re eps - 1 is (2 / pi) P int x Im eps(x) / (x^2 - E^2) dx."""
    model = Gaussian([2.0, 0.5], [3.0, 5.0], [0.8, 1.5])
    line = jax.jit(lambda x: model.susceptibility(x))
    for energy in (1.0, 3.2, 6.0):
        # symmetric about the pole, the integrand is smooth
        step = np.linspace(0.0, 1.0, 20001)[1:] - 0.5 / 20000.0
        x = np.concatenate([energy * (1.0 - step), energy * (1.0 + step), 2 * energy + 20 * step])
        weight = np.repeat([energy, energy, 20.0], len(step)) / len(step)
        im = np.asarray(line(x)[1])
        integral = 2.0 / np.pi * np.sum(weight * x * im / (x * x - energy**2))
        assert line(energy)[0] == pytest.approx(integral, abs=3e-4)


def test_derivatives_are_finite() -> None:
    @jax.jit
    def both(numbers):
        eta, k = Gaussian(*numbers[:3], eps_inf=numbers[3])(numbers[4])
        return jnp.stack([eta, k])

    slopes = jax.jit(jax.jacfwd(both))
    for wavelength in (HC_EV_UM / 3.0, 0.2, 30.0):  # at the resonance, and far from it
        at = np.array([0.5, 3.0, 0.1, 2.0, wavelength])
        slope = slopes(at)
        assert np.isfinite(slope).all()
        step = 1e-6 * np.diag(at)
        difference = np.stack([(both(at + h) - both(at - h)) / (2.0 * h.sum()) for h in step], 1)
        np.testing.assert_allclose(slope, difference, rtol=1e-6, atol=1e-8)


def test_a_sum_is_that_of_its_terms() -> None:
    w = jnp.linspace(0.2, 2.0, 7)
    edge = TaucLorentz([80.0], [4.0], [2.0], 1.5, 1.7)
    line, pole = Gaussian([0.3], [2.5], [0.4]), DrudeLorentz([90.0], [12.0], [0.0])
    of_sum, of_edge_alone, *each = jax.jit(
        lambda w: [m(w).complex for m in (Sum((edge, line, pole), 1.7), Sum((edge,), 1.7),
                                          edge, line, pole)]
    )(w)  # fmt: skip
    wanted = sum(np.asarray(n) ** 2 for n in each) - 2.0
    np.testing.assert_allclose(np.asarray(of_sum) ** 2, wanted, rtol=1e-13)
    assert of_edge_alone.tolist() == each[0].tolist()
    with pytest.raises(ValueError, match="amplitudes"):
        Gaussian([1.0, 2.0], [3.0], [0.1])
