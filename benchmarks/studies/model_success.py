"""How often the fit of a dispersion model reaches the best minimum, over simulated spectra.

Random materials of every model, 60 wavelengths, four ways to measure them, Gaussian noise: the fit
as a user gets it (quasi-random starts) against the best minimum known, that of the same fit started
at the true parameters as well. Counted, in per cent, are

  best    chi2 within a hundredth of a unit of the best known
  false   chi2 higher than that, and yet nothing in the result says so (status "converged", and
          three starts or more that ended in the same minimum)
  failed  "not converged" although the best known minimum is
  starts  how many of the starts ended in the best minimum (median)

and the seconds that a fit takes once its program is compiled (median).

    python -m benchmarks.studies.model_success [--truths 100] [--only lorentz]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from fitting import fit
from tests.truth.random_spectra import SETUPS, SLAB, Setup, sample_of, simulated, truth


def one(model: str, setup: Setup, seed: int, **options: Any) -> dict[str, float] | None:
    """Return what the fit of one simulated spectrum came to."""
    random = np.random.default_rng([seed, len(model), ord(model[0]), len(setup.name)])
    parameters = truth(model, random)
    if "edge_ev" not in parameters and model.startswith("cauchy-urbach"):
        from fresnel_jax.dispersion import HC_EV_UM

        parameters["edge_ev"] = HC_EV_UM / 0.3
    measured = simulated(model, parameters, setup, random)
    if measured is None:
        return None
    sample = sample_of(model, setup)
    began = time.perf_counter()
    found = fit(measured, sample, errors="stated", **options)
    seconds = time.perf_counter() - began
    edge = parameters.pop("edge_ev", None)
    known = fit(measured, sample, errors="stated", start=parameters, **options)
    del edge
    best = min(found.cost, known.cost)
    good = found.cost <= best + 0.01 and found.status != "not converged"
    quiet = found.status == "converged" and found.reached >= 3
    return {
        "best": good, "false": not good and quiet,
        "failed": found.status == "not converged" and known.status != "not converged",
        "starts": 100.0 * found.reached / found.starts if good else np.nan,
        "seconds": seconds, "rise": found.cost - best, "seed": seed,
    }  # fmt: skip


def cases() -> Iterator[tuple[str, Setup]]:
    """Yield the models and the ways to measure them."""
    for model in ("cauchy", "cauchy-urbach", "sellmeier", "sellmeier:2", "drude", "lorentz:1",
                  "lorentz:2", "lorentz:3", "drude-lorentz:1", "drude-lorentz:2",
                  "tauc-lorentz"):  # fmt: skip
        for setup in SETUPS:
            yield model, setup
    yield "cauchy-urbach", SLAB


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--truths", type=int, default=100)
    parser.add_argument("--only", default="", help="models that begin so")
    parser.add_argument("--verbose", action="store_true", help="name the spectra that were missed")
    arguments = parser.parse_args()
    print(f"{arguments.truths} spectra a line; per cent\n")
    print(f"{'model':17}{'measured':26}{'best':>7}{'false':>7}{'failed':>7}{'starts':>7}{'s':>8}")
    total = []
    for model, setup in cases():
        if not model.startswith(arguments.only):
            continue
        rows = [r for seed in range(arguments.truths) if (r := one(model, setup, seed))]
        total += rows
        mean = {
            k: 100.0 * float(np.mean([r[k] for r in rows])) for k in ("best", "false", "failed")
        }
        starts = float(np.nanmedian([r["starts"] for r in rows] or [np.nan]))
        seconds = float(np.median([r["seconds"] for r in rows]))
        print(
            f"{model:17}{setup.name:26}{mean['best']:7.1f}{mean['false']:7.1f}{mean['failed']:7.1f}"
            f"{starts:7.0f}{seconds:8.3f}", flush=True,
        )  # fmt: skip
        if arguments.verbose:
            missed = [(int(r["seed"]), round(r["rise"], 3)) for r in rows if not r["best"]]
            print("   missed", missed) if missed else None
    share = 100.0 * float(np.mean([r["best"] for r in total]))
    print(f"\nall: {share:.2f} % of {len(total)} spectra at the best minimum known")


if __name__ == "__main__":
    main()
