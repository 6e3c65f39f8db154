"""One least-squares problem: rows, unknowns, targets, options; how it is run and evaluated."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any, NamedTuple

import numpy as np

from fitting.optics.spec import Spec
from fitting.problem.lanes import (
    LANES,
    MOST,
    SIFT,
    Ends,
    Limits,
    coordinate_bounds,
    run_lanes,
    with_fixed,
)
from fitting.problem.observations import Observations, squares_of
from fitting.problem.programs import SOLVER, Targets
from fitting.problem.slopes import Slopes, loss_of, prior_rows, slopes_at
from fitting.problem.unknowns import Unknowns, terms_of
from fitting.process.progress import heard, tell
from fitting.samples.dispersion import Model
from fitting.samples.parameters import Settings, value_and_slope

# See `Problem.lost`; BoxBOD of NIST is lost at 1e-38 of both.
_LOST, _NO_CHANGE = 1e-7, 1e-3
# Where the noise is found from the residuals of a lane, the lane ends that near to its minimum, in
# standard errors: with a robust loss a step is only several times shorter than the one before.
_SHARP = 1e-6


class Kept(NamedTuple):
    """What searches of the same measurements keep for each other.

    ends: the ends and the noise of a search, by all that these depend on. lowest: the lowest ends
    (8,) in each free unknown, by its name, of every search by `FitOptions.kept_as`.
    """

    ends: dict[Hashable, tuple[Ends, float]]
    lowest: dict[str, dict[str, np.ndarray]]


class FitOptions(NamedTuple):
    """The options of a fit other than those of its parameters.

    errors, intervals, loss, starts, start, seed: as `fitting.fit` has them. kept, kept_as: what
    other searches left, and where this one leaves its own. near: `kept_as` of the search whose
    lowest ends are of use here: of the same model with other weights or without a parameter of the
    instrument, or of the one with a term less. thorough: whether the search goes on where it may
    have missed the best minimum. See `search`. rtol: as in `fit_residuals`.
    """

    errors: str = "auto"
    intervals: str = "auto"
    loss: str = "squares"
    seed: int = 0
    kept: Kept | None = None
    starts: int | None = None
    start: Mapping[str, Any] | None = None
    kept_as: str = ""
    near: str | None = None
    thorough: bool = True
    rtol: float = SOLVER.rtol

    @property
    def scaled(self) -> bool:
        """Whether the errors of the parameters are multiplied by the scatter."""
        return self.errors != "stated"


class Problem:
    """One fit: everything that is the same in all its rounds."""

    def __init__(
        self, u: Unknowns, seen: Observations, targets: Targets, settings: Settings,
        asked: FitOptions, whole: Problem | None = None,
    ):  # fmt: skip
        # Of a fit of a part of the data: that of all, whose residuals and derivatives are taken,
        # since their program is compiled anyhow.
        self.whole = whole or self
        self.u, self.seen, self.targets, self.settings = u, seen, targets, settings
        self.asked = asked
        self.starts = 0
        self.n_data = len(seen.row)
        self.priors = sum(w.prior is not None for w in u.moving)
        self.dof = max(self.n_data + self.priors - int(u.free.sum()), 0)
        # Whether there are a robust loss or priors, and the noise that they need is to be found.
        self.weighed = u.spec.loss != "squares" or self.priors > 0
        self.by_noise = self.weighed and asked.scaled
        # The solver ends a lane at SOLVER.rtol**2 / (dof * sharper).
        rtol = min(asked.rtol, _SHARP) if self.weighed else asked.rtol
        self.sharper = (SOLVER.rtol / rtol) ** 2
        self.limits = coordinate_bounds(u.moving)
        self.lanes = LANES  # the number of starts that the search follows
        self.lowest = np.inf  # the cost of the best end that was reported
        self.fewer: np.ndarray | None = None  # the lowest ends (p, 8) of a model with a term less
        self.squares = float(squares_of(seen).sum())
        self.looked = 0  # how often residuals with their derivatives were formed, by `slopes`
        self.first: tuple[np.ndarray, Slopes] | None = None  # a start, of the caller's residuals

    def in_order(self, y: np.ndarray) -> np.ndarray:
        """Return y (p, L), the terms of each lane by rising resonance unless they are named."""
        names = self.u.own_names
        if any(n.rsplit("_", 1)[-1].isdigit() for n in self.settings.names):
            return y
        out, media = y.copy(), self.u.spec.media
        for place, model in zip(media.places, media.index, strict=True):
            groups = terms_of(names, f"{place}.")
            if len(groups) < 2 or not isinstance(model, Model) or model.is_sum:
                continue  # of a sum each term is what its name says
            key = next(i for i, n in enumerate(groups[0]) if ".resonance" in names[n])
            rows = np.array(groups)  # (terms, parameters of a term)
            if model.name == "sellmeier":
                rows = rows[:-1]  # the last one is on the other side of the spectrum
            order = np.argsort(y[rows[:, key]], axis=0, kind="stable")
            for column in rows.T:
                out[column] = np.take_along_axis(y[column], order, axis=0)
        return out

    def run(self, start: np.ndarray, noise: float, priors: bool = True) -> Ends:
        """Return the ends of the starts at this noise, terms in order.

        Of more than LANES starts the lowest after SIFT evaluations go on; then each goes on while
        it may become the best.
        """
        used = 0
        if start.shape[1] > LANES:
            start, used = self.held(start, noise, SIFT, priors=priors).lowest(LANES), SIFT
        self.lanes = start.shape[1]
        ends = self.held(start, noise, MOST, priors=priors, fit=np.zeros(self.lanes, int))
        return ends._replace(y=self.in_order(ends.y), evaluations=ends.evaluations + used)

    def _report(self, ends: Ends) -> None:
        """Report the best end so far, if somebody listens: the free parameters, and its misfit."""
        i = int(np.argmin(ends.cost))
        if not heard() or not ends.cost[i] < self.lowest:
            return
        self.lowest = ends.cost[i]
        pairs = zip(self.u.moving, ends.y[:, i], self.u.spec.moving, strict=True)
        values = [
            f"{self.u.labels[name]} {value_and_slope(w.parameter.coordinate, y)[0]:.4g}"
            for w, y, name in pairs if w.free
        ]  # fmt: skip
        misfit = self.lowest / max(self.dof, 1)
        size = f"chi2/dof {misfit:.3g}" if self.seen.stated else f"rms {np.sqrt(misfit):.2g}"
        tell(done=0, best=f"{', '.join(values[:4])}{', ...' * (len(values) > 4)} ({size})")

    def held(
        self, start: np.ndarray, noise: float, steps: int, limits: Limits | None = None,
        priors: bool = True, fit: np.ndarray | None = None,
    ) -> Ends:  # fmt: skip
        """Return where starts (p, S) are after so many evaluations.

        Terms stay in the order that they have. limits: bounds (p, S) of each start, if not those of
        all. priors: whether these count. fit: see `run_lanes`.
        """
        targets, count = self.targets._replace(noise=np.float64(noise)), start.shape[1]
        degrees = max(self.dof, 1.0) * self.sharper
        if not priors:
            targets = targets._replace(prior_weight=np.zeros_like(targets.prior_weight))
        ends = run_lanes(
            self.u.spec, lambda _: targets, start, limits or self.limits,
            np.full(count, degrees), np.full(count, self.squares / noise**2), steps, fit=fit,
        )  # fmt: skip
        if limits is None and noise == 1.0:
            self._report(ends)
        return ends

    def pinned(self, start: np.ndarray, row: Any, noise: float, steps: int) -> Ends:
        """Return `held`, of starts (p, S) of each of which one coordinate stays.

        row: which one, () or (S,).
        """
        limits = with_fixed(self.limits, start, row)
        return self.held(start, noise, steps, limits)

    def slopes(self, y: np.ndarray) -> Slopes:
        """Return residuals and derivatives at y, of all data."""
        self.looked += 1
        if not isinstance(self.u.spec, Spec):
            return self.u.spec.slopes(self.targets, y)
        whole = self.whole
        return slopes_at(whole.u.spec, whole.seen, whole.targets, y)

    def lost(self, s: Slopes, y: np.ndarray) -> np.ndarray:
        """Return which unknowns (p,) ran off to y, where the data do not change with them any more.

        The derivatives with respect to the parameter fell by _LOST on the way from the start, and
        all the way back would change the residuals by less than _NO_CHANGE of their size.
        """
        if self.first is None:
            return np.zeros(len(y), bool)
        begun, at_start = self.first
        kinds = [w.parameter.coordinate for w in self.u.moving]
        size, before = (
            np.linalg.norm(slopes.jacobian, axis=0)
            / [max(abs(value_and_slope(k, v)[1]), 1e-300) for k, v in zip(kinds, z, strict=True)]
            for slopes, z in ((s, y), (at_start, begun))
        )
        change = np.linalg.norm(s.jacobian, axis=0) * np.abs(y - begun)
        return (size < _LOST * before) & (change < _NO_CHANGE * np.linalg.norm(s.residual))

    def cost(self, s: Slopes, y: np.ndarray, noise: float) -> float:
        """Return the cost at y."""
        off, _ = prior_rows(self.u, y)
        return loss_of(self.u.spec.loss, s.residual / noise) + float(off @ off)

    def unit(self, cost: float) -> float:
        """Return a unit of chi2 where the lowest cost is ``cost``."""
        scatter = cost / max(self.dof, 1)
        return max(1.0, scatter) if self.seen.stated or not self.asked.scaled else scatter
