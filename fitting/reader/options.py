"""The options of the reader, each a Python value or the text of its flag, checked."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, NoReturn

from fitting.data.errors import refuse
from fitting.data.quantities import QUANTITIES
from fitting.data.units import ANGLE_UNITS, WAVELENGTH_UNITS
from fitting.reader.names import light_of, plain

ROLES = (
    "angle", "wavelength", "polarization", "polarizer", *QUANTITIES,
    *("sigma_" + quantity for quantity in QUANTITIES),
)  # fmt: skip
DELIMITERS = {"tab": "\t", "semicolon": ";", "comma": ",", "pipe": "|", "blank": " "}
POLARIZER_FROM = ("angle-from-p", "angle-from-s")
# the numbers that an option may be, in words if they have no end
_RANGES = {
    "angle_deg": (0.0, 90.0, ""), "wavelength_um": (1e-9, 1e9, ""),
    "scale": (1e-300, 1e300, "a number above 0"),
    "sigma": (1e-300, 1e300, "a number above 0, not in per cent (0.002),"),
}  # fmt: skip
_CHOICES = {
    "angle_unit": ANGLE_UNITS, "wavelength_unit": WAVELENGTH_UNITS, "psi_unit": ("deg", "rad"),
    "delta_range": ("180", "360"), "decimal": (".", ","),
}  # fmt: skip


class Options(NamedTuple):
    """Checked options of :func:`fitting.read_csv`; None, or empty, where not given.

    light: "s", "p", "u" for the whole file, or "". codes: text of a cell -> "s", "p", "u".
    ignore: names, in small letters, or numbers of columns that shall not be read.
    polarizer: "angle-from-p", "angle-from-s" or "". missing: with "none", zeros were measured.
    lines: the first and the last that may hold rows; the header may stand before. delimiter: the
    sign itself; without it the split is taken that makes the most lines rows of one length.
    divided: the values are one of two scans or columns, whose quotient counts: their unit is of no
    matter. reference: what may be the name of the second column.
    """

    columns: Mapping[str, str] = {}
    ignore: tuple[str, ...] = ()
    angle_deg: float | None = None
    angle_unit: str = ""
    wavelength_um: float | None = None
    wavelength_unit: str = ""
    light: str = ""
    codes: Mapping[str, str] = {}
    polarizer: str = ""
    scale: float | None = None
    sigma: float | None = None
    psi_unit: str = ""
    delta_range: str = ""
    missing: tuple[str, ...] = ()
    lines: tuple[int, int] = (1, 10**9)
    delimiter: str | None = None
    decimal: str | None = None
    encoding: str | None = None
    sheet: str | None = None
    divided: bool = False
    reference: str = ""


def _refuse(name: str, value: object, text: str) -> NoReturn:
    refuse(f"--{name.replace('_', '-')}={value} {text}")


def _number(name: str, value: Any) -> float:
    low, high, wanted = _RANGES[name]
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = float("nan")
    if not low <= number <= high:
        wanted = wanted or f"a number from {low:g} to {high:g}"
        _refuse(name, value, f"came where {wanted} was wanted.")
    return number


def _word(name: str, value: object) -> str:
    if (text := str(value).strip()) not in _CHOICES[name]:
        _refuse(name, value, f"is not known; it can be {' or '.join(_CHOICES[name])}.")
    return text


def _words(_: str, value: object) -> tuple[str, ...]:
    """Return the words of a list or of ``a,b``."""
    items = value if isinstance(value, (list, tuple)) else [value]
    return tuple(part.strip() for item in items for part in str(item).split(","))


def _pairs(name: str, value: object) -> dict[str, str]:
    """Return the pairs of ``A=1,B=2`` or a mapping."""
    if isinstance(value, Mapping):
        return {str(key).strip(): str(of).strip() for key, of in value.items()}
    pairs: dict[str, str] = {}
    for part in str(value).split(","):
        left, equals, right = map(str.strip, part.partition("="))
        if not equals:
            _refuse(name, value, "came where NAME=VALUE,... was wanted.")
        if left in pairs:
            _refuse(name, value, f"gives {left} twice, {pairs[left]} and {right}. Keep one.")
        pairs[left] = right
    return pairs


def _columns(name: str, value: object) -> dict[str, str]:
    columns = _pairs(name, value)
    for role in columns:
        if role not in ROLES:
            _refuse(name, value, f"has {role}, which is none of {', '.join(ROLES)}.")
    return columns


def _polarization(value: object) -> dict[str, Any]:
    """Return the fields of `Options` for one light, the codes of a column or a polarizer's zero."""
    text = plain(str(value)).strip().lower() if isinstance(value, str) else ""
    if text in POLARIZER_FROM:
        return {"polarizer": text}
    if light_of(text):
        return {"light": light_of(text)}
    pairs = _pairs("polarization", value) if isinstance(value, Mapping) or "=" in text else {}
    codes = {key.lower(): light_of(item.lower()) for key, item in pairs.items()}
    if not codes or not all(codes.values()):
        _refuse(
            "polarization",
            value,
            "is not known; it can be s, p or unpolarized for the whole file, codes of a column "
            "such as 0=s,1=p, or angle-from-p or angle-from-s for the angle of a polarizer from "
            "the plane of incidence or from its normal.",
        )
    return {"codes": codes}


def _lines(name: str, value: object) -> tuple[int, int]:
    """Return the first and last line of a range such as 10-200, 10- or -200."""
    match = re.fullmatch(r"\s*([0-9]{0,9})\s*-\s*([0-9]{0,9})\s*", str(value))
    first, last = (int(match[1] or 1), int(match[2] or 10**9)) if match else (0, 0)
    if not match or not (match[1] or match[2]) or not 1 <= first <= last:
        _refuse(name, value, "came where a range such as 10-200, 10- or -200 was wanted.")
    return first, last


def _sign(name: str, value: object) -> str:
    """Return the delimiter, given by its name or the sign itself."""
    mark = DELIMITERS.get(str(value), str(value))
    if len(mark) != 1 or mark.isalnum() or mark in "\r\n\"'.+-":
        _refuse(name, value, f"is none of {', '.join(DELIMITERS)}, nor a sign between columns.")
    return mark


_PARSERS: dict[str, Callable[[str, object], Any]] = {
    **dict.fromkeys(_RANGES, _number), **dict.fromkeys(_CHOICES, _word), "columns": _columns,
    "ignore": lambda name, value: tuple(word.lower() for word in _words(name, value)),
    "missing": _words, "lines": _lines, "delimiter": _sign,
    **dict.fromkeys(("encoding", "sheet"), lambda _, value: str(value)),
}  # fmt: skip


def parse_options(by_name: Mapping[str, object]) -> Options:
    """Return the options of ``read_csv`` by their names; None is not given. Refuses a bad one."""
    given = {name: value for name, value in by_name.items() if value is not None}
    light = _polarization(given.pop("polarization")) if "polarization" in given else {}
    options = Options(**light, **{name: _PARSERS[name](name, of) for name, of in given.items()})
    if options.delimiter and options.delimiter == options.decimal:
        refuse("--delimiter and --decimal are the same sign. Give one of them another.")
    return options
