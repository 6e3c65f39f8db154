"""From parameters to what is measured: a sample seen through an instrument, row by row.

This is the one place where a sample becomes numbers: `boundary` chooses between one surface, a
thick plate and a stack, and `predicted` makes every observable of it.

psi and Delta are compared as N = cos 2psi, C = sin 2psi cos Delta, S = sin 2psi sin Delta, which
have no branches and no place where one of them means nothing; a divergent beam averages the
intensities behind them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from fitting.dispersion import Model
from fitting.instrument import cosines, detected
from fitting.parameters import to_parameter
from fresnel_jax import powers
from fresnel_jax.dispersion import material
from fresnel_jax.layers import slab, stack
from fresnel_jax.polarization import ellipsometric_ratio

POWERS = ("R_s", "R_p", "R", "R_back", "T_s", "T_p", "T")
NCS = "NCS"


class Points(NamedTuple):
    """Where the data lie, M rows; the last axis is 1, or L where every lane has points of its own.

    angle_deg, wavelength_um, s_share: (M, 1) or (M, L); s_share is the part of s in R and T.
    file: (M,) number of the file of each row.
    distinct_um, place: where wavelengths repeat (angles, repeated rows), each of them once, (U, 1),
        and (M,) which of them belongs to each row; else None. The index is evaluated there: with
        two oscillators a fit at 3 angles takes half, one at 7 angles a third of the time.
    """

    angle_deg: Any
    wavelength_um: Any
    s_share: Any
    file: Any
    distinct_um: Any = None
    place: Any = None


class Media(NamedTuple):
    """What a compiled program must know of a sample: its media after the first, and no number.

    index: a `Model`, or the name of a material. places: their names. coherent: of each layer.
    closed: whether the last medium is the first one again.
    """

    index: tuple[Model | str, ...]
    places: tuple[str, ...]
    coherent: tuple[bool, ...] = ()
    closed: bool = False

    @property
    def bare(self) -> bool:
        """Whether there is one boundary and no layer."""
        return not self.coherent


class Spec(NamedTuple):
    """Everything about a fit that a compiled program depends on; hashable.

    channels: those of `POWERS` and `NCS` that are fitted. moving: names of the unknowns, in the
    order of y; coordinates: theirs. held: names of the constants. tied: (name, factor, of which).
    curves: for each channel the curve of every file, the number in ``scale_0``, ``background_0``.
    """

    media: Media
    channels: tuple[str, ...]
    moving: tuple[str, ...]
    coordinates: tuple[str, ...]
    held: tuple[str, ...]
    curves: tuple[tuple[int, ...], ...]
    tied: tuple[tuple[str, float, str], ...] = ()
    loss: str = "squares"
    priors: bool = False

    def values(self, y: Array, held: Array) -> dict[str, Array]:
        """Return every parameter, (L,), at the unknowns y (p, L) and constants (h,)."""
        lanes = y.shape[1:]
        out = dict(zip(self.moving, to_parameter(self.coordinates, y), strict=True))
        out |= {
            name: jnp.broadcast_to(value, lanes)
            for name, value in zip(self.held, held, strict=True)
        }
        return out | {name: factor * out[of] for name, factor, of in self.tied}


def medium_index(
    spec: Spec, medium: int, v: Mapping[str, Array], wavelength_um: Any
) -> tuple[Array, Array]:
    """Return eta and k, (M, L), of a medium at wavelengths (M, 1) or (M, L).

    NaN where eta is not positive: a step of the solver to where a formula has no meaning is refused
    by it, as the cost is NaN.
    """
    wavelength_um = jnp.asarray(wavelength_um)
    which, place = spec.media.index[medium], spec.media.places[medium]
    lanes = jax.tree.leaves(dict(v))[0].shape[-1]
    if isinstance(which, str):
        known = material(which).model.index(wavelength_um)
        shape = (wavelength_um.shape[0], lanes)
        return jnp.broadcast_to(known.eta, shape), jnp.broadcast_to(known.k, shape)
    shared = wavelength_um.shape[-1] == 1
    at = wavelength_um[:, 0] if shared else wavelength_um
    head = f"{place}."
    own = {
        name.removeprefix(head): value for name, value in v.items()
        if name.startswith(head) and not name.startswith(f"{head}thickness")
    }  # fmt: skip
    index = jax.vmap(which.index, in_axes=(0, None if shared else -1), out_axes=-1)(own, at)
    return jnp.where(index.eta > 0.0, index.eta, jnp.nan), index.k


def _at_rows(spec: Spec, v: Mapping[str, Array], points: Points) -> list[tuple[Array, Array]]:
    """Return eta and k of every medium after the first, at every row."""
    repeated = points.place is not None
    at = points.distinct_um if repeated else points.wavelength_um
    out = [medium_index(spec, i, v, at) for i in range(len(spec.media.index))]
    # Without the barrier XLA repeats the model's formula for every angle and output.
    out = jax.lax.optimization_barrier(out)
    return [(n[points.place], k[points.place]) for n, k in out] if repeated else out


def thickness_um(spec: Spec, v: Mapping[str, Array], layer: int) -> Array:
    """Return the thickness (L,) of a layer in micrometres."""
    place = spec.media.places[layer]
    if spec.media.coherent[layer]:
        return 1e-3 * v[f"{place}.thickness_nm"]
    return v[f"{place}.thickness_um"]


def boundary(
    spec: Spec, c: Array, index: list[tuple[Array, Array]], v: Mapping[str, Array],
    points: Points, eta_i: Any,
) -> Any:  # fmt: skip
    """Return R_s, R_p, T_s and T_p of the sample at cosines c (Q, M, L); of films also r_s, r_p."""
    if spec.media.bare:
        return powers(c, *index[0], eta_i)
    if not all(spec.media.coherent):
        return slab(c, *index[0], thickness_um(spec, v, 0), points.wavelength_um, eta_i)
    shape = index[0][0].shape
    outside = jnp.broadcast_to(jnp.asarray(eta_i, index[0][0].dtype), shape)
    media = [jax.lax.complex(outside, jnp.zeros_like(outside))]
    media += [jax.lax.complex(n, k) for n, k in index]
    depth = [thickness_um(spec, v, i) for i in range(len(spec.media.coherent))]
    return stack(c, jnp.stack(media), jnp.stack(depth)[:, None], points.wavelength_um)


def _ellipsometry(
    spec: Spec, c: Array, index: list[tuple[Array, Array]], both: Any, eta_i: Any
) -> tuple[Array, Array, Array]:
    """Return cos 2psi, sin 2psi cos Delta and sin 2psi sin Delta at cosines c (Q, M, L)."""
    if spec.media.bare:
        rho = ellipsometric_ratio(c, *index[0], eta_i)
        share = 2.0 / (1.0 + rho.real**2 + rho.imag**2)
        return share - 1.0, rho.real * share, -rho.imag * share
    # By products of amplitudes: r_s may be 0.
    cross, total = both.r_p * jnp.conj(both.r_s), both.R_s + both.R_p
    return (both.R_s - both.R_p) / total, 2.0 * cross.real / total, -2.0 * cross.imag / total


def predicted(spec: Spec, v: Mapping[str, Array], points: Points, eta_i: Any) -> dict[str, Any]:
    """Return what is seen of each channel, (M, L); of `NCS` a list of three.

    v: every parameter, (L,); an instrument parameter that is left out is neutral.
    """
    index = _at_rows(spec, v, points)
    c, weights = cosines(v, points.angle_deg)
    both = boundary(spec, c, index, v, points, eta_i)

    def mean(x: Array) -> Array:
        return x[0] if x.shape[0] == 1 else (weights * x).sum(0)

    ideal = {name: mean(getattr(both, name)) for name in ("R_s", "R_p", "T_s", "T_p")}
    out: dict[str, Any] = {
        channel: detected(v, channel, ideal, points.s_share, (own, points.file))
        for channel, own in zip(spec.channels, spec.curves, strict=True)
        if channel != NCS
    }
    if NCS in spec.channels:
        parts = _ellipsometry(spec, c, index, both, eta_i)
        if c.shape[0] > 1:
            # cos 2psi of a mixture is that of the summed intensities.
            intensity = both.R_s + both.R_p
            parts = [intensity * x for x in parts]
            total = mean(intensity)
            parts = [x / total for x in map(mean, parts)]
        else:
            parts = [mean(x) for x in parts]
        # Not stacked: XLA computes anew what it joins, and a fit of psi and Delta took 4 times as
        # long.
        out[NCS] = parts
    return out
