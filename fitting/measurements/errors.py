"""The error that reading a measurement raises, how it names its place, and missing packages."""

from __future__ import annotations

from typing import NoReturn


class MeasurementError(ValueError):
    """A measurement cannot be read, or a value in it is impossible.

    The text names the file, line and column as far as they are known, what came,
    what was wanted, and the option that settles it, for example
    ``gold.csv, line 14, column R_s: reflectance 92.4 is outside [0, 1]. If the
    column is in percent, say --scale 0.01.``  An option ``--angle-unit`` of the command
    line is the keyword ``angle_unit`` of :func:`fitting.measurements.measurement.read_csv`.
    """


def place(source: str, line: int = 0, column: str = "") -> str:
    """Return ``source, line 14, column R_s``, leaving out what is not known."""
    text = source
    if line:
        text += f", line {line}"
    if column:
        text += f", column {column}"
    return text


def refuse(line: int, text: str) -> NoReturn:
    """Raise MeasurementError at a line of a file; its name is put before by `reader.formats`."""
    raise MeasurementError(f"line {line}: {text}")


class MissingExtra(ValueError, ImportError):
    """A package is not installed; the text names what asked for it and how to install it."""

    def __init__(self, asked: str, package: str, extra: str) -> None:
        super().__init__(
            f"{asked} needs {package}, which is not installed: pip install {package} "
            f"(or install fresnel-jax with its extra {extra!r})."
        )
