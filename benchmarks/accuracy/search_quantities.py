"""What the accuracy search attacks: each public quantity, its truth, and the bound it must keep."""

import functools
from collections.abc import Callable
from typing import NamedTuple

import gmpy2
import jax
import jax.numpy as jnp
import numpy as np

from fresnel_jax import amplitudes, powers, reflectance
from fresnel_jax.polarization import ellipsometric_ratio, psi_delta
from tests.truth.exact_fresnel import CONTEXT, Exact

# What is left out of (c, n, k, m) as a Python number, which selects a smaller program.
PROGRAMS = {"all given": (), "no k": (2,), "no eta_i": (3,), "neither": (2, 3)}


# Below this a gradient counts as 0: that of total reflection, which 1,000 bits leave at 1e-290.
_NO_GRADIENT = 1e-200


class Quantity(NamedTuple):
    """`function` of (c, n, k, m); `truth` gives (true value, scale of its error) for each result.

    A gradient is one result: the list of its parts, measured by its norm.
    """

    function: Callable
    truth: Callable[[Exact, float, float], list]
    gradient: bool
    bound: float  # eps
    small_index: float = 0.0  # further eps times (eta_i / |N|)^2

    def bound_at(self, points) -> np.ndarray:
        _, n, k, m = (np.asarray(x, float) for x in points)
        return self.bound + self.small_index * (m / np.hypot(n, k)) ** 2


def _powers(exact: Exact, eps, tiny):
    true = exact.powers()
    # an R below eps^2 counts as eps^2, and a T next to the smallest float as 1e13 of it
    return [(x, max(x, (eps**2 if j < 2 else 1e13 * tiny))) for j, x in enumerate(true)]


def _reflectance(exact: Exact, eps, tiny):
    R_s, R_p, *_ = exact.powers()
    R = (R_s + R_p) / 2
    return [(R, max(R, eps**2))]


def _amplitudes(exact: Exact, eps, tiny):
    values = (exact.r_s, exact.r_p, exact.t_s, exact.t_p)
    return [(z, max(abs(z), eps**2)) for z in values]


def _ratio(exact: Exact, eps, tiny):
    rho, _ = exact.ratio()
    return [(rho, max(abs(rho), eps**2))]


def _of_norm(exact: Exact, gradients, variables, tiny):
    """Each gradient as (unit, part) of every variable, and its norm in these units.

    The units are those of relative changes: cos, |N|, |N|, eta_i. In plain numbers the norm would
    weigh dR/dcos by the index: beside the pseudo-Brewster angle of an index of 500 it is the
    difference of numbers 500^2 times as large as all other derivatives.
    """
    N = abs(exact.N)
    units = (exact.c, N, N, exact.m)
    found = []
    for gradient in gradients:
        parts = [(units[v], gradient[v]) for v in variables]
        norm = gmpy2.sqrt(sum(gmpy2.norm(gmpy2.mpc(u * g)) for u, g in parts))
        found.append((parts, max(norm, 1e7 * tiny, _NO_GRADIENT)))
    return found


def _power_gradients(exact: Exact, eps, tiny, variables):
    of_R = exact.power_gradients()
    return _of_norm(
        exact, [*of_R, *([-g for g in x] for x in of_R)], variables, max(tiny / eps, _NO_GRADIENT)
    )


def _reflectance_gradient(exact: Exact, eps, tiny, variables):
    of_s, of_p = exact.power_gradients()
    return _of_norm(
        exact,
        [[(a + b) / 2 for a, b in zip(of_s, of_p, strict=True)]],
        variables,
        max(tiny / eps, _NO_GRADIENT),
    )


def _amplitude_gradients(exact: Exact, eps, tiny, variables):
    return _of_norm(exact, exact.amplitude_gradients, variables, tiny / eps)


def _psi_delta_gradients(exact: Exact, eps, tiny, variables):
    rho, d = exact.ratio()
    modulus2 = gmpy2.norm(rho)
    if modulus2 == 0:
        return []
    log = [x / rho for x in d]
    modulus = gmpy2.sqrt(modulus2)
    psi = [x.real * modulus / (1 + modulus2) for x in log]
    delta = [-x.imag for x in log]
    return _of_norm(exact, [psi, delta], variables, tiny)


QUANTITIES = {
    "R and T of s and p": Quantity(powers, _powers, False, 9.0),
    "R": Quantity(lambda *a: (reflectance(*a),), _reflectance, False, 8.0),
    "amplitudes": Quantity(amplitudes, _amplitudes, False, 8.0),
    "r_p / r_s": Quantity(lambda *a: (ellipsometric_ratio(*a),), _ratio, False, 8.0),
    "gradient of R and T of s and p": Quantity(powers, _power_gradients, True, 50.0, 4.0),
    "gradient of R": Quantity(
        lambda *a: (reflectance(*a),), _reflectance_gradient, True, 50.0, 100.0
    ),
    "gradient of amplitudes": Quantity(amplitudes, _amplitude_gradients, True, 50.0, 4.0),
    "gradient of psi and Delta": Quantity(psi_delta, _psi_delta_gradients, True, 50.0, 4.0),
}


def variables_of(program: str) -> tuple[int, ...]:
    return tuple(i for i in range(4) if i not in PROGRAMS[program])


@functools.cache
def compiled(name: str, program: str):
    """Points -> array (results, points), or (results, variables, points) of gradients."""
    quantity, variables = QUANTITIES[name], variables_of(program)
    left_out = {2: 0.0, 3: 1.0}

    def function(*given):
        given = dict(zip(variables, given, strict=True))
        return tuple(quantity.function(*(given.get(i, left_out.get(i)) for i in range(4))))

    if not quantity.gradient:
        return jax.jit(lambda *given: jnp.stack(function(*given)))

    def partials(*given):
        rows = [
            jax.jvp(function, given, tuple(jnp.full_like(x, i == j) for j, x in enumerate(given)))[
                1
            ]
            for i in range(len(given))
        ]
        return jnp.stack([jnp.stack(row) for row in rows], axis=1)

    return jax.jit(partials)


def errors(name: str, program: str, points, dtype, ours=None) -> np.ndarray:
    """In eps, the largest of each point's results; NaN counts as infinite.

    ours: results of `compiled` at these points, if they are there.
    """
    quantity, variables = QUANTITIES[name], variables_of(program)
    info = np.finfo(dtype)
    eps, tiny = float(info.eps), float(info.tiny)
    if ours is None:
        given = (jnp.asarray(points[i], dtype) for i in variables)
        ours = np.asarray(compiled(name, program)(*given))
    worst = np.zeros(len(points[0]))

    with gmpy2.context(CONTEXT):
        for i, point in enumerate(zip(*points, strict=True)):
            exact = Exact(*point)
            if exact.degenerate or exact.critical:
                continue  # the limit is stated, and has tests of its own
            if quantity.gradient:
                true = quantity.truth(exact, eps, tiny, variables)
            else:
                true = quantity.truth(exact, eps, tiny)
            for j, (value, scale) in enumerate(true):
                if scale > float(info.max) / 16:
                    continue  # not representable
                found = ours[j, ..., i]
                error = _distance(found, value) / scale / eps
                worst[i] = max(worst[i], float(error) if error == error else np.inf)
    return worst


def _distance(found, value):
    if isinstance(value, list):
        parts = [
            gmpy2.norm(unit * (gmpy2.mpc(complex(x)) - y))
            for x, (unit, y) in zip(found, value, strict=True)
        ]
        return gmpy2.sqrt(sum(parts))
    return abs(gmpy2.mpc(complex(found)) - value)
