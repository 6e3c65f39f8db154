"""PointFits: what the fits wavelength by wavelength found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from fitting.measurement import Measurement
from fitting.model.result import ModelFit
from fitting.plain_data import plain
from fitting.pseudo_index import is_pseudo

# What `to_dict` holds of every wavelength.
_EACH = (
    "wavelength_um", "eta", "sigma_eta", "k", "sigma_k", "correlation", "k_upper_limit",
    "eta_interval", "k_interval", "interval_kind", "chi2", "chi2_reduced", "dof", "n_data", "rms",
    "status", "warnings", "others",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class PointFits:
    """The fits of all wavelengths, in rising order; arrays are over the W wavelengths.

    eta_i: index of the medium that the light comes from. wavelength_um: (W,), NaN for one that is
    not known. fits: a `ModelFit` (model "constant") each, with its warnings, covariance and second
    minima. measurement: all data. notes: sentences on all wavelengths together.
    """

    structure: str
    eta_i: float
    wavelength_um: np.ndarray
    fits: tuple[ModelFit, ...]
    measurement: Measurement
    notes: tuple[str, ...] = ()

    def _of(self, pick: Callable[[ModelFit], Any]) -> np.ndarray:
        return np.array([pick(f) for f in self.fits])

    @property
    def pseudo(self) -> bool:
        """Whether eta and k are a pseudo-index: from psi, or psi and Delta, of an interface."""
        return is_pseudo(self.structure, self.measurement)

    @property
    def curve_names(self) -> tuple[str, ...]:
        """The quantities that were measured."""
        return tuple(dict.fromkeys(self.measurement.quantity.tolist()))

    @property
    def curve(self) -> np.ndarray:
        """(N,) which of `curve_names` each datum is."""
        return np.array([self.curve_names.index(q) for q in self.measurement.quantity.tolist()])

    @property
    def eta(self) -> np.ndarray:
        """Real part of the index."""
        return self._of(lambda f: f.value_of("eta"))

    @property
    def k(self) -> np.ndarray:
        """Imaginary part of the index."""
        return self._of(lambda f: f.value_of("k"))

    @property
    def sigma_eta(self) -> np.ndarray:
        """Standard error of eta; NaN where the data give none."""
        return self._of(lambda f: f.sigma_of("eta"))

    @property
    def sigma_k(self) -> np.ndarray:
        """Standard error of k; NaN where the data give none."""
        return self._of(lambda f: f.sigma_of("k"))

    @property
    def correlation(self) -> np.ndarray:
        """Correlation of eta and k; NaN where the data give none."""
        return self._of(lambda f: f.correlation[f.names.index("eta"), f.names.index("k")])

    @property
    def k_upper_limit(self) -> np.ndarray:
        """95 % upper limit of k where it is compatible with 0, NaN elsewhere."""
        return self._of(lambda f: f.upper_limits[f.names.index("k")])

    @property
    def eta_interval(self) -> np.ndarray:
        """(W, 2) 95 % intervals of eta; NaN where there is none."""
        return self._of(lambda f: f.intervals[f.names.index("eta")])

    @property
    def k_interval(self) -> np.ndarray:
        """(W, 2) 95 % intervals of k; NaN where there is none."""
        return self._of(lambda f: f.intervals[f.names.index("k")])

    @property
    def interval_kind(self) -> np.ndarray:
        """How both were found, see `ModelFit.interval_kinds`: "profile" if one of them was so."""
        return self._of(lambda f: max(f.interval_kinds, key=lambda kind: kind == "profile"))

    @property
    def chi2(self) -> np.ndarray:
        """Sum of (residual / sigma)^2; NaN without stated errors."""
        return self._of(lambda f: f.chi2)

    @property
    def chi2_reduced(self) -> np.ndarray:
        """chi2 by dof; NaN without stated errors or degrees of freedom."""
        return self._of(lambda f: f.chi2_reduced)

    @property
    def dof(self) -> np.ndarray:
        """Data minus unknowns, at least 0."""
        return self._of(lambda f: f.dof)

    @property
    def n_data(self) -> np.ndarray:
        """How many data there are; psi and Delta are two."""
        return self._of(lambda f: f.n_data)

    @property
    def rms(self) -> np.ndarray:
        """Root mean square of the residuals at each wavelength; psi and Delta as N, C, S."""
        return self._of(lambda f: f.rms)

    @property
    def status(self) -> np.ndarray:
        """The `ModelFit.status` of each wavelength."""
        return self._of(lambda f: f.status)

    @property
    def warnings(self) -> list[tuple[str, ...]]:
        """The warnings of each wavelength."""
        return [f.warnings for f in self.fits]

    @property
    def others(self) -> list[tuple[dict[str, Any], ...]]:
        """Indices that fit as well, of each wavelength; see `ModelFit.others`."""
        return [f.others for f in self.fits]

    def fitted(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the model at every datum of the measurement and its standard error, (N,)."""
        out, sigma = np.empty(len(self.measurement)), np.empty(len(self.measurement))
        # NaN (no wavelength is known) counts as one value.
        _, which = np.unique(self.measurement.wavelength_um, return_inverse=True)
        for i, fit in enumerate(self.fits):
            out[which == i], sigma[which == i] = fit.fitted()
        return out, sigma

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for ``json.dumps``: lists over the wavelengths, NaN as None.

        Of one wavelength numbers, as in ``FitResult.to_dict``.
        """
        first = self.fits[0]
        out: dict[str, Any] = {
            "structure": self.structure, "pseudo_index": self.pseudo, "eta_i": self.eta_i,
            "fixed": first.fixed,
        }  # fmt: skip
        each = {name: plain(getattr(self, name)) for name in _EACH}
        if len(self.fits) == 1:
            each = {name: values[0] for name, values in each.items()}
        return out | each | {"sigma_kind": first.sigma_kind, "notes": list(self.notes)}
