"""eta and k wavelength by wavelength from R, T, psi and Delta, of an interface or a slab.

`fitting.fit` does this for the reflectance of a bare interface, with a method made for it. Here
every wavelength is a small model fit of its own, with the starts of all wavelengths as lanes of one
program.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fitting.bare_surface.region_intervals import QUADRATIC
from fitting.dispersion import Model
from fitting.measurement import Measurement
from fitting.model.fit import check_choices, targets_of
from fitting.model.point_result import PointFits as PointFits
from fitting.model.result import CONVERGED, UNDETERMINED, ModelFit
from fitting.observations import observations
from fitting.observe import SLAB
from fitting.outcome import model_fit_of
from fitting.parameters import Settings
from fitting.problem import Targets
from fitting.progress import listening, tell
from fitting.pseudo_index import notes_on
from fitting.search import Fit
from fitting.starts import LANES, Ends, run
from fitting.starts import starts as start_points
from fitting.uncertainty.intervals import check_intervals
from fitting.unknowns import check_quantities, spectrum_of, unknowns

# Wavelengths that are solved side by side, each with LANES starts.
_TOGETHER = 16
# Degrees of freedom from which on a wavelength's own scatter tells its noise.
_ENOUGH = 5
_CONSTANT = Model("constant", 1)


class _One(NamedTuple):
    """One wavelength before it is solved."""

    fit: Fit
    start: np.ndarray
    measurement: Measurement
    place: int

    @property
    def kind(self) -> tuple[Any, ...]:
        """What wavelengths must share to be lanes of one program."""
        return self.fit.u.spec, self.fit.seen.points.angle_deg.shape[0]


def _lanes(several: list[_One], count: int) -> Targets:
    """Return the targets of wavelengths side by side, each for ``count`` lanes."""
    targets = [one.fit.targets for one in several]

    def beside(pick: Any) -> Any:
        return np.repeat(np.concatenate([pick(t) for t in targets], -1), count, -1)

    first = targets[0]
    points = first.points._replace(
        angle_deg=beside(lambda t: t.points.angle_deg),
        wavelength_um=beside(lambda t: t.points.wavelength_um),
        s_share=beside(lambda t: t.points.s_share),
    )
    channels = range(len(first.values))
    return first._replace(
        points=points,
        values=tuple(beside(lambda t, i=i: t.values[i]) for i in channels),
        weights=tuple(beside(lambda t, i=i: t.weights[i]) for i in channels),
        ncs=beside(lambda t: t.ncs),
        ncs_weights=beside(lambda t: t.ncs_weights),
    )


def _chunks(ones: list[_One]) -> Iterator[list[_One]]:
    kinds: dict[tuple[Any, ...], list[_One]] = {}
    for one in ones:
        kinds.setdefault(one.kind, []).append(one)
    for alike in kinds.values():
        for first in range(0, len(alike), _TOGETHER):
            yield alike[first : first + _TOGETHER]


def _scatter(pairs: list[tuple[_One, Ends]]) -> float | None:
    """Return the mean square of the residuals of all wavelengths, None where each has enough.

    Two or three values for two unknowns say nothing of their noise, or that it is 0.
    """
    dof = sum(one.fit.dof for one, _ in pairs)
    if dof == 0 or min(one.fit.dof for one, _ in pairs) >= _ENOUGH:
        return None
    cost = sum(min((c for c in ends.cost[ends.done]), default=0.0) for _, ends in pairs)
    return float(cost) / dof


def _levelled(ends: Ends) -> Ends:
    """Return the ends with costs next to each other where they are next to the least one.

    Where k ended at 0 with a misfit, and no degree of freedom tells how large it may be, the solver
    stopped within 1e-4 of the cost (measured), and 1 of 64 starts seemed to end in the best.
    """
    least = np.min(ends.cost[ends.done], initial=np.inf)
    near = (ends.cost > least) & (ends.cost <= 1.0002 * least)
    return ends._replace(cost=np.where(near, np.nextafter(least, np.inf), ends.cost))


def _too_few(one: _One, found: ModelFit) -> ModelFit:
    """Return ``found``, undetermined where there are fewer data than unknowns.

    With k at 0, the end of its range, a single datum seems to determine eta.
    """
    if one.fit.n_data >= one.fit.u.free.sum() or found.status != CONVERGED:
        return found
    text = (
        "eta and k are not determined separately: there is one value for the two of them. The "
        "values shown are one pair of many that fit alike."
    )
    nothing = np.full_like(found.sigmas, np.nan)
    return replace(
        found, status=UNDETERMINED, warnings=(text, *found.warnings), sigmas=nothing,
        upper_limits=nothing, covariance=np.full_like(found.covariance, np.nan),
        correlation=np.full_like(found.correlation, np.nan),
        intervals=np.full_like(found.intervals, np.nan),
        interval_kinds=("none",) * len(nothing),
    )  # fmt: skip


def fit_points(
    measurement: Measurement,
    structure: str = SLAB,
    *,
    thickness_um: float | None = None,
    eta_i: float = 1.0,
    sigma: str = "given",
    absolute_sigma: bool = False,
    seed: int = 0,
    intervals: str = QUADRATIC,
) -> PointFits:
    """Return eta and k of every wavelength by itself.

    measurement: R, T, R_s, ... of an interface or a slab, psi and Delta of an interface (whose eta
        and k are the pseudo-index, see `pseudo_index`). Without any wavelength it is one curve.
    structure, thickness_um, eta_i, sigma, absolute_sigma, seed: as in `fit_model`. With fewer than
    five data to spare at some wavelength, the scatter behind scaled errors is that of all.
    intervals: as in `fit_model`, but quadratic if nothing is said: others take some .1 s for each
        wavelength.
    Result: a `PointFits`. Raises ValueError as `fit_model` does.
    """
    check_quantities([measurement], _CONSTANT, structure)
    check_intervals(intervals)
    wave = measurement.wavelength_um
    if np.isnan(wave).any() and not np.isnan(wave).all():
        raise ValueError(
            f"{measurement.source}: the wavelength of {int(np.isnan(wave).sum())} of {len(wave)} "
            "data is not known; give it."
        )
    wavelengths, which = np.unique(wave, return_inverse=True)
    settings = Settings()
    ones = []
    for place in range(len(wavelengths)):
        part = measurement.where(which == place)
        seen = observations([part], sigma)
        check_choices(seen, "squares", sigma, absolute_sigma, eta_i, None)
        spectrum = spectrum_of([part], structure, eta_i)
        u = unknowns(_CONSTANT, structure, spectrum, thickness_um, settings, seen, "squares")
        fit = Fit(u, seen, targets_of(u, seen, eta_i), settings)
        ones.append(_One(fit, start_points(u.moving, LANES, seed), part, place))
    solved: list[Ends | None] = [None] * len(ones)
    how: dict[str, Any] = {
        "scaled": not absolute_sigma,
        "eta_i": float(eta_i),
        "notes": (),
        "starts": LANES,
    }
    how["intervals"] = intervals
    tell(total=2 * len(ones), done=0)  # each is solved, and then looked at closely
    for chunk in _chunks(ones):
        # Filled up with the last one, so that one program serves.
        full = chunk + [chunk[-1]] * (_TOGETHER - len(chunk))
        groups = np.repeat(np.arange(_TOGETHER), LANES)
        with listening(None):  # wavelengths are counted here, not rounds
            ends = run(
                chunk[0].fit.u.spec,
                _lanes(full, LANES),
                np.concatenate([one.start for one in full], 1),
                full[0].fit.limits,
                np.repeat([max(one.fit.dof, 1.0) for one in full], LANES),
                np.repeat([one.fit.squares for one in full], LANES),
                groups,
            )
        for i, one in enumerate(chunk):
            own = slice(i * LANES, (i + 1) * LANES)
            solved[one.place] = Ends(*(a[..., own] for a in ends))
        tell(done=len(chunk))
    pairs = [(one, ends) for one, ends in zip(ones, solved, strict=True) if ends is not None]
    pooled = _scatter(pairs)
    fits = []
    for one, ends in pairs:
        one.fit.pooled = pooled
        ends = _levelled(ends) if one.fit.dof == 0 else ends
        tell("errors")
        fits.append(_too_few(one, model_fit_of(one.fit, ends, 1.0, how, [one.measurement])))
    return PointFits(
        structure, float(eta_i), wavelengths, tuple(fits), measurement,
        notes_on(fits, wavelengths, measurement),
    )  # fmt: skip
