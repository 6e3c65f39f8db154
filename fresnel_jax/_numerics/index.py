"""The complex index of a medium as a pair of real arrays."""

from __future__ import annotations

from typing import NamedTuple

from jaxtyping import Array, ArrayLike, Complex

from .results import exported


@exported
class Index(NamedTuple):
    """The complex index eta + ik as two real arrays of one shape; k >= 0 absorbs.

    Every argument that is an index takes it, as it takes a real and a complex one:
    `reflectance(cos, gold(0.55))`.
    """

    eta: Array
    k: Array

    @property
    def complex(self) -> Complex[Array, "..."]:
        """eta + ik as one complex array."""
        return self.eta + 1j * self.k


IndexLike = ArrayLike | Index
