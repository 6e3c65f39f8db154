"""The programs of the fits, compiled and operation by operation; see `jit_study`.

Each fit below runs twice, the second time with the first call of every compiled program of
`fitting`, for each shape of its arguments, operation by operation. What the program gives for the
same arguments is compared in eps of the largest number along the last axis (rows, slots or lanes).
A solver stops where its steps get small, which is not the same last bit: the parameters of both
fits are compared in units of their standard errors.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from typing import Any

import jax
import numpy as np

import fitting.process.compiled as programs

# Standard errors that hold a thousandth need values and derivatives within 1e-3; wrong programs
# were off by 1e-2 and more, right ones by 1e-11.
BOUND = 1e6  # eps
BOUND_OF_FIT = 1e-3  # standard errors
ANGLES = ("psi", "delta")
_plain = programs.compiled
_seen: set | None = None  # the calls that are compared; None: none is
_largest: dict[str, float] = {}


def _compared(function: Callable, *static: str) -> Callable:
    """Return ``function`` compiled, but for first calls, which run operation by operation."""
    program = _plain(function, *static)
    name = f"{function.__module__.removeprefix('fitting.')}.{function.__name__.strip('_')}"

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        leaves = jax.tree.leaves(args)
        key = name, *kwargs.values(), *map(np.shape, leaves)
        within = any(isinstance(x, jax.core.Tracer) for x in leaves)
        if within or _seen is None or key in _seen:
            return program(*args, **kwargs)
        _seen.add(key)
        with jax.disable_jit():
            expected = function(*args, **kwargs)
        if not name.endswith("solve"):
            found = program(*args, **kwargs)
            pairs = zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True)
            _largest[name] = max(_largest.get(name, 0.0), *(_difference(*pair) for pair in pairs))
        return expected

    return call


def _difference(found: Any, expected: Any) -> float:
    found, expected = (np.atleast_1d(np.asarray(x, float)) for x in (found, expected))
    with np.errstate(all="ignore"):
        off = np.where(found == expected, 0.0, np.abs(found - expected))
        off = np.where(np.isnan(found) & np.isnan(expected), 0.0, off)
        scale = np.max(np.abs(expected), -1, keepdims=True, where=np.isfinite(expected), initial=0)
        eps = off / np.maximum(scale, 1e-290) / np.finfo(float).eps
    return float(np.max(np.nan_to_num(eps, nan=np.inf, posinf=np.inf), initial=0.0))


programs.compiled = _compared  # before the modules below are imported

from fitting import Measurement, fit, fit_many, fit_residuals, simulate  # noqa: E402
from fresnel_jax import powers  # noqa: E402


def _residuals(v: Any, data: Any) -> Any:
    cosine, R = data
    return (powers(cosine, v["eta"], v["k"]).R - R) / 0.002


def _simulated(random: Any, sample: str, values: dict, quantities: tuple, waves: Any) -> Any:
    columns = {}
    for q in quantities:
        exact = simulate(sample, values, 60.0, waves, q)
        columns[q] = exact + (0.1 if q in ANGLES else 0.002) * random.standard_normal(len(waves))
    return Measurement.from_columns(60.0, waves, **columns)


def fits(random: Any) -> dict[str, Callable]:
    """Return name -> a fit: of every engine and of every kind of sample."""
    angle, waves = np.linspace(20.0, 80.0, 13), np.linspace(0.4, 0.9, 24)
    curve = {
        q: r + 0.002 * random.standard_normal(r.shape)
        for q, r in powers(np.cos(np.radians(angle)), 1.7, 0.3)._asdict().items()
        if q in ("R_s", "R_p")
    }
    many = {
        q: np.asarray(r) + 0.002 * random.standard_normal((300, len(angle)))
        for q, r in curve.items()
    }
    index = {"A": 2.05, "B": 0.017}
    film, plate = "air | cauchy:2 50..200 nm | SiO2", "air | cauchy:2 1 mm thick | air"
    ellipsometry = _simulated(random, film, index | {"thickness_nm": 110.0}, ANGLES, waves)
    power = _simulated(random, film, index | {"thickness_nm": 110.0}, ("R",), waves)
    through = _simulated(random, plate, index, ("R", "T"), waves)
    bare = _simulated(random, "cauchy:2", index, ("R_s", "R_p"), waves)
    one = Measurement.from_columns(angle, **curve)
    model = {"eta": {"start": (1.2, 3.0)}, "k": {"start": (0.05, 1.0)}}
    few: dict[str, Any] = {"starts": 4}
    return {
        "one bare surface": lambda: fit(one),
        "many bare surfaces": lambda: fit_many(angle, **many),
        "bare surface, Cauchy": lambda: fit(bare, "cauchy:2", **few),
        "bare surface with a scale": lambda: fit(one, free="scale", **few),
        "film, psi and Delta": lambda: fit(ellipsometry, film, free="angle_offset", **few),
        "film, R": lambda: fit(power, film, **few),
        "plate, R and T": lambda: fit(through, plate, free="scale", **few),
        "own residuals": lambda: fit_residuals(
            _residuals, model, (np.cos(np.radians(angle)), (curve["R_s"] + curve["R_p"]) / 2), **few
        ),
    }


def _off(found: Any, expected: Any) -> float:
    """Return by how many standard errors the parameters of two fits differ at most."""
    worst = 0.0
    for name, one in found.parameters.items():
        value, other, sigma = (
            np.ravel(x)
            for x in (one.value, expected.parameters[name].value, expected.parameters[name].sigma)
        )
        with np.errstate(all="ignore"):  # sigma is 0 where a parameter is held
            off = np.where(value == other, 0.0, np.abs(value - other) / sigma)
        worst = max(worst, float(np.max(np.nan_to_num(off, nan=np.inf))))
    return worst


def rows(random: Any, chosen: Callable[[str], bool]) -> Iterator[tuple[str, float, float]]:
    """Yield (what, difference, its share of the bound) of every fit, then of every program."""
    global _seen
    for name, run in fits(random).items():
        if chosen(f"fit of {name}"):
            expected, _seen = run(), set()
            found, _seen = run(), None
            off = _off(found, expected)
            yield f"fit of {name}, standard errors", off, off / BOUND_OF_FIT
    for name, eps in sorted(_largest.items()):
        yield f"program {name}", eps, eps / BOUND
