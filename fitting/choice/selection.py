"""`choose`: the simplest dispersion model of a medium that is written `auto`.

Candidates are tried in stages, each only if the one before gives a reason: models without k and
with the simplest k; more oscillators, if light is absorbed or no model so far describes the data,
and as long as they help; then each instrument parameter. `candidates` says how they compare and
which is taken.

Nearly all of the time of a first `choose` is spent on compiling. Candidates therefore share
programs: a parameter that only some of them fit (of the instrument, or of the terms by which one
model is wider than another, see `wider_models`) is fixed in the others, which is the same program
with equal bounds.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np

from fitting.choice.candidates import MARGIN, Candidate, Choice, Key, candidate, decide, simplest
from fitting.choice.sample_choice import choose_sample, several_samples
from fitting.fits import check_choices, fit_checked, measurements_of
from fitting.measurements.measurement import Measurement, concatenate
from fitting.measurements.quantities import are_powers
from fitting.optics.instrument import INSTRUMENT, instrument_parameter
from fitting.process.progress import tell
from fitting.residuals.pattern import pattern
from fitting.residuals.residuals import weighted_residuals
from fitting.results.diagnostics import Finding
from fitting.results.result import NOT_CONVERGED, Fit
from fitting.samples.parameters import Settings, check_search, check_settings, names_of, plain_name
from fitting.samples.sample import Sample
from fitting.samples.sample_checks import check_fit
from fitting.searching.search import Asked
from fitting.searching.starts import Ends
from fitting.uncertainty.intervals import QUADRATIC, check_intervals

MOST_TERMS = 4
_OPTIONS = ("bounds", "priors", "tie", "loss", "errors", "starts", "start", "seed")


def _first_stage(wavelengths: int) -> list[str]:
    """Return the models that so many wavelengths can tell apart."""
    models = ["constant"]
    for least, name in (
        (3, "cauchy:2"), (3, "sellmeier:1"), (5, "cauchy:3"), (5, "drude"), (5, "cauchy-urbach:2"),
        (6, "lorentz:1"), (8, "sellmeier:2"),
    ):  # fmt: skip
        if wavelengths >= least:
            models.append(name)
    return models


def _absorbs(c: Candidate) -> bool:
    return not c.key.without_k and not c.key.model.startswith(("cauchy:", "sellmeier"))


def _good(c: Candidate | None) -> bool:
    return c is not None and c.good


def _only_shared(names: Iterable[str]) -> None:
    """Raise ValueError for settings of parameters that only some of the models have."""
    for name in names:
        bare = plain_name(name).split("[")[0]
        if bare not in INSTRUMENT and "thickness" not in bare:
            raise ValueError(
                f"{name} is not a parameter of every model, and the sample leaves the model open "
                f"(auto): only {', '.join(INSTRUMENT)} and thicknesses can be set. Name a model in "
                "the sample to set others."
            )


def _in_errors(found: Fit) -> float:
    """Return the size of the residuals in stated errors; outliers of a robust loss do not count."""
    if found.loss == "squares":
        return float(np.sqrt(found.chi2_reduced))
    m = found.measurement
    assert m is not None
    off = np.abs(weighted_residuals(m, found.predict().value))
    return 1.4826 * float(np.median(off)) * float(np.sqrt(found.n_data / found.dof))


def explains(found: Fit) -> bool:
    """Whether the residuals of a fit look like noise.

    With stated errors they must not be larger than these; without, they must not be autocorrelated
    (`pattern`).
    """
    if np.isfinite(found.chi2_reduced) and found.dof:
        return _in_errors(found) ** 2 < max(1.5, 1.0 + 5.0 * np.sqrt(2.0 / found.dof))
    m, curve = found.measurement, found.curve
    assert m is not None and curve is not None
    return pattern(m, found.predict().value, curve, stated=False) is None


def _with_doubt(choice: Choice) -> Choice:
    """Return the choice, with a first warning if its model does not describe the data."""
    found = choice.fit
    if explains(found):
        return choice
    better = [c for c in choice.candidates if c.fit.status != NOT_CONVERGED and explains(c.fit)]
    values: dict[str, Any] = {"taken": choice.taken.label, "rms": found.rms}
    if better:
        values["better"] = tuple(c.label for c in better)
    elif np.isfinite(found.chi2_reduced):
        values["factor"] = _in_errors(found)
    doubt = Finding("candidates_do_not_describe", np.True_, values)
    told = replace(found, findings=(doubt, *found.findings))
    return replace(choice.with_fit(told), describes=False)


def _of_instrument(m: Measurement) -> list[str]:
    """Return the instrument parameters that such data can determine."""
    power = are_powers(m.quantity)
    oblique = m.angle_deg[m.angle_deg > 0.0]
    names = []
    # At one or two angles a scale cannot be told from another index.
    if power.any() and len(np.unique(m.angle_deg)) > 2:
        names.append("scale")
    if len(np.unique(oblique)) > 2 or (len(oblique) and not power.all()):
        names.append("angle_offset")
    return names


def choose(
    measurement: Measurement | Sequence[Measurement],
    sample: str | Sample | Sequence[str | Sample] = "auto",
    *,
    free: str | Iterable[str] = (),
    fixed: Mapping[str, float] | None = None,
    instrument: bool = True,
    intervals: str = "auto",
    progress: Callable[[str], None] | None = None,
    **options: Any,
) -> Choice:
    """Return the smallest model or sample that the data do not contradict, with the comparison.

    Args:
        measurement, free, fixed: as for `fit`, and used for every candidate.
        sample: with one medium that is `auto`: "auto", "air | auto 3 mm thick | air"; or several
            samples, in a list or with "or" between them: "Si or air | SiO2 1..50 nm | Si".
        instrument: whether a free scale and angle offset are tried.
        intervals: of the model that is taken, as for `fit`.
        progress: called with the label of each candidate before it is tried; ``print`` will do.
        options: bounds, priors, tie, loss, errors, starts, start, seed, as for `fit`.

    Returns: a `Choice`. How often the true model of simulated spectra is found, and how seldom a
        parameter too many, is in docs/fitting.md.

    Raises:
        ValueError: as `fit` does, and for parameters that only some of the models have.
        TypeError: for an unknown option.
    """
    strange = [name for name in options if name not in _OPTIONS]
    if strange:
        raise TypeError(f"choose has no option {strange[0]!r}; it has {', '.join(_OPTIONS)}.")
    samples = several_samples(sample)
    if not samples:
        raise ValueError("the list of samples is empty; the text of one or more was wanted.")
    if len(samples) > 1:
        given = {"free": free, "fixed": fixed, **options}
        return choose_sample(
            measurement, samples, intervals=intervals, progress=progress, **given
        )  # fmt: skip
    which = Sample.parse(next(iter(samples)))
    if not which.open:
        raise ValueError(
            f"the sample {str(which)!r} leaves nothing to choose: write 'auto' for one index in "
            "it, or several samples with 'or' between them; or use fit."
        )
    check_intervals(intervals)
    several = measurements_of(measurement)
    check_fit(several, which)
    held, given = dict(fixed or {}), names_of(free)
    _only_shared([
        *held, *given,
        *(name for key in ("bounds", "priors", "tie") for name in options.get(key) or {}),
    ])  # fmt: skip
    joined = concatenate(*several)
    starts, start, seed = options.pop("starts", None), options.pop("start", None), 0
    loss, errors = options.pop("loss", "squares"), options.pop("errors", "auto")
    seed = options.pop("seed", 0)
    check_choices(loss, errors, intervals)
    check_search(starts, start, seed)
    base = check_settings(Settings(given, held, **options))
    mentioned = {name.partition("[")[0] for name in base.names}
    wanted = [n for n in _of_instrument(joined) if instrument and n not in mentioned]

    # The model that is taken is fitted twice; its minima are found once.
    ends: dict[Hashable, tuple[Ends, float]] = {}

    # BIC compares fits with the same weights. The model that is taken is then fitted as asked.
    compared = "scaled" if errors == "auto" else errors

    def run(key: Key, kind: str = QUADRATIC, believed: str = compared) -> Fit:
        # Candidates with an instrument parameter free share one program.
        quiet = {
            n: float(instrument_parameter(n).held or 0.0)
            for n in wanted if key.free and n not in key.free
        }  # fmt: skip
        settings = base._replace(
            free=(*base.free, *key.free), variants=tuple(quiet), shared=True,
            fixed={**base.fixed, **quiet, **({"k": 0.0} if key.without_k else {})},
        )  # fmt: skip
        asked = Asked(believed, kind, loss, seed, ends)
        found = fit_checked(several, which.with_model(key.model), settings, asked, (starts, start))
        shown = {n: e for n, e in found.parameters.items() if n.partition("[")[0] not in quiet}
        return replace(found, parameters=shown)

    search = _Search(run, progress or (lambda label: None), errors)
    _stages(search, len(np.unique(joined.wavelength_um[np.isfinite(joined.wavelength_um)])))
    _instrument_stage(search, wanted)
    choice = decide(list(search.tried.values()))
    if intervals != QUADRATIC or errors != compared:
        choice = choice.with_fit(run(choice.taken.key, intervals, errors))
    return _with_doubt(choice)


class _Search:
    """The candidates tried so far. errors: how the stated errors are used, as in `fit`."""

    def __init__(self, run: Callable[[Key], Fit], progress: Callable[[str], None], errors: str):
        self.run, self.progress, self.errors = run, progress, errors
        self.tried: dict[Key, Candidate] = {}

    def attempt(self, *keys: Key) -> list[Candidate]:
        """Return the candidates, fitted side by side if they were not tried before."""
        self.attempt_chains(*((key,) for key in keys))
        return [self.tried[key] for key in keys]

    def attempt_chains(self, *chains: Sequence[Key]) -> None:
        """Try chains of candidates in parallel, each until one of its candidates is not good."""
        new = [c for c in dict.fromkeys(map(tuple, chains)) if any(k not in self.tried for k in c)]
        if not new:
            return
        for key in dict.fromkeys(k for c in new for k in c if k not in self.tried):
            self.progress(key.label)
            tell(key.label)
        # Compiling a program and running it both take one core.
        with ThreadPoolExecutor(min(len(new), os.cpu_count() or 1)) as pool:
            list(pool.map(self._try_chain, new))

    def _try_chain(self, chain: Sequence[Key]) -> None:
        for key in chain:
            if key not in self.tried:
                self.tried[key] = candidate(key, self.run(key), self.errors)
            if not self.tried[key].good:
                return

    def best(self) -> Candidate:
        """Return the candidate that would be taken now."""
        return simplest(list(self.tried.values()))


def _stages(search: _Search, wavelengths: int) -> None:
    """Try the models that so many wavelengths can tell apart, and more while they help."""
    search.attempt(Key("constant", without_k=True), *map(Key, _first_stage(wavelengths)))
    best = search.best()
    if wavelengths < 6 or best.enough or not (_absorbs(best) or not explains(best.fit)):
        return

    def grown(terms: int) -> list[Key]:
        return [
            Key(f"{kind}:{terms}")
            for kind in ("lorentz", "drude-lorentz")
            if wavelengths >= 4 * terms and _good(search.tried.get(Key(f"{kind}:{terms - 1}")))
        ]

    # In parallel, so that the programs of two oscillators and of Tauc-Lorentz compile together.
    with_electrons = [Key(f"drude-lorentz:{terms}") for terms in (1, 2) if wavelengths >= 4 * terms]
    search.attempt_chains(with_electrons, [Key("tauc-lorentz:1")], grown(2)[:1])
    for terms in range(2, MOST_TERMS + 1):
        keys = grown(terms)
        new = search.attempt(*keys)
        if search.best().enough:
            return
        before = simplest([c for key, c in search.tried.items() if key not in keys]).fit.bic
        if not any(c.good and c.fit.bic < before - MARGIN for c in new) and (
            terms > 2 or explains(search.best().fit)
        ):
            return


def _instrument_stage(search: _Search, wanted: Sequence[str]) -> None:
    """Try each instrument parameter, and keep those that help for the next."""
    # A scale can look like absorption: it is tried with the best model without k as well.
    clear = [c for c in search.tried.values() if not _absorbs(c)]
    bases = [search.best()]
    bases += [c for c in [simplest(clear)] if c.key != bases[0].key]
    for base in bases:
        extra: tuple[str, ...] = ()
        for name in wanted:
            (grown,) = search.attempt(Key(base.key.model, (*extra, name), base.key.without_k))
            if grown.good and grown.fit.bic < base.fit.bic - MARGIN:
                base, extra = grown, (*extra, name)
