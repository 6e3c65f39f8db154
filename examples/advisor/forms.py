"""The models of one boundary that a scene may choose from, and what each costs.

A form maps (cos, eta, k, eta_i) to (R_s, R_p). All but the first two know unpolarized light only
and return its R twice.
"""

import functools
import time
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from fresnel_jax import approximate, powers, reflectance


class Form(NamedTuple):
    """`polarized`: tells s from p; `costs`: time relative to `EXACT` in float64, by dtype."""

    name: str
    function: Callable
    polarized: bool
    costs: dict[str, float]


def _exact(c, eta, k, eta_i):
    return powers(c, eta, k, eta_i)[:2]


def _without_k(c, eta, k, eta_i):
    return powers(c, eta, 0.0, eta_i)[:2]


def _unpolarized(c, eta, k, eta_i):
    return (reflectance(c, eta, k, eta_i),) * 2


def _unpolarized_without_k(c, eta, k, eta_i):
    return (reflectance(c, eta, 0.0, eta_i),) * 2


def _at_normal(c, eta, k, eta_i):
    R = approximate.normal_reflectance(eta, k, eta_i)
    return (jnp.broadcast_to(R, jnp.broadcast_shapes(c.shape, R.shape)),) * 2


def _from_the_thin_side(approximation):
    """An approximation as its docstring wants it used.

    Light that leaves a lossless medium for a thinner one brings the cosine on the thin side, where
    R is the same, and R = 1 beyond the critical angle.
    """

    def form(c, eta, k, eta_i):
        leaves = (eta < eta_i) & (k == 0.0)
        ratio = eta_i / eta
        cos2 = 1.0 - ratio * ratio * ((1.0 - c) * (1.0 + c))
        total = leaves & (cos2 <= 0.0)
        outside = jnp.sqrt(jnp.where(cos2 > 0.0, cos2, 1.0))
        n, m = jnp.where(leaves, eta_i, eta), jnp.where(leaves, eta, eta_i)
        R = approximation(jnp.where(leaves, outside, c), n, k, m)
        return (jnp.where(total, 1.0, R),) * 2

    return form


def _polynomial(degree):
    return functools.partial(approximate.polynomial, degree=degree)


EXACT = "exact, s and p"
# (float64, float32), by `python -m examples.advisor gold --measure` on 2 cores of an AMD EPYC
# (family 25, model 17), jax 0.10.2, 2026-11-21: median ratios of 15 interleaved rounds, 1e5 angles
# of one material. The machine was busy: trust them to a third. Approximations include the way
# from the thin side below.
_COSTS = {
    EXACT: (1.0, 0.59),
    "k = 0, s and p": (0.79, 0.41),
    "exact, unpolarized": (0.51, 0.31),
    "k = 0": (0.33, 0.17),
    "normal incidence": (0.02, 0.01),
    "schlick": (0.06, 0.03),
    "large_index": (0.07, 0.04),
    "lazanyi_szirmay_kalos": (0.04, 0.04),
    "f82": (0.04, 0.03),
    "polynomial, degree 6": (0.08, 0.04),
    "polynomial, degree 8": (0.11, 0.08),
    "polynomial, degree 10": (0.15, 0.11),
}
_FUNCTIONS = (
    _exact,
    _without_k,
    _unpolarized,
    _unpolarized_without_k,
    _at_normal,
    _from_the_thin_side(approximate.schlick),
    _from_the_thin_side(approximate.large_index),
    _from_the_thin_side(approximate.lazanyi_szirmay_kalos),
    _from_the_thin_side(approximate.f82),
    *(_from_the_thin_side(_polynomial(degree)) for degree in (6, 8, 10)),
)
FORMS = {
    name: Form(
        name, jax.jit(function), i < 2, dict(zip(("float64", "float32"), costs, strict=True))
    )
    for i, (function, (name, costs)) in enumerate(zip(_FUNCTIONS, _COSTS.items(), strict=True))
}


def measured(angles: int = 100_000, rounds: int = 15) -> dict[str, Form]:
    """`FORMS` with costs timed here and now, about 20 seconds.

    One material, many angles: what depends on the material alone is computed once per call.
    """
    random = np.random.default_rng(20261121)
    with jax.enable_x64(True):
        calls = {}
        for dtype in ("float64", "float32"):
            cosines = jnp.asarray(random.uniform(0.01, 1.0, angles), dtype)
            material = [jnp.asarray(x, dtype) for x in (1.5, 3.0, 1.0)]
            for name, form in FORMS.items():
                call = jax.jit(form.function if form.polarized else _only(form.function))
                jax.block_until_ready(call(cosines, *material))
                calls[name, dtype] = functools.partial(call, cosines, *material)
        ratios = {key: [] for key in calls}
        for _ in range(rounds):
            seconds = {key: min(_seconds(call) for _ in range(5)) for key, call in calls.items()}
            for key, taken in seconds.items():
                ratios[key].append(taken / seconds[EXACT, "float64"])
    costs = {key: float(np.median(values)) for key, values in ratios.items()}
    return {
        name: form._replace(costs={d: costs[name, d] for d in ("float64", "float32")})
        for name, form in FORMS.items()
    }


def _only(function):
    return lambda *arguments: function(*arguments)[0]


def _seconds(call) -> float:
    start = time.perf_counter()
    jax.block_until_ready(call())
    return time.perf_counter() - start
