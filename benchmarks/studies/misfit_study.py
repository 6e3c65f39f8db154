"""How often a fit of a sample that is not the true one is told, and what its intervals then hold.

    python -m benchmarks.studies.misfit_study --truths 3

Each case has an error that the fitted sample or instrument does not have: an oxide of 3 nm left
out, the back face of a plate, a gradient, roughness, an index of the substrate 1 % off, a scale of
2 %, angles 0.3 degrees and wavelengths 1 nm off, a slit, a polarizer that leaks. R and T over the
wavelength, R_s and R_p over the angle, psi and Delta; films and bare surfaces; random truths, noise
with stated errors. A fit is right if the 95 % intervals of all parameters hold the truth. It tells
a misfit by its status, or lists other solutions or a warning of the residuals; else it is silent.
Silent and wrong is also what the data do not show: that counts where chi2/dof exceeds 1.3 beyond
chance (one in a thousand), or where residuals are in order.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy.special import chdtri

from benchmarks.machine import conditions
from fitting import Fit, Measurement, fit, simulate

WAVES, ANGLES = np.linspace(0.42, 0.86, 60), np.linspace(20.0, 84.0, 33)
NOISE = {"psi": 0.03, "delta": 0.08}  # degrees; of powers .002
TOLD = ("chi2_large", "chi2_doubtful", "residuals_in_order", "errors_floor", "errors_relative",
        "errors_differ")  # fmt: skip


class Case(NamedTuple):
    """true: the sample as it is; fitted: as the fit has it. of: quantities, over WAVES or ANGLES.

    names: parameters that are compared. place: of them in the true sample. extra: its further
    parameters. shift: degrees and micrometres by which the axes that are written down are off.
    """

    true: str
    fitted: str
    of: tuple[str, ...]
    names: tuple[str, ...]
    place: str = ""
    extra: Mapping[str, float] = {}
    angle_deg: float | None = None
    shift: tuple[float, float] = (0.0, 0.0)


FILM, BARE = ("A", "thickness_nm"), ("eta", "k")
ON_GLASS, FITTED = "air | cauchy:2 100..900 nm | {}", "air | cauchy:2 100..900 nm | 1.52"
RT, SP, ELLIPSOMETRY = ("R", "T"), ("R_s", "R_p"), ("psi", "delta")
CASES = {
    "back face, R T": Case(ON_GLASS.format("1.52 1 mm thick | air"), FITTED, RT, FILM, "film."),
    "gradient, R": Case("air | cauchy:2 100..900 nm graded | 1.52", FITTED, ("R",), FILM,
                        extra={"grade": 0.06}),
    "roughness, R": Case("air | 1.45 12 nm held | cauchy:2 100..900 nm | 1.52", FITTED, ("R",),
                         FILM, "film_2."),
    "substrate 1 %, R": Case(ON_GLASS.format("1.535"), FITTED, ("R",), FILM),
    "scale 2 %, R": Case(FITTED, FITTED, ("R",), FILM, extra={"scale": 0.98}),
    "wavelength 1 nm, R": Case(FITTED, FITTED, ("R",), FILM, shift=(0.0, 1e-3)),
    "slit 12 nm, R": Case(FITTED, FITTED, ("R",), FILM, extra={"bandwidth": 12.0}),
    "angle .3, psi Delta": Case(ON_GLASS.format("Si"), ON_GLASS.format("Si"), ELLIPSOMETRY, FILM,
                                angle_deg=65.0, shift=(0.3, 0.0)),
    "oxide, psi Delta": Case(ON_GLASS.format("SiO2 3 nm held | Si"), ON_GLASS.format("Si"),
                             ELLIPSOMETRY, FILM, "film_1.", angle_deg=65.0),
    "oxide, bare s p": Case("air | SiO2 3 nm held | constant", "constant", SP, BARE, "substrate."),
    "scale 2 %, bare s p": Case("constant", "constant", SP, BARE, extra={"scale": 0.98}),
    "angle .3, bare s p": Case("constant", "constant", SP, BARE, shift=(0.3, 0.0)),
    "leak 3 %, bare s p": Case("constant", "constant", SP, BARE, extra={"leak": 0.03}),
    "roughness, bare s p": Case("air | 1.8 8 nm held | constant", "constant", SP, BARE,
                                "substrate."),
}  # fmt: skip


def _truth(case: Case, rng: np.random.Generator) -> dict[str, float]:
    if case.names is BARE:
        return {"eta": rng.uniform(1.6, 4.5), "k": rng.choice([0.0, rng.uniform(0.2, 3.0)])}
    return {
        "A": rng.uniform(1.6, 2.4), "B": rng.uniform(0.004, 0.02),
        "thickness_nm": rng.uniform(150.0, 800.0),
    }  # fmt: skip


def measured(case: Case, rng: np.random.Generator) -> tuple[Measurement, dict[str, float]]:
    """Return what is written down of a random truth, with stated errors that are right."""
    truth = _truth(case, rng)
    bare = case.names is BARE
    angle = ANGLES if bare else np.full(len(WAVES), case.angle_deg or 0.0)
    wave = np.full(len(ANGLES), 0.6) if bare else WAVES
    parameters = {case.place + n: float(v) for n, v in truth.items()} | dict(case.extra)
    values, sigma = {}, {}
    for q in case.of:
        clean = simulate(
            case.true, parameters, np.minimum(angle + case.shift[0], 90.0),
            wave + case.shift[1], q,
        )  # fmt: skip
        sigma[q] = NOISE.get(q, 0.002)
        values[q] = clean + sigma[q] * rng.standard_normal(len(clean))
    return Measurement.from_columns(angle, wave, sigma=sigma, **values), truth


def _holds(ends: Mapping[str, tuple[float, float]], truth: Mapping[str, float]) -> bool:
    return all(low <= truth[n] <= high for n, (low, high) in ends.items())


class Verdict(NamedTuple):
    """right: intervals hold the truth. told: "told", "listed" or "silent". shows: whether the data
    show it. covered: whether the range over the explanations holds the truth. off: in half widths.
    """

    right: bool
    told: str
    shows: bool
    covered: bool
    off: float


def verdict(found: Fit, case: Case, truth: Mapping[str, float]) -> Verdict:
    """Return how a fit stands beside the truth."""
    own = {n: tuple(map(float, found.parameters[n].interval)) for n in case.names}
    codes = {w.code: w for w in found.warnings}
    every = dict(own)
    if "explained_by" in codes:
        for *_, after in codes["explained_by"].values["explanations"]:
            for n, (_, _, low, high) in ((n, after[n]) for n in case.names):
                every[n] = min(every[n][0], low), max(every[n][1], high)
    told = "told" if found.status != "converged" else "silent"
    if told == "silent" and (found.alternatives or set(TOLD) & {*codes}):
        told = "listed"
    limit = max(1.3, float(chdtri(found.dof, 1e-3)) / found.dof)
    shows = bool(found.chi2_reduced > limit) or "residuals_in_order" in codes
    off = max(
        abs(truth[n] - 0.5 * (low + high)) / max(0.5 * (high - low), 1e-12)
        for n, (low, high) in own.items()
    )
    return Verdict(_holds(own, truth), told, shows, _holds(every, truth), off)


def verdicts(
    names: tuple[str, ...], truths: int, seed: int, fitted: Callable[..., Fit] = fit
) -> Iterator[tuple[str, Verdict]]:
    """Yield the verdict on every case and truth."""
    for i, name in enumerate(names):
        for j in range(truths):
            m, truth = measured(CASES[name], np.random.default_rng([seed, i, j]))
            yield name, verdict(fitted(m, CASES[name].fitted), CASES[name], truth)


def table(each: list[tuple[str, Verdict]]) -> list[str]:
    """Return the lines of the report."""
    lines = ["| case | right | wrong, told | wrong, listed | wrong, silent | off |",
             "| --- | --- | --- | --- | --- | --- |"]  # fmt: skip
    by_name: dict[str, list[Verdict]] = {}
    for name, v in each:
        by_name.setdefault(name, []).append(v)
    for name, some in [*by_name.items(), ("all", [v for _, v in each])]:
        count = Counter("right" if v.right else v.told for v in some)
        numbers = (str(count[kind]) for kind in ("right", "told", "listed", "silent"))
        off = np.median([v.off for v in some])
        lines.append(f"| {name} | {' | '.join(numbers)} | {off:.1f} |")
    told = [v for _, v in each if v.told == "told"]
    silent = sum(v.told == "silent" and not v.right and v.shows for _, v in each)
    held: Any = 100.0 * np.mean([v.covered for v in told]) if told else float("nan")
    return [
        *lines, "", f"Silent although the data show it: {silent} (aim 0).",
        f"Where told, interval or explanations hold the truth in {held:.0f} % (aim 80 %).",
    ]  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--truths", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--cases", nargs="*", default=list(CASES), choices=list(CASES))
    said = parser.parse_args()
    print(conditions())
    each = list(verdicts(tuple(said.cases), said.truths, said.seed))
    print("\n".join(table(each)))


if __name__ == "__main__":
    main()
