"""The accuracy search for every further public function: one entry each, in the tables beside.

An entry has a sampler of its domain, the function of single numbers, the textbook's formula in
gmpy2, and the bounds. The derivative of the truth is a central difference in the oracle's digits
(its step is 2^-250 of the argument), so that no derivative is written down twice.

Errors of values are in eps of the scale that the truth gives (the value itself if it gives none);
those of gradients in eps of the larger of the scale and the gradient's norm, in relative changes
of the arguments; of a conditioned entry also of what such a change of one eps does to the gradient.
"""

import functools
import time
from collections.abc import Callable
from operator import truediv
from typing import NamedTuple

import gmpy2
import jax
import jax.numpy as jnp
import numpy as np

from tests.truth.exact_fresnel import CONTEXT

_STEP = gmpy2.mpfr(2) ** -250


class Function(NamedTuple):
    """`truth` takes the same numbers as `function`, exactly, and returns (value, scale or None)s,
    or None where the point is left out."""

    draw: Callable  # (random, size, eps) -> columns
    limits: tuple[tuple[float, float], ...]  # of each column, for the climb
    function: Callable  # scalars -> tuple of scalars
    truth: Callable[..., list | None]
    bound: float | None  # eps; None: another entry has the values
    gradient_bound: float | None = None  # eps; None: the function has no derivative of interest
    arguments: Callable = lambda *columns: (
        columns
    )  # columns -> arguments: directions from angles, for example
    fixed: tuple[int, ...] = ()  # arguments that gradients leave out
    amplified: bool = False  # the norm of a gradient counts with the factor scale / value, too
    shared: bool = False  # the results' gradients are measured by the largest of their norms
    # values are measured by what a relative change of one eps in each argument does to the truth,
    # where it is larger, as all gradients are: beside a maximum or a zero nobody does better
    conditioned: bool = False
    # pairs (result, other): what such a change does to the other counts for the result, too
    coupled: tuple[tuple[int, int], ...] = ()
    dtypes: tuple[type, ...] = (np.float64, np.float32)


def decades(random, size, low, high):
    return 10.0 ** random.uniform(low, high, size)


def uniform_decades(*limits):
    """A sampler of columns, each log-uniform between its limits."""
    return lambda random, size, eps: tuple(
        10.0 ** random.uniform(np.log10(low), np.log10(high), size) for low, high in limits
    )


def plain_entry(limits, function, truth, *bounds, **options):
    """An entry whose whole domain is drawn log-uniformly."""
    return Function(uniform_decades(*limits), limits, function, truth, *bounds, **options)


def _all_of(entry, function, arguments):
    return jnp.stack([jnp.asarray(x) for x in function(*arguments)])


@functools.cache
def compiled(entry: Function, gradient: bool):
    """Arguments -> (points, results), or (points, results, variables)."""

    def values(*arguments):
        return _all_of(entry, entry.function, arguments)

    if not gradient:
        return jax.jit(jax.vmap(values))

    def partials(*arguments):
        # One program for all variables: one for each took nine times as long to compile.
        chosen = np.eye(len(arguments))[_variables(entry, len(arguments))]
        basis = tuple(jnp.asarray(chosen[:, j], x.dtype) for j, x in enumerate(arguments))
        return jax.vmap(lambda *t: jax.jvp(values, arguments, t)[1], out_axes=-1)(*basis)

    return jax.jit(jax.vmap(partials))


def _variables(entry, count):
    return [i for i in range(count) if i not in entry.fixed]


def errors(entry: Function, gradient: bool, columns, dtype, ours=None) -> np.ndarray:
    """In eps, the largest of each point's results; NaN counts as infinite.

    ours: results of `compiled` at these columns, if they are there.
    """
    arguments = [np.asarray(x, dtype) for x in entry.arguments(*columns)]
    eps, tiny = float(np.finfo(dtype).eps), float(np.finfo(dtype).tiny)
    if ours is None:
        ours = np.asarray(compiled(entry, gradient)(*map(jnp.asarray, arguments)))
    worst = np.zeros(len(arguments[0]))
    with gmpy2.context(CONTEXT):
        for i, point in enumerate(zip(*arguments, strict=True)):
            exact = [gmpy2.mpfr(float(x)) for x in point]
            true = entry.truth(*exact)
            if true is None:
                continue
            scales = [max(abs(v) if s is None else s, tiny / eps) for v, s in true]
            largest = float(np.finfo(dtype).max) / 16
            if max(abs(v) for v, _ in true) > largest:
                continue  # not representable
            if not gradient:
                if entry.conditioned:
                    # of all arguments: directions, which gradients leave out, are rounded as well
                    every = range(len(exact))
                    norms = _gradients(entry, exact, np.zeros((len(true), len(exact))), every)[1]
                    for result, other in entry.coupled:
                        norms[result] = max(norms[result], norms[other])
                    scales = [max(pair) for pair in zip(scales, norms, strict=True)]
                found = [
                    abs(gmpy2.mpc(complex(x)) - v) / s
                    for x, (v, _), s in zip(ours[i], true, scales, strict=True)
                ]
            else:
                variables = _variables(entry, len(exact))
                distances, norms, steepest = _gradients(entry, exact, ours[i], variables)
                if steepest > largest:
                    continue
                if entry.shared:
                    norms = [max(norms)] * len(norms)
                if entry.amplified:
                    pairs = zip(norms, scales, true, strict=True)
                    norms = [n * s / abs(v) if v else n for n, s, (v, _) in pairs]
                # A slope below the smallest float is 0 in hardware, by a relative change too.
                lost = max(1.0, *(float(abs(x)) for x in exact)) * tiny / eps
                measured = [max(*pair, lost) for pair in zip(scales, norms, strict=True)]
                # The second derivatives cost as much as twenty points: only where they decide.
                worse = max(map(truediv, distances, measured)) > 0.9 * entry.gradient_bound * eps
                if worse:
                    sensitive = _sensitivities(entry, exact, len(true))
                    for result, other in entry.coupled:
                        sensitive[result] = max(sensitive[result], sensitive[other])
                    measured = [max(pair) for pair in zip(measured, sensitive, strict=True)]
                found = [*map(truediv, distances, measured)]
            for error in found:
                error = float(error)
                worst[i] = max(worst[i], error / eps if error == error else np.inf)
    return worst


def _gradients(entry, exact, ours, variables):
    """Of each result: the distance of our gradient by these variables from the true one, whose norm
    comes next; and the largest of all slopes. A point beside which there is no truth has distances
    of 0."""
    error2, norm2 = ([gmpy2.mpfr(0)] * len(ours) for _ in range(2))
    steepest = gmpy2.mpfr(0)
    for column, j in enumerate(variables):
        h = _STEP * exact[j] if exact[j] != 0 else _STEP
        unit = abs(exact[j])
        pair = [entry.truth(*exact[:j], exact[j] + sign * h, *exact[j + 1 :]) for sign in (1, -1)]
        if pair[0] is None or pair[1] is None:
            return error2, norm2, gmpy2.inf()
        for r, ((above, _), (below, _)) in enumerate(zip(*pair, strict=True)):
            slope = (above - below) / (2 * h)
            steepest = max(steepest, abs(slope))
            off = gmpy2.mpc(complex(ours[r, column])) - slope
            error2[r] += gmpy2.norm(gmpy2.mpc(unit * off))
            norm2[r] += gmpy2.norm(gmpy2.mpc(unit * slope))
    return [*map(gmpy2.sqrt, error2)], [*map(gmpy2.sqrt, norm2)], steepest


def _sensitivities(entry, exact, results):
    """What a relative change of one eps in each argument does to the gradient of each result, over
    eps: the norm of its second derivatives in these units."""
    here = _slopes(entry, exact)
    step = gmpy2.mpfr(2) ** -80
    norm2 = [gmpy2.mpfr(0)] * results
    for j in range(len(exact)):
        there = _slopes(entry, [*exact[:j], exact[j] * (1 + step), *exact[j + 1 :]])
        if here is None or there is None:
            return [gmpy2.inf()] * results
        for r in range(results):
            norm2[r] += sum(
                gmpy2.norm(gmpy2.mpc((b - a) / step))
                for a, b in zip(here[r], there[r], strict=True)
            )
    return [*map(gmpy2.sqrt, norm2)]


def _slopes(entry, exact):
    """The gradient of each result in relative changes of the arguments; None where it has none."""
    columns = []
    for j in _variables(entry, len(exact)):
        h = _STEP * exact[j] if exact[j] != 0 else _STEP
        pair = [entry.truth(*exact[:j], exact[j] + sign * h, *exact[j + 1 :]) for sign in (1, -1)]
        if pair[0] is None or pair[1] is None:
            return None
        columns.append(
            [(a - b) * abs(exact[j]) / (2 * h) for (a, _), (b, _) in zip(*pair, strict=True)]
        )
    return [*zip(*columns, strict=True)]


def search(
    entry: Function, gradient: bool, dtype, random, size, seconds=np.inf, batch=128, survivors=16
):
    """The largest error over its bound, and its columns; the first third of `size` is random."""
    bound = entry.gradient_bound if gradient else entry.bound
    eps = float(np.finfo(dtype).eps)
    end = time.monotonic() + seconds
    best, places, done = np.zeros(0), None, 0
    while done == 0 or (done < size and time.monotonic() < end):
        if places is None or done < size / 3 or random.random() < 0.25:
            columns = [np.asarray(x, float) for x in entry.draw(random, batch, eps)]
        else:
            columns = _moved(random, places, batch // len(places[0]))
        columns = [
            np.clip(x, *limit) if limit[1] > limit[0] else x
            for x, limit in zip(columns, entry.limits, strict=True)
        ]
        found = errors(entry, gradient, columns, dtype) / bound
        done += len(found)
        best = np.concatenate([best, found])
        pairs = (
            columns if places is None else map(np.concatenate, zip(places, columns, strict=True))
        )
        order = np.argsort(-best, kind="stable")[:survivors]
        places = [x[order] for x in pairs]
        best = best[order]
    return best[0], tuple(x[0] for x in places), done


def _moved(random, places, copies):
    moved = []
    step = 10.0 ** random.uniform(-17.0, 0.3, copies * len(places[0]))
    for x in places:
        x = np.repeat(x, copies)
        changed = random.random(len(x)) < 0.5
        moved.append(np.where(changed, x * (1.0 + step * random.standard_normal(len(x))), x))
    return moved
