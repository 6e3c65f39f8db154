"""`FitData`: the result of a fit, as data. `fitting.Fit` adds what is drawn, printed and written.

A fit has one set of parameters for all data (a dispersion model, batch shape S = ()), or many
independent ones: an index at every wavelength (S = (W,), in rising order), or any batch of curves
(`fit_many`, S that of the arrays). All arrays begin with S; one curve has Python scalars.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fitting.data.measurement import Measurement
from fitting.data.quantities import STOKES
from fitting.results.diagnostics import Finding, Warning
from fitting.results.result_parts import (
    Alternative,
    ErrorModel,
    Estimate,
    IndexBand,
    item,
    picked,
    place_of,
)
from fitting.samples.sample import Sample


@dataclass(frozen=True, eq=False, kw_only=True)
class FitData:
    """The result of `fit`, `fit_many`, `choose` and `fit_residuals`. S: the batch shape (module).

    sample: the sample that was fitted; None for the caller's own residuals.
    parameters: name -> `Estimate`; the fitted ones first, then what was fixed or tied.
    covariance: S + (P, P) of the fitted parameters in the order of `names`; NaN where sigma is NaN.
    wavelength_um: S, micrometres; NaN where unknown. For a dispersion model, whose eta and k depend
        on the wavelength: the W measured ones.
    chi2, chi2_reduced: sum of (residual / stated error)^2, and that by dof; NaN without stated
        errors, the second also without a degree of freedom.
    dof: data and priors minus fitted parameters, at least 0. n_data: a psi and a Delta are two.
    rms: root mean square of the unweighted residuals; for psi and Delta those of N, C, S. rms_of:
        the same by quantity ("NCS": psi and Delta). n_of: how many residuals each has; of psi and
        Delta three a pair.
    status: "converged"; "misfit" (the best minimum, but the sample does not describe the data: a
        warning says so); "undetermined" (a minimum, but the data do not determine some combination
        of the parameters); "not converged"; "no data"; of a batch also "refused" (data out of
        range; the warning says which).
    evaluations: how often residuals and derivatives were evaluated: by all starts of a bare
        surface and of a batch, by the best start of other fits. starts, reached: the number of
        starting points, and of those that led to the best minimum; 0 if not counted.
    errors: how the errors of the data were used.
    loss, noise: "squares" or "huber", and the noise for which a robust loss or a prior
        was weighted, in units of the stated errors.
    cost: the minimised sum. bic, aicc: information criteria, NaN where they were not asked for.
    findings, others, notes: the data of `warnings` and `alternatives`; notes on all curves.
    measurement: the fitted data, all files joined; None for `fit_many`. curve: (N,) which of
        `curve_names` (a quantity of a file) each datum belongs to.
    evaluator: computes `predict` and `index` (`problem.evaluation`); None for the caller's own
        residuals.
    """

    sample: Sample | None
    parameters: Mapping[str, Estimate]
    covariance: np.ndarray
    wavelength_um: Any
    chi2: Any
    chi2_reduced: Any
    dof: Any
    n_data: Any
    rms: Any
    status: Any
    errors: ErrorModel
    evaluations: Any = 0
    starts: Any = 0
    reached: Any = 0
    rms_of: Mapping[str, Any] = field(default_factory=dict)
    n_of: Mapping[str, Any] = field(default_factory=dict)
    loss: str = "squares"
    noise: Any = 1.0
    cost: Any = np.nan
    bic: Any = np.nan
    aicc: Any = np.nan
    findings: tuple[Finding, ...] = ()
    others: tuple[Alternative, ...] = ()
    notes: tuple[Warning, ...] = ()
    measurement: Measurement | None = None
    curve: np.ndarray | None = None
    curve_names: tuple[str, ...] = ()
    evaluator: Any = None

    @property
    def shape(self) -> tuple[int, ...]:
        """The batch shape S; () for one set of parameters."""
        return np.shape(self.status)

    @property
    def names(self) -> tuple[str, ...]:
        """The fitted parameters, in the order of `covariance`."""
        return tuple(name for name, e in self.parameters.items() if e.free)

    @property
    def values(self) -> dict[str, Any]:
        """Name -> value of all parameters, fitted, fixed and tied."""
        return {name: e.value for name, e in self.parameters.items()}

    @property
    def mse(self) -> Any:
        """What ellipsometers call the mean squared error, of unweighted residuals of N, C and S.

        1000 sqrt(sum of squares / (3 n - m)), n points of psi and Delta or of N, C, S (of psi
        alone one counts, N), m fitted parameters; S of a batch, NaN without these quantities.
        Source: J. A. Woollam Co., CompleteEASE manual, section on the mean squared error.
        """
        count = {q: np.asarray(n) for q, n in self.n_of.items() if q in (*STOKES, "NCS")}
        squares = sum((np.where(n, self.rms_of[q], 0.0) ** 2 * n for q, n in count.items()), 0.0)
        freedom = np.asarray(sum(count.values()) - len(self.names), float)
        with np.errstate(all="ignore"):
            found = np.where(freedom > 0, 1e3 * np.sqrt(squares / freedom), np.nan)
        return found if found.shape else found.item()

    @property
    def correlation(self) -> np.ndarray:
        """S + (P, P), correlation of the fitted parameters; NaN where sigma is NaN."""
        with np.errstate(all="ignore"):
            size = np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1))
            return self.covariance / (size[..., :, None] * size[..., None, :])

    @property
    def eta(self) -> Any:
        """Real part of the unknown index at `wavelength_um`; errors: `parameters` or `index`."""
        return self._index_part("eta")

    @property
    def k(self) -> Any:
        """Imaginary part of the unknown index at `wavelength_um`."""
        return self._index_part("k")

    def _index_part(self, name: str) -> Any:
        if name in self.parameters:
            return self.parameters[name].value
        return getattr(self.index(), name)

    @property
    def sigma_kind(self) -> Any:
        """ "absolute" where stated errors were taken as they are, else "scaled"."""
        taken = np.where(np.asarray(self.errors.taken) == "stated", "absolute", "scaled")
        return taken if taken.shape else taken.item()

    @property
    def warnings(self) -> Any:
        """The warnings, the most serious first: a tuple; of a batch an object array of tuples."""
        return self._each(self._warnings_at, [f.at for f in self.findings])

    @property
    def alternatives(self) -> Any:
        """Other minima that fit nearly as well: a tuple; of a batch an object array of tuples."""
        there = [np.isfinite(a.delta_chi2) for a in self.others]
        return self._each(self._alternatives_at, there)

    def _each(self, of: Any, where: list[Any]) -> Any:
        if not self.shape:
            return of(())
        out = np.empty(self.shape, dtype=object)
        out.fill(())
        some = np.logical_or.reduce(where) if where else np.zeros(self.shape, bool)
        for index in zip(*np.nonzero(some), strict=True):
            out[index] = of(index)
        return out

    def _place(self, index: tuple[int, ...]) -> dict[str, Any]:
        wavelength = np.asarray(self.wavelength_um)
        if wavelength.shape == self.shape and np.isfinite(wavelength[index]):
            return {"wavelength_um": float(wavelength[index])}
        return {"curve": tuple(map(int, index))} if index else {}

    def _warnings_at(self, index: tuple[int, ...]) -> tuple[Warning, ...]:
        place = self._place(index)
        return tuple(f.of(index, place) for f in self.findings if np.asarray(f.at)[index])

    def _alternatives_at(self, index: tuple[int, ...]) -> tuple[Alternative, ...]:
        every = (a.at(index) for a in self.others) if self.shape else iter(self.others)
        return tuple(a for a in every if np.isfinite(a.delta_chi2))

    @property
    def fitted(self) -> np.ndarray:
        """The fitted curve at every datum, (N,)."""
        assert self.evaluator is not None
        return self.evaluator.predict(None).value

    def index(self, wavelength_um: Any = None, medium: str | None = None) -> IndexBand:
        """Return eta and k with standard errors, at wavelengths in micrometres.

        Args:
            wavelength_um: None for the measured ones. An index that is free at every wavelength is
                known at the measured ones only.
            medium: "film", "substrate", ... of `Sample.places`; None for the first unknown one.

        Returns:
            `IndexBand` of arrays (W,).
        """
        if self.evaluator is None:
            raise ValueError("this fit is of your own residuals; it has no sample and no index.")
        return self.evaluator.index(wavelength_um, medium)

    def __len__(self) -> int:
        if not self.shape:
            raise TypeError("this fit is one set of parameters and no batch; it has no length.")
        return self.shape[0]

    def __bool__(self) -> bool:
        return True  # a single fit has no length

    def __iter__(self) -> Iterator[FitData]:
        return (self[i] for i in range(len(self)))

    def __getitem__(self, index: int | tuple[int, ...]) -> FitData:
        """Return the fit of one curve of a batch."""
        index = place_of(index, self.shape)
        m, curve = self.measurement, self.curve
        if m is not None:
            rows = m.at_wavelength(np.asarray(self.wavelength_um)[index])
            m, curve = m.where(rows), None if curve is None else curve[rows]
        return replace(
            picked(self, index),
            parameters={name: e.at(index) for name, e in self.parameters.items()},
            rms_of={name: item(v, index) for name, v in self.rms_of.items()},
            n_of={name: item(v, index) for name, v in self.n_of.items()},
            errors=ErrorModel(*(item(v, index) for v in self.errors)),
            findings=tuple(
                Finding(f.code, np.True_, f.of(index, {}).values, self._place(index))
                for f in self.findings
                if np.asarray(f.at)[index]
            ),
            others=self._alternatives_at(index),
            measurement=m,
            curve=curve,
            evaluator=None if self.evaluator is None else self.evaluator.at(index),
        )
