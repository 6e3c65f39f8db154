"""The inputs of the optics of a sample: indices, thicknesses, instrument; their derivatives."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from fitting.optics.observe import medium_index
from fitting.optics.spec import Points, Spec
from fitting.samples.dispersion import SPLINE
from fitting.samples.known_media import Mixture
from fresnel_jax.layers import FEW_LAYERS


class Core(NamedTuple):
    """The structure on which the optics depend, without numbers; hashable.

    spec: without model and unknowns. indices: of which media eta and k move. moving, held: names of
    thicknesses and of instrument parameters.
    """

    spec: Spec
    indices: tuple[int, ...]
    moving: tuple[str, ...]
    held: tuple[str, ...]


def has_parts(spec: Any) -> bool:
    """Whether optics and model of a fit run in separate programs: few layers, one file, no spline.

    A spline depends on each of its dozens of unknowns at every wavelength: writing all these
    derivatives between two programs takes four times as long as one program.
    """
    if not isinstance(spec, Spec) or spec.priors:
        return False
    index = spec.media.index
    simple = not any(isinstance(m, Mixture) or getattr(m, "name", "") == SPLINE for m in index)
    simple &= not any(spec.media.graded) and all(len(c) == 1 for c in spec.curves)
    apart = {"divergence", "bandwidth", "wavelength_offset"}
    simple &= not apart & {*spec.moving, *spec.held}
    return simple and len(spec.media.coherent) <= FEW_LAYERS


def along_the_normal(spec: Spec) -> Spec:
    """Return the spec of a fit whose light comes along the normal: what s shows is that of both."""
    tilted = {"angle_offset", "divergence"} & {*spec.moving, *spec.held}
    normal = spec.only_powers and not tilted
    return spec._replace(media=spec.media._replace(normal=normal))


def spec_at(spec: Spec, angle_deg: np.ndarray) -> Spec:
    """Return the spec of a fit at these angles: that along the normal, if all of them are 0."""
    return spec if np.any(angle_deg) else along_the_normal(spec)


@functools.lru_cache(maxsize=256)
def core_of(spec: Spec, normal: bool) -> Core:
    """Return what the optics of a fit depend on; normal: whether light comes along the normal."""
    names = (*spec.moving, *(name for name, _, _ in spec.tied))
    of_index = tuple(
        i for i, place in enumerate(spec.media.places)
        if any(n.startswith(f"{place}.") and ".thickness_" not in n for n in names)
    )  # fmt: skip
    moving, held = (
        tuple(n for n in some if ".thickness_" in n or "." not in n) for some in (names, spec.held)
    )
    media = along_the_normal(spec).media if normal else spec.media
    known = media._replace(index=("",) * len(media.index))  # type: ignore
    core = spec._replace(
        media=known, moving=(), coordinates=(), held=(), tied=(), shared=False
    )  # fmt: skip
    return Core(core, of_index, moving, held)


def _index_and_slopes(
    spec: Spec, medium: int, v: Mapping[str, Array], at: Array
) -> tuple[tuple[Array, Array], tuple[dict[str, Array], dict[str, Array]]]:
    """Return eta and k (M, C) of a medium, and the derivatives of each by all its parameters.

    v: parameters (C,); at: wavelengths (M, C). Backwards from two numbers each derivative takes a
    part of one term, whatever the number of parameters; forwards they take up to six times as long.
    Every point is a lane with parameters of its own, so that one backward pass serves all of them:
    a pass for each point takes half as long again, and twice as long to compile.
    """
    head = f"{spec.media.places[medium]}."
    own = {n: x for n, x in v.items() if n.startswith(head) and ".thickness_" not in n}
    of_points = {n: jnp.broadcast_to(x, at.shape).reshape(-1) for n, x in own.items()}

    def index(own: Mapping[str, Array]) -> tuple[Array, Array]:
        return medium_index(spec, medium, own, at.reshape(1, -1))

    (eta, k), back = jax.vjp(index, of_points)
    one, none = jnp.ones_like(eta), jnp.zeros_like(eta)
    slopes = [
        {n: slope.reshape(at.shape) for n, slope in back(along)[0].items()}
        for along in ((one, none), (none, one))
    ]
    return (eta.reshape(at.shape), k.reshape(at.shape)), (slopes[0], slopes[1])


def quantities(
    trial: Array, slot: Array, held: Array, points: Points, *, spec: Spec, core: Core
) -> tuple[list[Array], list[Array], list[Array]]:
    """Return what moves with the unknowns, its derivatives, (P, M or 1, C), and what stays.

    What moves and what stays are flat, (1, M C) each.
    trial: (P, S); slot: (C,), the one of each column; points: (M, C).
    """
    p, shape = len(spec.moving), points.angle_deg.shape
    y = trial.at[:p, slot].get(mode="clip")
    none = [jnp.zeros((1, shape[1]))] * (len(trial) - p)
    # Each parameter moves with one unknown.
    v, rate = jax.jvp(lambda z: spec.values(z, held), (y,), (jnp.ones_like(y),))
    row = {name: j for j, name in enumerate(spec.moving)}
    row |= {name: row[of] for name, _, of in spec.tied if of in row}

    def column(slopes: Mapping[str, Array]) -> list[Array]:
        """Return the derivatives by the unknowns of what has these by parameters."""
        out: list[Array] = [jnp.zeros((1, shape[1]))] * p
        for name, slope in slopes.items():
            if name in row:
                out[row[name]] = out[row[name]] + slope.reshape(-1, shape[1]) * rate[name]
        return out

    moving, columns = [], []
    for i in core.indices:
        index, slopes = _index_and_slopes(spec, i, v, points.wavelength_um)
        moving += index
        columns += map(column, slopes)
    for name in core.moving:
        moving.append(v[name][None])
        columns.append(column({name: jnp.ones(shape[1])}))
    columns = [jnp.stack(jnp.broadcast_arrays(*each, *none)) for each in columns]
    fixed = [
        x for i in range(len(spec.media.index)) if i not in core.indices
        for x in medium_index(spec, i, v, points.wavelength_um)
    ]  # fmt: skip
    fixed += [v[name] for name in core.held]
    flat = [[jnp.broadcast_to(x, shape).reshape(1, -1) for x in some] for some in (moving, fixed)]
    return flat[0], columns, flat[1]
