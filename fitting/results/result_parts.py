"""The parts of a `Fit`: estimates of parameters, other minima, the errors that were used."""

from __future__ import annotations

import operator
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

CONVERGED, UNDETERMINED = "converged", "undetermined"
MISFIT = "misfit"  # converged, but the sample does not describe the data
DETERMINED = CONVERGED, MISFIT
NOT_CONVERGED, NO_DATA = "not converged", "no data"
REFUSED = "refused"  # one curve of a batch, whose data cannot be measurements
FITTED, AT_LOWER, AT_UPPER = "fitted", "at lower bound", "at upper bound"
FIXED, TIED = "fixed", "tied"
SHARED = "shared"  # by all wavelengths, each of which has an index of its own
QUADRATIC, PROFILE, NONE = "quadratic", "profile", "none"


@dataclass(frozen=True, eq=False, kw_only=True)
class Estimate:
    """One parameter: its value and how well it is known. Arrays have the batch shape S.

    name, unit: unit "" for a pure number.
    value: NaN where the data do not determine it at all.
    sigma: standard error; NaN where there is none (undetermined, at a bound), 0 if fixed.
    interval: S + (2,), 95 % interval; NaN where there is none, infinite where it is unlimited; for
        a fixed parameter its value twice.
    interval_kind: "quadratic" (value +- t sigma; for k, where the data depend on k^2, from
        k^2 +- t sigma(k^2)), "profile" (profile likelihood), or "none".
    upper_limit: upper end of the 95 % interval of a parameter that cannot be negative and is
        compatible with 0; NaN elsewhere.
    status: "fitted", "at lower bound" (k = 0, for one), "at upper bound", "undetermined", "fixed",
        "tied" (to another parameter), or "shared" (by all wavelengths of a batch).
    """

    name: str
    value: Any
    sigma: Any
    interval: np.ndarray
    interval_kind: Any
    unit: str = ""
    upper_limit: Any = np.nan
    status: Any = FITTED

    @property
    def free(self) -> bool:
        """Whether it was fitted: neither fixed nor tied."""
        return not (isinstance(self.status, str) and self.status in (FIXED, TIED, SHARED))

    def at(self, index: tuple[int, ...]) -> Estimate:
        """Return the estimate of one fit of a batch; a fixed parameter is the same for all."""
        return picked(self, index) if np.ndim(self.value) else self


@dataclass(frozen=True, eq=False, kw_only=True)
class Alternative:
    """Another minimum that fits nearly as well (chi2 higher by less than `alternative_chi2`).

    parameters: name -> `Estimate` of each free parameter, as if that minimum were the best one.
    delta_chi2: by how much its chi2 is higher, in units of the scatter; in a batch of shape S, NaN
        where there is none. reached: number of starts that ended there, NaN if not counted.
    """

    parameters: Mapping[str, Estimate]
    delta_chi2: Any
    reached: Any = np.nan

    def at(self, index: tuple[int, ...]) -> Alternative:
        """Return the alternative of one fit of a batch."""
        parameters = {name: e.at(index) for name, e in self.parameters.items()}
        return replace(picked(self, index), parameters=parameters)


class IndexBand(NamedTuple):
    """eta and k over wavelength with one standard error each, all (W,)."""

    wavelength_um: np.ndarray
    eta: np.ndarray
    sigma_eta: np.ndarray
    k: np.ndarray
    sigma_k: np.ndarray


class Prediction(NamedTuple):
    """Values that the fitted sample gives, and their standard errors: powers as fractions, psi and
    Delta (0 to 360) in degrees."""

    value: np.ndarray
    sigma: np.ndarray


class ErrorModel(NamedTuple):
    """The errors of the data that a fit used.

    taken: "stated" (as they are), "scaled" (stated errors times one factor; without stated errors
    the scatter), "floor" (stated errors and one common error, added in squares), "relative" (the
    same with an error in proportion to each R or T), "of each quantity" (without stated errors, the
    scatter of each R and T about the fit), or "equal" (that of all data; stated errors are not
    used). In a batch an array of shape S.
    factor: the factor on the standard errors of the parameters; 1 if "stated".
    added: the common error of "floor", in units of R, T and N, C, S; that of "relative" as a part
    of each fitted R or T; else 0. stated: whether every datum had an error. widened: the part of
    factor for autocorrelation, sqrt((1+rho)/(1-rho)).
    """

    taken: Any
    factor: Any
    added: Any = 0.0
    stated: bool = False
    widened: Any = 1.0


def item(value: Any, index: tuple[int, ...]) -> Any:
    """Return the part of ``value`` that belongs to one fit, if it is an array of a batch."""
    part = value[index] if isinstance(value, np.ndarray) and value.ndim else value
    return part.item() if isinstance(part, np.generic) else part


def place_of(index: Any, shape: tuple[int, ...]) -> tuple[int, ...]:
    """Return the place of one fit in a batch, counted from 0.

    Raises TypeError for other than whole numbers, IndexError for too many, few or large ones.
    """
    came = index if isinstance(index, tuple) else (index,)
    try:
        places = [operator.index(i) for i in came]
    except TypeError:
        raise TypeError(
            f"{index!r} came; one whole number for each axis of the batch was wanted. Several fits "
            "are [fit[i] for i in range(3)]."
        ) from None
    if len(places) != len(shape):
        raise IndexError(
            f"{len(places)} indices came; a batch of shape {shape} needs {len(shape)}."
            if shape
            else "this fit is one set of parameters and no batch; it takes no index."
        )
    for i, size in zip(places, shape, strict=True):
        if not -size <= i < size:
            raise IndexError(f"index {i} is out of range for a batch of shape {shape}")
    return tuple(i % size for i, size in zip(places, shape, strict=True))


def picked(record: Any, index: tuple[int, ...]) -> Any:
    """Return a dataclass with every array field reduced to one fit of the batch."""
    parts = {name: item(v, index) for name, v in vars(record).items() if name != "curve"}
    return replace(record, **parts)
