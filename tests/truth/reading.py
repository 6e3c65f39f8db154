"""Numbers as texts, files made of them, and what the reader makes of such a file."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from fitting.data.errors import for_command
from fitting.data.measurement import Measurement, MeasurementError
from fitting.measured_file import read_csv

ANGLES = ("29.6667", "34.6667", "0.4e2", "61.25", "80")
R_S = ("0.755435", "0.774384", "8.09614e-1", ".85", "0.912516")
R_P = ("0.666709", "0.680472", "0.676313", "0.641742", "7.41058E-01")
ERRORS = ("0.000945", "0.002387", "9.49e-4", "0.0016", "0.002909")
PERCENT = ("75.5435", "77.4384", "80.9614", "85", "91.2516")
NANOMETRES = ("405", "532.0", "632.8", "658", "1064")
PSI = ("36.989", "31.637", "24.155", "15.2", "7.1034375")
DELTA = ("171.512", "164.968", "152.624", "118.601", "-3.5")


class Variety(NamedTuple):
    """The bytes of a file, the options that it needs, and what it holds, as texts.

    expected: quantity -> texts of the values; angles: texts, the same for every quantity.
    """

    content: bytes
    expected: dict[str, tuple[str, ...]]
    options: dict[str, object] = {}  # noqa: RUF012
    angles: tuple[str, ...] = ANGLES
    name: str = "gold.csv"


def rows(*columns: tuple[str, ...], mark: str = ",", end: str = "\n") -> str:
    return "".join(mark.join(cells) + end for cells in zip(*columns, strict=True))


def comma(cells: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(cell.replace(".", ",") for cell in cells)


def read(
    folder: Path, content: bytes | str, name: str = "gold.csv", **options: object
) -> Measurement:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_csv(path, **options)


def refusal(folder: Path, content: bytes | str, name: str = "gold.csv", **options: object) -> str:
    with pytest.raises(MeasurementError) as caught:
        read(folder, content, name, **options)
    text = for_command(caught.value)
    assert text.startswith(name), text
    assert not re.search("--[a-z]", str(caught.value)), "Python has arguments, not options"
    return text


def columns_of(path):
    """The columns of a CSV file of results by name; lines of comments are left out."""
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if line[:1] != "#"]
    return np.genfromtxt(lines, delimiter=",", names=True, dtype=None, encoding="utf-8")
