"""The result of N fits of one kind from their minima, made in one place; N = 1 is a single fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import numpy as np

from fitting.outcomes.doubtful_index import of_solids
from fitting.outcomes.findings import contradicted_priors, findings_of_all, not_quadratic
from fitting.problem.problem import Problem
from fitting.problem.unknowns import Unknowns
from fitting.residuals.error_model import misses_without_freedom
from fitting.results import result_parts as status
from fitting.results.diagnostics import ranked
from fitting.results.result import FitData
from fitting.results.result_parts import Alternative, ErrorModel, Estimate
from fitting.samples.parameters import value_and_slope
from fitting.samples.sample import Sample
from fitting.uncertainty.covariance import Uncertainty
from fitting.uncertainty.intervals import QUADRATIC, Intervals, Minima, intervals, total_reflection
from fitting.uncertainty.limits import ROUNDING
from fitting.uncertainty.profile import Lanes

# So many of the other minima have intervals by profile, the rest quadratic ones.
_OTHERS = 3
# Without a degree of freedom several solutions may be exact, and side by side. An end of a lane is
# as many standard errors, for errors of 1, from one as the root of its cost: ends of one solution
# differ by less than the sum of both times this.
EXACT = 2.0


class Solutions(NamedTuple):
    """One minimum of each of the n fits ``which``, and what is known there.

    y (n, p); costs; sum of squares of the data in units of their errors and (n, C) of the
    unweighted residuals, with their numbers (n, C), by channel. reached: lanes that ended there.
    """

    which: np.ndarray
    y: np.ndarray
    known: Uncertainty
    cost: np.ndarray
    squares: np.ndarray
    plain: np.ndarray
    counts: np.ndarray
    reached: np.ndarray

    def of(self, some: np.ndarray) -> Solutions:
        """Return those of some places."""
        return jax.tree.map(lambda a: a[some], self)

    def put(self, some: np.ndarray, others: Solutions) -> None:
        """Take those of some places from others."""
        jax.tree.map(lambda mine, a: mine.__setitem__(some, a), self, others)


class Shaped:
    """The values of some of N fits in the batch shape, NaN or ``fill`` for the others."""

    def __init__(self, shape: tuple[int, ...], count: int, which: np.ndarray):
        self.shape, self.count, self.which = shape, count, which

    def __call__(self, values: np.ndarray, fill: Any = np.nan) -> Any:
        values = np.asarray(values)
        kind = object if values.dtype == object else np.result_type(values, type(fill))
        whole = np.full((self.count, *values.shape[1:]), fill, kind)
        whole[self.which] = values
        whole = whole.reshape(self.shape + values.shape[1:])
        return whole.item() if whole.ndim == 0 else whole


def parameters_at(u: Unknowns, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return parameters and their slopes dx/dy at y, each (..., p)."""
    both = [value_and_slope(w.parameter.coordinate, y[..., i]) for i, w in enumerate(u.moving)]
    x, slope = (np.stack(part, -1) for part in zip(*both, strict=True))
    return x, slope


def first_of(
    fit: Problem, outside: Any, y: np.ndarray, cost: np.ndarray, unit: Any, rounding: Any
) -> np.ndarray:
    """Return which of the T minima of n fits is to be shown first, (n,).

    y (T, n, p), cost (T, n): by rising cost, infinite for none. Noise decides which of them is the
    lowest. So the first one comes first whose indices are those of solids. At normal incidence N
    and eta_i^2 / N have the same reflectance: of those within one unit of chi2 one above eta_i is
    first. Of what only rounding tells apart the one that absorbs least is.
    """
    names, each = fit.u.spec.moving, np.arange(y.shape[1])
    solid = of_solids(fit, y.reshape(-1, y.shape[-1])).reshape(cost.shape)
    first = (solid & np.isfinite(cost)).argmax(0)
    indices = [i for i, name in enumerate(names) if name.endswith(".eta")]
    if len(indices) != 1:  # neither of the surface nor of a plate
        return first
    above = (y[..., indices[0]] >= outside) & (cost <= cost[first, each] + unit)
    first = np.where(above[first, each] | ~above.any(0), first, above.argmax(0))
    absorbs = [i for i, name in enumerate(names) if name.endswith(".k")]
    if not absorbs:
        return first
    alike = (cost <= cost[first, each] + rounding) & (above == above[first, each])
    return np.where(alike, y[..., absorbs[0]], np.inf).argmin(0)


def ranges_of(
    u: Unknowns, limits: Any, minima: Sequence[Solutions], t: np.ndarray, wanted: Any,
    critical: np.ndarray, at: Lanes, enough: float = -np.inf,
) -> list[Intervals]:  # fmt: skip
    """Return the intervals at the best minima of n fits, and at the second, third, ... of some.

    t: (n,), half of them in standard errors. critical: the largest index that reflects totally.
    enough: a cost that ends the search for them, if a place below it is met.
    """
    every = jax.tree.map(lambda *a: np.concatenate(a), *minima)
    turn = np.repeat(np.arange(len(minima)), [len(m.which) for m in minima])
    row = np.searchsorted(minima[0].which, every.which)
    found = intervals(u, limits, Minima(
        every.which, every.y, every.cost, every.known, t[row], ROUNDING * every.squares,
        np.where(turn > _OTHERS, QUADRATIC, np.broadcast_to(wanted, t.shape)[row]),
        total_reflection(u, every.y, critical[row]),
    ), at, enough)  # fmt: skip
    return [jax.tree.map(lambda a, i=i: a[turn == i], found) for i in range(len(minima))]


def _estimates(
    u: Unknowns, m: Solutions, known: Intervals, failed: np.ndarray, put: Shaped
) -> tuple[dict[str, Estimate], np.ndarray]:
    """Return the free parameters at n minima by name, and their covariance (n, P, P).

    failed: (n,), of which fits the values mean nothing.
    """
    x, slope = parameters_at(u, m.y)
    unseen = m.known.unseen_of | failed[:, None]
    covariance = m.known.covariance * (slope[:, :, None] * slope[:, None, :])
    # What is compatible with 0 has a limit, and no standard error, which would not be one.
    none = unseen | np.isfinite(known.limits)
    blank = ~np.isfinite(covariance) | none[:, :, None] | none[:, None, :]
    covariance = np.where(blank, np.nan, covariance)
    sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    ends = np.where(failed[:, None, None], np.nan, known.ends)
    limits = np.where(failed[:, None], np.nan, known.limits)
    kinds = np.where(np.isnan(ends).any(-1), status.NONE, known.kind)
    states = np.select(
        [unseen, m.known.at_bound == "low", m.known.at_bound == "high"],
        [status.UNDETERMINED, status.AT_LOWER, status.AT_UPPER], status.FITTED,
    )  # fmt: skip
    out = {}
    for i in np.flatnonzero(u.free):
        inside = u.spec.moving[i]
        name = u.labels[inside]
        out[name] = Estimate(
            name=name, unit=u.units[inside], value=put(x[:, i]), sigma=put(sigma[:, i]),
            interval=put(ends[:, i]), interval_kind=put(kinds[:, i], status.NONE),
            upper_limit=put(limits[:, i]), status=put(states[:, i], status.UNDETERMINED),
        )  # fmt: skip
    return out, covariance[:, u.free][:, :, u.free]


def without_errors(m: Solutions, where: Any) -> Solutions:
    """Return the minima, of whose parameters (...) none has an error where that is so."""
    unseen = m.known.unseen_of | np.asarray(where)[..., None]
    return m._replace(known=m.known._replace(unseen_of=unseen))


def too_few(u: Unknowns, sample: Sample | None, n_data: Any) -> Any:
    """Return which fits of an index that is free at every wavelength have too few data.

    With k at 0, the end of its range, a single datum would seem to determine eta.
    """
    return (n_data < u.free.sum()) & (sample is not None and sample.by_wavelength)


def _unseen(u: Unknowns, known: Uncertainty, put: Shaped) -> Iterator[tuple[Any, Any]]:
    """Yield which of n fits have a first combination that is not seen, a second, ..., and names."""
    count = known.hidden.sum(1)
    for turn in range(count.max(initial=0)):
        names = np.empty(len(count), object)
        for i in np.flatnonzero(count > turn):
            direction = np.abs(known.directions[i][:, known.hidden[i]][:, turn])
            parts = direction > 0.1 * direction.max()
            names[i] = tuple(
                u.labels[n] for n, part in zip(u.spec.moving, parts, strict=True) if part
            )
        yield put(count > turn, False), put(names)


def _fixed_and_tied(u: Unknowns, y: np.ndarray, free: dict[str, Estimate]) -> dict[str, Estimate]:
    """Return the parameters that were fixed or tied, by name. y: (p,), of one fit."""
    x, _ = parameters_at(u, y)
    values = {n: float(v) for n, v in zip(u.spec.moving, x, strict=True)}
    values |= {n: float(v) for n, v in zip(u.spec.held, u.held, strict=True)}
    every, out = {}, {}
    for inside, value in values.items():
        name = u.labels.get(inside, "")
        every[inside] = free.get(name) or Estimate(
            name=name, unit=u.units.get(inside, ""), value=value, sigma=0.0,
            interval=np.array([value, value]), interval_kind=status.NONE, status=status.FIXED,
        )  # fmt: skip
        if name and name not in free:
            out[name] = every[inside]
    for inside, factor, of in u.spec.tied:
        name, e = u.labels[inside], every[of]
        out[name] = replace(
            e, name=name, unit=u.units[inside], value=factor * e.value,
            sigma=abs(factor) * e.sigma, interval=np.sort(factor * e.interval),
            upper_limit=np.nan, status=status.TIED,
        )  # fmt: skip
    return out


@np.errstate(all="ignore")
def result_of(
    fit: Problem, sample: Sample | None, put: Shaped, minima: Sequence[Solutions],
    ranges: Sequence[Intervals], *, scatter: np.ndarray, failed: np.ndarray, dof: np.ndarray,
    n_data: np.ndarray, starts: np.ndarray, evaluations: np.ndarray, known_um: np.ndarray,
    kinds: tuple[str, ...], missed_noise: np.ndarray, chi2: Any = None, reduced: Any = None,
    open_: Any = False, **more: Any,
) -> FitData:  # fmt: skip
    """Return the result of N fits.

    put: gives values of the n fits with data the shape of all. minima, ranges: the best minimum of
    each of these, the second of some, ... scatter: (n,), the unit of a rise of chi2. failed: which
    have no minimum. known_um: (W,) or (N, W) wavelengths. kinds: of residuals. missed_noise: that
    of data over the angle that a fit misses by more, else NaN. chi2, reduced: (n,), that by dof
    without outliers, if not as the cost has it. open_: of which fits many indices fit alike. more:
    as in `FitData`.
    """
    u, m, stated, scaled = fit.u, minima[0], fit.seen.stated, fit.asked.scaled
    chi2 = m.cost if chi2 is None else chi2
    plain, rows = m.plain.sum(1), m.counts.sum(1)
    unseen = m.known.hidden.any(1)
    missed = misses_without_freedom(chi2, plain, rows, dof, stated) & ~(failed | unseen)
    missed &= (stated or sample is not None) and not u.spec.priors
    failed = (failed | missed) & ~np.asarray(open_)
    free, covariance = _estimates(u, m, ranges[0], failed, put)
    others = list[Alternative]()
    for other, known in zip(minima[1:], ranges[1:], strict=True):
        row = np.searchsorted(m.which, other.which)
        there = Shaped(put.shape, put.count, other.which)
        rise = np.where(failed[row], np.nan, (other.cost - m.cost[row]) / scatter[row])
        others.append(Alternative(
            parameters=_estimates(u, other, known, failed[row], there)[0], delta_chi2=there(rise),
            reached=there(other.reached.astype(float)),
        ))  # fmt: skip
    state = np.where(failed, status.NOT_CONVERGED, np.where(
        unseen | too_few(u, sample, n_data), status.UNDETERMINED, status.CONVERGED
    ))  # fmt: skip
    by_dof = np.where((dof > 0) & stated, chi2 / np.maximum(dof, 1), np.nan)
    waves = np.broadcast_to(known_um, (*put.shape, known_um.shape[-1]))
    waves = waves[..., 0] if waves.shape[-1] == 1 else waves
    # Without a degree of freedom only the stated errors are available.
    own = np.where((dof > 0) & scaled, "scaled", "stated") if stated else np.full(len(dof), "equal")
    size = np.sqrt(np.broadcast_to(m.known.variance, dof.shape))
    rms_of = np.sqrt(m.plain / m.counts).T
    found = FitData(
        sample=sample, parameters=free | _fixed_and_tied(u, m.y[0], free),
        covariance=np.asarray(put(covariance)), wavelength_um=waves if waves.ndim else waves.item(),
        chi2=put(chi2 if stated else np.full(len(dof), np.nan)), chi2_reduced=put(by_dof),
        dof=put(dof, 0), n_data=put(n_data, 0), rms=put(np.sqrt(plain / rows)), cost=put(m.cost),
        status=put(state, status.NO_DATA),
        rms_of=dict(zip(kinds, map(put, rms_of), strict=True)),
        n_of={kind: put(n, 0) for kind, n in zip(kinds, m.counts.T, strict=True)},
        errors=ErrorModel(
            taken=put(own, "scaled" if stated else "equal"), factor=put(size),
            added=put(np.zeros(len(dof))), stated=stated, widened=put(np.ones(len(dof))),
        ),
        evaluations=put(evaluations, 0), others=tuple(others),
        starts=put(starts, 0), reached=put(np.minimum(m.reached, starts), 0),
        loss=u.spec.loss, **more,
    )  # fmt: skip
    told = findings_of_all(
        found, found.chi2_reduced if reduced is None else put(reduced), put(missed, False),
        _unseen(u, m.known, put), put(missed_noise),
    )  # fmt: skip
    quadratic = put(ranges[0].quadratic[:, u.free])
    told = [*told, *contradicted_priors(u, free, found.status), *not_quadratic(free, quadratic)]
    return replace(found, findings=ranked(told))
