"""Several files fitted together: whether they can be of one sample."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import PurePath
from typing import Any

import numpy as np

from fitting.diagnostics import Warning
from fitting.errors import MeasurementError
from fitting.measurement import Measurement
from fitting.result import Fit
from fitting.visible import visible

# "glass_3mm.csv", "CLEAR_0.7 mm.dat"
_MILLIMETRES = re.compile(r"(?<![\d.])(\d+(?:\.\d+)?) ?mm(?![a-z])", re.IGNORECASE)
# Two files exclude each other where their indices are so many standard errors of the difference
# apart: by chance in 6e-5 of all pairs.
EXCLUDING = 4.0


def refuse_several_thicknesses(sources: Sequence[str]) -> None:
    """Raise where the names of files that share one thickness name different ones."""
    named: dict[float, str] = {}
    for source in sources:
        found = _MILLIMETRES.search(PurePath(source).name)
        if found:
            named.setdefault(float(found[1]), source)
    if len(named) > 1:
        each = " and ".join(f"{mm:g} mm ({source})" for mm, source in sorted(named.items()))
        raise MeasurementError(
            f"the files name plates of {each}; one thickness was given for all of them. Fit plates "
            "of different thickness one by one, each with its own thickness."
        )


def told_apart(measurements: Sequence[Measurement], paths: Sequence[str]) -> list[Measurement]:
    """Return measurements of files of one name (a/scan.csv, b/scan.csv) named by their paths."""
    sources = [m.source for m in measurements]
    return [
        replace(m, source=visible(path)) if sources.count(m.source) > 1 else m
        for m, path in zip(measurements, paths, strict=True)
    ]


def disagreement(results: Sequence[Fit]) -> tuple[Warning, ...]:
    """Return a warning where the separate fits of two files exclude each other; else nothing.

    Compared are eta and k at the wavelengths that two files share, where both fits converged with
    standard errors.
    """
    worst, said = EXCLUDING, None
    for i, first in enumerate(results):
        for j in range(i):
            second = results[j]
            for a, b in _shared(first, second):
                apart, values = _apart(_one(first, a), _one(second, b))
                if apart > worst:
                    names = [f.measurement.source for f in (second, first) if f.measurement]
                    worst, said = apart, {**values, "files": tuple(names)}
    return (Warning("files_exclude", {}, said),) if said else ()


def _shared(first: Fit, second: Fit) -> list[tuple[int, int]]:
    waves = (np.atleast_1d(f.wavelength_um).tolist() for f in (first, second))
    one, other = waves
    return [
        (a, b)
        for a, x in enumerate(one)
        for b, y in enumerate(other)
        if x == y or (np.isnan(x) and np.isnan(y))
    ]


def _one(result: Fit, i: int) -> Fit:
    return result[i] if result.shape else result


def _apart(one: Fit, other: Fit) -> tuple[float, dict[str, Any]]:
    """Return how many standard errors the two are apart, and the numbers of the sentence."""
    worst, said = 0.0, {}
    for name in ("eta", "k"):
        estimates = other.parameters[name], one.parameters[name]
        values, sigmas = [e.value for e in estimates], [e.sigma for e in estimates]
        together = float(np.hypot(*sigmas))
        if not (np.isfinite(together) and together > 0.0):
            continue
        apart = abs(values[0] - values[1]) / together
        if apart > worst:
            worst = apart
            said = {"parameter": name, "values": values, "sigmas": sigmas, "apart": apart}
    return worst, said
