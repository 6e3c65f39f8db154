"""The error that reading a measurement raises, how it names its place, and missing packages."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn

# An option of the command line in a sentence, and the word behind it.
_OPTION = re.compile(r"--([a-z]+(?:-[a-z]+)*)(?:([ =])(\S+))?")
# Options whose value is a number, and the words in small letters that are values of others.
_NUMBERS = ("angle_deg", "wavelength_um", "scale", "sigma")
_WORDS = (
    "deg", "rad", "nm", "um", "none", "s", "p", "grazing-deg", "angle-from-p", "angle-from-s", ",",
)  # fmt: skip


# Letters of a message: a cell of it may have as many as the file.
_LONGEST = 1500


class MeasurementError(ValueError):
    """A measurement cannot be read, or a value in it is impossible.

    The text names the file, line and column as far as they are known, what came,
    what was wanted, and the argument that settles it, for example
    ``gold.csv, line 14, column R_s: reflectance 92.4 is outside [0, 1]. If the
    column is in percent, say scale=0.01.``
    """

    def __str__(self) -> str:
        return _OPTION.sub(_argument, for_command(self))


def for_command(error: Exception) -> str:
    """Return the text of an error with the options of the command line: ``say --scale 0.01``."""
    return str(error.args[0]) if isinstance(error, MeasurementError) else str(error)


def _argument(option: re.Match[str]) -> str:
    """Return the argument of `read_csv` for an option with the word behind it."""
    name, mark, word = option[1].replace("-", "_"), option[2] or "", option[3] or ""
    value = word.rstrip(",;:)") or word
    value = value if value.endswith("...") else value.removesuffix(".")
    rest = word[len(value) :]
    known = name == "ignore" or value in _WORDS
    if not (known or mark == "=" or re.search(r"[A-Z0-9=]", value)):
        return f"{name}{mark}{word}"
    return f"{name}={value}{rest}" if name in _NUMBERS else f'{name}="{value}"{rest}'


def place(source: str, line: int = 0, column: str = "") -> str:
    """Return ``source, line 14, column R_s``, leaving out what is not known."""
    return source + f", line {line}" * bool(line) + f", column {column}" * bool(column)


class _Refused(Exception):
    """What is wrong with a measurement, its line and its column, before its name is known."""


def refuse(text: str, line: int = 0, column: str = "") -> NoReturn:
    """Refuse a measurement, whose name `named` puts before the text."""
    raise _Refused(text, line, column)


@contextmanager
def named(source: str) -> Iterator[None]:
    """Raise MeasurementError, with the name of the measurement, for what is refused inside."""
    try:
        yield
    except _Refused as refused:
        text, line, column = refused.args
        if len(text) > _LONGEST:  # what to do stands at its end
            text = f"{text[: _LONGEST // 2]} ... {text[-_LONGEST // 2 :]}"
        raise MeasurementError(f"{place(source, line, column)}: {text}") from None


class MissingExtra(ValueError, ImportError):
    """A package is not installed; the text names what asked for it and how to install it."""

    def __init__(self, asked: str, package: str, extra: str) -> None:
        super().__init__(
            f"{asked} needs {package}, which is not installed: pip install {package} "
            f"(or install fresnel-jax with its extra {extra!r})."
        )
