"""ModelFit: what the fit of a dispersion model found and how well it is known."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

import numpy as np

from fitting.measurement import Measurement
from fitting.plain_data import plain

CONVERGED, UNDETERMINED, NOT_CONVERGED = "converged", "undetermined", "not converged"


class IndexBand(NamedTuple):
    """eta and k over wavelength with one standard error each, all (W,)."""

    wavelength_um: np.ndarray
    eta: np.ndarray
    sigma_eta: np.ndarray
    k: np.ndarray
    sigma_k: np.ndarray


@dataclass(frozen=True, eq=False)
class ModelFit:
    """A fitted dispersion model. Arrays are over the P free parameters, in the order of `names`.

    model, structure, loss: as fitted, the model with its number of terms. eta_i: the medium that
    the light comes from.
    names, units: of the free parameters: the model's, the structure's, the nuisances.
    values, sigmas: (P,); a sigma is NaN where the data give none (undetermined, or at a bound).
        Beside a parameter at a bound the sigmas of the others, covariance and bands are those for
        that value of it; the intervals of the others are not.
    covariance, correlation: (P, P), NaN as the sigmas are.
    intervals: (P, 2), 95 % intervals; NaN where there is none, infinite where no end was found.
    interval_kinds: of each: "quadratic" (value +- t sigma; of k where only k^2 is seen, from
        k^2 +- t sigma(k^2)); "profile" (of the likelihood itself, all other parameters free within
        their ranges, those on a bound too); "none".
    at_bound: "", "low" or "high" for each: the best value lies on that end of its range.
    upper_limits: (P,), of what is at 0 or compatible with it and cannot be below: the upper end of
        its 95 % interval; NaN elsewhere.
    fixed: name -> value of what was held.
    chi2, chi2_reduced: sum of (residual / sigma)^2 of the data, and that by dof; NaN without stated
        errors, the second also without a degree of freedom.
    cost: what was minimised: loss of the weighted residuals, and priors.
    noise: what a robust loss or a prior took as the noise, in units of the stated errors (of R
        where there are none); 1 otherwise.
    dof: data and priors minus free parameters, at least 0. n_data: a psi and a Delta are two.
    rms: root mean square of the residuals, unweighted; of psi and Delta those of N, C, S.
    rms_of: the same by quantity.
    bic, aicc: information criteria, -2 log(likelihood) and a term for the parameters. With scaled
        errors the likelihood is that of one unknown noise; with a robust loss it is robust, too
        (see `criteria`). To compare models of the same data.
    sigma_kind: "absolute", or "scaled" by the scatter of the residuals; with a robust loss both by
        Huber's estimate from them (see `uncertainty`), "absolute" at the stated noise.
    status: "converged"; "undetermined" (the fit is at its best, but the data do not see some
        combination of the parameters, whose sigmas are NaN); "not converged".
    warnings, notes: sentences.
    starts, reached: how many starts there were, and how many of them ended in the best minimum.
    others: further minima that fit as well: {"values", "sigmas", "intervals", "interval_kinds" (by
        name, as if that minimum were the best one), "delta_chi2", "reached"}.
    iterations: evaluations of residuals and derivatives of the winning start.
    measurement: what was fitted, all files joined. curve: (N,) which quantity of which file each
        datum belongs to, an index of curve_names.
    """

    model: str
    structure: str
    loss: str
    eta_i: float
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: np.ndarray
    sigmas: np.ndarray
    covariance: np.ndarray
    correlation: np.ndarray
    intervals: np.ndarray
    interval_kinds: tuple[str, ...]
    at_bound: tuple[str, ...]
    upper_limits: np.ndarray
    fixed: dict[str, float]
    chi2: float
    chi2_reduced: float
    cost: float
    noise: float
    dof: int
    n_data: int
    rms: float
    rms_of: dict[str, float]
    bic: float
    aicc: float
    sigma_kind: str
    status: str
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    starts: int
    reached: int
    others: tuple[dict[str, Any], ...]
    iterations: int
    measurement: Measurement = field(repr=False)
    curve: np.ndarray = field(repr=False)
    curve_names: tuple[str, ...] = field(repr=False)
    curves_from: Any = field(repr=False)
    """What `fitted` and `index` evaluate (`model_curves.Evaluated`)."""

    @property
    def parameters(self) -> dict[str, float]:
        """Name -> value of all parameters, free and held."""
        return dict(zip(self.names, self.values.tolist(), strict=True)) | self.fixed

    def value_of(self, name: str) -> float:
        """Return the value of a parameter; KeyError for a name that there is not."""
        return self.parameters[name]

    def sigma_of(self, name: str) -> float:
        """Return the standard error of a parameter, 0 for one that was held."""
        if name in self.fixed:
            return 0.0
        if name not in self.names:
            raise KeyError(name)
        return float(self.sigmas[self.names.index(name)])

    def interval_of(self, name: str) -> tuple[float, float]:
        """Return the 95 % interval of a parameter; of one that was held its value, twice."""
        if name in self.fixed:
            return self.fixed[name], self.fixed[name]
        if name not in self.names:
            raise KeyError(name)
        low, high = self.intervals[self.names.index(name)].tolist()
        return low, high

    def fitted(self, measurement: Measurement | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Return the model at every datum, and the standard error of that, (N,) each.

        measurement: None for what was fitted; or points of one's own, in the units of a
        Measurement. Their scale and background are those of the first fitted curve of the quantity.
        psi and Delta are in degrees, Delta from 0 to 360.
        """
        from fitting.evaluation import fitted

        return fitted(self.curves_from, measurement)

    def index(self, wavelength_um: Any) -> IndexBand:
        """Return eta and k, each with a standard error, at wavelengths in micrometres."""
        from fitting.evaluation import index_band

        return IndexBand(*index_band(self.curves_from, wavelength_um))

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for ``json.dumps``: the field names, NaN as None, arrays as lists."""
        left_out = ("measurement", "curve", "curves_from")
        return {
            f.name: plain(getattr(self, f.name)) for f in fields(self) if f.name not in left_out
        }
