"""How often the interval of the thickness of a film with a free index holds the true one.

Random films of 40 to 400 nm, transparent (Cauchy) or with an Urbach tail, on silicon, glass or
silver; psi and Delta at three angles, at two, or R and T of s and p at two; 8 to 40 wavelengths;
noise of .02 to .2 degrees of psi, twice that of Delta, a hundredth of it of powers. The fit knows
that the film is between 2/3 and 3/2 of its thickness, and nothing of its index. Counted are

  holds   the 95 % interval of the thickness holds the true one, in per cent
  told    it does not, and the result says that the data are not described, gives other thicknesses
          or no error, in per cent
  bias    mean of (fitted - true) / standard error; 0 but for the noise is right
  spread  root mean square of that; 1 is right

    python -m benchmarks.studies.free_film_study [--films 200] [--minutes 60]
                                                 [--seed N] [--only silver]
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from benchmarks.studies.study_options import run_study, study_options
from fitting import fit
from tests.truth.random_free_films import Case, simulated

TOLD = {"chi2_large", "does_not_describe", "other_thickness", "shared_not_seen"}


def outcome(case: Case, seed: int) -> dict[str, Any]:
    """Return what the fit of a film came to."""
    began = time.perf_counter()
    found = fit(case.measurement, case.sample)
    d = found.parameters["thickness_nm"]
    holds = bool(d.interval[0] <= case.thickness_nm <= d.interval[1])
    told = not holds and bool({f.code for f in found.findings} & TOLD)
    return {
        "cell": case.cell, "seed": seed, "holds": holds, "told": told, "thickness": d.value,
        "off": float((d.value - case.thickness_nm) / d.sigma),
        "seconds": time.perf_counter() - began,
    }  # fmt: skip


def _line(name: str, rows: list[dict[str, Any]]) -> str:
    off = np.array([r["off"] for r in rows])
    off = off[np.isfinite(off)] if np.isfinite(off).any() else np.array([np.nan])
    holds, told = (100.0 * float(np.mean([r[k] for r in rows])) for k in ("holds", "told"))
    seconds = float(np.median([r["seconds"] for r in rows]))
    return (
        f"{name:40}{len(rows):6d}{holds:8.1f}{told:8.1f}{off.mean():8.2f}"
        f"{np.sqrt(np.mean(off**2)):8.2f}{seconds:8.2f}"
    )


def _tell(case: Case, r: dict[str, Any]) -> None:
    """Print a line for a film whose thickness is not in its interval."""
    if not r["holds"]:
        print(f"missed{', told' if r['told'] else ''}: film {r['seed']}, {', '.join(case.cell)}, "
              f"{case.thickness_nm:.4g} nm, found {r['thickness']:.4g} nm, {r['off']:.3g} "
              "standard errors off", flush=True)  # fmt: skip


def main() -> None:
    """Print the table."""
    arguments = study_options(__doc__, "films", 200)

    def one(seed: int) -> dict[str, Any] | None:
        case = simulated(seed)
        if not any(text in ", ".join(case.cell) for text in arguments.only):
            return None
        r = outcome(case, seed)
        _tell(case, r)
        return r

    rows = run_study(arguments, one)
    heads = "".join(f"{h:>8}" for h in ("holds", "told", "bias", "spread", "s"))
    print(f"\n{'film':40}{'films':>6}{heads}")
    for part in range(3):
        for value in sorted({r["cell"][part] for r in rows}):
            print(_line(value, [r for r in rows if r["cell"][part] == value]))
    print(_line("all", rows))


if __name__ == "__main__":
    main()
