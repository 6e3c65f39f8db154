"""Cody-Lorentz oscillators against the Kramers-Kronig integral; derivatives by differences."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

from fresnel_jax.dispersion import CodyLorentz

pytestmark = pytest.mark.slow

# E, A, E_0, C, gap, E_p, E_t, E_u
ROWS = [
    (3.0, 75.0, 3.8, 2.4, 1.6, 1.0, 1.8, 0.05), (1.79999, 75.0, 3.8, 2.4, 1.6, 1.0, 1.8, 0.05),
    (1.2, 75.0, 3.8, 2.4, 1.6, 1.0, 1.8, 0.3), (0.2, 75.0, 3.8, 2.4, 1.6, 1.0, 1.8, 0.05),
    (3.0, 99.0, 4.0, 8.0, 1.5, 1.0, 1.8, 0.05), (3.0, 99.0, 4.0, 7.9, 1.5, 1.0, 1.8, 0.05),
    (3.0, 99.0, 4.0, 40.0, 1.5, 9.0, 1.8, 0.05), (4.001, 99.0, 4.0, 1e-2, 1.5, 0.1, 1.5, 0.05),
    (30.0, 99.0, 4.0, 2.0, 1.5, 1.0, 1.8, 1e-3), (2.5, 99.0, 4.0, 2.0, 4.5, 1.0, 5.0, 0.05),
    (1.8, 75.0, 3.8, 2.4, 1.6, 1.0, 1.8, 0.05), (2.0, 99.0, 4.0, 2.0, 0.0, 1.0, 0.0, 0.05),
]  # fmt: skip


def susceptibility(x):
    return jnp.stack(CodyLorentz(*x[1:]).susceptibility(x[0]))


def truth(E, A, E_0, C, gap, E_p, E_t, E_u):
    """Return both parts, the real one by quadrature; P int dx / (x^2 - E^2) over all x is 0."""

    def absorption(x):
        onset = (x - gap) ** 2 / ((x - gap) ** 2 + E_p**2)
        return onset * A * E_0 * C * x / ((x * x - E_0**2) ** 2 + (C * x) ** 2)

    def im(x):
        if x > E_t:
            return absorption(x)
        return E_t * absorption(E_t) / x * mp.exp((x - E_t) / E_u)

    of_energy = im(E)

    def integrand(x):
        return (x * im(x) - E * of_energy) / ((x - E) * (x + E)) if x != E else mp.mpf(0)

    wide = 50 * max(E, E_0, C)
    places = {mp.mpf(0), E, E_t, E_0, E_0 + C, abs(E_0 - C), 2 * E, 4 * (E + E_0), wide}
    places |= {max(E_t - n * E_u, 0) for n in (1, 3, 10)}
    near = mp.quad(integrand, sorted(places))
    far = mp.quad(lambda s: integrand(wide / s) * wide / s**2, [0, 1])
    return 2 / mp.pi * (near + far), of_energy


@jax.jit
def values_and_slopes(rows):
    return jax.vmap(susceptibility)(rows), jax.vmap(jax.jacfwd(susceptibility))(rows)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_both_parts_against_the_integral(dtype: type) -> None:
    eps, rows = np.finfo(dtype).eps, np.asarray(ROWS, dtype)
    values, slopes = map(np.asarray, values_and_slopes(jnp.asarray(rows)))
    assert values.dtype == dtype and np.isfinite(slopes).all()
    for row, (re, im), slope in zip(rows.astype(float), values, slopes, strict=True):
        with mp.workdps(20):
            wanted = [float(x) for x in truth(*map(mp.mpf, row))]
        conditioning = np.linalg.norm(slope[0] * row)
        assert abs(re - wanted[0]) <= 64.0 * eps * max(1.0, *map(abs, wanted), conditioning)
        in_tail = max(row[6] - row[0], 0.0) / row[7]
        assert abs(im - wanted[1]) <= (16.0 + 2.0 * in_tail) * eps * wanted[1]


def test_derivatives_are_those_of_the_values() -> None:
    rows = np.array(ROWS)
    slopes = np.asarray(values_and_slopes(jnp.asarray(rows))[1])
    # not at E_t, where one is infinite, nor where an argument is 0 or a resonance very narrow
    smooth = (abs(rows[:, 0] - rows[:, 6]) > 1e-2) & (rows[:, 3] > 0.1) & rows.all(axis=1)
    assert smooth.sum() == 8
    for i in range(8):
        step = 1e-5 * rows[:, i : i + 1] * np.eye(8)[i]
        above, below = (values_and_slopes(jnp.asarray(rows + s))[0] for s in (step, -step))
        difference = np.asarray(above - below)[smooth] / (2.0 * step[smooth, i : i + 1])
        np.testing.assert_allclose(slopes[smooth, :, i], difference, rtol=1e-6, atol=1e-6)


def test_terms_share_the_gap_and_add_up() -> None:
    @jax.jit
    def permittivities(E):
        both = CodyLorentz([75.0, 20.0], [3.8, 6.0], [2.4, 1.0], 1.6, 1.0, 1.8, 0.05)
        parts = [CodyLorentz(*x, 1.6, 1.0, 1.8, 0.05) for x in ((75.0, 3.8, 2.4), (20.0, 6.0, 1.0))]
        return [jnp.stack(model.susceptibility(E)) for model in (both, *parts)]

    both, one, two = permittivities(jnp.array([1.0, 3.0, 6.0]))
    np.testing.assert_allclose(both, one + two, rtol=1e-13, atol=1e-13)
    with pytest.raises(ValueError, match="resonances_ev"):
        CodyLorentz([1.0], [3.0, 4.0], [1.0], 1.0, 1.0, 1.0, 0.05)
