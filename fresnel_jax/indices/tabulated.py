"""An index that is given by a table, interpolated so that no shape appears that is not in it."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike

from .._numerics.arguments import float_named
from .._numerics.index import Index
from .spectral import DispersionModel, evaluate_within, in_one_type


def _slopes(x: Array, y: Array) -> Array:
    """Slopes at the knots: a weighted harmonic mean of both secants, 0 where they change sign.

    Fritsch and Butland 1984, doi:10.1137/0905021; at the ends the slope of the parabola through
    three points, kept within what preserves the shape.
    """
    steps = jnp.diff(x)
    secants = jnp.diff(y) / steps
    if len(x) == 2:
        return jnp.concatenate([secants, secants])
    h_0, h_1, d_0, d_1 = steps[:-1], steps[1:], secants[:-1], secants[1:]
    w_0, w_1 = h_0 + 2.0 * h_1, 2.0 * h_0 + h_1
    same_sign = jnp.sign(d_0) * jnp.sign(d_1) > 0.0
    # d_0 d_1 / (..) would underflow for the k = 1e-25 of some tables in float32
    d_0, d_1 = jnp.where(same_sign, d_0, 1.0), jnp.where(same_sign, d_1, 1.0)
    inner = jnp.where(same_sign, d_0 * ((w_0 + w_1) * (d_1 / (w_0 * d_1 + w_1 * d_0))), 0.0)
    first = _end_slope(steps[0], steps[1], secants[0], secants[1])
    last = _end_slope(steps[-1], steps[-2], secants[-1], secants[-2])
    return jnp.concatenate([first[None], inner, last[None]])


def _end_slope(h_0, h_1, d_0, d_1):
    slope = d_0 + (d_0 - d_1) * (h_0 / (h_0 + h_1))
    slope = jnp.where(jnp.sign(slope) != jnp.sign(d_0), 0.0, slope)
    overshoots = (jnp.sign(d_0) != jnp.sign(d_1)) & (jnp.abs(slope) > 3.0 * jnp.abs(d_0))
    return jnp.where(overshoots, 3.0 * d_0, slope)


def monotone_cubic(at: Array, x: Array, values: tuple[Array, ...]) -> list[Array]:
    """Piecewise cubics through (x, y), for each y of `values`, at points within x."""
    left = jnp.clip(jnp.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
    x_0, x_1 = x[left], x[left + 1]
    step = x_1 - x_0
    t, u = (at - x_0) / step, (x_1 - at) / step
    results = []
    for y in values:
        slopes = _slopes(x, y)
        y_0, y_1 = y[left], y[left + 1]
        # Bernstein's form: both inner control points lie between y_0 and y_1, so that all terms
        # have one sign and a small y keeps its digits beside a large one.
        b_0 = y_0 + slopes[left] * (step / 3.0)
        b_1 = y_1 - slopes[left + 1] * (step / 3.0)
        results.append(u * u * (u * y_0 + 3.0 * (t * b_0)) + t * t * (t * y_1 + 3.0 * (u * b_1)))
    return results


def _concrete(x) -> np.ndarray | None:
    return None if isinstance(x, Tracer) else np.asarray(x)


class Tabulated(DispersionModel):
    """An index interpolated in a table of measured or computed values.

    Piecewise cubic in the wavelength with a continuous first derivative; monotone where the table
    is (so k never falls below 0), no overshoot at a kink; each value of the table is met exactly.

    Arguments:
        wavelength_um: at least two wavelengths, ascending.
        eta, k: as many values, >= 0; k left out: 0.

    Accuracy: that of the table at its knots; between them the error of the interpolation, which
    falls as the cube of the step (as its square at an extremum). Of every second row of published
    tables, left out, the rms error of n is .002 (Ge, 400 rows), .02 (Au, 49 rows), .045 (Si, 121
    rows, nearly all of it at the sharp peak at .37 um). In float32 the wavelengths of the table are
    rounded too: eps times wavelength over step.
    Derivatives with respect to the table exist; where a value is a local extremum the slope there
    is 0 and has a kink, whose derivative is returned as 0. Outside of the table the index is
    unknown: a ValueError, or NaN for a traced wavelength or table.
    Source: F. N. Fritsch and J. Butland, SIAM J. Sci. Stat. Comput. 5, 300 (1984),
    doi:10.1137/0905021.

    Raises:
        ValueError: shapes, order or signs are not as above, or a value is not finite.
    """

    wavelength_um: Array = eqx.field(converter=float_named("wavelength_um"))
    eta: Array = eqx.field(converter=float_named("eta"))
    k: Array = eqx.field(converter=float_named("k"), default=0.0)

    def __check_init__(self):
        shape = self.wavelength_um.shape
        if len(shape) != 1 or shape[0] < 2:
            raise ValueError(f"wavelength_um has shape {shape}; wanted at least two wavelengths")
        for name, column in (("eta", self.eta), ("k", self.k)):
            if column.shape not in (shape, () if name == "k" else shape):
                raise ValueError(f"{name} has shape {column.shape}, wavelength_um {shape}")
            values = _concrete(column)
            if values is not None and not ((values >= 0) & np.isfinite(values)).all():
                raise ValueError(f"{name} holds a value that is negative or not finite")
        knots = _concrete(self.wavelength_um)
        if knots is not None and not ((np.diff(knots) > 0).all() and 0 < knots[0] < np.inf):
            raise ValueError(
                "wavelength_um is not positive and ascending; sort the rows and drop repeats"
            )

    def index(self, wavelength_um: Array) -> Index:
        dtype = wavelength_um.dtype
        knots = self.wavelength_um.astype(dtype)
        # What is clipped is rounding: the derivative stays that of the wavelength, at the ends too
        # (that of jnp.clip is a half there).
        clipped = jnp.clip(wavelength_um, knots[0], knots[-1])
        inside = wavelength_um + jax.lax.stop_gradient(clipped - wavelength_um)
        k = jnp.broadcast_to(self.k, knots.shape)
        index = monotone_cubic(inside, knots, (self.eta.astype(dtype), k.astype(dtype)))
        return Index(*index)

    def __call__(self, wavelength_um: ArrayLike) -> Index:
        """`Index(eta, k)` at vacuum wavelengths in micrometres; see the module `dispersion`."""
        wavelength = in_one_type(wavelength_um, self)
        knots = _concrete(self.wavelength_um)
        knots = self.wavelength_um if knots is None else knots
        return evaluate_within(self, wavelength, knots[0], knots[-1], "the table")
