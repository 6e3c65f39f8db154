"""eta and k of the media of a sample, of mixtures and of the slices of a graded layer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array

from fitting.optics.spec import Spec
from fitting.samples.known_media import (
    ABOVE,
    BELOW,
    RULES,
    UNIAXIAL,
    MaterialFile,
    Mixture,
    known_medium,
)

Pair = tuple[Array, Array]  # eta and k


def _index_of(which: Any, own: Mapping[str, Array], wavelength_um: Array, lanes: int) -> Pair:
    """Return eta and k, (M, L), of a medium without mixture; own: its parameters by bare names."""
    if isinstance(which, complex):
        shape = (wavelength_um.shape[0], lanes)
        return jnp.full(shape, which.real), jnp.full(shape, which.imag)
    if isinstance(which, str | MaterialFile):
        known = known_medium(which).model.index(wavelength_um)
        shape = (wavelength_um.shape[0], lanes)
        return jnp.broadcast_to(known.eta, shape), jnp.broadcast_to(known.k, shape)
    shared = wavelength_um.shape[-1] == 1
    at = wavelength_um[:, 0] if shared else wavelength_um
    index = jax.vmap(which.index, in_axes=(0, None if shared else -1), out_axes=-1)(own, at)
    return jnp.where(index.eta > 0.0, index.eta, jnp.nan), index.k


def _mixed(mixture: Mixture, parts: list[Pair], fractions: list[Array]) -> Pair:
    """Return eta and k, (M, L), of a mixture."""
    eta, k = (jnp.stack(part) for part in zip(*parts, strict=True))
    shape = eta.shape[1:]
    shares = jnp.stack([jnp.broadcast_to(f, shape) for f in fractions])
    if len(fractions) > 1:
        # The shares exceed 1: NaN, so that the solver refuses a step to it.
        shares = jnp.where(shares.sum(0) <= 1.0 + 1e-9, shares, jnp.nan)
    grains = (mixture.depolarization,) if mixture.rule == "bruggeman" else ()
    return tuple(RULES[mixture.rule](eta, k, shares, *grains))  # type: ignore


def _lanes(v: Mapping[str, Array]) -> int:
    """Return the number of lanes; 1 for a sample without parameters."""
    some = jax.tree.leaves(dict(v))
    return some[0].shape[-1] if some else 1


def _own(spec: Spec, medium: int, v: Mapping[str, Array]) -> dict[str, Array]:
    """Return the parameters of a medium by their bare names."""
    head = f"{spec.media.places[medium]}."
    return {name.removeprefix(head): x for name, x in v.items() if name.startswith(head)}


def medium_index(
    spec: Spec, medium: int, v: Mapping[str, Array], wavelength_um: Any, eta_i: Any = 1.0
) -> Pair:
    """Return eta and k, (M, L), of a medium at wavelengths (M, 1) or (M, L).

    NaN where eta is not positive: the cost is then NaN, and the solver refuses a step to where a
    formula has no meaning. For a layer in steps it is the index in its middle, for a uniaxial one
    the ordinary index. eta_i: index of the first medium, for a layer that is mixed with it.
    """
    wavelength_um = jnp.asarray(wavelength_um)
    which, own = spec.media.index[medium], _own(spec, medium, v)
    if not isinstance(which, Mixture):
        return _index_of(which, own, wavelength_um, _lanes(v))
    if which.rule == UNIAXIAL:
        return _parts(spec, medium, v, wavelength_um, eta_i)[0]
    fractions = [own[name] for name in which.fractions] or [jnp.full((), 0.5)]
    return _mixed(which, _parts(spec, medium, v, wavelength_um, eta_i), fractions)


def _parts(
    spec: Spec, medium: int, v: Mapping[str, Array], wavelength_um: Array, eta_i: Any
) -> list[Pair]:
    """Return eta and k of the parts of a mixture."""
    which = spec.media.index[medium]
    assert isinstance(which, Mixture)
    lanes, own, out = _lanes(v), _own(spec, medium, v), []
    for part in which.parts:
        if part == ABOVE and medium == 0:
            shape = (wavelength_um.shape[0], lanes)
            out.append((jnp.broadcast_to(jnp.asarray(eta_i), shape), jnp.zeros(shape)))
        elif part in (ABOVE, BELOW):
            beside = medium + (1 if part == BELOW else -1)
            out.append(medium_index(spec, beside, v, wavelength_um, eta_i))
        else:
            out.append(_index_of(part, own, wavelength_um, lanes))
    return out


# Slices of a film whose index changes with depth.
_SLICES = 12


def slices_of(
    spec: Spec, medium: int, v: Mapping[str, Array], at: Array, eta_i: Any
) -> list[tuple[Array, ...]]:
    """Return eta and k of a medium, or of the slices of equal thickness that stand for a layer.

    A uniaxial medium has its extraordinary eta and k behind them.
    """
    which = spec.media.index[medium]
    if isinstance(which, Mixture) and which.rule == UNIAXIAL:
        (eta, k), *others = _parts(spec, medium, v, at, eta_i)
        if which.shares:
            along = eta + v[f"{spec.media.places[medium]}.birefringence"]
            others = [(jnp.where(along > 0.0, along, jnp.nan), k)]
        return [(eta, k, *others[0])]
    if isinstance(which, Mixture) and which.steps:
        parts = [
            (jnp.stack([n] * which.steps), jnp.stack([k] * which.steps))
            for n, k in _parts(spec, medium, v, at, eta_i)
        ]
        # All steps at once: a formula for each of eight takes five seconds more to compile.
        shares = ((jnp.arange(which.steps) + 0.5) / which.steps)[:, None, None]
        eta, k = _mixed(which, parts, [shares])
        return [(eta[j], k[j]) for j in range(which.steps)]
    eta, k = medium_index(spec, medium, v, at, eta_i)
    if medium < len(spec.media.graded) and spec.media.graded[medium]:
        grade = v[f"{spec.media.places[medium]}.grade"]
        depths = (jnp.arange(_SLICES) + 0.5) / _SLICES - 0.5
        return [(eta * (1.0 + grade * depth), k) for depth in depths]
    return [(eta, k)]
