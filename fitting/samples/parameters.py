"""Parameters of a model fit: free, fixed, with bounds or a prior, and the text for each.

eta=1.5            fixed at 1.5
k=0.1..2           free between .1 and 2 (either end may be left out: k=..2)
scale=1+-0.02      free, and known beforehand to be 1 with a standard error of .02 (or ~)
"""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

# The coordinate of a parameter in the solver: the parameter itself, its logarithm or its square.
PLAIN, LOG, SQUARE = "plain", "log", "square"
# At u = k^2 = 0 dR/du is taken at this u instead, where sqrt(u) and dR/dk = 2k dR/du are exact.
LEAST_SQUARE = 1e-24

NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_NUMBER = rf"[-+]?{NUMBER}"
_NAME = re.compile(r"\s*([A-Za-z_][-\w]*(?:\.[A-Za-z_]\w*)?(?:\[[^\]]*\])?)\s*([=~])\s*(.*?)\s*$")
_RANGE = re.compile(rf"({_NUMBER})?\s*\.\.\s*({_NUMBER})?$")
_PRIOR = re.compile(rf"({_NUMBER})\s*\+-\s*({_NUMBER})$")


class Parameter(NamedTuple):
    """The description of a parameter by its model.

    start: the range that starts are drawn from, evenly, or evenly in the logarithm if ``decades``.
    low, high: its bounds. coordinate: PLAIN, LOG or SQUARE. held: its value if it is fixed by
    default; None if it is free by default. near: starts accumulate at this value, at distances from
    1e-7 of it on (an index next to that of the medium in front).
    """

    name: str
    unit: str
    start: tuple[float, float]
    low: float = -math.inf
    high: float = math.inf
    coordinate: str = PLAIN
    held: float | None = None
    decades: bool = False
    near: float | None = None


class Unknown(NamedTuple):
    """One unknown of a fit: the model's parameter and what the caller made of it.

    low, high: bounds, equal where the parameter is held. prior: mean and standard error.
    """

    parameter: Parameter
    low: float
    high: float
    prior: tuple[float, float] | None = None

    @property
    def free(self) -> bool:
        """Whether the parameter is not held."""
        return self.low < self.high


class Settings(NamedTuple):
    """The caller's settings of parameters, by name; a name is ``scale`` or ``scale[R_s]``.

    variants: names in ``fixed`` that are free in other fits of the same data. They are unknowns of
    the program with equal bounds, so that all these fits share it. shared: the same for the further
    terms of wider models of the data.
    """

    free: tuple[str, ...] = ()
    fixed: Mapping[str, float] = {}
    bounds: Mapping[str, tuple[float, float]] = {}
    priors: Mapping[str, tuple[float, float]] = {}
    tie: Mapping[str, Any] = {}
    variants: tuple[str, ...] = ()
    shared: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """All names that have a setting."""
        said = (*self.free, *self.fixed, *self.bounds, *self.priors, *self.tie)
        return tuple(dict.fromkeys((*said, *(of for _, of in self.tie.values()))))


def plain_name(name: str) -> str:
    """Return the name with underscores in place of the hyphens of the command line."""
    head, bracket, tail = name.strip().partition("[")
    return head.replace("-", "_") + bracket + tail


def parse_setting(text: str) -> tuple[str, str, Any]:
    """Return name, "fixed", "bounds" or "priors", and the number or the pair of numbers.

    Raises ValueError for anything but the three forms in the docstring of the module.
    """
    found = _NAME.match(text)
    name, sign, rest = (plain_name(found[1]), found[2], found[3]) if found else ("", "", "")
    if prior := _PRIOR.match(rest):
        return name, "priors", (float(prior[1]), float(prior[2]))
    if sign == "=" and (pair := _RANGE.match(rest)) and (pair[1] or pair[2]):
        return name, "bounds", (float(pair[1] or -math.inf), float(pair[2] or math.inf))
    if sign == "=" and re.fullmatch(_NUMBER, rest):
        return name, "fixed", float(rest)
    raise ValueError(
        f"{text!r} came; NAME=VALUE (fixed), NAME=LOW..HIGH (bounds) or NAME=VALUE+-SIGMA (prior) "
        "was wanted, for example k=0, eta=1.4..1.6 or scale=1+-0.02."
    )


def names_of(names: str | Iterable[str]) -> tuple[str, ...]:
    """Return names as a tuple: a string is one name, not its letters."""
    several = (names,) if isinstance(names, str) or not isinstance(names, Iterable) else (*names,)
    if not all(isinstance(name, str) for name in several):
        raise ValueError(
            f"free is {names!r}; the name of a parameter or a list of names was wanted."
        )
    return several


def check_search(starts: Any, start: Any, seed: Any) -> None:
    """Raise ValueError for a wrong number of starts, start or seed."""
    whole = isinstance(starts, int | np.integer) and not isinstance(starts, bool)
    if not (starts is None or (whole and starts > 0)):
        raise ValueError(f"starts is {starts!r}; a whole number above 0 was wanted.")
    if not isinstance(seed, int | np.integer) or seed < 0:
        raise ValueError(f"seed is {seed!r}; a whole number of 0 or more was wanted.")
    if start is not None and not isinstance(start, Mapping):
        raise ValueError(
            f"start is {start!r}; a mapping from names to values was wanted: {{'eta': 1.5}}."
        )


def _number(value: Any) -> float:
    """Return a number; NaN of what is none, such as a text, even where it spells one."""
    if isinstance(value, (str, bytes)):
        return math.nan
    with contextlib.suppress(TypeError, ValueError):
        return float(value)
    return math.nan


def _fixed(name: str, value: Any) -> float:
    if not math.isfinite(number := _number(value)):
        raise ValueError(f"{name} is fixed at {value!r}; a finite number was wanted.")
    return number


def _pair(name: str, value: Any, what: str) -> tuple[float, float]:
    low = high = math.nan
    with contextlib.suppress(TypeError, ValueError):
        first, second = value
        low = -math.inf if first is None else _number(first)
        high = math.inf if second is None else _number(second)
    if math.isnan(low) or math.isnan(high):
        raise ValueError(f"{what} of {name} is {value!r}; two numbers were wanted.")
    return low, high


def _bounds(name: str, value: Any) -> tuple[float, float]:
    low, high = _pair(name, value, "the range")
    if not low < high:
        ends = f"{low:g} to {high:g}"
        raise ValueError(f"the range of {name} is {ends}; the lower end must come first.")
    return low, high


def _prior(name: str, value: Any) -> tuple[float, float]:
    mean, sigma = _pair(name, value, "the prior")
    came = f"the prior of {name} is {mean:g} +- {sigma:g}"
    if not (math.isfinite(mean) and math.isfinite(sigma) and sigma > 0.0):
        raise ValueError(f"{came}; a finite value and a standard error above 0 were wanted.")
    if sigma < max(1e-9 * abs(mean), 1e-100):
        advice = f"which is narrower than a fit resolves; fix it instead at {mean:g}."
        raise ValueError(f"{came}, {advice}")
    return mean, sigma


def _tied(name: str, value: Any) -> tuple[float, str]:
    """Return the factor and the name of the parameter that another one is tied to."""
    form = rf"\s*(?:({_NUMBER})\s*\*)?\s*([A-Za-z_][^*]*?)\s*"
    found = re.fullmatch(form, value) if isinstance(value, str) else None
    if not found:
        raise ValueError(
            f"{name} is tied to {value!r}; the name of another parameter was wanted, or a multiple "
            "of one: '0.5 * film.A'."
        )
    return float(found[1] or 1.0), plain_name(found[2])


_READ = {"fixed": _fixed, "bounds": _bounds, "priors": _prior, "tie": _tied}


def settings_of(
    free: Any = (), fixed: Any = None, bounds: Any = None, priors: Any = None, tie: Any = None
) -> Settings:
    """Return what a caller asked of parameters, with plain names and numbers.

    Raises ValueError for wrong ones.
    """
    by: dict[str, dict[str, Any]] = {"free": dict.fromkeys(map(plain_name, names_of(free)))}
    for kind, came in zip(_READ, (fixed, bounds, priors, tie), strict=True):
        if not isinstance(came or {}, Mapping):
            raise ValueError(
                f"{kind} is {came!r}; a mapping from names of parameters was wanted, {{name: ...}}."
            )
        by[kind] = {plain_name(n): _READ[kind](n, v) for n, v in (came or {}).items()}
    others = {**by["free"], **by["bounds"], **by["priors"]}
    for name in sorted(by["fixed"].keys() & others):
        raise ValueError(f"{name} is fixed and cannot also be free, bounded or have a prior.")
    for name in sorted(by["tie"].keys() & {**others, **by["fixed"]}):
        raise ValueError(
            f"{name} is tied to another parameter and cannot also be free, fixed, bounded or have "
            "a prior."
        )
    return Settings(tuple(by["free"]), by["fixed"], by["bounds"], by["priors"], by["tie"])


def check_tie(name: str, factor: float, parameter: Parameter, of: Parameter) -> None:
    """Raise ValueError where a multiple of a parameter is always out of the range of another."""
    if factor < 0.0 and parameter.low >= 0.0 and of.low >= 0.0:
        raise ValueError(
            f"{name} is tied to {factor:g} times another parameter, and neither of them can be "
            "negative; a factor above 0 was wanted."
        )


def to_parameter(coordinates: tuple[str, ...], y: Array) -> list[Array]:
    """Return the parameters (each of shape y[0]) at the solver's coordinates y (p, ...)."""
    out = []
    for kind, value in zip(coordinates, y, strict=True):
        if kind == LOG:
            value = jnp.exp(value)
        elif kind == SQUARE:
            # At 0 the derivative is that just beside it: a maximum alone would give 0.
            least = jax.lax.stop_gradient(jnp.maximum(value, LEAST_SQUARE) - value)
            value = jnp.sqrt(value + least)
        out.append(value)
    return out


def from_parameter(kind: str, x: Any) -> np.ndarray:
    """Return the solver's coordinate of parameter values (0 is -inf in LOG)."""
    x = np.asarray(x, float)
    if kind == LOG:
        with np.errstate(divide="ignore"):
            return np.log(np.maximum(x, 0.0))
    return np.square(x) if kind == SQUARE else x


def value_and_slope(kind: str, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a parameter and its derivative by the solver's coordinate; a square at 0: 0, inf."""
    if kind == LOG:
        return np.exp(y), np.exp(y)
    if kind == SQUARE:
        root = np.sqrt(np.maximum(y, 0.0))
        root = np.where(y <= 2.0 * LEAST_SQUARE, 0.0, root)
        with np.errstate(divide="ignore"):
            return root, 0.5 / root
    return np.asarray(y, float), np.ones_like(y)


def start_range(unknown: Unknown) -> tuple[float, float]:
    """Return the range of starts: the model's, cut to bounds and prior."""
    low, high = unknown.parameter.start
    if unknown.prior is not None:
        mean, sigma = unknown.prior
        low, high = mean - 2.0 * sigma, mean + 2.0 * sigma
    cut_low, cut_high = max(low, unknown.low), min(high, unknown.high)
    if cut_low <= cut_high:
        return cut_low, cut_high
    # Bounds beside the usual range: all of it, or next to the end that there is.
    ends = [e for e in (unknown.low, unknown.high) if math.isfinite(e)]
    return (ends[0], ends[-1]) if len(ends) == 2 else (ends[0], ends[0])
