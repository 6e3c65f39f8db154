"""Numbers with their errors, intervals and units as text, with as many digits as are known."""

from __future__ import annotations

import math

# A residual below this is the rounding of float64 in a sum of a hundred data.
_ROUNDING = 1e-14
# A 95 % interval contradicts the standard error if an end differs from value +- 1.96 sigma by more
# than this share of half its width.
_CONTRADICTS = 0.25


def number(value: float, digits: int = 4) -> str:
    """Return ``value`` with that many significant digits, trailing zeros kept; "-" for NaN."""
    if math.isnan(value):
        return "-"
    text = f"{value:#.{digits}g}"
    return text.removesuffix(".")


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
    if math.isinf(low) and math.isinf(high):
        return "any value"
    if math.isinf(low):
        return f"below {number(high)}"
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
    off = max(abs(value - expected - low), abs(value + expected - high))
    return off <= _CONTRADICTS * half


def with_unit(text: str, unit: str) -> str:
    """Return ``text`` with the unit behind it, if there is one."""
    return f"{text} {unit}" if unit and text else text


def to_its_interval(value: float, low: float, high: float) -> str:
    """Return ``value`` to the third digit of the distance to the nearer end of its interval."""
    away = [abs(end - value) for end in (low, high) if math.isfinite(end) and end != value]
    digits = 3 + math.floor(math.log10(abs(value) / min(away))) if value and away else 4
    digits = min(max(digits, 2), 15)
    return f"{value:.{digits - 1}e}" if 0.0 < abs(value) < 1e-3 else number(value, digits)
