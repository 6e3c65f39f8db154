"""Numbers as text: as many digits as are known, and never two that contradict each other."""

import math

import numpy as np
import pytest

from fitting.output.export import plain
from fitting.output.numbers import (
    agree,
    beside,
    interval_text,
    k_text,
    size_text,
    value_text,
    with_error,
)
from fitting.process.visible import visible
from fitting.results.diagnostics import Warning
from fitting.results.result_parts import Estimate


@pytest.mark.parametrize(
    ("value", "sigma", "text"),
    [
        (0.34428, 0.02201, "0.344 +- 0.022"),
        (1.8203, 0.0867, "1.820 +- 0.087"),
        (1.5, 0.0996, "1.50 +- 0.10"),  # the error rounds up into the next decade
        (1.5, 0.0994, "1.500 +- 0.099"),
        (12.3, 4.5, "12.3 +- 4.5"),
        (123.4, 45.6, "123 +- 46"),
        (5e-8, 1.2e-8, "(5.0 +- 1.2)e-08"),
        (0.0012, 1e-5, "0.001200 +- 0.000010"),
        (0.999984387, 4.9e-8, "0.999984387 +- 0.000000049"),
        (1.86e-7, 4.7e-7, "(1.9 +- 4.7)e-07"),
        (5e-12, 1.2e-13, "(5.00 +- 0.12)e-12"),
        (1.0, math.nan, "1"),
        (1.2345678, math.nan, "1.23457"),
        (1.5, 1e-16, "1.5 +- 1e-16"),
        (math.nan, math.nan, "-"),
        (12345.0, 678.0, "(1.234 +- 0.068)e+04"),
    ],
)
def test_a_value_is_given_to_the_second_digit_of_its_error(value, sigma, text):
    assert with_error(value, sigma) == text


@pytest.mark.parametrize(
    ("low", "high", "text"),
    [
        (1.49592, 1.50303, "1.4959 to 1.5030"),
        (0.0, 0.00123, "0 to 0.00123"),
        (1.0, 1.0, ""),  # "1 to 1" says nothing
        (0.9999999999999998, 1.0000000000000002, "0.9999999999999998 to 1.0000000000000002"),
        (7.6e-5, 2.25e-4, "(0.76 to 2.25)e-04"),
        (1e-9, 3e-4, "1.00e-09 to 0.000300"),
        (-0.053, 0.0041, "-0.053 to 0.004"),
        (-math.inf, 2.0, "below 2.000"),
        (1.25, math.inf, "above 1.250"),
        (-math.inf, math.inf, "any value"),
        (math.nan, 1.0, ""),
        (123456.0, 123999.0, "(1.2346 to 1.2400)e+05"),
        (1.0 + 1e-12, 1.0 + 3e-12, "1.0000000000010 to 1.0000000000030"),
    ],
)
def test_an_interval_is_given_to_the_second_digit_of_its_half_width(low, high, text):
    assert interval_text(low, high) == text


def test_the_ends_of_an_interval_are_never_the_same_text():
    rng = np.random.default_rng(5)
    for _ in range(20_000):
        middle = rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-12.0, 12.0)
        half = abs(middle) * 10.0 ** rng.uniform(-15.0, 3.0)
        text = interval_text(middle - half, middle + half)
        if middle - half == middle + half:
            assert text == ""
            continue
        low, high = text.partition(")")[0].removeprefix("(").split(" to ")
        assert float(low) < float(high), (middle, half, text)
        power = float("1" + text.partition(")")[2]) if ")" in text else 1.0
        # Both ends are right to a twentieth of the half width, or to all their digits.
        for told, true in ((low, middle - half), (high, middle + half)):
            off = abs(float(told) * power - true)
            assert off <= 0.051 * half + 4e-16 * abs(true) or off <= 0.006 * abs(true), text


def _estimate(value, sigma, low, high, kind="quadratic", **more):
    return Estimate(
        name="k", value=value, sigma=sigma, interval=np.array([low, high]), interval_kind=kind,
        **more,
    )  # fmt: skip


def test_no_standard_error_beside_an_interval_that_says_otherwise():
    assert agree(1.0, 0.1, 0.804, 1.196, 1.96)
    assert not agree(1.0, 0.1, 0.9, 1.6, 1.96)
    assert not agree(1.0, 0.1, 0.5, 1.5, 1.96)  # twice as wide as the error says
    assert agree(1.0, 0.1, 0.5, 1.5, math.nan)  # or the factor is not known
    assert not agree(1.0, 0.1, 0.8, math.inf, 1.96)
    assert value_text(_estimate(1.0, 0.1, 0.8, 1.2, "profile"), 1.96) == "1.00 +- 0.10"
    skew = _estimate(1.22e-4, 0.32e-4, 0.757e-4, 2.25e-4, "profile")
    assert value_text(skew, 1.96) == "1.22e-04"
    # next to its bound, where it had the digits of the rounding
    assert value_text(_estimate(1.0 + 3e-11, 0.6, 1.0, 1.35, "profile"), 1.96) == "1.0000"
    assert beside(skew) == "(0.76 to 2.25)e-04 (profile likelihood)"


def test_what_is_fixed_or_limited_is_said_in_words():
    fixed = _estimate(0.0, 0.0, 0.0, 0.0, "none", status="fixed")
    assert (value_text(fixed), beside(fixed)) == ("0", "fixed")
    thick = _estimate(3050.0, 0.0, 3050.0, 3050.0, "none", status="fixed", unit="um")
    assert (value_text(thick), beside(thick)) == ("3050 um", "fixed")
    limited = _estimate(0.0, math.nan, 0.0, 0.0123, upper_limit=0.0123, status="at lower bound")
    assert value_text(limited) == "0 (< 0.012)"
    assert beside(limited) == "95 % upper limit in brackets"
    bound = _estimate(2.0, math.nan, math.nan, math.nan, "none", status="at upper bound")
    assert (value_text(bound), beside(bound)) == ("2", "at its upper bound")


def test_k_has_no_error_that_reaches_below_0():
    assert k_text(0.02, 0.001, False) == "0.0200 +- 0.0010"
    assert k_text(1.7e-12, 2.2e-12, False) == "1.7e-12 (compatible with 0)"
    assert k_text(4e-97, 3e-95, False) == k_text(4e-97, 3e-98, True) == "below 1e-12"
    assert k_text(0.02, 0.005, True) == "0.020 (compatible with 0)"
    assert k_text(0.0, math.nan, True) == "0"


def test_a_residual_that_is_rounding_is_0():
    assert size_text(1.13e-17) == "0"
    assert size_text(0.02976) == "0.0298"


def test_control_characters_are_escaped():
    assert visible("\x1b[31mred\x07\r\n") == "\\x1b[31mred\\x07\\r\\n"
    assert visible("Messung \u00b5m \u91d1.csv") == "Messung \u00b5m \u91d1.csv"
    assert visible("\udcff") == "\\udcff"
    assert visible("a\u202eb\u2028") == "a\\u202eb\\u2028"


def test_plain_data_of_every_kind():
    given = {"a": np.float64("nan"), "b": (np.int64(3), math.inf), "c": np.array([[1.0, np.nan]])}
    assert plain(given) == {"a": None, "b": [3, None], "c": [[1.0, None]]}


def test_a_share_above_1_is_told_without_a_power_of_ten():
    told = Warning("poorly_determined", {}, {"parameters": ("A", "B"), "shares": (0.753, 1.17)})
    assert told.text.endswith("of the value of A (75 %) and B (120 %).")
