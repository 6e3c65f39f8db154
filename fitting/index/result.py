"""FitResult: what a fit found and how well it is known."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fitting.index import identifiability
from fitting.plain_data import plain

CONVERGED = "converged"
AT_ZERO = "converged at k = 0"
UNDETERMINED = "undetermined"
NOT_CONVERGED = "not converged"
NO_DATA = "no data"


class FitResult(NamedTuple):
    """One or many fitted curves. One: Python scalars. Many: NumPy arrays of the batch shape S.

    eta, k: absolute index eta + i k of the medium that the light enters.
    sigma_eta, sigma_k: standard errors; NaN where the data give none.
    covariance: S + (2, 2), of (eta, k); NaN as the sigmas are.
    correlation: of eta and k; NaN where either sigma is.
    chi2, chi2_reduced: sum of (residual / sigma)^2, and that by dof; NaN without stated errors, the
        second also without a degree of freedom.
    dof: n_data - 2, at least 0. n_data: the number of data.
    rms: root mean square of the residuals, unweighted, in units of R.
    sigma_kind: "absolute", or "scaled" by the scatter of the residuals; for the whole result.
    k_upper_limit: the upper end of the 95 % interval of k, where k is compatible with 0 (k^2 less
        than three standard errors of k^2; in total reflection k itself), NaN elsewhere.
    status: "converged"; "converged at k = 0" (the best k >= 0 is 0; sigma_eta covers the
        k that the data allow);
        "undetermined" (the fit is at its best, but only one combination of eta and k is known; the
        values are those of the best fit, within the intervals that say what else fits; NaN where a
        perfect mirror fits as well); "not converged"; "no data".
    iterations: evaluations of residuals and derivatives, of all starts together.
    wavelength_um: micrometres; NaN where unknown.
    flags: bits of `identifiability`, behind `warnings`.
    notes: sentences that hold for all curves.
    information: S + (2, 2), Fisher information in (eta, u = k^2); regular at k = 0, and singular
        where one combination is unknown, where the covariance does not exist.
    alternative_eta, alternative_k, alternative_delta_chi2: a second solution whose chi2 (in units
        of its expected scatter) is less than 6 higher; NaN where there is none.
    eta_i: index of the medium that the light comes from.
    eta_interval, k_interval: S + (2,), 95 % intervals; NaN where there is none.
    residual_correlation: of residuals next to each other along the angle, where that says that they
        are no noise (see `fitting.pattern`); NaN elsewhere, and of `fit_many`.
    least_reflectance: the R at normal incidence that a curve exceeds (95 %) which strong mirrors of
        any index fit alike; NaN elsewhere.
    neighbour_noise: standard deviation of the noise that neighbours in angle show, where the fit
        misses the data by more (see `fitting.misfit`); NaN elsewhere, and of `fit_many`.
    interval_kind: "quadratic": eta +- t sigma_eta, and k from k^2 +- t sigma(k^2) (in total
        reflection k +- t sigma), cut at 0; "profile": of the likelihood itself, for an undetermined
        index as well (the range that the data leave, with every k); "none".
    """

    eta: Any
    k: Any
    sigma_eta: Any
    sigma_k: Any
    covariance: np.ndarray
    correlation: Any
    chi2: Any
    chi2_reduced: Any
    dof: Any
    n_data: Any
    rms: Any
    sigma_kind: str
    k_upper_limit: Any
    status: Any
    iterations: Any
    wavelength_um: Any
    flags: Any
    notes: tuple[str, ...]
    information: np.ndarray
    alternative_eta: Any
    alternative_k: Any
    alternative_delta_chi2: Any
    eta_i: float
    eta_interval: np.ndarray
    k_interval: np.ndarray
    interval_kind: Any
    residual_correlation: Any
    least_reflectance: Any
    neighbour_noise: Any

    @property
    def shape(self) -> tuple[int, ...]:
        """The batch shape, () for one curve."""
        return np.shape(self.eta)

    @property
    def warnings(self) -> Any:
        """Sentences on what the data do not say: a tuple, or for a batch an array of tuples."""
        return self._each(lambda one: identifiability.sentences(one), self.flags != 0)

    @property
    def alternatives(self) -> Any:
        """Second solutions: a tuple of dicts, or for a batch an array of such tuples."""

        def of(one: FitResult) -> tuple[dict[str, float], ...]:
            if not np.isfinite(one.alternative_eta):
                return ()
            names = ("eta", "k", "delta_chi2")
            return ({name: getattr(one, f"alternative_{name}") for name in names},)

        return self._each(of, np.isfinite(self.alternative_eta))

    def _each(self, of: Any, some: Any) -> Any:
        if not self.shape:
            return of(self)
        out = np.empty(self.shape, dtype=object)
        for index in np.ndindex(self.shape):
            out[index] = of(self.at(index)) if some[index] else ()
        return out

    def at(self, index: int | tuple[int, ...]) -> FitResult:
        """Return the result of the one curve at ``index`` of a batch."""
        if not self.shape:
            raise IndexError("this result is of one curve; there is nothing to index")
        index = index if isinstance(index, tuple) else (index,)
        if len(index) != len(self.shape):
            raise IndexError(
                f"a batch of shape {self.shape} needs {len(self.shape)} indices; {len(index)} came"
            )
        picked = {
            name: value[index] for name, value in zip(self._fields, self, strict=True)
            if isinstance(value, np.ndarray)
        }  # fmt: skip
        return self._replace(**picked).plain()

    def plain(self) -> FitResult:
        """Return the result with Python scalars for arrays of shape ()."""
        scalars = {
            name: value.item() if np.ndim(value) == 0 else value
            for name, value in zip(self._fields, self, strict=True)
            if isinstance(value, np.ndarray | np.generic)
        }
        return self._replace(**scalars)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for ``json.dumps``: the field names, NaN as None, arrays as lists.

        Left out: flags and information. Added: warnings and alternatives.
        """
        named = {n: v for n, v in self._asdict().items() if n not in ("flags", "information")}
        named = {n: v for n, v in named.items() if not n.startswith("alternative_")}
        named["warnings"], named["alternatives"] = self.warnings, self.alternatives
        return {name: plain(value) for name, value in named.items()}
