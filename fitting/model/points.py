"""eta and k wavelength by wavelength from R, T, psi and Delta, of an interface or a slab.

`fitting.fit` does this for the reflectance of a bare interface, with a method made for it. Here
every wavelength is a small model fit of its own, with the starts of all wavelengths as lanes of one
program.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from fitting.measurement import Measurement
from fitting.model.dispersion import Model
from fitting.model.fit import check_choices, targets_of
from fitting.model.multistart import LANES, Ends, run
from fitting.model.multistart import starts as start_points
from fitting.model.observations import observations
from fitting.model.outcome import model_fit_of
from fitting.model.parameters import Settings
from fitting.model.problem import Targets
from fitting.model.result import ModelFit
from fitting.model.solve import Fit
from fitting.model.structures import SLAB
from fitting.model.unknowns import check_quantities, spectrum_of, unknowns
from fitting.plain_data import plain

# Wavelengths that are solved side by side, each with LANES starts.
_TOGETHER = 16
# Degrees of freedom from which on a wavelength's own scatter tells its noise.
_ENOUGH = 5
_CONSTANT = Model("constant", 1)


@dataclass(frozen=True, eq=False)
class PointFits:
    """The fits of all wavelengths, in rising order; arrays are over the W wavelengths.

    wavelength_um: (W,). fits: a `ModelFit` (model "constant") each, with its warnings, covariance
    and second minima. measurement: all data.
    """

    structure: str
    wavelength_um: np.ndarray
    fits: tuple[ModelFit, ...]
    measurement: Measurement

    def _of(self, pick: Any) -> np.ndarray:
        return np.array([pick(f) for f in self.fits])

    @property
    def curve_names(self) -> tuple[str, ...]:
        """The quantities that were measured."""
        return tuple(dict.fromkeys(self.measurement.quantity.tolist()))

    @property
    def curve(self) -> np.ndarray:
        """(N,) which of `curve_names` each datum is."""
        return np.array([self.curve_names.index(q) for q in self.measurement.quantity.tolist()])

    @property
    def eta(self) -> np.ndarray:
        """Real part of the index."""
        return self._of(lambda f: f.value_of("eta"))

    @property
    def k(self) -> np.ndarray:
        """Imaginary part of the index."""
        return self._of(lambda f: f.value_of("k"))

    @property
    def sigma_eta(self) -> np.ndarray:
        """Standard error of eta; NaN where the data give none."""
        return self._of(lambda f: f.sigma_of("eta"))

    @property
    def sigma_k(self) -> np.ndarray:
        """Standard error of k; NaN where the data give none."""
        return self._of(lambda f: f.sigma_of("k"))

    @property
    def k_upper_limit(self) -> np.ndarray:
        """95 % upper limit of k where it is compatible with 0, NaN elsewhere."""
        return self._of(lambda f: f.upper_limits[f.names.index("k")] if "k" in f.names else np.nan)

    @property
    def rms(self) -> np.ndarray:
        """Root mean square of the residuals at each wavelength."""
        return self._of(lambda f: f.rms)

    @property
    def status(self) -> np.ndarray:
        """The `ModelFit.status` of each wavelength."""
        return self._of(lambda f: f.status)

    def fitted(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the model at every datum of the measurement and its standard error, (N,)."""
        out, sigma = np.empty(len(self.measurement)), np.empty(len(self.measurement))
        for wavelength, fit in zip(self.wavelength_um, self.fits, strict=True):
            here = self.measurement.wavelength_um == wavelength
            out[here], sigma[here] = fit.fitted()
        return out, sigma

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for ``json.dumps``: arrays over the wavelengths, NaN as None."""
        names = ("wavelength_um", "eta", "sigma_eta", "k", "sigma_k", "k_upper_limit", "rms")
        out: dict[str, Any] = {"structure": self.structure, "fixed": self.fits[0].fixed}
        out |= {name: plain(getattr(self, name)) for name in (*names, "status")}
        out["chi2"] = plain([f.chi2 for f in self.fits])
        out["dof"] = [f.dof for f in self.fits]
        out["warnings"] = [list(f.warnings) for f in self.fits]
        out["others"] = plain([list(f.others) for f in self.fits])
        return out


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


def fit_points(
    measurement: Measurement,
    structure: str = SLAB,
    *,
    thickness_um: float | None = None,
    eta_i: float = 1.0,
    sigma: str = "given",
    absolute_sigma: bool = False,
    seed: int = 0,
) -> PointFits:
    """Return eta and k of every wavelength by itself.

    measurement: R, T, R_s, ... of an interface or a slab, psi and Delta of an interface.
    structure, thickness_um, eta_i, sigma, absolute_sigma, seed: as in `fit_model`. With fewer than
    five data to spare at some wavelength, the scatter behind scaled errors is that of all.
    Result: a `PointFits`. Raises ValueError as `fit_model` does.
    """
    check_quantities([measurement], _CONSTANT, structure)
    wave = measurement.wavelength_um
    if np.isnan(wave).any():
        raise ValueError(f"{measurement.source}: the wavelength is not known; give it.")
    wavelengths = np.unique(wave)
    settings = Settings()
    ones = []
    for place, wavelength in enumerate(wavelengths):
        part = measurement.where(wave == wavelength)
        seen = observations([part], sigma)
        check_choices(seen, "squares", sigma, absolute_sigma, eta_i, None)
        spectrum = spectrum_of([part], structure, eta_i)
        u = unknowns(_CONSTANT, structure, spectrum, thickness_um, settings, seen, "squares")
        fit = Fit(u, seen, targets_of(u, seen, eta_i), settings)
        ones.append(_One(fit, start_points(u.moving, LANES, seed), part, place))
    solved: list[Ends | None] = [None] * len(ones)
    how = {"scaled": not absolute_sigma, "eta_i": float(eta_i), "notes": (), "starts": LANES}
    for chunk in _chunks(ones):
        # Filled up with the last one, so that one program serves.
        full = chunk + [chunk[-1]] * (_TOGETHER - len(chunk))
        groups = np.repeat(np.arange(_TOGETHER), LANES)
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
    pairs = [(one, ends) for one, ends in zip(ones, solved, strict=True) if ends is not None]
    pooled = _scatter(pairs)
    fits = []
    for one, ends in pairs:
        one.fit.pooled = pooled
        fits.append(model_fit_of(one.fit, ends, 1.0, how, [one.measurement]))
    return PointFits(structure, wavelengths, tuple(fits), measurement)
