"""Coordinates in which a reflectance curve is nearly linear, and back to eta + i k.

Reflectance fixes the two parts of a relative index N = n + ik very unequally. What is left of it
at normal incidence is one number,

    x = log[(1 + |N|^2) / (2n)],     R(0) = tanh(x / 2),

and along a line of constant x only the shape over angle tells one index from another. On that
line |N| runs from e = exp(xi) to 1/e, with cosh xi = exp(x), and k = 0 holds at both ends (n and
1/n reflect alike at normal incidence). The second coordinate is the distance from one end,

    w = 2 xi - c log|N|^2,           0 <= w <= 4 xi,

where the chart c is +1 (from the end with n >= 1) or -1 (from the end with n <= 1). Both numbers
are positive for every passive medium, n is positive by construction, and near the end w is
proportional to k^2, the variable in which R is analytic there (R is even in k when the light comes
from a lossless medium, so dR/dk = 0 at k = 0 and k itself is a bad variable). Measuring w from the
end, instead of carrying log|N|^2, keeps every digit of a small k.

On the way back nothing is subtracted that cancels. With A = exp(w) - 1 and E = exp(4 xi) - 1

    n = e (1 + e^2 + A) / [(1 + e^2) (1 + A)],  k = e sqrt(A (E - A)) / [(1 + e^2) (1 + A)]

for c = +1; for c = -1 the factor 1 + A below is e^2 (N and 1/N* share x).
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

# Where k = 0 is reached: k is then about 1e-12 n, which changes R by 1e-24, far below rounding, and
# the chain rule through the square root stays finite (dR/dk ~ k meets dk/dw ~ 1/k).
W_MIN = 1e-24
# n = 1 +- 1.4e-10: R below 1e-20. A smaller x is no boundary at all.
X_MIN = 1e-20
# 1 - R(0) = 8e-18: a perfect mirror in float64.
X_MAX = 40.0
W_MAX = 163.0  # beyond the far end of X_MAX
# The far end of the line of constant x; k^2 is right to 1e-15 there, which is enough to notice
# that the other chart should be used.
FAR_END = 2.0**-50

# A chart in which the coordinates are Re eps and log Im eps. In total reflection far beyond the
# critical angle 1 - R_s = 2 cos Im(eps) / [sqrt(sin^2 - Re eps) (1 - Re eps)] for a small k: there
# the valley in which a fit creeps is bent in x and w (up to 10,000 steps were counted) and nearly
# straight in these.
EPS = 2.0
EPS_BOUNDS = (-1e4, -60.0), (1e4, 12.0)


def _parts(x: Any, w: Any, xp: Any) -> tuple[Any, Any, Any, Any, Any]:
    """Return cosh xi, sinh xi, e^2 - 1, E and A."""
    grown = xp.expm1(x)
    sinh = xp.sqrt(grown * (grown + 2.0))
    h = grown + sinh  # e - 1
    h2 = h * (2.0 + h)
    h4 = h2 * (2.0 + h2)
    near = xp.minimum(xp.expm1(xp.minimum(w, 700.0)), h4 * (1.0 - FAR_END))
    return 1.0 + grown, sinh, h2, h4, near


def _index(parts: tuple[Any, Any, Any, Any, Any], chart: Any, xp: Any) -> tuple[Any, Any]:
    cosh, sinh, h2, h4, near = parts
    scale = (cosh + sinh) / ((2.0 + h2) * xp.where(chart > 0, 1.0 + near, 1.0 + h2))
    return (2.0 + h2 + near) * scale, xp.sqrt(near * (h4 - near)) * scale


def index_derivatives(x: Any, w: Any, chart: Any, xp: Any = np) -> tuple[Any, ...]:
    """Return (n, k, dn/dx, dn/dw, dk/dx, dk/dw); xp is the array module, numpy or jax.numpy.

    dk/dw grows as 1/k towards k = 0; k dk/dw = d(k^2/2)/dw is finite and right there.
    """
    parts = _parts(x, w, xp)
    n, k = _index(parts, chart, xp)
    cosh, sinh, h2, h4, near = parts
    e2, first = 1.0 + h2, chart > 0
    per_n, per_far = 1.0 / (1.0 + e2 + near), 1.0 / (h4 - near)
    xi_x = cosh / sinh
    common = 1.0 - 2.0 * e2 / (1.0 + e2) - xp.where(first, 0.0, 2.0)
    n_x = n * xi_x * (common + 2.0 * e2 * per_n)
    k_x = k * xi_x * (common + 2.0 * (1.0 + h4) * per_far)
    drop = xp.where(first, 1.0, 0.0)
    n_w = n * ((1.0 + near) * per_n - drop)
    k_w = k * (0.5 * (1.0 + near) * (1.0 / near - per_far) - drop)
    return n, k, n_x, n_w, k_x, k_w


@jax.custom_jvp
def index_of(x: jax.Array, w: jax.Array, chart: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the relative index (n, k) of coordinates ``x``, ``w`` in the ``chart`` (+1 or -1)."""
    return _index(_parts(x, w, jnp), chart, jnp)


@index_of.defjvp
def _index_of_jvp(primals, tangents):
    x, w, chart = primals
    n, k, n_x, n_w, k_x, k_w = index_derivatives(x, w, chart, jnp)
    dx, dw, _ = tangents
    return (n, k), (n_x * dx + n_w * dw, k_x * dx + k_w * dw)


def _index_of_eps(re: jax.Array, log_im: jax.Array) -> tuple[jax.Array, jax.Array]:
    im = jnp.exp(log_im)
    large = jnp.sqrt(0.5 * (jnp.hypot(re, im) + jnp.abs(re)))
    small = 0.5 * im / large
    return jnp.where(re >= 0.0, large, small), jnp.where(re >= 0.0, small, large)


def index_of_lanes(first: jax.Array, second: jax.Array, chart: jax.Array):
    """Return the relative index (n, k) of x and w, or in the chart EPS of Re eps and log Im eps."""
    by_eps = chart == EPS
    n, k = index_of(jnp.where(by_eps, 1.0, first), jnp.where(by_eps, 1.0, second), chart)
    of_eps = _index_of_eps(jnp.where(by_eps, first, 1.0), jnp.where(by_eps, second, 0.0))
    return jnp.where(by_eps, of_eps[0], n), jnp.where(by_eps, of_eps[1], k)


def to_eps(x: np.ndarray, w: np.ndarray, chart: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return Re eps and log Im eps of x and w."""
    n, k, *_ = index_derivatives(x, w, chart)
    return (n - k) * (n + k), np.log(2.0 * n * k)


def from_eps(re: np.ndarray, log_im: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return x, w and chart of Re eps and log Im eps, with every digit of a small k."""
    index = np.sqrt(re + 1j * np.exp(log_im))
    n, k = np.real(index), np.imag(index)
    x, w, chart = coordinates_of(n, k)
    return x, np.where(chart < 0.0, w_of_small_k(x, k), w), chart


def w_of_small_k(x: np.ndarray, k: np.ndarray) -> np.ndarray:
    """Return w of a small k (relative) at the end n <= 1, chart -1, of the line of constant x.

    From k^2 = A (E - A) f^2 with the root that does not cancel.
    """
    xi = xi_of(x)
    E = np.expm1(4.0 * xi)
    square = (k * np.exp(xi) * (1.0 + np.exp(2.0 * xi))) ** 2
    A = 2.0 * square / (E + np.sqrt(np.maximum(E * E - 4.0 * square, 0.0)))
    return np.maximum(np.log1p(A), W_MIN)


def xi_of(x: Any, xp: Any = np) -> Any:
    """Return xi = arcosh(exp(x)), so that w runs from 0 to 4 xi."""
    grown = xp.expm1(x)
    return xp.log1p(grown + xp.sqrt(grown * (grown + 2.0)))


def coordinates_of(n: Any, k: Any, xp: Any = np) -> Any:
    """Return stack([x, w, chart]) of a relative index, in the chart whose end is nearer.

    n > 0, k >= 0. For starts, not for results: the digits of a small k are lost in w.
    """
    x = xp.clip(xp.log1p(((n - 1.0) ** 2 + k * k) / (2.0 * n)), X_MIN, X_MAX)
    y = xp.log(n * n + k * k)
    w = xp.maximum(2.0 * xi_of(x, xp) - xp.abs(y), W_MIN)
    return xp.stack([x, w, xp.where(y < 0.0, -1.0, 1.0)])
