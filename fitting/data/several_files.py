"""Several files fitted together: what their names contain."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import PurePath

from fitting.data.errors import MeasurementError
from fitting.data.measurement import Measurement
from fitting.process.visible import visible

# "glass_3mm.csv", "CLEAR_0.7 mm.dat"
_MILLIMETRES = re.compile(r"(?<![\d.])(\d+(?:\.\d+)?) ?mm(?![a-z])", re.IGNORECASE)


def millimetres_named(source: str) -> str | None:
    """Return the thickness in mm in the name of a file, as it is written there."""
    found = _MILLIMETRES.search(PurePath(source).name)
    return found[1] if found else None


def refuse_several_thicknesses(sources: Sequence[str]) -> None:
    """Raise ValueError where files that share one thickness have different ones in their names."""
    named: dict[float, str] = {}
    for source in sources:
        if mm := millimetres_named(source):
            named.setdefault(float(mm), source)
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
