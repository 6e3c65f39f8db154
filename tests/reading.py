"""Write a small file, read it, or catch what the reader says against it."""

from __future__ import annotations

from pathlib import Path

import pytest

from fitting.measurement import Measurement, MeasurementError, read_csv


def read(
    folder: Path, content: bytes | str, name: str = "gold.csv", **options: object
) -> Measurement:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_csv(path, **options)


def refusal(folder: Path, content: bytes | str, name: str = "gold.csv", **options: object) -> str:
    with pytest.raises(MeasurementError) as caught:
        read(folder, content, name, **options)
    text = str(caught.value)
    assert text.startswith(name), text
    return text
