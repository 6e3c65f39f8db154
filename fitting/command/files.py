"""Several files fitted together: whether they can be of one sample."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import PurePath

import numpy as np

from fitting.errors import MeasurementError
from fitting.index.fit import FitResult, fit
from fitting.measurement import Measurement

# "glass_3mm.csv", "CLEAR_0.7 mm.dat"
_MILLIMETRES = re.compile(r"(?<![\d.])(\d+(?:\.\d+)?) ?mm(?![a-z])", re.IGNORECASE)
# Two files exclude each other where their indices are so many standard errors of the difference
# apart: by chance in 6e-5 of all pairs.
EXCLUDING = 4.0


def refuse_several_thicknesses(sources: Sequence[str]) -> None:
    """Raise where the names of files that share one thickness name different ones."""
    named = {}
    for source in sources:
        found = _MILLIMETRES.search(PurePath(source).name)
        if found:
            named.setdefault(float(found[1]), source)
    if len(named) > 1:
        each = " and ".join(f"{mm:g} mm ({source})" for mm, source in sorted(named.items()))
        raise MeasurementError(
            f"the files name plates of {each}; one thickness was given for all of them. Fit plates "
            "of different thickness one by one, each with its own --slab."
        )


def disagreement(measurements: Sequence[Measurement], **options) -> tuple[str, ...]:
    """Return a sentence where the separate fits of two files exclude each other; else nothing.

    options: of `fit`. Compared are eta and k at the wavelengths that two files share, where both
    fits converged with standard errors.
    """
    results = [fit(m, **options) for m in measurements]
    waves = [np.unique(m.wavelength_um) for m in measurements]
    worst, said = EXCLUDING, ""
    for i, first in enumerate(results):
        for j in range(i):
            second = results[j]
            for a, b in _shared(waves[i], waves[j]):
                apart, text = _apart(_one(first, a), _one(second, b))
                if apart > worst:
                    names = measurements[j].source, measurements[i].source
                    worst, said = apart, text.format(*names)
    return (said,) if said else ()


def _shared(first: np.ndarray, second: np.ndarray) -> list[tuple[int, int]]:
    return [
        (a, b)
        for a, x in enumerate(first.tolist())
        for b, y in enumerate(second.tolist())
        if x == y or (np.isnan(x) and np.isnan(y))
    ]


def _one(result: FitResult, i: int) -> FitResult:
    return result.at(i) if result.shape else result


def _apart(one: FitResult, other: FitResult) -> tuple[float, str]:
    """Return how many standard errors the two are apart, and the sentence with gaps for names."""
    worst, text = 0.0, ""
    for name in ("eta", "k"):
        values = getattr(other, name), getattr(one, name)
        sigmas = getattr(other, f"sigma_{name}"), getattr(one, f"sigma_{name}")
        together = float(np.hypot(*sigmas))
        if not (np.isfinite(together) and together > 0.0):
            continue
        apart = abs(values[0] - values[1]) / together
        if apart > worst:
            worst = apart
            text = (
                f"the files exclude each other: {name} is {values[0]:.5g} +- {sigmas[0]:.2g} by "
                f"{{0}} alone and {values[1]:.5g} +- {sigmas[1]:.2g} by {{1}} alone, "
                f"{apart:.2g} standard errors apart. They are not of one sample, or one of them "
                "is off; the values above average what cannot both be right."
            )
    return worst, text
