"""How often a fit finds the best minimum, and whether its status tells the truth.

For 1e4 random materials of each class, 60 angles from 1 to 89 degrees, s and p together, p, s and
unpolarised, noise 0, .1 and .5 %: the fit as a user gets it (mesh start) against the best minimum
known (that of the same fit started at the true index as well). Counted, in per cent, are

  wrong   chi2 more than a hundredth of a unit above the best known, yet reported as converged
  failed  reported as "not converged"
  open    reported as "undetermined" (the data fix only one combination of eta and k)
  k = 0   wrong when the user gives a start at k = 0, 20 % off in eta (where other programs fail)

and the evaluations of residuals and derivatives that the fit of a curve took, second basins
included (median, 99 %, most). For s and p without noise, the next line says how far eta and k are
off.

    python benchmarks/fit_success.py [--truths 10000]
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import jax
import numpy as np

from fitting import Fit, fit_many
from fresnel_jax import powers

ANGLES = np.linspace(1.0, 89.0, 60)
CHANNELS = {"s, p": ("R_s", "R_p"), "p": ("R_p",), "unpolarised": ("R",), "s": ("R_s",)}
CLASSES = ("dielectric", "weak absorber", "semiconductor", "metal", "total reflection")
NOISES = (0.0, 1e-3, 5e-3)


def truths(kind: str, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return random eta and k of a class of materials, (count,) each."""
    if kind == "dielectric":
        return rng.uniform(1.3, 3.5, count), np.zeros(count)
    if kind == "weak absorber":
        return rng.uniform(1.3, 3.5, count), 10.0 ** rng.uniform(-6.0, -2.0, count)
    if kind == "semiconductor":
        return rng.uniform(2.0, 5.0, count), rng.uniform(0.01, 3.0, count)
    if kind == "total reflection":  # n relative to a prism
        return rng.uniform(0.3, 0.95, count), 10.0 ** rng.uniform(-4.0, 0.0, count)
    return rng.uniform(0.05, 4.0, count), rng.uniform(1.0, 10.0, count)


def curves(
    eta: np.ndarray, k: np.ndarray, names: tuple[str, ...], noise: float, rng: np.random.Generator
) -> dict[str, Any]:
    """Return noisy reflectances of every material, (count, angles) a channel."""
    with jax.enable_x64(True):
        exact = powers(np.cos(np.radians(ANGLES)), eta[:, None], k[:, None])
        both = {"R_s": exact.R_s, "R_p": exact.R_p, "R": exact.R}
        both = {name: np.asarray(both[name]) for name in names}
    return {name: r + noise * rng.standard_normal(r.shape) for name, r in both.items()}


def chi2(result: Fit, noise: float) -> np.ndarray:
    """Return the sum of squares in units of the noise (of 1e-12 where there is none)."""
    return result.rms**2 * result.n_data / max(noise, 1e-12) ** 2


def study(kind: str, names: tuple[str, ...], noise: float, count: int) -> str:
    """Return one row of the table."""
    rng = np.random.default_rng(20)
    eta, k = truths(kind, count, rng)
    measured = curves(eta, k, names, noise, rng)
    found = fit_many(ANGLES, **measured)
    at_zero = fit_many(ANGLES, **measured, start={"eta": 1.2 * eta, "k": 0.0 * k})
    best = chi2(fit_many(ANGLES, **measured, start={"eta": eta, "k": k}), noise)
    good = found.status == "converged"
    wrong = good & (chi2(found, noise) > best + 1e-2)
    wrong_at_zero = good & (chi2(at_zero, noise) > best + 1e-2)
    failed, undetermined = found.status == "not converged", found.status == "undetermined"
    shares = [100.0 * w.mean() for w in (wrong, failed, undetermined, wrong_at_zero)]
    calls = np.percentile(found.evaluations, [50, 99, 100]).astype(int)
    row = " ".join(f"{share:7.3f}" for share in shares) + "  " + "/".join(map(str, calls))
    if noise or len(names) == 1:
        return row
    row += f"\n{'':31s}eta off by at most {np.max(np.abs(found.eta / eta - 1.0)):.1e} of itself"
    for least in (0.01, 0.1):
        seen = k > least
        if seen.any():
            off = np.abs(found.k / k - 1.0)[seen]
            row += f", k > {least} by {np.max(off):.1e} (99 % below {np.percentile(off, 99):.1e})"
    return row


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--truths", type=int, default=10_000, help="materials of each class")
    count = parser.parse_args().truths
    print(f"{count} materials a class, {len(ANGLES)} angles")
    heads = " ".join(f"{head:>7s}" for head in ("wrong", "failed", "open", "k = 0"))
    print(f"{'data':12s} {'class':16s} {'noise':>6s} {heads}  evaluations")
    started = time.perf_counter()
    for data, names in CHANNELS.items():
        for noise in NOISES:
            for kind in CLASSES:
                row = study(kind, names, noise, count)
                print(f"{data:12s} {kind:16s} {noise:6.1%} {row}", flush=True)
    print(f"{time.perf_counter() - started:.0f} s")


if __name__ == "__main__":
    main()
