"""Second derivatives of R and T of a stack of two films, where first ones have special places.

The truth is a second difference of characteristic matrices in mpmath with 100 digits.
"""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

from fresnel_jax.layers import stack
from tests.truth import stack_oracle

# cos_theta_i; n of the four media; k of all but the first; thicknesses; wavelength
POINTS = {
    "films": (0.6, 1.0, 1.46, 2.3, 3.9, 0.0, 0.01, 0.02, 0.1, 0.07, 0.55),
    "k = 0": (0.6, 1.0, 1.46, 2.3, 1.52, 0.0, 0.0, 0.0, 0.1, 0.07, 0.55),
    "total reflection": (0.4, 2.0, 1.6, 1.3, 1.1, 0.0, 0.0, 0.0, 0.15, 0.1, 0.6),
    "frustrated total reflection": (0.4, 2.0, 1.1, 1.3, 2.0, 0.0, 0.0, 0.0, 0.15, 0.1, 0.6),
    "no thickness": (0.7, 1.0, 1.46, 2.3, 1.52, 0.0, 0.3, 0.1, 0.0, 0.0, 0.55),
    "no thickness, k = 0": (0.7, 1.0, 1.46, 2.3, 1.52, 0.0, 0.0, 0.0, 0.0, 0.1, 0.55),
    "metal": (0.7, 1.0, 0.2, 0.05, 1.5, 3.1, 4.0, 0.0, 0.05, 1.0, 0.55),
    "a layer at its critical angle": (
        0.759934207678533, 2.0, 1.3, 1.7, 2.4, 0.0, 0.0, 0.0, 0.1, 0.1, 0.55,
    ),
    "index match": (0.8, 1.5, 1.5, 1.5, 1.5, 0.0, 0.0, 0.0, 0.1, 0.1, 0.55),
}  # fmt: skip
WEIGHTS = (1.0, 0.7, 0.4, 0.9)  # of R_s, R_p, T_s, T_p


def powers(x):
    n, k = x[1:5], jnp.concatenate([jnp.zeros(1, x.dtype), x[5:8]])
    out = stack(x[0], n + 1j * k, thickness_um=x[8:10], wavelength_um=x[10])
    return sum(a * z for a, z in zip(WEIGHTS, out[:4], strict=True))


def truth(x):
    index = [x[1], *(mp.mpc(*z) for z in zip(x[2:5], x[5:8], strict=True))]
    out = stack_oracle.stack(x[0], index, x[8:10], x[10], digits=100)
    return sum(a * z for a, z in zip(WEIGHTS, out[:4], strict=True))


def second_difference(x, directions):
    """The mixed second derivative along two directions."""
    step = mp.mpf(10) ** -25
    with mp.workdps(100):
        corners = {
            (i, j): truth(
                [
                    mp.mpf(float(z)) + step * (i * float(a) + j * float(b))
                    for z, a, b in zip(x, *directions, strict=True)
                ]
            )
            for i in (-1, 1)
            for j in (-1, 1)
        }
        mixed = corners[1, 1] - corners[1, -1] - corners[-1, 1] + corners[-1, -1]
        return float(mixed / (4 * step**2))


def along(x, v, w):
    return jax.jvp(lambda y: jax.jvp(powers, (y,), (v,))[1], (x,), (w,))[1]


@pytest.mark.study
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_second_derivatives(dtype):
    """Along two directions in which all arguments change; 200 eps of the size of the terms."""
    x = np.array(list(POINTS.values()), dtype)
    random = np.random.default_rng(2)
    v, w = (np.where(x == 0, 0.1, x) * random.uniform(0.5, 1.5, x.shape) for _ in range(2))
    v, w = v.astype(dtype), w.astype(dtype)
    found = jax.jit(jax.vmap(along))(x, v, w)
    for name, here, *directions, value in zip(POINTS, x, v, w, found, strict=True):
        exact = second_difference(here, directions)
        assert abs(value - exact) <= 200 * np.finfo(dtype).eps * max(abs(exact), 1.0), name


@pytest.mark.study
def test_the_whole_hessian():
    """Compiles for minutes. Found: 72 eps of the norm in relative changes of the arguments (the
    metal; 6 elsewhere; the critical angle has not been measured this way)."""
    x = np.array(list(POINTS.values()))
    forward_over_reverse = np.asarray(jax.jit(jax.vmap(jax.hessian(powers)))(x))
    for name, here, hessian in zip(POINTS, x, forward_over_reverse, strict=True):
        size = np.where(here == 0, 1.0, here)
        units = np.eye(len(here))
        exact = np.array([[second_difference(here, (a, b)) for b in units] for a in units])
        scale = np.outer(size, size)
        error = np.linalg.norm((hessian - exact) * scale)
        assert error <= 200 * np.finfo(float).eps * np.linalg.norm(exact * scale), name
