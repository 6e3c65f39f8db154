"""From parameters to what is measured: a sample seen through an instrument, row by row.

This is the one place where a sample becomes numbers: `boundary` chooses between one surface, a
plate, coherent films and thick layers, and `predicted` makes every observable of it.

psi and Delta are compared as N = cos 2psi, C = sin 2psi cos Delta, S = sin 2psi sin Delta, which
have no branches and no place where one of them means nothing; a divergent beam and the width of a
slit average the intensities behind them.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from fitting.data.quantities import POWERS, STOKES
from fitting.optics.instrument import SLIT, cosines, detected, slit
from fitting.optics.layer_index import Pair, slices_of
from fitting.optics.layer_index import medium_index as medium_index
from fitting.optics.partial_derivatives import by_partial_derivatives
from fitting.optics.spec import NCS, Points, Spec
from fitting.samples.known_media import known_medium
from fresnel_jax import powers
from fresnel_jax.layers import Uniaxial, slab, stack
from fresnel_jax.performance import computed_once
from fresnel_jax.polarization import ellipsometric_ratio


def indices(spec: Spec, v: Mapping[str, Array], points: Points, eta_i: Any) -> list[list[Any]]:
    """Return eta and k of every medium after the first, of its slices from above, at every row.

    As of `slices_of`, so that a uniaxial medium has four.
    """
    repeated = points.place is not None
    at = jnp.asarray(points.distinct_um if repeated else points.wavelength_um)
    outside = eta_i[_first_of(points)] if repeated and jnp.ndim(eta_i) else eta_i
    out = [slices_of(spec, i, v, at, outside) for i in range(len(spec.media.index))]
    # Else XLA repeats the model's formula for every angle and output.
    out = jax.tree.map(computed_once, out)
    if not repeated:
        return out
    return [[tuple(x[points.place] for x in parts) for parts in each] for each in out]


def _medium(parts: tuple[Array, ...]) -> Any:
    """Return the medium of `stack` from eta and k, or from those of both axes."""
    ordinary, *axis = (jax.lax.complex(*parts[i : i + 2]) for i in range(0, len(parts), 2))
    return Uniaxial(ordinary, *axis) if axis else ordinary


def _first_of(points: Points) -> Array:
    """Return a row (U,) of each distinct wavelength."""
    count = points.distinct_um.shape[0]
    rows = jnp.arange(points.place.shape[0])
    return jnp.zeros(count, rows.dtype).at[points.place].max(rows)


def thickness_um(spec: Spec, v: Mapping[str, Array], layer: int) -> Array:
    """Return the thickness (L,) of a layer in micrometres."""
    place = spec.media.places[layer]
    if spec.media.coherent[layer]:
        return 1e-3 * v[f"{place}.thickness_nm"]
    return v[f"{place}.thickness_um"]


class Light(NamedTuple):
    """Powers of s and p, and the ratio r_p / r_s as (re, im), (Q, M, L); None if not asked for."""

    R_s: Array
    R_p: Array
    T_s: Array
    T_p: Array
    ellipse: tuple[Array, Array, Array] | None = None


def boundary(
    spec: Spec, c: Array, index: list[list[Any]], v: Mapping[str, Array],
    wavelength_um: Any, eta_i: Any,
) -> Light:  # fmt: skip
    """Return what the sample does to light at cosines c (Q, M, L).

    ellipse: cos 2psi, sin 2psi cos Delta and sin 2psi sin Delta; shorter than 1 of a thick layer,
    whose light is partly depolarized.
    """
    media, pairs = spec.media, not spec.only_powers
    first: Pair = index[0][0][:2]
    if media.bare:
        both = powers(c, *first, eta_i, compensated=False)  # in half of the time
        rho = ellipsometric_ratio(c, *first, eta_i) if pairs else None
        return Light(*both, None if rho is None else _ellipse(rho))
    layers = [
        (_medium(parts), thickness_um(spec, v, i) / len(slices))
        for i, slices in enumerate(index[:-1])
        for parts in slices
    ]
    thicknesses: Any = [d for _, d in layers]
    media_index: Any = [*(n for n, _ in layers), _medium(index[-1][0])]
    together = zip(media.coherent, index[:-1], strict=True)
    coherent = [interferes for interferes, slices in together for _ in slices]
    if not pairs and media.coherent == (False,) and media.closed:
        # `stack` is right too, but takes twice as long, to compile (1.5 s) and to run.
        found: Any = slab(
            c, *first, thickness_um=thicknesses[0], wavelength_um=wavelength_um, eta_i=eta_i
        )
    else:
        every = [eta_i, *media_index]
        found = stack(
            c,
            every,
            thickness_um=thicknesses,
            wavelength_um=wavelength_um,
            coherent=coherent,
            exact=False,
        )
        if media.normal:  # s is both, and what p needs is not computed
            found = found._replace(R_p=found.R_s, T_p=found.T_s)
    # No quotient r_p / r_s: a film may extinguish r_s.
    ellipse = _ellipse_of(found.R_s, found.R_p, found.cross) if pairs else None
    return Light(found.R_s, found.R_p, found.T_s, found.T_p, ellipse)


def _ellipse_of(R_s: Array, R_p: Array, product: Array) -> tuple[Array, Array, Array]:
    total = R_s + R_p
    return (R_s - R_p) / total, 2.0 * product.real / total, -2.0 * product.imag / total


def _ellipse(rho: Array) -> tuple[Array, Array, Array]:
    share = 2.0 / (1.0 + rho.real**2 + rho.imag**2)
    return share - 1.0, rho.real * share, -rho.imag * share


def predicted(
    spec: Spec, v: Mapping[str, Array], points: Points, eta_i: Any, directions: int = 1,
    index: list[list[Any]] | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Return what is seen of each channel, (M, L); of `NCS` a list of three.

    v: every parameter, (L,); an instrument parameter that is left out is neutral. directions: in
    how many derivatives are going to be asked for. index: that of all media, where it is known.
    """
    if "wavelength_offset" in v:
        points = _shifted(points, 1e-3 * v["wavelength_offset"])
        eta_i = _outside(spec, points, eta_i)
    if "bandwidth" in v:
        shifts, shares = slit(v, spec.places[0])

        def within(shift: Array) -> Light:
            at = _shifted(points, shift)
            return _light(spec, v, at, _outside(spec, at, eta_i), directions)

        # One after the other where they are many: side by side they fill the memory.
        each = jax.vmap(within)(shifts) if len(shares) <= SLIT else jax.lax.map(within, shifts)
        light = jax.tree.map(lambda x: jnp.tensordot(shares, x, 1), each)
    else:
        light = _light(spec, v, points, eta_i, directions, index)
    ideal = light._asdict()
    out: dict[str, Any] = {
        channel: detected(v, channel, ideal, points.s_share, (own, points.file))
        for channel, own in zip(spec.channels, spec.curves, strict=True)
        if channel in POWERS
    }
    if light.ellipse is not None:
        # Not stacked: XLA computes anew what it joins, and a fit of psi and Delta took 4 times as
        # long.
        ellipse = list(light.ellipse)
        if _mixed(v):
            intensity = light.R_s + light.R_p
            ellipse = [x / intensity for x in ellipse]
        out |= {q: x for q, x in zip(STOKES, ellipse, strict=True) if q in spec.channels}
        if _mixed(v) or not all(spec.media.coherent):
            # psi and Delta are angles, those of the polarized part of the light.
            length = jnp.sqrt(sum(x * x for x in ellipse))
            ellipse = [x / length for x in ellipse]
        if points.folded is not None:
            # The slope changes its sign with that of S; where S is 0, as of a transparent surface,
            # it is that of S itself, so that k is still seen.
            N, C, S = ellipse
            ellipse = [N, C, jnp.where(points.folded & (S < 0.0), -S, S)]
        out[NCS] = ellipse
    return out


def _mixed(v: Mapping[str, Array]) -> bool:
    return "divergence" in v or "bandwidth" in v


def _outside(spec: Spec, points: Points, eta_i: Any) -> Any:
    """Return the index of the first medium at other wavelengths than those of ``eta_i``."""
    which = spec.media.outside
    return eta_i if which is None else known_medium(which).model.index(points.wavelength_um).eta


def _shifted(points: Points, shift: Array) -> Points:
    """Return the points at wavelengths that are longer by a shift (L,)."""
    distinct = points.distinct_um
    return points._replace(
        wavelength_um=points.wavelength_um + shift,
        distinct_um=None if distinct is None else distinct + shift,
    )


def _light(
    spec: Spec, v: Mapping[str, Array], points: Points, eta_i: Any, directions: int,
    index: list[list[Any]] | None = None,
) -> Light:  # fmt: skip
    """Return the light of one wavelength at every row, (M, L), summed over the beam.

    ellipse: where light is mixed times the intensity R_s + R_p, since cos 2psi of a mixture is that
    of the summed intensities.
    """
    index = index or indices(spec, v, points, eta_i)
    c, weights = cosines(v, points.angle_deg, spec.places[1])
    sizes = {name: x for name, x in v.items() if ".thickness_" in name}
    at = c, index, sizes, jnp.asarray(points.wavelength_um), jnp.asarray(eta_i)
    both = by_partial_derivatives(functools.partial(boundary, spec), at, directions)
    if both.ellipse is not None and _mixed(v):
        intensity = both.R_s + both.R_p
        first, second, third = both.ellipse
        parts = intensity * first, intensity * second, intensity * third
        both = both._replace(ellipse=parts)

    def mean(x: Array) -> Array:
        return x[0] if x.shape[0] == 1 else (weights * x).sum(0)

    return jax.tree.map(mean, both)
