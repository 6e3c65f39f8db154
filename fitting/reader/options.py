"""The options of the reader, each a Python value or the text of its flag, checked."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple, NoReturn

from fitting.data.errors import refuse
from fitting.data.quantities import QUANTITIES
from fitting.data.units import ANGLE_UNITS, WAVELENGTH_UNITS
from fitting.reader.cells import DELIMITERS
from fitting.reader.vocabulary import light_of, plain

ROLES = (
    ("angle", "wavelength", "polarization", "polarizer")
    + QUANTITIES
    + tuple("sigma_" + quantity for quantity in QUANTITIES)
)
POLARIZER_FROM = ("angle-from-p", "angle-from-s")


class Options(NamedTuple):
    """Checked options of :func:`fitting.read_csv`; None, or empty, where not given.

    light: "s", "p", "u" for the whole file, or "". codes: text of a cell -> "s", "p", "u".
    ignore: names, in small letters, or numbers of columns that shall not be read.
    polarizer: "angle-from-p", "angle-from-s" or "". zero_is_value: zeros were said to be measured.
    lines: the first and the last that may hold rows; the header may stand before. delimiter: the
    sign itself; without it the split is taken that makes the most lines rows of one length.
    divided: the values are one of two scans, whose quotient counts: their unit is of no matter.
    """

    columns: dict[str, str]
    keep: dict[str, list[str]]
    ignore: list[str]
    angle_deg: float | None
    angle_unit: str
    wavelength_um: float | None
    wavelength_unit: str
    light: str
    codes: dict[str, str]
    polarizer: str
    scale: float | None
    sigma: float | None
    psi_unit: str
    missing: list[str]
    zero_is_value: bool
    lines: tuple[int, int]
    delimiter: str | None
    decimal: str | None
    encoding: str | None
    divided: bool = False


class _Given(NamedTuple):
    """The options as they came, by name."""

    by_name: Mapping[str, object]

    def refuse(self, name: str, text: str) -> NoReturn:
        """Raise because the value of an option means nothing."""
        came = f"--{name.replace('_', '-')}={self.by_name[name]}"
        refuse(f"{came} {text}")

    def number(self, name: str, low: float, high: float, wanted: str = "") -> float | None:
        """Return a number from low to high, None where none was given. wanted: these in words."""
        value = self.by_name.get(name)
        try:
            number = None if value is None else float(value)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            number = float("nan")
        if number is not None and not low <= number <= high:
            self.refuse(
                name, f"came where {wanted or f'a number from {low:g} to {high:g}'} was wanted."
            )
        return number

    def one_of(self, name: str, wanted: tuple[str, ...]) -> str:
        """Return one of the words wanted; "" where none was given."""
        if (value := self.by_name.get(name)) is None:
            return ""
        if (text := str(value).strip()) not in wanted:
            self.refuse(name, f"is not known; it can be {', '.join(wanted)}.")
        return text

    def words(self, name: str) -> list[str]:
        """Return the words of a list or of ``a,b``."""
        value = self.by_name.get(name)
        items = [] if value is None else value if isinstance(value, (list, tuple)) else [value]
        return [part.strip() for item in items for part in str(item).split(",")]

    def pairs(self, name: str) -> dict[str, str]:
        """Return the pairs of ``A=1,B=2`` or a mapping; a part without = goes to the one before."""
        value = self.by_name.get(name)
        if value is None:
            return {}
        if isinstance(value, Mapping):
            value = ",".join(f"{k}={','.join(map(str, v)) if isinstance(v, (list, tuple)) else v}"
                             for k, v in value.items())  # fmt: skip
        pairs: dict[str, str] = {}
        key = ""
        for part in str(value).split(","):
            left, equals, right = map(str.strip, part.partition("="))
            if equals and left in pairs:
                self.refuse(name, f"gives {left} twice, {pairs[left]} and {right}. Keep one.")
            if equals:
                key, pairs[left] = left, right
            elif key:
                pairs[key] += "," + left
        if not pairs:
            self.refuse(name, "came where NAME=VALUE was wanted.")
        return pairs

    def polarization(self) -> tuple[str, dict[str, str], str]:
        """Return the light of the whole file, the meaning of codes, where a polarizer counts from.

        One of them at most is not empty.
        """
        value = self.by_name.get("polarization")
        if value is None:
            return "", {}, ""
        text = plain(str(value)).strip().lower() if isinstance(value, str) else ""
        if light_of(text) or text in POLARIZER_FROM:
            return light_of(text), {}, text if text in POLARIZER_FROM else ""
        codes = {}
        if not text or "=" in text:
            pairs = self.pairs("polarization")
            codes = {key.lower(): light_of(item.lower()) for key, item in pairs.items()}
        if not codes or not all(codes.values()):
            self.refuse(
                "polarization",
                "is not known; it can be s, p or unpolarized for the whole file, codes of a "
                "column such as 0=s,1=p, or angle-from-p or angle-from-s for the angle of a "
                "polarizer from the plane of incidence or from its normal.",
            )
        return "", codes, ""

    def lines(self) -> tuple[int, int]:
        """Return the first and last line of a range such as 10-200, 10- or -200."""
        option = self.by_name.get("lines")
        match = re.fullmatch(r"\s*([0-9]{0,9})\s*-\s*([0-9]{0,9})\s*", str(option or "1-"))
        first, last = (int(match[1] or 1), int(match[2] or 10**9)) if match else (0, 0)
        if not match or not (match[1] or match[2]) or not 1 <= first <= last:
            refuse(f"--lines {option} came where a range such as 10-200, 10- or -200 was wanted.")
        return first, last

    def marks(self) -> tuple[str | None, str | None]:
        """Return the delimiter, given by its name or the sign itself, and the decimal mark."""
        delimiter, decimal = self.by_name.get("delimiter"), self.by_name.get("decimal")
        if decimal not in (None, ".", ","):
            refuse(f"--decimal {decimal!r} is neither . nor , (a comma).")
        mark = None if delimiter is None else DELIMITERS.get(str(delimiter), str(delimiter))
        wrong = mark is not None and (len(mark) != 1 or mark.isalnum() or mark in "\r\n\"'.+-")
        if wrong or (mark is not None and mark == decimal):
            refuse(
                f"--delimiter {delimiter!r} is none of {', '.join(DELIMITERS)}, nor a sign other "
                "than the decimal mark."
            )
        return mark, decimal if decimal is None else str(decimal)


def parse_options(by_name: Mapping[str, object]) -> Options:
    """Return the options of ``read_csv`` by their names, checked; None is not given.

    Refuses one that means nothing.
    """
    given = _Given(by_name)
    columns = given.pairs("columns")
    stray = [role for role in columns if role not in ROLES]
    if stray:
        given.refuse("columns", f"has {stray[0]}, which is none of {', '.join(ROLES)}.")
    light, codes, polarizer = given.polarization()
    delimiter, decimal = given.marks()
    encoding = by_name.get("encoding")
    gaps = given.words("missing")
    return Options(
        columns=columns,
        keep={k: [part.strip() for part in v.split(",")] for k, v in given.pairs("keep").items()},
        ignore=[word.lower() for word in given.words("ignore")],
        angle_deg=given.number("angle_deg", 0.0, 90.0),
        angle_unit=given.one_of("angle_unit", ANGLE_UNITS),
        wavelength_um=given.number("wavelength_um", 1e-9, 1e9),
        wavelength_unit=given.one_of("wavelength_unit", WAVELENGTH_UNITS),
        light=light,
        codes=codes,
        polarizer=polarizer,
        scale=given.number("scale", 1e-300, 1e300, "a number above 0"),
        sigma=given.number("sigma", 1e-300, 1e300, "a number above 0, not in per cent (0.002),"),
        psi_unit=given.one_of("psi_unit", ("deg", "rad")),
        missing=gaps,
        zero_is_value="none" in gaps,
        lines=given.lines(),
        delimiter=delimiter,
        decimal=decimal,
        encoding=None if encoding is None else str(encoding),
    )
