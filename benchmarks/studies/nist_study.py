"""How close fits from one start come to the certified values of NIST's nonlinear problems.

    python -m benchmarks.studies.nist_study --only MGH

27 problems from both starts of NIST, the first of them far away; the worst parameter, and the worst
standard error, to so many digits (at most 11, as many as are certified). Beside `fit_residuals`
with one start: `optimistix.least_squares` with its Levenberg-Marquardt method and the same
residuals. Evaluations are of residuals with their derivatives, of optimistix its steps.
"""

from __future__ import annotations

import argparse
import warnings
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from benchmarks.machine import conditions
from fitting import Fit, fit_residuals
from tests.truth.nist_strd import NistProblem, digits, nist_problems

# A start ends when its next step is shorter than so many standard errors; of optimistix rtol, atol.
RTOL, TOLERANCE, MAX_STEPS = 1e-8, 1e-10, 10_000
ENOUGH = 6.0  # digits

Row = tuple[str, int, float, float, str, int, float, str, int]


def fitted(problem: NistProblem, start: np.ndarray, **settings: Any) -> Fit:
    """Return the fit of a problem from one start (p,). settings: of `fit_residuals`."""
    at = dict(zip(problem.names, start.tolist(), strict=True))
    ranges = {name: (value, value) for name, value in at.items()}
    return fit_residuals(
        problem.residuals, ranges, problem.data, start=at, starts=1, intervals="quadratic",
        **settings,
    )  # fmt: skip


def rows_of(problem: NistProblem) -> list[Row]:
    """Return a row for each start, as `main` prints it."""
    solver = optx.LevenbergMarquardt(rtol=TOLERANCE, atol=TOLERANCE)
    out = []
    for number, start in enumerate(problem.starts, 1):
        ours = fitted(problem, start, rtol=RTOL)
        every = [ours.parameters[name] for name in problem.names]
        theirs = optx.least_squares(
            problem.residuals, solver, jnp.asarray(start), problem.data, max_steps=MAX_STEPS,
            throw=False,
        )  # fmt: skip
        done = bool(theirs.result == optx.RESULTS.successful)
        out.append((
            problem.name, number, digits([e.value for e in every], problem.certified),
            digits([e.sigma for e in every], problem.errors), str(ours.status),
            int(ours.evaluations), digits(theirs.value, problem.certified),
            "successful" if done else "not successful", int(theirs.stats["num_steps"]),
        ))  # fmt: skip
    return out


def main() -> None:
    """Print a row for each problem and start, and how many are right."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--only", default="", help="problems with such a text in their names")
    only = parser.parse_args().only
    print(conditions())
    print(f"{'':12}{'fit_residuals':^44}  {'optimistix':^30}")
    print(
        f"{'problem':9}{'':3}{'values':>7} {'errors':>7}  {'status':14}{'evaluations':>12}  "
        f"{'values':>7}  {'result':14}{'steps':>7}"
    )
    rows = []
    for name, problem in nist_problems().items():
        if only not in name:
            continue
        for row in rows_of(problem):
            rows.append(row)
            print(
                f"{row[0]:9} {row[1]} {row[2]:7.1f} {row[3]:7.1f}  {row[4]:14}{row[5]:12d}  "
                f"{row[6]:7.1f}  {row[7]:14}{row[8]:7d}", flush=True,
            )  # fmt: skip
    for who, column in (("fit_residuals", 2), ("optimistix", 6)):
        right = sum(row[column] >= ENOUGH for row in rows)
        print(f"{who}: {right} of {len(rows)} to {ENOUGH:g} digits")
    silent = sum(row[2] < ENOUGH and row[4] == "converged" for row in rows)
    print(f"wrong and said to have converged: {silent}")


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    warnings.simplefilter("ignore")
    main()
