"""How often the 95 % intervals of a film hold the truth: its thickness, and its eta and k.

The random films of `film_success`, with a noise of .3 to 3 times the one there, fitted as everyone
does it: `fit(measurement, sample)`, which knows that the film is 5 nm to 20 um thick. eta and k are
those at the ends and in the middle of the spectrum, with 1.96 standard errors for an interval. In
per cent of the films that are described (no warning that chi2 is too large)

  d in     the interval of the thickness holds the true one
  told     it does not, but the result gives other solutions, calls the thickness undetermined, or
           says that its fringes are no larger than those of noise
  eta in   the share of the three wavelengths whose true eta is within its error; k in: of k
  rms      root mean square of the deviation of the thickness in standard errors, of films that have
           one; 1 if errors are right

    python -m benchmarks.studies.film_coverage [--films 300] [--minutes 60]
                                               [--seed N] [--only "on Si, R"]
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from benchmarks.studies.film_success import named
from benchmarks.studies.study_options import run_study, study_options
from fitting import Fit, fit
from fitting.residuals.error_model import beyond_chance
from fitting.samples.dispersion import parse_model
from tests.truth.random_films import MEASURED, MODELS, Case, drawn


class Row(NamedTuple):
    """What the intervals of one film hold; deviation: in standard errors, NaN without one."""

    cell: tuple[str, str, str]
    described: bool
    inside: bool
    told: bool
    eta: float
    k: float
    deviation: float
    thickness: float


def _told(found: Fit) -> bool:
    """Whether the result says that the thickness may be another one."""
    codes = {w.code for w in found.warnings}
    open_ = str(found.parameters["thickness_nm"].status) == "undetermined"
    return bool(found.alternatives) or "fringes_in_noise" in codes or open_


def _index_inside(case: Case, found: Fit) -> tuple[float, float]:
    """Return at which share of three wavelengths eta, and k, are within 1.96 standard errors."""
    at = np.quantile(case.measurement.wavelength_um, [0.0, 0.5, 1.0])
    true = parse_model(case.cell[0]).index(case.truth, at)
    band = found.index(at)
    shares = []
    for value, sigma, truth in (
        (band.eta, band.sigma_eta, np.asarray(true.eta)),
        (band.k, band.sigma_k, np.asarray(true.k)),
    ):
        # rounding, for what has no error since it is 0 by its model
        shares.append(float((np.abs(value - truth) <= 1.96 * sigma + 1e-9).mean()))
    return shares[0], shares[1]


def outcome(case: Case) -> Row:
    """Return what the intervals of the fit of a film hold."""
    found = fit(case.measurement, case.sample)
    d, true = found.parameters["thickness_nm"], case.truth["thickness_nm"]
    large, _ = beyond_chance(found.chi2_reduced, found.dof)
    eta, k = _index_inside(case, found)
    return Row(
        cell=case.cell, described=not large, inside=bool(d.interval[0] <= true <= d.interval[1]),
        told=_told(found), eta=eta, k=k, deviation=float((d.value - true) / d.sigma),
        thickness=true,
    )  # fmt: skip


def _line(name: str, rows: list[Row]) -> str:
    """Return the line of the table for the films of ``rows`` that are described."""
    some = [r for r in rows if r.described]
    if not some:
        return f"{name:40}{len(rows):6d}{0:10d}"
    told = [r.told and not r.inside for r in some]
    deviations = np.array([r.deviation for r in some])
    deviations = deviations[np.isfinite(deviations)]
    rms = np.sqrt((deviations**2).mean()) if len(deviations) else np.nan
    shares = ([r.inside for r in some], told, [r.eta for r in some], [r.k for r in some])
    numbers = "".join(f"{100.0 * float(np.mean(s)):8.1f}" for s in shares)
    return f"{name:40}{len(rows):6d}{len(some):10d}{numbers}{rms:8.2f}"


def main() -> None:
    """Print the table."""
    arguments = study_options(__doc__, "films", 300)

    def one(seed: int) -> Row | None:
        case = drawn(seed)
        if case is None or not any(text in named(case.cell) for text in arguments.only):
            return None
        r = outcome(case)
        if r.described and not (r.inside or r.told):
            print(
                f"outside, untold: film {seed}, {named(case.cell)}, {r.thickness:.4g} nm, "
                f"{r.deviation:+.1f} standard errors",
                flush=True,
            )
        return r

    rows: list[Row] = run_study(arguments, one)
    heads = "".join(f"{h:>8}" for h in ("d in", "told", "eta in", "k in", "rms"))
    print(f"\n{'':40}{'films':>6}{'described':>10}{heads}")
    for cell in sorted({r.cell for r in rows}):
        print(_line(named(cell), [r for r in rows if r.cell == cell]))
    for low, high in ((5, 50), (50, 500), (500, 5000), (5000, 20000)):
        some = [r for r in rows if low <= r.thickness < high]
        print(_line(f"{low} to {high} nm", some))
    for kind in (*MEASURED, *MODELS):
        print(_line(kind, [r for r in rows if kind in r.cell]))
    print(_line("no other thickness told", [r for r in rows if not r.told]))
    print(_line("all", rows))


if __name__ == "__main__":
    main()
