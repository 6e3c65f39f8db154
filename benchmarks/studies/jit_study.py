"""Whether `jax.jit` changes a result: all public functions, and the programs of the fits.

    python -m benchmarks.studies.jit_study                             # another seed each time
    python -m benchmarks.studies.jit_study --points 1000 --only stack  # rows with this in the name

Every function of the accuracy search, at random points of its whole domain, in both precisions:
values, gradients, and the loss sum((M v)^2) of the values v of each point, with a random matrix M.
Each is compiled for every number of points and compared with the same operations one by one
(`jax.disable_jit`). Differences are in eps of the value, of a gradient in eps of its norm. The
points that differ most are compared with the truth, too, as in the accuracy search: beside a zero
a function changes by many eps of itself within an eps of its arguments. "of bound" is the error
there over the bound of docs/accuracy.md. A loss may differ by twice what the bounds of its values
(of at least their median), or where that is more the differences of its values, do to it.

The programs of the fits: see `jit_study_fits`. The exit status is 1 if a bound is
exceeded.
"""

import argparse
import sys
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import jaxlib
import numpy as np

from benchmarks.accuracy import search_functions, search_quantities
from benchmarks.accuracy.search import FUNCTIONS, random_points, simpler
from benchmarks.accuracy.search_quantities import PROGRAMS, QUANTITIES

# jaxlib 0.10.2 is wrong in both precisions between 32,769 and 65,536 points (two processors).
POINTS = "1000,40000,1000000"
# Operation by operation so many points at once; a program that needs more memory is left out.
BLOCK, MOST_BYTES = 100_000, 5 * 2**30
# Points compared with the truth: those that differ most, and others that differ by a bound.
WORST, FURTHER = 6, 6


class Case(NamedTuple):
    """Values or gradients of a function of the accuracy search.

    program: arguments (N,) -> (N, results) or, of gradients, (N, results, variables). variables:
    numbers of these arguments. errors: of results at columns, in units of the bound, in eps.
    """

    name: str
    dtype: Any
    gradient: bool
    bound: float
    program: Callable
    draw: Callable
    arguments: Callable
    variables: tuple[int, ...]
    errors: Callable


def cases(chosen: Callable[[str], bool]) -> Iterator[Case]:
    for dtype in (np.float64, np.float32):
        for name in filter(chosen, QUANTITIES):
            yield from (_of_quantity(name, program, dtype) for program in PROGRAMS)
        for name in filter(chosen, FUNCTIONS):
            entry = FUNCTIONS[name]
            for gradient, bound in ((False, entry.bound), (True, entry.gradient_bound)):
                if bound is not None:
                    yield _of_function(name, entry, gradient, bound, dtype)


def _of_quantity(name, program, dtype) -> Case:
    quantity, compiled = QUANTITIES[name], search_quantities.compiled(name, program)
    variables = search_quantities.variables_of(program)

    def errors(points, ours):
        ours = np.moveaxis(ours, 0, -1)
        found = search_quantities.errors(name, program, points, dtype, ours)
        return found / quantity.bound_at(points)

    return Case(
        name + (program != "all given") * f" ({program})", dtype, quantity.gradient, quantity.bound,
        lambda *a: jnp.moveaxis(compiled(*a), -1, 0),
        lambda random, size: simpler(random_points(random, size, dtype), program),
        lambda *points: [points[i] for i in variables],
        tuple(range(len(variables))),
        errors,
    )  # fmt: skip


def _of_function(name, entry, gradient, bound, dtype) -> Case:
    eps = float(np.finfo(dtype).eps)
    pairs = [limit if limit[1] > limit[0] else (-np.inf, np.inf) for limit in entry.limits]

    def draw(random, size):
        columns = entry.draw(random, size, eps)
        return [np.clip(x, *limit) for x, limit in zip(columns, pairs, strict=True)]

    def arguments(*columns):
        return [np.asarray(x, dtype) for x in entry.arguments(*columns)]

    count = len(arguments(*draw(np.random.default_rng(0), 1)))
    return Case(
        name, dtype, gradient, bound, search_functions.compiled(entry, gradient), draw, arguments,
        tuple(i for i in range(count) if i not in entry.fixed),
        lambda columns, ours: (
            search_functions.errors(entry, gradient, columns, dtype, ours) / bound
        ),
    )  # fmt: skip


def one_by_one(program: Callable, arguments: list) -> np.ndarray:
    """Return what a program returns operation by operation, in blocks of points."""
    starts = range(0, len(arguments[0]), BLOCK)
    with jax.disable_jit():
        blocks = [program(*(jnp.asarray(x[i : i + BLOCK]) for x in arguments)) for i in starts]
    return np.concatenate([np.asarray(x) for x in blocks])


def compiled(program: Callable, arguments: list) -> np.ndarray | None:
    """Return what one program for all points returns; None if it would need too much memory."""
    ready = jax.jit(program).lower(*arguments).compile()
    if ready.memory_analysis().temp_size_in_bytes > MOST_BYTES:
        return None
    return np.array(ready(*arguments))


def _difference(found: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Return |found - expected|: 0 where both are the same infinity or not a number."""
    with np.errstate(all="ignore"):
        off = np.abs(found.astype(complex) - expected)
    alike = (found == expected) | (np.isnan(found) & np.isnan(expected))
    return np.where(alike, 0.0, np.where(np.isfinite(off), off, np.inf))


def differences(case: Case, arguments: list, found: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Return by how much each result differs, in eps: of itself, and of the point's largest one.

    Each (N,), the largest of the point; of a gradient it is the norm of relative changes.
    """
    off, size = _difference(found, expected), np.abs(expected).astype(float)
    if case.gradient:
        unit = np.stack([np.abs(arguments[i], dtype=float) for i in case.variables], -1)[:, None]
        off, size = (np.sqrt(np.sum((unit * x) ** 2, -1)) for x in (off, size))
    eps, least = float(np.finfo(case.dtype).eps), float(np.finfo(case.dtype).tiny)
    with np.errstate(all="ignore"):
        scales = [np.maximum(x, least / eps) * eps for x in (size, size.max(1, keepdims=True))]
        return np.stack([np.nan_to_num(off / x, nan=0.0, posinf=np.inf).max(1) for x in scales])


def parts(values: Any) -> Any:
    """Return values (N, R) as real numbers: of complex ones real and imaginary parts (N, 2R)."""
    return jnp.concatenate([values.real, values.imag], -1) if values.dtype.kind == "c" else values


def loss_difference(
    case: Case, columns: list, values: np.ndarray, expected: np.ndarray, matrix: np.ndarray
) -> tuple[float, float]:
    """Return the largest difference of the losses in eps of sum((|M| |v|)^2), and over its bound.

    values: (N, R), of the compiled program. expected: operation by operation.
    """
    arguments = case.arguments(*columns)

    def loss(*arguments):
        rows = parts(case.program(*arguments))
        return jax.vmap(lambda r: jnp.sum((m @ r) ** 2))(rows)

    m, eps = jnp.asarray(matrix, case.dtype), float(np.finfo(case.dtype).eps)
    found = compiled(loss, arguments)
    if found is None:
        return 0.0, 0.0
    v, matrix = np.asarray(parts(expected), float), np.asarray(m, float)
    moved = np.abs(np.asarray(parts(values), float) - v)
    # A value that is small for its function may be a difference of larger ones.
    sizes = np.maximum(np.abs(v), np.nanmedian(np.abs(v), 0))
    moved = 2.0 * np.maximum(moved, case.bound * eps * sizes)
    products, largest = v @ matrix.T, np.abs(v) @ np.abs(matrix).T
    by_values = moved @ np.abs(matrix).T
    rounding = 2.0 * len(matrix) * eps * np.sum(largest**2, 1)
    allowed = np.sum((2.0 * np.abs(products) + by_values) * by_values, 1) + rounding
    there = np.isfinite(found) & np.isfinite(allowed) & (allowed > np.finfo(case.dtype).tiny / eps)
    off = np.abs(found - np.sum(products**2, 1))[there]
    scale = np.sum(largest**2, 1)[there]
    share, points = off / allowed[there], np.flatnonzero(there)
    for i in np.flatnonzero(share > 1.0):  # where nothing is promised any number is right
        point = [x[points[i], None] for x in columns]
        if not case.errors(point, np.full_like(values[:1], np.nan)).any():
            share[i] = 0.0
    return max(off / scale / eps, default=0.0), max(share, default=0.0)


def rows_of(case: Case, random: Any, sizes: list[int]) -> Iterator[tuple]:
    """Yield (points, difference in eps, error over bound, the same two of the loss)."""
    columns = case.draw(random, max(sizes))
    arguments = case.arguments(*columns)
    expected = one_by_one(case.program, arguments)
    matrix = random.standard_normal((3, parts(expected).shape[1]))
    for size in sizes:
        some = [x[:size] for x in arguments]
        found = compiled(case.program, some)
        if found is None:
            yield size, np.nan, 0.0, np.nan, 0.0
            continue
        off, shown = differences(case, some, found, expected[:size])
        chosen = np.argsort(-off, kind="stable")[:WORST]
        more = np.flatnonzero(off > case.bound)
        chosen = np.union1d(chosen, random.choice(more, min(FURTHER, len(more)), replace=False))
        chosen = chosen[off[chosen] > 0.0]
        places = [x[chosen] for x in columns]
        errors = case.errors(places, found[chosen]) if len(chosen) else np.zeros(1)
        if not errors.max() <= 1.0:
            alone = case.errors(places, expected[chosen])[errors.argmax()]
            print(f"above its bound, operation by operation {alone:.3g} of it, at "
                  f"{[float(x[errors.argmax()]) for x in places]}")  # fmt: skip
        loss = np.nan, 0.0
        if not case.gradient:
            first = [x[:size] for x in columns]
            loss = loss_difference(case, first, found, expected[:size], matrix)
        yield size, shown.max(), errors.max(), *loss


def report(name: str, dtype: str, size: Any, cells: tuple) -> float:
    """Print a row; return the larger share of a bound."""
    text = "".join(
        f"{eps:12.4g}{share:9.3g}" if np.isfinite(eps) else f"{'-':>12}{'-':>9}"
        for eps, share in (cells[:2], cells[2:])
    )
    largest = float(np.max([cells[1], cells[3]]))
    print(f"{name:52}{dtype:9}{size:>9}{text}{'  ABOVE' * (not largest <= 1.0)}", flush=True)
    return largest


def studied(seed: int, sizes: list[int], chosen: Callable[[str], bool]) -> Iterator[tuple]:
    """Print every row; yield (share of a bound, name)."""
    for i, case in enumerate(cases(chosen)):
        prefix = "gradient of " * (case.gradient and "gradient" not in case.name)
        for size, *cells in rows_of(case, np.random.default_rng([seed, i]), sizes):
            name, dtype = prefix + case.name, np.dtype(case.dtype).name
            yield report(name, dtype, size, tuple(cells)), name
    # Imported here, since it takes the place of what compiles the programs of the fits.
    from benchmarks.studies.jit_study_fits import rows

    for name, off, share in rows(np.random.default_rng(seed), chosen):
        yield report(name, "float64", "", (off, share, np.nan, 0.0)), name


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser("python -m benchmarks.studies.jit_study", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--points", default=POINTS, help="numbers of points (%(default)s)")
    parser.add_argument("--seed", type=int, help="left out: another one each time")
    parser.add_argument("--only", default="", help="names that contain this; fits: 'fit of'")
    parser.add_argument("--skip", help="no names that contain this: 'stack', which takes hours")
    given = parser.parse_args(arguments)
    seed = np.random.SeedSequence().entropy % 10**9 if given.seed is None else given.seed
    jax.config.update("jax_enable_x64", True)
    print(f"jax {jax.__version__}, jaxlib {jaxlib.__version__}, seed {seed}; jit against eager")
    heads = f"{'eps':>12}{'of bound':>9}{'loss, eps':>12}{'of bound':>9}"
    print(f"{'':61}{'points':>9}{heads}", flush=True)

    def chosen(name: str) -> bool:
        return given.only in name and not (given.skip and given.skip in name)

    rows = list(studied(seed, [int(x) for x in given.points.split(",")], chosen))
    if not rows:
        parser.error(f"no name contains --only {given.only!r}")
    missed, (share, name) = sum(not row[0] <= 1.0 for row in rows), max(rows)
    print(
        f"{missed} of {len(rows)} rows above their bound; worst: {name}, {share:.3g} of its bound"
    )
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
