"""Starts that are followed as long as they may be worth it; the last steps of the lowest lane."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from fitting.problem.lanes import STAGE, Ends, best_of, joined
from fitting.problem.problem import Problem
from fitting.problem.slopes import Slopes, prior_rows
from fitting.problem.solver import NO_NOISE
from fitting.searching.minima import SAME_CHI2
from fitting.uncertainty.covariance import End, uncertainty_at

# Number of undamped steps that are tried, and of evaluations along a curved valley.
_STEPS, _EVALUATIONS = 3, 200
# The same of a start that was lost: NIST's MGH17 takes 940. It was if the error of a parameter is
# so many times the way from its start: a million times for Eckerle4, up to 84 where all is well.
_FROM_START, _FAR = 2000, 1e3
# A step is not taken if its expected decrease of chi2 is smaller than this.
_FALL = 1e-4
# The last steps of a lane that was stopped on its way are made so many times at most.
_TIMES = 8
# Largest number of stages of STAGE evaluations of starts that are followed, and the number of
# evaluations after which each is looked at.
STAGES_ON, _LOOK = 8, STAGE // 2


def followed(fit: Problem, start: np.ndarray, noise: float, best: float) -> Ends:
    """Return the ends of starts (p, S); those that will hardly become the best stop on the way.

    best: the best cost known; where it is infinite, none stops. A start goes on if it fell by more
    in its last STAGE evaluations than it is above the best. One at the right order of the fringes
    was at 1279, 645 and 521 after three stages and ended at 488, where the best known was 516.
    """
    ends = fit.held(start, noise, _LOOK)
    # How far each fell in its last two looks, which are a stage.
    falls = np.full((2, len(ends.cost)), np.inf)
    for look in range(STAGES_ON * STAGE // _LOOK):
        live = np.flatnonzero(~ends.done & (ends.cost < best + falls.sum(0)))
        if not len(live):
            break
        before = ends.cost[live]
        ends.put(live, fit.held(ends.y[:, live], noise, _LOOK))
        # a cost may become infinite
        falls[look % 2, live] = np.maximum(before - ends.cost[live], 0.0)
    return ends._replace(y=fit.in_order(ends.y))


def down_the_valley(fit: Problem, ends: Ends, noise: float) -> Ends:
    """Return the ends, and where the lowest of them leads if it was stopped on its way.

    In a narrow, curved valley a lane may need thousands of evaluations. It is not at rest then, and
    may yet be far below every lane that is.
    """
    for _ in range(_TIMES):
        lane, best = int(np.argmin(ends.cost)), best_of(ends)
        enough = np.inf
        if best is not None:
            enough = float(ends.cost[best] - SAME_CHI2 * fit.unit(ends.cost[best]))
        if ends.done[lane] or not ends.cost[lane] < enough:
            break
        used = int(ends.evaluations[lane]) - fit.looked
        y, _ = polished(fit, ends.y[:, lane], noise)
        more = fit.held(y[:, None], noise, STAGE)
        more.evaluations[:] += used + fit.looked
        ends = joined([ends, more])
        if int(np.argmin(ends.cost)) == lane:
            break
    return ends


def brought_to_rest(fit: Problem, ends: Ends, noise: float) -> Ends:
    """Return `down_the_valley`; if the best start was lost, from where short steps of it lead.

    The first steps of lanes are long, since other starts make up for one that is lost; those of a
    trust region are not, whose radius begins with the size of the start. (BoxBOD, MGH17, Eckerle4
    and MGH10 of NIST from their far starts.) What is not at rest even then is not done.
    """
    best = best_of(ends)
    fine = best is not None and not any(_stuck_or_far(fit, ends.y[:, best], noise))
    if fine or fit.u.spec.loss != "squares" or fit.first is None:
        return down_the_valley(fit, ends, noise)
    lane = int(np.argmin(ends.cost))
    used = int(ends.evaluations[lane]) - fit.looked
    y, _ = _along_the_valley(fit, *fit.first, noise, _FROM_START)
    more = fit.held(y[:, None], noise, STAGE)
    more.evaluations[:] += used + fit.looked
    lowest = down_the_valley(fit, more if more.cost[0] < ends.cost[lane] else ends, noise)
    stuck = np.array([_stuck_or_far(fit, y, noise)[0] for y in lowest.y.T])
    return lowest._replace(done=lowest.done & ~stuck)


def _stuck_or_far(fit: Problem, y: np.ndarray, noise: float) -> tuple[bool, bool]:
    """Return whether a lane stopped at y (p,) since no step succeeds, and whether it went too far.

    The undamped step promises a large part of the cost where every step fails until none is left.
    Too far is where a parameter has no effect, or an error of many times the way from its start.
    Where derivatives of the caller's function are not finite no step is known.
    """
    begun, s = fit.first[0] if fit.first else y, fit.slopes(y)
    if not s.finite:
        return True, True
    cost, known = fit.cost(s, y, noise), uncertainty_at(fit, s, y, noise)
    promised = float(np.sum((s.jacobian @ known.step / noise) ** 2))
    stuck = promised > 0.5 * cost > NO_NOISE * fit.squares / noise**2
    unknown = np.diagonal(known.covariance) > (_FAR * (y - begun)) ** 2  # NaN of what is held
    return stuck, bool((unknown | fit.lost(s, y)).any())


def polished(fit: Problem, y: np.ndarray, noise: float) -> tuple[np.ndarray, Slopes]:
    """Return the minimum next to y (p,), along a curved valley too, and the derivatives there."""
    s = fit.slopes(y)
    if fit.u.spec.loss != "squares" or not s.finite:
        return y, s
    cost = fit.cost(s, y, noise)
    for _ in range(_STEPS):
        step = uncertainty_at(fit, s, y, noise).step
        trial = np.clip(y + step, *fit.limits)
        there = fit.slopes(trial)
        found = fit.cost(there, trial, noise)
        if not (found < cost and np.isfinite(there.jacobian).all()):
            # the unit of chi2: that of the stated errors, else from the scatter
            unit = cost / max(fit.dof, 1) if fit.asked.scaled else 1.0
            if float(np.sum((s.jacobian @ step / noise) ** 2)) > _FALL * unit:
                return _along_the_valley(fit, y, s, noise)
            break
        y, s, cost = trial, there, found
    return y, s


def _along_the_valley(
    fit: Problem, y: np.ndarray, s: Slopes, noise: float, evaluations: int = _EVALUATIONS
) -> tuple[np.ndarray, Slopes]:
    """Return the bottom of a curved valley, in which an undamped step leads up its side.

    The solver of many lanes stops there once every damped step is expected to lower chi2 by less
    than 1e-4; some hundred such steps lowered it by up to .02.
    """
    from scipy.optimize import least_squares  # slow to import, seldom needed

    low, high = fit.limits
    inside = fit.u.free & (y > low) & (y < high)
    if not inside.any():
        return y, s
    seen: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def at(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return residuals and derivatives, formed once where both are asked for."""
        if x.tobytes() not in seen:
            z = y.copy()
            z[inside] = x
            here = fit.slopes(z)
            off, lines = prior_rows(fit.u, z)
            r = np.concatenate([here.residual / noise, off])
            rows = np.concatenate([here.jacobian / noise, lines])[:, inside]
            seen.clear()
            # The method steps back from residuals that are NaN, but not from derivatives that are.
            seen[x.tobytes()] = (r if np.isfinite(rows).all() else np.full_like(r, np.nan)), rows
        return seen[x.tobytes()]

    with np.errstate(all="ignore"):
        found = least_squares(
            lambda x: at(x)[0], y[inside], jac=cast(Any, lambda x: at(x)[1]),
            bounds=(low[inside], high[inside]), x_scale="jac", ftol=1e-8, max_nfev=evaluations,
        )  # fmt: skip
    lower = y.copy()
    lower[inside] = found.x
    there = fit.slopes(lower)
    if fit.cost(there, lower, noise) < fit.cost(s, y, noise):
        return lower, there
    return y, s


def refined(fit: Problem, y: np.ndarray, noise: float, polish: bool = True) -> End:
    """Return the minimum next to y, the end of a lane, and its errors.

    polish: take the last steps, too.
    """
    y, s = polished(fit, y, noise) if polish else (y, fit.slopes(y))
    finite = s.finite and bool(np.isfinite(y).all())
    if not finite:
        s = s._replace(jacobian=np.zeros_like(s.jacobian), residual=np.zeros_like(s.residual))
    return End(y, s, uncertainty_at(fit, s, y, noise), fit.cost(s, y, noise), finite)
