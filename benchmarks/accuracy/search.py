"""The largest errors of the library, searched: `make accuracy-search`.

    python -m benchmarks.accuracy.search --minutes 10            # another seed each time, printed
    python -m benchmarks.accuracy.search --points 2000 --seed 7  # the same points each time

For every quantity (R and T of s and p, R, amplitudes, r_p / r_s, and the gradients of these and of
psi and Delta), in float64 and float32, with k and eta_i as arrays and left out: random points over
the whole domain, a share of them beside index match, the critical, Brewster's and grazing angle,
then a hill climb on the error from the worst of them. Errors are in eps of each value (of a
gradient: of its norm, in units of relative changes of cos, N and eta_i), against the textbook
formulas in 1,000 bits at the exact inputs. The exit status is 1 if a bound is exceeded.

Domain: cosines 1e-12 to 1, indices 1e-6 to 1e8, k 0 or 1e-30 to 1e8, eta_i 1 or .03 to 30.
"""

import argparse
import sys
import time

import jax
import numpy as np

from benchmarks.accuracy import search_functions
from benchmarks.accuracy.search_approximations import APPROXIMATIONS
from benchmarks.accuracy.search_boundary import BOUNDARY_FUNCTIONS
from benchmarks.accuracy.search_bsdf import BSDFS
from benchmarks.accuracy.search_colour import COLOUR
from benchmarks.accuracy.search_depth import DEPTH
from benchmarks.accuracy.search_directions import DIRECTIONS
from benchmarks.accuracy.search_facets import FACETS
from benchmarks.accuracy.search_layers import LAYERS
from benchmarks.accuracy.search_media import MEDIA
from benchmarks.accuracy.search_mixed import MIXED
from benchmarks.accuracy.search_models import MODELS
from benchmarks.accuracy.search_polarization import POLARIZATION
from benchmarks.accuracy.search_quantities import PROGRAMS, QUANTITIES, errors

BATCH, SURVIVORS = 256, 16
FUNCTIONS = (
    BOUNDARY_FUNCTIONS
    | LAYERS
    | MIXED
    | POLARIZATION
    | DIRECTIONS
    | APPROXIMATIONS
    | MODELS
    | MEDIA
    | BSDFS
    | FACETS
    | DEPTH
    | COLOUR
)


def random_points(random, size: int, dtype) -> list[np.ndarray]:
    """(c, n, k, m) over the whole domain, most of them beside a place where something cancels."""

    def decades(low, high):
        return 10.0 ** random.uniform(low, high, size)

    def chosen(*columns):
        return np.choose(random.integers(0, len(columns), size), columns)

    eps = float(np.finfo(dtype).eps)
    m = chosen(np.ones(size), random.uniform(1.0, 4.0, size), decades(-1.5, 1.5))
    n = chosen(
        random.uniform(0.05, 6.0, size), decades(-6.0, 8.0), decades(-1.0, 1.0),
        m * (1.0 + random.choice([-1.0, 1.0], size) * decades(-18.0, -0.5)),
    )  # fmt: skip
    k = chosen(np.zeros(size), decades(-30.0, 8.0), decades(-3.0, 1.0), n * decades(-9.0, 3.0))
    c = chosen(
        random.uniform(0.0, 1.0, size), decades(-12.0, 0.0), 1.0 - decades(-17.0, 0.0),
        np.sqrt(np.abs((1.0 - n / m) * (1.0 + n / m))), m / np.hypot(np.hypot(n, k), m),
        m / np.hypot(n, m),
    )  # fmt: skip
    aside = chosen(
        np.zeros(size), eps * random.integers(-16, 17, size) / 4.0,
        random.choice([-1.0, 1.0], size) * decades(-16.0, -0.5),
    )  # fmt: skip
    return _within_domain([c * (1.0 + aside), n, k, m], dtype)


def _within_domain(points, dtype):
    c, n, k, m = points
    k = np.where(k < 1e-30, 0.0, np.minimum(k, 1e8))
    points = [np.clip(c, 1e-12, 1.0), np.clip(n, 1e-6, 1e8), k, np.clip(m, 0.03, 30.0)]
    return [x.astype(dtype) for x in points]


def simpler(points, program: str):
    c, n, k, m = points
    left_out = PROGRAMS[program]
    return [c, n, 0 * k if 2 in left_out else k, 0 * m + 1 if 3 in left_out else m]


def moved(random, points, copies: int, dtype):
    """Each point with some of its arguments changed, by parts of 1e-17 to 3."""
    spread = [np.repeat(x, copies).astype(float) for x in points]
    size = len(spread[0])
    step = 10.0 ** random.uniform(-17.0, 0.5, size)
    for i, x in enumerate(spread):
        changed = random.random(size) < 0.6
        factor = 1.0 + step * random.standard_normal(size)
        spread[i] = np.where(changed, x * np.abs(factor), x)
    toward_one = random.random(size) < 0.2
    spread[0] = np.where(toward_one, 1.0 - step * np.abs(random.standard_normal(size)), spread[0])
    return _within_domain(spread, dtype)


def search(name, program, dtype, random, size, seconds=np.inf):
    """The largest error over its bound, and its point; a third of `size` is random."""
    end, done = time.monotonic() + seconds, 0
    best, places = np.zeros(0), [np.zeros(0, dtype)] * 4
    while done == 0 or (done < size and time.monotonic() < end):
        # the first third at random, then climbing with one new random batch of four
        if done < size / 3 or len(best) == 0 or random.random() < 0.25:
            points = random_points(random, BATCH, dtype)
        else:
            points = moved(random, places, BATCH // SURVIVORS, dtype)
        points = simpler(points, program)
        found = errors(name, program, points, dtype) / QUANTITIES[name].bound_at(points)
        done += BATCH
        best, places = (
            np.concatenate([best, found]),
            [np.concatenate(pair) for pair in zip(places, points, strict=True)],
        )
        order = np.argsort(-best, kind="stable")[:SURVIVORS]
        best, places = best[order], [x[order] for x in places]
    return best[0], tuple(x[0] for x in places), done


def _report(name, dtype, kind, error, bound, done, place) -> bool:
    """Prints a row; True if the bound is exceeded."""
    over = not error <= bound
    print(
        f"{name:36}{np.dtype(dtype).name:9}{kind:11}{error:10.4g} of {bound:<9.4g} "
        f"({done} points) at {', '.join(repr(float(x)) for x in place)}{'  ABOVE' * over}",
        flush=True,
    )
    return over


def _rows(only: str):
    """Every quantity, dtype, and program or derivative that is searched: (name, dtype, kind)."""
    for name in QUANTITIES:
        for dtype in (np.float64, np.float32):
            if only in name:
                yield from ((name, dtype, program) for program in PROGRAMS)
    for name, entry in FUNCTIONS.items():
        for dtype in entry.dtypes:
            if only in name:
                if entry.bound is not None:
                    yield name, dtype, "value"
                if entry.gradient_bound is not None:
                    yield name, dtype, "gradient"


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser("python -m benchmarks.accuracy.search", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--seed", type=int, help="left out: another one each time")
    parser.add_argument("--minutes", type=float, help="in all; left out: --points decides")
    parser.add_argument("--points", type=int, default=3_000, help="per quantity, dtype and program")
    parser.add_argument("--only", default="", help="quantities whose name contains this")
    given = parser.parse_args(arguments)
    seed = np.random.SeedSequence().entropy % 10**9 if given.seed is None else given.seed
    print(f"seed {seed}; errors in eps", flush=True)
    rows, missed = list(_rows(given.only)), 0
    if not rows:
        known = ", ".join([*QUANTITIES, *FUNCTIONS])
        parser.error(f"--only {given.only!r} is in no name; there are {known}")
    limited = given.minutes is not None
    end = time.monotonic() + 60.0 * given.minutes if limited else np.inf
    points = 10**9 if limited else given.points
    jax.config.update("jax_enable_x64", True)
    for i, (name, dtype, kind) in enumerate(rows):
        # An equal share of what is left; at least one batch, whatever compiling it took.
        seconds = (end - time.monotonic()) / (len(rows) - i)
        random = np.random.default_rng([seed, i])
        if kind in PROGRAMS:
            worst, place, done = search(name, kind, dtype, random, points, seconds)
            bound = float(QUANTITIES[name].bound_at(place))
        else:
            entry, gradient = FUNCTIONS[name], kind == "gradient"
            bound = entry.gradient_bound if gradient else entry.bound
            worst, place, done = search_functions.search(
                entry, gradient, dtype, random, points, seconds
            )
        missed += _report(name, dtype, kind, worst * bound, bound, done, place)
    print(f"{missed} of {len(rows)} bounds exceeded; seed {seed}")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
