"""The spectrum that is fitted, as far as the parameters of dispersion models depend on it."""

from __future__ import annotations

from typing import NamedTuple

from fresnel_jax.dispersion import HC_EV_UM


class Spectrum(NamedTuple):
    """The properties of the data on which the ranges of starting values depend.

    shortest_um, longest_um: measured wavelengths; eta_i: index of the medium in front.
    even_in_k: whether the data depend on k^2 (powers of a bare interface), and not on k.
    step_ev: the least distance of two photon energies.
    """

    shortest_um: float
    longest_um: float
    eta_i: float = 1.0
    even_in_k: bool = True
    step_ev: float = 0.0

    @property
    def low_ev(self) -> float:
        """The least photon energy."""
        return HC_EV_UM / self.longest_um

    @property
    def high_ev(self) -> float:
        """The largest photon energy."""
        return HC_EV_UM / self.shortest_um

    @property
    def narrowest_ev(self) -> float:
        """The least width of a line that is looked for.

        One that is narrower than the distance of two data takes up the noise of one of them, at any
        place of the spectrum: minima by the dozen, and none that the data tell.
        """
        return min(max(1e-3 * self.low_ev, self.step_ev), 0.03 * self.low_ev)
