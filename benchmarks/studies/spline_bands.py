"""How often the bands of a kk-spline hold the index of simulated Tauc-Lorentz materials.

``python -m benchmarks.studies.spline_bands --truths 60 --models kk-spline:24,kk-spline`` prints,
for wavelengths by their distance from the gap, the share whose true eta and k lie within 1.96
standard errors (95 % wanted), and the median of these errors; then chi2 over the degrees of
freedom. Gap, resonance, width and strength of each material are random; with ``--film`` it is a
film on silicon or on glass, of random thickness, and the share of thicknesses within their
intervals is printed.
"""

from __future__ import annotations

import argparse
import itertools

import numpy as np

from tests.truth.random_edges import fitted, measured, off_of, truth_of

# Photon energy minus the gap, eV.
PLACES = (-9.0, -0.25, -0.1, 0.0, 0.1, 0.25, 0.5, 1.0, 2.0, 9.0)


def table(model: str, found: list[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> None:
    """Print the shares of one model by the distance from the gap."""
    above, off, sigma = (np.concatenate(part, -1) for part in zip(*found, strict=True))
    print(f"{model}\n   eV above the gap  points  eta in band  k in band  sigma eta    sigma k")
    for low, high in [*itertools.pairwise(PLACES), (PLACES[0], PLACES[-1])]:
        here = (above >= low) & (above < high)
        inside = (np.abs(off[:, here]) < 1.96).mean(1)
        size = np.median(sigma[:, here], 1)
        print(
            f"   {low:6.2f} to {high:5.2f}  {here.sum():7d}  {inside[0]:11.1%}  {inside[1]:9.1%}  "
            f"{size[0]:9.5f}  {size[1]:9.5f}"
        )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--truths", type=int, default=60)
    parser.add_argument("--models", default="kk-spline")
    parser.add_argument("--film", action="store_true")
    parser.add_argument("--seed", type=int, default=20261123)
    arguments = parser.parse_args()
    for model in arguments.models.split(","):
        random = np.random.default_rng(arguments.seed)
        found, chi2, right = [], [], []
        for _ in range(arguments.truths):
            truth = truth_of(random, arguments.film)
            result = fitted(truth, measured(truth, random), model)
            found.append(off_of(result, truth))
            chi2.append(result.chi2_reduced)
            if truth.thickness_nm:
                low, high = result.parameters["thickness_nm"].interval
                right.append(low <= truth.thickness_nm <= high)
        table(model, found)
        if right:
            print(f"   interval of the thickness holds the true one: {np.mean(right):.1%}")
        print(f"   chi2 / dof: median {np.median(chi2):.2f}, largest {max(chi2):.2f}", flush=True)


if __name__ == "__main__":
    main()
