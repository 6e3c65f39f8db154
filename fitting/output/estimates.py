"""One parameter as text: its value, its standard error, its 95 % interval, and what limits it."""

from __future__ import annotations

import math

import numpy as np

from fitting.outcomes.findings import is_outer
from fitting.output.numbers import (
    agree,
    interval_text,
    number,
    to_its_interval,
    with_error,
    with_unit,
)
from fitting.results.result import Fit
from fitting.results.result_parts import (
    AT_LOWER,
    AT_UPPER,
    FIXED,
    PROFILE,
    SHARED,
    TIED,
    UNDETERMINED,
    Estimate,
)
from fitting.uncertainty.limits import student_quantile

# A k that acts on the data by k^2 alone is compatible with 0 if it lies less than so many standard
# errors above 0: three standard errors of k^2 are six of k.
_UNSEEN = 6.0
# An absorption edge is a formula: far from it k may be 1e-90, of which no measurement tells.
_LEAST_K = 1e-12
_STATES = {
    AT_LOWER: "at its lower bound",
    AT_UPPER: "at its upper bound",
    FIXED: FIXED,
    TIED: TIED,
    UNDETERMINED: "one of many that fit equally well; see the warning",
}


def reach(fit: Fit) -> float:
    """Return half the width of a 95 % interval in standard errors: Student's t, or 1.96.

    NaN for a batch: its fits may share one estimate of the noise, whose degrees of freedom differ.
    """
    stated = fit.errors.taken == "stated"
    if fit.shape or not (stated or fit.dof):
        return math.nan
    return student_quantile(0 if stated else fit.dof)


def value_text(e: Estimate, student: float = math.nan) -> str:
    """Return the value with its standard error and unit.

    Without the standard error where the 95 % interval says otherwise; with the upper limit in
    brackets where the value is compatible with 0.
    """
    value, sigma, limit = float(e.value), float(e.sigma), float(e.upper_limit)
    low, high = (float(end) for end in e.interval)
    if e.status in (FIXED, TIED):
        text = f"{value:.8g}"
    elif math.isfinite(limit):
        text = f"{number(value, 2) if value else 0} (< {number(limit, 2)})"
    elif e.status in (AT_LOWER, AT_UPPER):
        text = f"{value:.6g}"
    elif agree(value, sigma, low, high, student if e.interval_kind == PROFILE else math.nan):
        text = with_error(value, sigma)
    else:
        text = to_its_interval(value, low, high)
    return with_unit(text, e.unit)


def interval_of(e: Estimate) -> str:
    """Return the 95 % interval and where it comes from; "" where there is none."""
    if e.status in (FIXED, TIED):
        return ""
    if math.isfinite(float(e.upper_limit)):
        # The interval is not repeated: its lower end is 0 or nearly 0.
        return "95 % upper limit in brackets"
    text = interval_text(*(float(end) for end in e.interval))
    return f"{text} (profile likelihood)" if text and e.interval_kind == PROFILE else text


def beside(e: Estimate) -> str:
    """Return all that stands beside a value: interval, bound, whether it is fixed."""
    state = _STATES.get(e.status, "")
    if e.status == SHARED:
        unseen = "" if math.isfinite(e.sigma) else ", not determined; see the warning"
        state = f"shared by all wavelengths{unseen}"
    elif math.isfinite(float(e.upper_limit)) and e.status != UNDETERMINED:
        state = ""
    return "; ".join(filter(None, (interval_of(e), state)))


def k_is_limited(fit: Fit) -> bool:
    """Whether a parameter of the material is only known to be below a limit."""
    return any(
        not is_outer(name) and np.isfinite(np.asarray(e.upper_limit)).any()
        for name, e in fit.parameters.items()
    )


def k_text(k: float, sigma: float, limited: bool) -> str:
    """Return k of a dispersion model with its error, or that it is compatible with 0.

    limited: see `k_is_limited`. No error is shown that reaches 0, since k cannot be negative.
    """
    if 0.0 < k < _LEAST_K:
        return f"below {_LEAST_K:.0e}"
    compatible = (_UNSEEN if limited else 1.96) * sigma
    if 0.0 < k < compatible:
        return f"{number(k, 2)} (compatible with 0)"
    return with_error(k, sigma) if k else "0"


def has_pseudo_index(fit: Fit) -> bool:
    """Whether eta and k are a pseudo-index, called <n> and <k>."""
    return any(note.code == "pseudo_index" for note in fit.notes)


def shown_name(fit: Fit, name: str) -> str:
    """Return the name under which a parameter is shown."""
    return {"eta": "<n>", "k": "<k>"}.get(name, name) if has_pseudo_index(fit) else name


def wave_text(fit: Fit, index: tuple[int, ...]) -> str:
    """Return what one fit of a batch is called: its wavelength, or its place."""
    waves = np.asarray(fit.wavelength_um)
    if by_wavelength(fit):
        return f"{waves[index]:.6g}"
    return ", ".join(str(i) for i in index)


def index_waves(fit: Fit) -> np.ndarray:
    """Return the known wavelengths, micrometres, at which `Fit.index` gives eta and k."""
    if fit.sample is None or fit.evaluator is None:
        return np.empty(0)
    waves = np.atleast_1d(np.asarray(fit.wavelength_um, float))
    return waves[np.isfinite(waves)]


def by_wavelength(fit: Fit) -> bool:
    """Whether the batch is one fit a wavelength."""
    waves = np.asarray(fit.wavelength_um)
    return fit.shape != () and waves.shape == fit.shape and bool(np.isfinite(waves).all())


def has_several_curves(fit: Fit) -> bool:
    """Whether the names of the curves say more than the quantities do: there are several files."""
    if fit.measurement is None or fit.curve is None:
        return False
    quantities = set(fit.measurement.quantity.tolist()) | {"NCS"}
    return not set(fit.curve_names) <= quantities
