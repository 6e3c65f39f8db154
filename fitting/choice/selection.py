"""`choose`: the simplest of several samples, or dispersion model of a medium that is `auto`.

Models are tried in stages, each only if the one before gives a reason: models without k and with
the simplest k; more oscillators, if light is absorbed or no model so far describes the data, and as
long as they help; then each instrument parameter. Of samples that are given all are tried:

    choose(m, "Si or air | SiO2 1..50 nm | Si")
    choose(m, "air | cauchy 50..500 nm | Si or air | rough 1..20 nm | cauchy 50..500 nm | Si "
              "or air | cauchy 50..500 nm graded | Si")

`candidates` says how they compare and which is taken: a further layer or parameter needs evidence.

Up to half of the time of a first `choose` is spent on compiling. Candidates therefore share
programs: a parameter that only some of them fit (of the instrument, or of the terms by which one
model is wider than another, see `dispersion`) is fixed in the others, which is the same program
with equal bounds.

Where no model describes the data, a thorough search of films takes longer than all else, and finds
a lower minimum of few models. Candidates are therefore compared by the minima that the first stages
of a search find (see `search`). Those that may then be taken are searched as thoroughly as `fit`
does, until this changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from fitting.choice.candidates import (
    Candidate,
    Choice,
    Key,
    candidate,
    contenders,
    decide,
    explains,
    simplest,
    with_doubt,
)
from fitting.data.measurement import Measurement, concatenate
from fitting.data.quantities import are_powers
from fitting.fits import fit_checked, measurements_of
from fitting.optics.instrument import INSTRUMENT
from fitting.outcomes.surface_verdicts import OPEN
from fitting.problem.problem import FitOptions, Kept
from fitting.process.progress import tell
from fitting.process.side_by_side import side_by_side
from fitting.results.diagnostics import Finding
from fitting.results.result import FitData
from fitting.results.result_parts import CONVERGED
from fitting.samples.parameters import Settings, check_search, settings_of
from fitting.samples.sample import AUTO, Sample, several_samples
from fitting.samples.sample_checks import check_fit
from fitting.uncertainty.intervals import QUADRATIC, check_choices
from fitting.uncertainty.likelihood import MARGIN, corrected_aic

# Calibrations of reflectances are hardly wrong by more.
MOST_GAIN = 0.1
_NEUTRAL = "angle_offset"
# Returns a fit: of this sample, with these settings and options; of a candidate.
Fitted = Callable[[Sample, Settings, FitOptions], FitData]
Run = Callable[[Key, FitOptions], FitData]


class Trials:
    """The candidates tried so far.

    run: fits a candidate; the second argument is whether its minima are searched thoroughly.
    progress: called with each label. errors: how the stated errors are used, as in `fit`.
    """

    def __init__(
        self, run: Callable[[Key, bool], FitData], progress: Callable[[str], None], errors: str
    ):
        self.run, self.progress, self.errors = run, progress, errors
        self.tried: dict[Key, Candidate] = {}

    def attempt(self, *keys: Key) -> list[Candidate]:
        """Return the candidates, fitted side by side if they were not tried before."""
        self.attempt_chains(*((key,) for key in keys))
        return [self.tried[key] for key in keys]

    def attempt_chains(self, *chains: Sequence[Key]) -> None:
        """Try chains of candidates in parallel, each until one of its candidates is not good."""
        new = [c for c in dict.fromkeys(map(tuple, chains)) if any(k not in self.tried for k in c)]

        def try_chain(chain: Sequence[Key]) -> None:
            for key in chain:
                if key not in self.tried:
                    self._fit(key, thorough=False)
                if not self.tried[key].good:
                    return

        if new:
            self._announce(dict.fromkeys(k for c in new for k in c if k not in self.tried))
            side_by_side(try_chain, new)

    def _announce(self, keys: Iterable[Key], what: str = "") -> None:
        for label in (key.label + what for key in keys):
            self.progress(label)
            tell(label)

    def _fit(self, key: Key, thorough: bool) -> None:
        self.tried[key] = candidate(key, self.run(key, thorough), self.errors)

    def settle(self) -> None:
        """Search thoroughly for the minima of the candidates that may be taken."""
        done: set[Key] = set()
        while new := [c.key for c in contenders(list(self.tried.values())) if c.key not in done]:
            # Those with most parameters take longest: none of them should be left alone at the end.
            new.sort(key=lambda key: -self.tried[key].size)
            self._announce(new, ", searched thoroughly")
            side_by_side(lambda key: self._fit(key, thorough=True), new)
            done |= {*new}

    def best(self) -> Candidate:
        """Return the candidate that would be taken now."""
        return simplest(list(self.tried.values()))


# Models of which more terms are tried as long as they help, and the largest number of terms.
GROWN, MOST_TERMS = ("lorentz", "drude-lorentz"), 4


def _first_stage(wavelengths: int) -> list[str]:
    """Return the models that so many wavelengths can tell apart."""
    several = (
        (3, "cauchy:2"), (3, "sellmeier:1"), (5, "cauchy:3"), (5, "drude"), (5, "cauchy-urbach:2"),
        (6, "lorentz:1"), (8, "sellmeier:2"),
    )  # fmt: skip
    return ["constant", *(name for least, name in several if wavelengths >= least)]


def _absorbs(c: Candidate) -> bool:
    return not c.key.without_k and not c.key.model.startswith(("cauchy:", "sellmeier"))


def _begun_from(key: Key) -> str | None:
    """Return the label of the candidate, tried before, whose minima are near; None: of none."""
    if key.free:
        return key._replace(free=key.free[:-1]).label
    kind, _, terms = key.model.partition(":")
    return Key(f"{kind}:{int(terms) - 1}").label if kind in GROWN and int(terms) > 1 else None


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


def _of_model(which: Sample, base: Settings, wanted: Sequence[str], fitted: Fitted) -> Run:
    """Return how a model of the medium `auto` is fitted; wanted: instrument parameters tried."""
    if not which.open:
        raise ValueError(
            f"the sample {str(which)!r} leaves nothing to choose: write 'auto' for one index in "
            "it, or several samples with 'or' between them; or use fit."
        )
    for name in base.names:
        bare = name.partition("[")[0]
        if bare not in INSTRUMENT and "thickness" not in bare:
            raise ValueError(
                f"{name} is not a parameter of every model, and the sample leaves the model open "
                f"(auto): only {', '.join(INSTRUMENT)} and thicknesses can be set. Name a model in "
                "the sample to set others."
            )
    media = zip(which.prefixes, which.media, strict=True)
    k = next(f"{prefix}k" for prefix, medium in media if medium.index == AUTO)

    def run(key: Key, asked: FitOptions) -> FitData:
        # Candidates with an instrument parameter free share one program.
        quiet = {
            n: float(INSTRUMENT[n].held or 0.0)
            for n in wanted if key.free and n not in key.free
        }  # fmt: skip
        bounds = {"scale": (1.0 - MOST_GAIN, 1.0 + MOST_GAIN)} if "scale" in key.free else {}
        settings = base._replace(
            free=(*base.free, *key.free), shared=True,
            # A k of 0 is assumed here, and not known.
            variants=(*quiet, *("k",) * key.without_k),
            bounds={**base.bounds, **bounds},
            fixed={**base.fixed, **quiet, **({k: 0.0} if key.without_k else {})},
        )  # fmt: skip
        found = fitted(which.with_model(key.model), settings, asked)
        shown = {n: e for n, e in found.parameters.items() if n.partition("[")[0] not in quiet}
        return replace(found, parameters=shown)

    return run


def _of_samples(samples: Sequence[Sample], base: Settings, fitted: Fitted) -> Run:
    """Return how one of several samples is fitted."""
    for which in samples:
        if which.by_wavelength or which.open:
            raise ValueError(
                f"the sample {str(which)!r} cannot be compared with others, since an index in it "
                "is free at every wavelength or auto. Write numbers, materials or named dispersion "
                "models instead."
            )
    by_label = {str(which): which for which in samples}
    at = base.fixed.get(_NEUTRAL, 0.0)
    nothing = base._replace(
        fixed={n: value for n, value in base.fixed.items() if n != _NEUTRAL},
        bounds={**base.bounds, _NEUTRAL: (at - 1e-9, at + 1e-9)},
    )

    def run(key: Key, asked: FitOptions) -> FitData:
        which = by_label[key.model]
        held = all(m.thickness is None or m.thickness.held for m in which.media)
        if held and not key.free and not any(m.unknown for m in which.media):
            return _without_unknowns(fitted(which, nothing, asked))
        return fitted(which, base._replace(free=(*base.free, *key.free)), asked)

    return run


def _with_gain_instead(choice: Choice, try_gain: Callable[[Key], FitData]) -> Choice:
    """Return the choice, with a warning if a smaller sample fits as well with a free scale.

    Reflectances that are 1 % low at all wavelengths are those of a thin oxide, too.
    """
    smaller = [c for c in choice.candidates if c.size < choice.taken.size]
    if not smaller or not are_powers(choice.fit.measurement.quantity).any():  # type: ignore
        return choice
    least = min(smaller, key=lambda c: c.fit.bic)
    other = try_gain(least.key._replace(free=("scale",)))
    # Of several files each has a scale of its own.
    scales = [e for name, e in other.parameters.items() if name.startswith("scale")]
    scale = max(scales, key=lambda e: abs(e.value - 1.0))
    near = other.bic <= choice.taken.fit.bic + MARGIN and abs(scale.value - 1.0) < MOST_GAIN
    if other.status != CONVERGED or not near:
        return choice
    told = Finding("gain_instead", np.True_, {
        "sample": least.label, "scale": scale.value, "sigma": scale.sigma,
        "delta_bic": other.bic - choice.taken.fit.bic,
    })  # fmt: skip
    return choice.with_fit(replace(choice.fit, findings=(told, *choice.fit.findings)))


def _without_unknowns(found: FitData) -> FitData:
    """Return the fit of a sample without unknowns, from that of an angle offset that hardly moves.

    The offset counts neither in the degrees of freedom nor in the information criteria.
    """
    parameters = {n: e for n, e in found.parameters.items() if n != _NEUTRAL}
    findings = tuple(
        f for f in found.findings if f.values.get("parameter") != _NEUTRAL
        and _NEUTRAL not in (f.values.get("parameters") or ())
    )  # fmt: skip
    n, dof = found.n_data, found.dof + 1
    bic = found.bic - float(np.log(n))
    noise = 0 if found.errors.taken == "stated" else 1  # the only unknown, see `criteria`
    return replace(
        found, parameters=parameters, covariance=found.covariance[:0, :0], findings=findings,
        bic=bic, aicc=corrected_aic(bic, noise, n),
        dof=dof, chi2_reduced=found.chi2_reduced * found.dof / dof, status=CONVERGED,
        evaluations=0, starts=0, reached=0,
    )  # fmt: skip


def choose(
    measurement: Measurement | Sequence[Measurement],
    sample: str | Sample | Sequence[str | Sample] = "auto",
    *,
    free: str | Iterable[str] = (),
    fixed: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    tie: Mapping[str, str] | None = None,
    instrument: bool = True,
    loss: str = "squares",
    errors: str = "auto",
    intervals: str = "auto",
    starts: int | None = None,
    start: Mapping[str, Any] | None = None,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Choice:
    """Return the smallest model or sample that the data do not contradict, with the comparison.

    Args:
        measurement, free, fixed, bounds, priors, tie, loss, errors, starts, start, seed: as for
            `fit`, and used for every candidate.
        sample: with one medium that is `auto`: "auto", "air | auto 3 mm thick | air"; or several
            samples, in a list or with "or" between them: "Si or air | SiO2 1..50 nm | Si".
        instrument: whether a free scale and angle offset are tried, for models; of samples, whether
            it is told that a smaller one fits as well with a free scale.
        intervals: of the model that is taken, as for `fit`.
        progress: called with the label of each candidate before it is tried, and again before it is
            searched thoroughly; ``print`` will do.

    Returns:
        A `Choice`. How often the true model of simulated spectra is found, and how seldom a
        parameter too many, is in docs/fitting.md.

    Raises:
        ValueError: as `fit` does, and for parameters that only some of the models have.
    """
    samples = several_samples(sample)
    if not samples:
        raise ValueError("the list of samples is empty; the text of one or more was wanted.")
    check_choices(loss, errors, intervals)
    check_search(starts, start, seed)
    several = measurements_of(measurement)
    base = settings_of(free, fixed, bounds, priors, tie)
    asked = FitOptions(errors, intervals, loss, seed, Kept({}, {}), starts, start)
    fitted = partial(fit_checked, several)
    joined, one = concatenate(*several), len(samples) == 1
    mentioned = {name.partition("[")[0] for name in base.names}
    wanted = [n for n in _of_instrument(joined) if one and instrument and n not in mentioned]
    if one:
        run_one = _of_model(samples[0], base, wanted, fitted)
        check_fit(several, samples[0])
    else:
        run_one = _of_samples(samples, base, fitted)

    def run(key: Key, asked: FitOptions) -> FitData:
        return run_one(key, asked._replace(kept_as=key.label, near=_begun_from(key)))

    # BIC compares fits with the same weights. The model that is taken is then fitted as asked.
    compared = asked._replace(errors="scaled" if errors == "auto" else errors, intervals=QUADRATIC)

    def tried(key: Key, thorough: bool) -> FitData:
        found = run(key, compared._replace(thorough=thorough or not one))
        # If the data determine only the product of thickness and index of a layer, a sample may
        # still be taken: the layer is there, although little is known of it.
        codes = {f.code for f in found.findings}
        thin = not one and "thin_film" in codes
        # A lossless index that is one of many stands for them, as it does in `fit`.
        one_of_many = key.without_k and codes & {*OPEN}
        return replace(found, status=CONVERGED) if thin or one_of_many else found

    trials = Trials(tried, progress or (lambda label: None), errors)
    if one:
        _stages(trials, len(np.unique(joined.wavelength_um[np.isfinite(joined.wavelength_um)])))
        _instrument_stage(trials, wanted)
        trials.settle()
    else:
        trials.attempt(*(Key(str(which)) for which in samples))
    choice = decide(list(trials.tried.values()))
    if choice.fit.names and compared != asked:
        taken = choice.taken.key
        if {f.code for f in choice.fit.findings} & {*OPEN}:  # with the range of all that fit
            taken = taken._replace(without_k=False)
        choice = choice.with_fit(run(taken, asked))
    if not one and instrument and "scale" not in mentioned:
        choice = _with_gain_instead(choice, lambda key: run(key, compared))
    return with_doubt(choice)


def _stages(trials: Trials, wavelengths: int) -> None:
    """Try the models that so many wavelengths can tell apart, and more while they help."""
    trials.attempt(Key("constant", without_k=True), *map(Key, _first_stage(wavelengths)))
    best = trials.best()
    if wavelengths < 6 or best.enough or not (_absorbs(best) or not explains(best.fit)):
        return
    if wavelengths >= 8 and best.key.model == "cauchy-urbach:2" and not explains(best.fit):
        trials.attempt(Key("cauchy-urbach:3"))

    def helped(kind: str, terms: int) -> bool:
        more, fewer = (trials.tried[Key(f"{kind}:{n}")] for n in (terms, terms - 1))
        return more.fit.bic < fewer.fit.bic - MARGIN

    def grown(terms: int) -> list[Key]:
        return [
            Key(f"{kind}:{terms}") for kind in GROWN
            if wavelengths >= 4 * terms
            and (fewer := trials.tried.get(Key(f"{kind}:{terms - 1}"))) and fewer.good
            and (terms < MOST_TERMS or helped(kind, terms - 1))
        ]  # fmt: skip

    # In parallel, so that the programs of two oscillators and of Tauc-Lorentz compile together.
    with_electrons = [Key(f"drude-lorentz:{terms}") for terms in (1, 2) if wavelengths >= 4 * terms]
    trials.attempt_chains(with_electrons, [Key("tauc-lorentz:1")], grown(2)[:1])
    for terms in range(2, MOST_TERMS + 1):
        keys = grown(terms)
        new = trials.attempt(*keys)
        if trials.best().enough:
            return
        before = simplest([c for key, c in trials.tried.items() if key not in keys]).fit.bic
        if not any(c.good and c.fit.bic < before - MARGIN for c in new) and (
            terms > 2 or explains(trials.best().fit)
        ):
            return


def _instrument_stage(trials: Trials, wanted: Sequence[str]) -> None:
    """Try each instrument parameter, and keep those that help for the next."""
    # A scale can look like absorption: it is tried with the best model without k as well.
    clear = [c for c in trials.tried.values() if not _absorbs(c)]
    bases = [trials.best()]
    bases += [c for c in [simplest(clear)] if c.key != bases[0].key]
    for name in wanted:
        new = trials.attempt(*(c.key._replace(free=(*c.key.free, name)) for c in bases))
        bases = [
            grown if grown.good and grown.fit.bic < base.fit.bic - MARGIN else base
            for base, grown in zip(bases, new, strict=True)
        ]
