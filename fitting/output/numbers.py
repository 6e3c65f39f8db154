"""Numbers as text: with errors, intervals and units, to as many digits as are known."""

from __future__ import annotations

import math

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

# A residual below this is the rounding of float64 in a sum of a hundred data.
_ROUNDING = 1e-14
# A 95 % interval contradicts the standard error if an end differs from value +- 1.96 sigma by more
# than this share of half its width.
_CONTRADICTS = 0.25
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


def number(value: float, digits: int = 4) -> str:
    """Return ``value`` with that many significant digits, trailing zeros kept; "-" for NaN."""
    if math.isnan(value):
        return "-"
    text = f"{value:#.{digits}g}"
    # 6400 is shorter than 6.40e+03, and easier to read
    return f"{float(text):.0f}" if "e+0" in text and abs(value) < 1e6 else text.removesuffix(".")


def size_text(value: float, digits: int = 3) -> str:
    """Return the size of a residual, ``0.0298``; 0 if it is only rounding of the arithmetic."""
    return "0" if abs(value) < _ROUNDING else number(value, digits)


def _two(first: float, mark: str, second: float, known: float, most: int) -> str:
    """Return two numbers, both to the second digit of ``known``, with at most so many decimals.

    Far from 1 there is one power of ten for both, that of the larger.
    """
    exponent = math.floor(math.log10(float(f"{known:.1e}")))
    decimals, largest, end = 1 - exponent, max(abs(first), abs(second)), ""
    if not 0 <= decimals <= most or largest < 1e-3:
        power = math.floor(math.log10(largest))
        decimals, scale, end = max(power - exponent + 1, 1), 10.0**power, f")e{power:+03d}"
        first, second = first / scale, second / scale
    text = mark.join(f"{x:.{decimals}f}" if x else "0" for x in (first, second))
    return f"({text}{end}" if end else text


def with_error(value: float, sigma: float) -> str:
    """Return ``0.344 +- 0.031``: the error with two digits, the value to the same place.

    Without an error (NaN) six digits of the value; an error below 1e-12 of the value is shown by
    its magnitude, since the value has no more digits to show.
    """
    if math.isnan(value):
        return "-"
    if not (math.isfinite(sigma) and sigma > 0.0):
        return f"{value:.6g}"
    if sigma < 1e-12 * abs(value):
        return f"{value:.13g} +- {sigma:.0e}"
    return _two(value, " +- ", sigma, sigma, 9)


def interval_text(low: float, high: float) -> str:
    """Return ``1.4959 to 1.5030``; "" if there is no interval or if its ends are equal.

    With an infinite end it is "above 1.2", "below 3" or "any value"; else both ends are given to
    the second digit of half the distance between them.
    """
    if math.isnan(low) or math.isnan(high) or low == high:
        return ""
    if math.isinf(low):
        return "any value" if math.isinf(high) else f"below {number(high)}"
    if math.isinf(high):
        return f"above {number(low)}"
    if high - low < 1e-13 * max(abs(low), abs(high)):
        return f"{float(low)!r} to {float(high)!r}"
    if 0.0 < 3.0 * low < high or 0.0 < 3.0 * -high < -low:
        # The end that lies far nearer to 0 needs more digits than the width of the interval has.
        return f"{number(low, 3)} to {number(high, 3)}"
    return _two(low, " to ", high, 0.5 * (high - low), 15)


def agree(value: float, sigma: float, low: float, high: float, student: float) -> bool:
    """Whether ``value +- sigma`` agrees with the 95 % interval from ``low`` to ``high``.

    student: half the width of a symmetric interval in standard errors; NaN if that is not known,
    and then any symmetric interval agrees. Where they disagree, only the interval is shown.
    """
    if math.isnan(low) or math.isnan(high) or not sigma > 0.0:
        return True
    if math.isinf(low) or math.isinf(high):
        return False
    half = 0.5 * (high - low)
    expected = half if math.isnan(student) else student * sigma
    return max(abs(value - expected - low), abs(value + expected - high)) <= _CONTRADICTS * half


def _to_its_interval(value: float, low: float, high: float) -> str:
    """Return ``value`` to the third digit of the distance to the nearer end of its interval.

    An end nearer than a hundredth of the other's distance is the value itself, as at a bound.
    """
    away = [abs(end - value) for end in (low, high) if math.isfinite(end) and end != value]
    nearer = max(min(away), 0.01 * max(away)) if away else 0.0
    digits = 3 + math.floor(math.log10(abs(value) / nearer)) if value and away else 4
    digits = min(max(digits, 2), 15)
    return f"{value:.{digits - 1}e}" if 0.0 < abs(value) < 1e-3 else number(value, digits)


def value_text(e: Estimate, student: float = math.nan) -> str:
    """Return the value of one fit with its standard error and unit.

    Without the standard error where the 95 % interval says otherwise; with the upper limit in
    brackets where the value is compatible with 0. student: as of `agree`.
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
        text = _to_its_interval(value, low, high)
    return f"{text} {e.unit}".rstrip()


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


def k_text(k: float, sigma: float, limited: bool) -> str:
    """Return k of a dispersion model with its error, or that it is compatible with 0.

    limited: whether a parameter of the material is only known to be below a limit. No error is
    shown that reaches 0, since k cannot be negative.
    """
    if 0.0 < k < _LEAST_K:
        return f"below {_LEAST_K:.0e}"
    if 0.0 < k < (_UNSEEN if limited else 1.96) * sigma:
        return f"{number(k, 2)} (compatible with 0)"
    return with_error(k, sigma) if k else "0"
