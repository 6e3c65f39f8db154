"""From where the lanes of many curves ended to one result of their batch shape."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import jax
import numpy as np
from scipy.special import chdtrc

from fitting.outcomes.outcome import (
    EXACT,
    Shaped,
    Solutions,
    first_of,
    ranges_of,
    result_of,
    too_few,
    without_errors,
)
from fitting.outcomes.surface_verdicts import marked, verdicts_of_batch
from fitting.problem.curve_lanes import measured_rows, shown_at, slopes
from fitting.problem.evaluation import Alike, EachFit, Evaluated
from fitting.problem.slopes import prior_rows
from fitting.problem.solver import NO_NOISE
from fitting.residuals.noise import noise_of_misfits
from fitting.results.diagnostics import Finding, ranked
from fitting.results.result import FitData
from fitting.results.result_parts import CONVERGED, MISFIT
from fitting.samples.sample import Sample
from fitting.searching.batch_search import BatchSearch
from fitting.searching.minima import SAME_CHI2, scatters
from fitting.uncertainty.covariance import uncertainty
from fitting.uncertainty.intervals import QUADRATIC
from fitting.uncertainty.likelihood import reduced_chi2
from fitting.uncertainty.limits import ROUNDING, student_quantiles
from fitting.uncertainty.profile import Lanes

# Undamped steps after the solver, and the part of a standard error below which one is taken without
# being looked at: what is left after a step is a thousandth of it.
_STEPS, _SMALL = 3, 1e-2
# Residuals of a curve are looked at only if the squares of the sums of four side by side are
# together so many times the sum of the squares. That is 1 for noise (above 1.7 in .4 % of fits of
# 50 to 100 data) and 2.5 for a smooth misfit as large as the noise. Steps of derivatives then.
_ALIKE, _STEP = 1.7, 1e-5
# What residuals of many curves have in common is looked for in so many of them; in fewer than the
# least it is not, nor told if it adds less than this to chi2 of each curve, or chance gives it.
_COMPARED, _LEAST_COMPARED, _SHARED, _CHANCE = 1000, 30, 1.0, 1e-6
# Two ends are two minima if some parameter differs by so many standard errors: lanes end within a
# few hundredths of one. With 4 a fifth of the other minima of R_p were taken for the best one.
_APART = 1.0
# Without a degree of freedom lanes that end at k = 0 with a misfit stop within 1e-4 of the cost.
_LEVEL = 2e-4


def _at(
    search: BatchSearch, which: np.ndarray, y: np.ndarray, pooled: Any
) -> tuple[Solutions, np.ndarray, np.ndarray]:
    """Return what is known of the curves ``which`` (n,) at y (p, n), `Slopes.together` there.

    And the cost after a step, (n,).
    """
    job, curves = search.job, search.curves
    at = slopes(job.u.spec, curves, y, which)
    known = uncertainty(
        job.u, at.triangle[..., -1], at.triangle[..., :-1], y.T, search.limits, 1.0,
        search.dof[which], job.asked.scaled, curves.stated[which], curves.squares[which], pooled,
    )  # fmt: skip
    off, lines = prior_rows(job.u, y.T)
    rows = np.concatenate([at.triangle[..., :-1], lines], -2)
    cost, fall = at.cost + np.vecdot(off, off), (rows @ known.step[..., None])[..., 0]
    found = Solutions(
        which, y.T, known, cost, curves.squares[which], at.plain, at.counts,
        np.zeros(len(which), int),
    )  # fmt: skip
    # `put` writes to it
    return jax.tree.map(np.array, found), at.together, cost - np.vecdot(fall, fall)


def _beside(
    search: BatchSearch, which: np.ndarray, y: np.ndarray, pooled: Any
) -> tuple[Solutions, np.ndarray]:
    """Return the minima of the curves ``which`` (n,) next to the ends y (p, n) of lanes.

    And `Slopes.together` there, (n,).
    """
    low, high = (a[:, None] for a in search.limits)
    out, together, promised = _at(search, which, y, pooled)
    together, go = together.copy(), np.arange(len(which))
    # Steps are of least squares; lanes of a robust loss ended at the minimum.
    for _ in range(_STEPS if search.job.u.spec.loss == "squares" else 0):
        here = out.of(go)
        step, error = here.known.step, here.known.edge * np.sqrt(here.known.variance)[:, None]
        whole = (here.y + step).T
        ahead = np.clip(whole, low, high)
        # Without a known scatter every step is looked at, and so is one that a bound cuts: of two
        # unknowns that change together only one may go on.
        far = ((step != 0.0) & ~(np.abs(step) <= _SMALL * error)).any(1)
        far |= (ahead != whole).any(0)
        out.y[go[~far]], out.cost[go[~far]] = ahead[:, ~far].T, promised[~far]
        go, cost = go[far], here.cost[far]
        if not len(go):
            break
        there, new, promised = _at(search, which[go], ahead[:, far], pooled)
        lower = there.cost < cost
        go, promised = go[lower], promised[lower]
        out.put(go, there.of(lower))
        together[go] = new[lower]
    return out, together


def _minima(
    search: BatchSearch, which: np.ndarray, pooled: float | None
) -> tuple[list[Solutions], np.ndarray, np.ndarray]:
    """Return the best minima of the curves ``which``, others that fit nearly as well; the scatter.

    The others: the second of all curves that have one, the third, ... scatter: (N,), the unit of a
    rise of the cost. And `Slopes.together` of the best ones.
    """
    job, best = search.job, search.best
    of_lane, ends = search.lanes
    scatter, most = scatters(
        best.cost, search.dof, job.asked.scaled,
        search.curves.stated | (search.curves.noise != 1.0), pooled,
    )  # fmt: skip
    done = np.flatnonzero(ends.done & np.isfinite(ends.cost))
    left = done[np.lexsort((ends.cost[done], of_lane[done]))]
    out, some, y, cost = list[Solutions](), which, best.y[:, which], best.cost[which]
    rounding, same, of_noise = np.zeros_like(scatter), scatter, scatter[which]
    while len(some):
        m, together = _beside(search, some, y, pooled)
        if not out:
            of_noise = together
            rounding[which] = ROUNDING * m.squares
            level = np.where(search.dof == 0, _LEVEL * best.cost, 0.0)
            same = SAME_CHI2 * scatter + rounding + level
            left = left[(ends.cost - (best.cost + most + rounding)[of_lane])[left] <= 0.0]
        row, lane = np.searchsorted(some, of_lane[left]), of_lane[left]
        exact = (search.dof == 0)[lane] & (ends.cost[left] <= (SAME_CHI2 * scatter)[lane])
        own = EXACT * (np.sqrt(ends.cost[left]) + np.sqrt(cost[row])) + np.sqrt(rounding)[lane]
        apart = np.where(exact, own, _APART * np.sqrt(scatter + rounding)[lane])
        width = apart[:, None] * m.known.edge[row]
        width = np.where(np.isfinite(width), width, np.inf) + 1e-6 * np.abs(y.T[row])
        near = (np.abs(ends.y[:, left].T - y.T[row]) <= width).all(1)
        alike = near & (ends.cost[left] - cost[row] <= same[some[row]])
        out.append(m._replace(reached=np.bincount(row[alike], minlength=len(some))))
        left = left[~near]
        some, first = np.unique(of_lane[left], return_index=True)
        y, cost = ends.y[:, left[first]], ends.cost[left[first]]
    if len(out) > 1:
        _show_first(search, out, scatter, rounding)
    return out, scatter, of_noise


def _show_first(
    search: BatchSearch, minima: list[Solutions], scatter: np.ndarray, rounding: np.ndarray
) -> None:
    """Bring the minimum of each curve that `first_of` names before its others."""
    some = minima[1].which
    y = np.repeat(minima[0].y[None, np.searchsorted(minima[0].which, some)], len(minima), 0)
    cost = np.full(y.shape[:2], np.inf)
    for turn, m in enumerate(minima):
        mine = np.isin(m.which, some)
        at = np.searchsorted(some, m.which[mine])
        y[turn, at], cost[turn, at] = m.y[mine], m.cost[mine]
    first = first_of(search.job, search.curves.outside[some], y, cost, scatter[some],
                     rounding[some])  # fmt: skip
    for turn in reversed(range(1, len(minima))):
        which = some[first >= turn]
        here, there = (np.searchsorted(m.which, which) for m in minima[turn - 1 : turn + 1])
        before, after = minima[turn - 1].of(here), minima[turn].of(there)
        minima[turn - 1].put(here, after)
        minima[turn].put(there, before)


def _noise_of_misfits(search: BatchSearch, m: Solutions, together: np.ndarray) -> np.ndarray:
    """Return the noise of curves over the angle that are missed by more, (n,), else NaN.

    Looked at are those whose residuals are alike side by side, or where angles are in no order.
    """
    spec, curves, out = search.job.u.spec, search.curves, np.full(len(m.which), np.nan)
    rows = np.unique(curves.seen.row)
    steps = np.diff(curves.of_points("angle_deg", m.which)[:, rows], axis=1)
    ordered = (steps >= 0.0).all(1) | (steps <= 0.0).all(1)
    some = np.flatnonzero((together > _ALIKE * m.cost) | ~ordered)
    if not len(some):
        return out
    y, which = m.y[some], m.which[some]
    targets, angle = curves.targets(which), curves.of_points("angle_deg", which)
    weight, value = (np.moveaxis(np.stack(a), -1, 0) for a in (targets.weights, targets.values))
    fitted = shown_at(spec, curves, y.T, which)

    def slopes_of(rows: np.ndarray) -> np.ndarray:
        at, step = y[rows], _STEP * (1.0 + np.abs(y[rows]))
        parts = [shown_at(spec, curves, (at + step * e).T, which[rows]) - fitted[rows]
                 for e in np.eye(y.shape[1])]  # fmt: skip
        return np.stack(parts, -1)

    out[some] = noise_of_misfits(angle, value, fitted - value, weight, slopes_of)
    return out


@np.errstate(all="ignore")
def _shared_misfit(search: BatchSearch, m: Solutions) -> float:
    """Return by how much chi2 of each curve is larger by residuals that are alike in all; else 0.

    Noise averages out over the curves, and what the sample or the instrument leaves does not: a
    gain of .3 % that raised chi2/dof of films by .1, as chance does, shifted thicknesses by up to
    40 of their standard errors.
    """
    curves, spec = search.curves, search.job.u.spec
    some = np.flatnonzero(search.best.done[m.which] & (m.cost > NO_NOISE * m.squares))
    some = some[:: max(-(-len(some) // _COMPARED), 1)]
    if len(some) < _LEAST_COMPARED or {"angle_deg", "wavelength_um"} & {*curves.own}:
        return 0.0
    measured, used = measured_rows(spec, curves.targets(m.which[some]))
    shown = np.moveaxis(shown_at(spec, curves, m.y[some].T, m.which[some]), 0, -1)
    off = np.where(used, shown - measured, np.nan).reshape(-1, len(some))
    count = np.isfinite(off).sum(1)
    off, count = off[count >= _LEAST_COMPARED], count[count >= _LEAST_COMPARED]
    share = np.nanmean(off, 1) ** 2 / np.nanvar(off, 1, ddof=1)
    rise = float((share - 1.0 / count).sum())
    by_chance = chdtrc(len(count), (share * count).sum()) if len(count) else 1.0
    return rise if rise > _SHARED and by_chance < _CHANCE else 0.0


@np.errstate(all="ignore")
def fit_of_batch(
    search: BatchSearch, shape: tuple[int, ...], sample: Sample, pooled: float | None = None,
    known: np.ndarray | None = None,
) -> FitData:  # fmt: skip
    """Return the result of N curves, of which all lanes have ended.

    pooled: the scatter of all curves, where each has too few data to estimate its own. known: the
    wavelengths, if not those of the points: NaN for none.
    """
    job, curves, best, u = search.job, search.curves, search.best, search.job.u
    which, (lanes_of, _) = np.flatnonzero(search.known), search.lanes
    put = Shaped(shape, curves.count, which)
    minima, scatter, together = _minima(search, which, pooled)
    m, dof, n_data = minima[0], search.dof[which], curves.n_data[which]
    if known is None:
        known = np.unique(job.seen.points.wavelength_um[job.seen.measured, 0])
    noise = np.full(len(which), np.nan)
    if u.spec.only_powers and (len(known) == 1 or "wavelength_um" in curves.own):
        noise = _noise_of_misfits(search, m, together)
    units, weighed = scatter[which], dict[str, Any]()
    if job.weighed:  # chi2 is that of all residuals, whatever the loss, and without priors
        size = np.broadcast_to(curves.noise, curves.count)[which]
        off = slopes(u.spec, curves, m.y.T, which).triangle[..., -1]
        square = np.vecdot(off, off)
        units, _ = scatters(square, dof, job.asked.scaled, curves.stated[which])
        reduced = reduced_chi2(u.spec.loss, off * size[:, None], dof)
        reduced = np.where(job.seen.stated, reduced, np.nan)
        weighed = {"noise": put(size), "chi2": square * size**2, "reduced": reduced}
    told = verdicts_of_batch(search, m, units)
    open_ = np.zeros(len(which), bool)  # indices that fit alike, of which profiles tell the range
    if told is not None:
        asked, verdicts, y = told
        new = np.flatnonzero((y != m.y[asked]).any(1))
        if len(new):
            m.put(asked[new], _at(search, which[asked[new]], y[new].T, pooled)[0])
        others = [o.of(~np.isin(o.which, which[asked[verdicts.open]])) for o in minima[1:]]
        minima = [m, *(o for o in others if len(o.which))]
        open_[asked] = verdicts.open & np.isfinite(verdicts.eta)
        open_ &= np.isfinite(m.cost)
    failed = ~best.done[which] | ~np.isfinite(m.cost)
    blank = too_few(u, sample, n_data) | open_
    minima = [without_errors(o, blank[np.searchsorted(which, o.which)]) for o in minima]
    m = minima[0]
    t = student_quantiles(dof * (job.asked.scaled and pooled is None))
    wanted = np.where(failed & ~open_, QUADRATIC, job.asked.intervals)
    ranges = ranges_of(u, search.limits, minima, t, wanted, curves.critical[which],
                       Lanes(search.pinned, curves.width))  # fmt: skip
    # The search for the ends of an interval may meet a lower minimum.
    least = best.cost.copy()
    for o in minima:
        np.minimum.at(least, o.which, o.cost)
    least[which] -= SAME_CHI2 * scatter[which] + ROUNDING * m.squares
    every = np.concatenate([o.which for o in minima])
    lowest, place = (np.concatenate([r.lowest[i] for r in ranges]) for i in (0, 1))
    lower = (~failed | open_)[np.searchsorted(which, every)] & (lowest < least[every])
    if lower.any():
        search.run(place[lower].T, every[lower])
        if (best.done & (best.cost < least)).any():
            return fit_of_batch(search, shape, sample, pooled, known)
    pattern = Evaluated(
        sample, u, job.seen, job.targets, m.y[0], m.known.covariance[0], known,
        inside=(np.empty((0, u.size)), 1.96),
    )  # fmt: skip
    of_each = Shaped((curves.count,), curves.count, which)
    inside = of_each(ranges[0].inside), of_each(t)
    fits = result_of(
        job, sample, put, minima, ranges, scatter=scatter[which], failed=failed, dof=dof,
        # Pixels begin where others ended, which are no starts of their own.
        n_data=n_data, starts=np.bincount(lanes_of, None, curves.count)[which] * bool(curves.own),
        evaluations=best.evaluations[which], known_um=known, kinds=u.spec.channels,
        missed_noise=noise, open_=open_, evaluator=EachFit(
            Alike(pattern, of_each(m.y), of_each(m.known.covariance), inside), shape
        ), **weighed,
    )  # fmt: skip
    if shared := _shared_misfit(search, m):
        all_ended = np.isin(fits.status, (CONVERGED, MISFIT))
        values = {"rise": shared, "measured": (*u.spec.channels,)}
        new = Finding("alike", all_ended, values)
        fits = replace(fits, findings=ranked([*fits.findings, new]))
    if told is None:
        return fits
    return marked(fits, verdicts, Shaped(shape, curves.count, which[asked]))
