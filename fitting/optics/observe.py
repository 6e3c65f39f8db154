"""From parameters to what is measured: a sample seen through an instrument, row by row.

This is the one place where a sample becomes numbers: `slices_of` evaluates the index of a medium,
of mixtures and of graded layers, `boundary` chooses between one surface, a plate, coherent films
and thick layers, and `predicted` makes every observable of it.

psi and Delta are compared as N = cos 2psi, C = sin 2psi cos Delta, S = sin 2psi sin Delta, which
have no branches and no place where one of them means nothing; a divergent beam and the width of a
slit average the intensities behind them.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array
from jax.custom_derivatives import SymbolicZero

from fitting.data.quantities import POWERS, STOKES
from fitting.optics.instrument import cosines, detected, slit
from fitting.optics.spec import NCS, SLIT, Points, Spec
from fitting.samples.known_media import (
    ABOVE,
    BELOW,
    RULES,
    UNIAXIAL,
    MaterialFile,
    Mixture,
    known_medium,
)
from fresnel_jax import powers
from fresnel_jax.layers import Uniaxial, slab, stack
from fresnel_jax.performance import computed_once
from fresnel_jax.polarization import ellipsometric_ratio

Pair = tuple[Array, Array]  # eta and k
# Slices of a film whose index changes with depth.
_SLICES = 12


def _index_of(
    which: Any, own: Mapping[str, Array], wavelength_um: Array, shape: tuple[int, int]
) -> Pair:
    """Return eta and k, (M, L), of a medium without mixture; own: its parameters by bare names."""
    if isinstance(which, complex):
        return jnp.full(shape, which.real), jnp.full(shape, which.imag)
    if isinstance(which, str | MaterialFile):
        known = known_medium(which).model.index(wavelength_um)
        return jnp.broadcast_to(known.eta, shape), jnp.broadcast_to(known.k, shape)
    shared = wavelength_um.shape[-1] == 1
    at = wavelength_um[:, 0] if shared else wavelength_um
    index = jax.vmap(which.index, in_axes=(0, None if shared else -1), out_axes=-1)(own, at)
    return jnp.where(index.eta > 0.0, index.eta, jnp.nan), index.k


def _mixed(mixture: Mixture, parts: list[Pair], fractions: list[Array]) -> Pair:
    """Return eta and k, (M, L), of a mixture."""
    eta, k = (jnp.stack(part) for part in zip(*parts, strict=True))
    shares = jnp.stack([jnp.broadcast_to(f, eta.shape[1:]) for f in fractions])
    if len(fractions) > 1:
        # The shares exceed 1: NaN, so that the solver refuses a step to it.
        shares = jnp.where(shares.sum(0) <= 1.0 + 1e-9, shares, jnp.nan)
    grains = (mixture.depolarization,) if mixture.rule == "bruggeman" else ()
    return tuple(RULES[mixture.rule](eta, k, shares, *grains))  # type: ignore


class _Medium(NamedTuple):
    """A medium of a sample: its index, its parameters by bare names, and eta and k of its parts."""

    which: Any
    own: dict[str, Array]
    parts: list[Pair]

    @property
    def index(self) -> Pair:
        """eta and k, (M, L): of a layer in steps in its middle, of a uniaxial one the ordinary."""
        if not isinstance(self.which, Mixture) or self.which.rule == UNIAXIAL:
            return self.parts[0]
        fractions = [self.own[name] for name in self.which.fractions] or [jnp.full((), 0.5)]
        return _mixed(self.which, self.parts, fractions)


def _medium(
    spec: Spec, medium: int, v: Mapping[str, Array], wavelength_um: Array, eta_i: Any
) -> _Medium:
    which, head = spec.media.index[medium], f"{spec.media.places[medium]}."
    own = {name.removeprefix(head): x for name, x in v.items() if name.startswith(head)}
    lanes = next((x.shape[-1] for x in v.values()), 1)
    shape, parts = (wavelength_um.shape[0], lanes), []
    for part in which.parts if isinstance(which, Mixture) else (which,):
        if part == ABOVE and medium == 0:
            parts.append((jnp.broadcast_to(jnp.asarray(eta_i), shape), jnp.zeros(shape)))
        elif part in (ABOVE, BELOW):
            beside = medium + (1 if part == BELOW else -1)
            parts.append(_medium(spec, beside, v, wavelength_um, eta_i).index)
        else:
            parts.append(_index_of(part, own, wavelength_um, shape))
    return _Medium(which, own, parts)


def medium_index(
    spec: Spec, medium: int, v: Mapping[str, Array], wavelength_um: Any, eta_i: Any = 1.0
) -> Pair:
    """Return eta and k, (M, L), of a medium at wavelengths (M, 1) or (M, L).

    NaN where eta is not positive: the cost is then NaN, and the solver refuses a step to where a
    formula has no meaning. For a layer in steps it is the index in its middle, for a uniaxial one
    the ordinary index. eta_i: index of the first medium, for a layer that is mixed with it.
    """
    return _medium(spec, medium, v, jnp.asarray(wavelength_um), eta_i).index


def slices_of(
    spec: Spec, medium: int, v: Mapping[str, Array], at: Array, eta_i: Any
) -> list[tuple[Array, ...]]:
    """Return eta and k of a medium, or of the slices of equal thickness that stand for a layer.

    A uniaxial medium has its extraordinary eta and k behind them.
    """
    which, own, parts = found = _medium(spec, medium, v, at, eta_i)
    if isinstance(which, Mixture) and which.rule == UNIAXIAL:
        (eta, k), *others = parts
        if which.shares:
            along = eta + own["birefringence"]
            others = [(jnp.where(along > 0.0, along, jnp.nan), k)]
        return [(eta, k, *others[0])]
    if isinstance(which, Mixture) and which.steps:
        each = [(jnp.stack([n] * which.steps), jnp.stack([k] * which.steps)) for n, k in parts]
        # All steps at once: a formula for each of eight takes five seconds more to compile.
        shares = ((jnp.arange(which.steps) + 0.5) / which.steps)[:, None, None]
        return [*zip(*_mixed(which, each, [shares]), strict=True)]
    eta, k = found.index
    if "grade" in own:
        depths = (jnp.arange(_SLICES) + 0.5) / _SLICES - 0.5
        return [(eta * (1.0 + own["grade"] * depth), k) for depth in depths]
    return [(eta, k)]


def indices(spec: Spec, v: Mapping[str, Array], points: Points, eta_i: Any) -> list[list[Any]]:
    """Return eta and k of every medium after the first, of its slices from above, at every row.

    As of `slices_of`, so that a uniaxial medium has four.
    """
    repeated = points.place is not None
    at = jnp.asarray(points.distinct_um if repeated else points.wavelength_um)
    outside = eta_i
    if repeated and jnp.ndim(eta_i):  # at a row of each distinct wavelength
        rows = jnp.arange(points.place.shape[0])
        first = jnp.zeros(points.distinct_um.shape[0], rows.dtype).at[points.place].max(rows)
        outside = eta_i[first]
    out = [slices_of(spec, i, v, at, outside) for i in range(len(spec.media.index))]
    # Else XLA repeats the model's formula for every angle and output.
    out = jax.tree.map(computed_once, out)
    if not repeated:
        return out
    return [[tuple(x[points.place] for x in parts) for parts in each] for each in out]


def _complex(parts: tuple[Array, ...]) -> Any:
    """Return the medium of `stack` from eta and k, or from those of both axes."""
    ordinary, *axis = (jax.lax.complex(*parts[i : i + 2]) for i in range(0, len(parts), 2))
    return Uniaxial(ordinary, *axis) if axis else ordinary


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
        if not pairs:
            return Light(*both)
        rho = ellipsometric_ratio(c, *first, eta_i)
        share = 2.0 / (1.0 + rho.real**2 + rho.imag**2)
        return Light(*both, (share - 1.0, rho.real * share, -rho.imag * share))
    layers = [
        (_complex(parts), thickness_um(spec, v, i) / len(slices), coherent)
        for i, (slices, coherent) in enumerate(zip(index[:-1], media.coherent, strict=True))
        for parts in slices
    ]
    within, thicknesses, coherent = (list[Any](each) for each in zip(*layers, strict=True))
    if not pairs and media.coherent == (False,) and media.closed:
        # `stack` is right too, but takes twice as long, to compile (1.5 s) and to run.
        found: Any = slab(
            c, *first, thickness_um=thicknesses[0], wavelength_um=wavelength_um, eta_i=eta_i
        )
    else:
        found = stack(
            c, [eta_i, *within, _complex(index[-1][0])], thickness_um=thicknesses,
            wavelength_um=wavelength_um, coherent=coherent, exact=False,
        )  # fmt: skip
        if media.normal:  # s is both, and what p needs is not computed
            found = found._replace(R_p=found.R_s, T_p=found.T_s)
    # No quotient r_p / r_s: a film may extinguish r_s.
    total, ellipse = found.R_s + found.R_p, None
    if pairs:
        both = 2.0 * found.cross.real / total, -2.0 * found.cross.imag / total
        ellipse = (found.R_s - found.R_p) / total, *both
    return Light(found.R_s, found.R_p, found.T_s, found.T_p, ellipse)


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
        if _averaged(v):
            intensity = light.R_s + light.R_p
            ellipse = [x / intensity for x in ellipse]
        out |= {q: x for q, x in zip(STOKES, ellipse, strict=True) if q in spec.channels}
        if _averaged(v) or not all(spec.media.coherent):
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


def _averaged(v: Mapping[str, Array]) -> bool:
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
    if both.ellipse is not None and _averaged(v):
        intensity = both.R_s + both.R_p
        both = both._replace(ellipse=tuple(intensity * x for x in both.ellipse))

    def mean(x: Array) -> Array:
        return x[0] if x.shape[0] == 1 else (weights * x).sum(0)

    return jax.tree.map(mean, both)


def by_partial_derivatives(f: Callable, args: Any, directions: int) -> Any:
    """Return ``f(*args)``, f elementwise, for derivatives in this number of directions.

    If fewer arguments vary than there are directions, a derivative is a sum over partial
    derivatives, which are formed once, instead of evaluating f along each direction. (A film with
    four oscillators, 14 directions, 3 arguments, 491 wavelengths: 45 ms instead of 119.)
    """

    def is_zero(x: Any) -> bool:
        return isinstance(x, SymbolicZero)

    def derivatives(primals: Any, tangents: Any) -> tuple[Any, Any]:
        flat, tree = jax.tree.flatten(primals)
        along = jax.tree.leaves(tangents, is_leaf=is_zero)
        moving = [i for i, t in enumerate(along) if not is_zero(t)]

        def of_moving(*some: Any) -> Any:
            whole = list(flat)
            for i, x in zip(moving, some, strict=True):
                whole[i] = x
            return f(*jax.tree.unflatten(tree, whole))

        at, steps = [flat[i] for i in moving], [along[i] for i in moving]
        if len(moving) >= directions:
            return jax.jvp(of_moving, at, steps)
        out, slope = jax.linearize(of_moving, *at)
        total = jax.tree.map(jnp.zeros_like, out)
        for i, step in enumerate(steps):
            partial = slope(*(jnp.full_like(x, float(j == i)) for j, x in enumerate(at)))
            total = jax.tree.map(lambda t, d, step=step: t + d * step, total, partial)
        return out, total

    g = jax.custom_jvp(f)
    g.defjvp(derivatives, symbolic_zeros=True)
    return g(*args)
