"""A rough boundary in a stack: the factor of Nevot and Croce on its reflection coefficient.

Between media i (above) and j the amplitude r is replaced by r w, w = exp(-2 k_0^2 sigma^2 Q_i Q_j),
with the factor 1 / t of the recursion unchanged. In the tangential fields U and W of
`_stack_coherent`, and with z = Q / g, that is a factor on each of them,

    U' = U + U (w - 1) (z_i - z_j) / (2 z_i),        W' = W - W (w - 1) (z_i - z_j) / (2 z_j).

Source: L. Nevot and P. Croce 1980, doi:10.1051/rphysap:01980001503076100.
"""

import jax.numpy as jnp
from jaxtyping import Array

from ._arithmetic import Complex, one_if_zero, squared_modulus, times
from ._stack_coherent import Fields, inverse, minus, plus, scaled
from ._stack_wave import Pair, choose


def _exponential_slope(z: Complex) -> Pair:
    """(exp(z) - 1) / z."""
    re, im = z[0], jnp.zeros_like(z[0]) if z[1] is None else z[1]
    small = re * re + im * im < 0.0625
    near = (jnp.where(small, re, 0.0), jnp.where(small, im, 0.0))
    series = (jnp.ones_like(re), jnp.zeros_like(re))
    for k in range(12, 1, -1):
        series = plus((jnp.ones_like(re), jnp.zeros_like(re)), scaled(1.0 / k, times(series, near)))
    far = (jnp.where(small, 1.0, re), jnp.where(small, 0.0, im))
    size = jnp.exp(far[0])
    difference = (size * jnp.cos(far[1]) - 1.0, size * jnp.sin(far[1]))
    per = 1.0 / one_if_zero(squared_modulus(far))
    return choose(small, series, times(difference, (far[0] * per, -far[1] * per)))


def rough_boundary(
    fields: Fields,
    waves_per_roughness: Array,
    above: tuple[Complex, Complex],
    below: tuple[Complex, Complex],
    q0: Complex,
) -> Fields:
    """The fields above the boundary from those below; above and below are Q and g (of p)."""
    (q_i, g_i), (q_j, g_j) = above, below
    tau = (2.0 * jnp.pi * waves_per_roughness) ** 2
    slope = scaled(-tau, _exponential_slope(scaled(-2.0 * tau, times(q_i, q_j))))
    out = []
    for p in range(2):
        u, w, m, f = (z[p] for z in fields)
        step_u, step_w = times(slope, q_j), times(slope, q_i)  # (w - 1) / (2 Q)
        if p == 0:
            difference = minus(q_i, q_j)
        else:
            difference = minus(times(q_i, inverse(g_i)), times(q_j, inverse(g_j)))
            step_u, step_w = times(step_u, g_i), times(step_w, g_j)
        du = times(times(step_u, difference), u)
        dw = scaled(-1.0, times(times(step_w, difference), w))
        out.append((plus(u, du), plus(w, dw), plus(m, minus(times(q0, du), dw)), f))
    return Fields(*zip(*out, strict=True))
