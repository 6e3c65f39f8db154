"""Stacks where methods fail, against characteristic matrices in mpmath.

Errors are in eps of each R and T. Where contributions cancel (a minimum of R, Brewster's angle) an
R below 1e-2 counts relative to its root: to 64 eps of the amplitude.
"""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
import stack_oracle

from fresnel_jax.layers import stack

DTYPES = [np.float32, np.float64]
CASES = 12


def _draw(kind, layers, dtype, rng):
    """cos_theta_i, n, k, thickness, wavelength of one stack."""
    n, k, d = rng.uniform(1.0, 4.0, layers + 2), np.zeros(layers + 2), rng.uniform(0, 0.5, layers)
    c, wavelength = rng.uniform(0.02, 1.0), rng.uniform(0.3, 2.0)
    if kind == "films with metals":
        k[1:] = rng.uniform(0, 6, layers + 1) * (rng.random(layers + 1) < 0.6)
    elif kind == "lossless plates up to 10 mm":
        d = 10.0 ** rng.uniform(0, 4, layers)
    elif kind == "metal up to 1 m, k up to 300":
        k[1:], d = 10.0 ** rng.uniform(-3, 2.5, layers + 1), 10.0 ** rng.uniform(-4, 6, layers)
    elif kind == "frustrated total reflection":
        n[0] = n[-1] = 4.0
        c, d = rng.uniform(0.02, 0.5), 10.0 ** rng.uniform(-3, 0.5, layers)
    elif kind == "total reflection, weak loss":
        n[0], k[1:] = 4.0, 10.0 ** rng.uniform(-12, -1, layers + 1)
        c, d = rng.uniform(0.02, 0.5), 10.0 ** rng.uniform(-3, 0.5, layers)
    elif kind == "a layer at its critical angle":
        n[0], j = 4.0, rng.integers(1, layers + 1)
        n[j] = rng.uniform(1.0, 3.9)
        c = np.sqrt((1.0 - n[j] / n[0]) * (1.0 + n[j] / n[0]))
    elif kind == "index match, weak loss":
        n[:], k[1:] = n[0], 10.0 ** rng.uniform(-7, -4, layers + 1)
        d = 10.0 ** rng.uniform(-3, 5, layers)
    elif kind == "grazing incidence":
        c = 10.0 ** rng.uniform(-12, -2)
    elif kind == "no thickness":
        d[:], k[1:] = 0.0, rng.uniform(0, 6, layers + 1)
    elif kind == "absorbing first medium":
        k = rng.uniform(0, 2, layers + 2)
    return [np.asarray(z, dtype) for z in (c, n, k, d, wavelength)]


KINDS = [
    "films",
    "films with metals",
    "lossless plates up to 10 mm",
    "metal up to 1 m, k up to 300",
    "frustrated total reflection",
    "total reflection, weak loss",
    "a layer at its critical angle",
    "index match, weak loss",
    "grazing incidence",
    "no thickness",
    "absorbing first medium",
]


def _stacks(layers, dtype):
    """Stacks of every kind, the cases on the last axis."""
    rng = np.random.default_rng(layers)
    drawn = [_draw(kind, layers, dtype, rng) for kind in KINDS for _ in range(CASES)]
    c, n, k, d, wavelength = (np.stack(z, axis=-1) for z in zip(*drawn, strict=True))
    return c, n, k, d, wavelength


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("layers", [1, 4])
def test_powers_and_amplitudes_of_hard_stacks(layers, dtype):
    c, n, k, d, wavelength = _stacks(layers, dtype)
    got = stack(c, n + np.asarray(1j, np.result_type(dtype, np.complex64)) * k, d, wavelength)
    assert got.R_s.dtype == dtype
    values = [np.asarray(z).astype(complex) for z in got[:8]]
    assert all(np.all(np.isfinite(z)) for z in values)
    eps, least = float(np.finfo(dtype).eps), 1e3 * float(np.finfo(dtype).tiny)
    for i in range(c.size):
        index = [complex(a, b) for a, b in zip(n[:, i].tolist(), k[:, i].tolist(), strict=True)]
        exact = stack_oracle.stack(c[i], index, d[:, i], wavelength[i])
        for j, (value, wanted) in enumerate(zip(values, exact, strict=True)):
            error = float(abs(mp.mpmathify(value[i]) - wanted))
            size = float(abs(wanted))
            if j < 2 and size < 1e-2:
                size = size**0.5
            if j >= 4:
                size = max(1.0, size)
            assert error <= 64 * eps * size + least, (KINDS[i // CASES], i, j, error / size / eps)
    total = np.asarray(got.R_s + got.T_s + jnp.sum(got.A_s, 0), float)
    total_p = np.asarray(got.R_p + got.T_p + jnp.sum(got.A_p, 0), float)
    lossless_front = k[0] == 0.0
    for sums in (total, total_p):
        assert np.max(np.abs(sums[lossless_front] - 1.0)) < 64 * eps


def test_derivatives_of_hard_stacks():
    c, n, k, d, wavelength = (z.astype(float) for z in _stacks(4, np.float64))
    chosen = np.arange(0, c.size, CASES)[:-1]  # one of each kind, lossless first media
    arguments = [jnp.asarray(z[..., chosen]) for z in (c, n, k, d, wavelength)]

    def powers(c, n, k, d, wavelength):
        return jnp.stack(stack(c, n + 1j * k, d, wavelength)[:4])

    def one(*z):
        return jax.jacrev(powers, argnums=(0, 1, 2, 3, 4))(*z)

    gradients = jax.jit(jax.vmap(one, in_axes=-1))(*arguments)
    step, eps = mp.mpf(10) ** -30, float(np.finfo(float).eps)
    for row, i in enumerate(chosen):
        flat = np.concatenate([np.asarray(g[row], float).reshape(4, -1) for g in gradients], axis=1)
        assert np.all(np.isfinite(flat))
        with mp.workdps(90):
            point = [
                mp.mpf(float(x)) for z in (c, n, k, d, wavelength) for x in np.ravel(z[..., i])
            ]

            def exact(p):
                index = [mp.mpc(a, b) for a, b in zip(p[1:7], p[7:13], strict=True)]
                return stack_oracle.stack(p[0], index, p[13:17], p[17], digits=90)[:4]

            here = exact(point)
            truth = np.zeros_like(flat)
            for j in range(len(point)):
                moved = [x + step if m == j else x for m, x in enumerate(point)]
                truth[:, j] = [
                    float((a - b) / step) for a, b in zip(exact(moved), here, strict=True)
                ]
        flat[:, 7] = truth[:, 7] = 0.0  # the first medium is lossless by choice
        norm = np.linalg.norm(truth, axis=1)
        error = np.linalg.norm(flat - truth, axis=1)
        # At grazing incidence in total reflection R does not change but for losses in proportion
        # to the cosine: what its derivatives cancel from leaves eps, which is not small there.
        least = 16 * eps if KINDS[i // CASES] == "grazing incidence" else 0.0
        assert np.all(error[:2] <= 200 * eps * norm[:2] + least), KINDS[i // CASES]
        assert np.all(error[2:] <= 200 * eps * norm[2:] + 1e-300), KINDS[i // CASES]
