"""What a compiled program depends on: media, channels, names of parameters; and where data lie."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from fitting.data.quantities import POWERS
from fitting.samples.dispersion import Model
from fitting.samples.known_media import Known, Mixture
from fitting.samples.parameters import to_parameter, value_and_slope

NCS = "NCS"
# Number of wavelengths in a slit and of angles in a beam, unless more are needed; see `instrument`.
SLIT, BEAM = 11, 7


class Points(NamedTuple):
    """Where the data lie, M rows; the last axis is 1, or L where every lane has points of its own.

    angle_deg, wavelength_um, s_share: (M, 1) or (M, L); s_share is the part of s in R and T.
    file: (M,) number of the file of each row.
    distinct_um, place: where wavelengths repeat (angles, repeated rows), each of them once, (U, 1),
        and (M,) which of them belongs to each row; else None. The index is evaluated there: with
        two oscillators a fit at 3 angles takes half, one at 7 angles a third of the time.
    folded: (M, 1), at which of them the sign of S is unknown (Delta from 0 to 180); None: at none.
    """

    angle_deg: Any
    wavelength_um: Any
    s_share: Any
    file: Any
    distinct_um: Any = None
    place: Any = None
    folded: Any = None


class Media(NamedTuple):
    """What a compiled program must know of a sample: its media after the first, and no number.

    index: a `Model`, a `Mixture`, the name of a material or its file. places: their names.
    coherent: of each layer. closed: whether the last medium is the first one again. graded: of each
    layer, whether its index changes with depth. normal: whether light comes along the normal and
    only powers are asked for. outside: the material or file of the first medium, which a slit sees
    at its own wavelengths; None of a number.
    """

    index: tuple[Model | Mixture | Known, ...]
    places: tuple[str, ...]
    coherent: tuple[bool, ...] = ()
    closed: bool = False
    graded: tuple[bool, ...] = ()
    normal: bool = False
    outside: Known | None = None

    @property
    def bare(self) -> bool:
        """Whether there is one boundary and no layer."""
        return not self.coherent


class Spec(NamedTuple):
    """Everything about a fit that a compiled program depends on; hashable.

    channels: the quantities that are fitted, with `NCS` for psi and Delta, the last one. moving:
    names of the unknowns, in the order of y; coordinates: theirs. held: names of the constants.
    tied: (name, factor, of which). curves: for each channel the curve of every file, the number in
    ``scale_0``, ``background_0``. places: at how many a slit and a beam are averaged
    (`instrument.with_places`).
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
    places: tuple[int, int] = (SLIT, BEAM)

    @property
    def only_powers(self) -> bool:
        """Whether neither psi nor Delta is asked for."""
        return set(self.channels) <= set(POWERS)

    def values(self, y: Array, held: Array) -> dict[str, Array]:
        """Return every parameter, (L,), at the unknowns y (p, L) and constants (h,)."""
        lanes = y.shape[1:]
        out = dict(zip(self.moving, to_parameter(self.coordinates, y), strict=True))
        held_at = (jnp.broadcast_to(value, lanes) for value in held)
        out |= dict(zip(self.held, held_at, strict=True))
        return out | {name: factor * out[of] for name, factor, of in self.tied}

    def numbers(self, y: np.ndarray, held: np.ndarray) -> dict[str, Any]:
        """Return every parameter, by its internal name, at unknowns y (p, ...), constants (h,)."""
        pairs = zip(self.moving, self.coordinates, y, strict=True)
        out = {name: value_and_slope(kind, x)[0] for name, kind, x in pairs}
        out |= dict(zip(self.held, held.tolist(), strict=True))
        return out | {name: factor * out[of] for name, factor, of in self.tied}
