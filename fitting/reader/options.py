"""The options of the reader, each a Python value or the text of its flag, checked."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from fitting.errors import MeasurementError
from fitting.reader.units import ANGLE_UNITS, WAVELENGTH_UNITS
from fitting.reader.vocabulary import light_of, plain, unit_of

QUANTITIES = ("R_s", "R_p", "R", "R_back", "T_s", "T_p", "T", "psi", "delta")
"""What a datum can be. R and T are powers of unpolarised light, unless ``polarizer_deg``
says otherwise; R_back is R with the light on the other face (equal to R for a plain slab)."""

ROLES = (
    ("angle", "wavelength", "polarization", "polarizer")
    + QUANTITIES
    + tuple("sigma_" + quantity for quantity in QUANTITIES)
)
POLARIZER_FROM = ("angle-from-p", "angle-from-s")


class Options(NamedTuple):
    """Checked options of :func:`fitting.measurement.read_csv`; None, or empty, where not given.

    light: "s", "p", "u" for the whole file, or "". codes: text of a cell -> "s", "p", "u".
    polarizer: "angle-from-p", "angle-from-s" or "". zero_is_value: zeros were said to be measured.
    """

    columns: dict[str, str]
    keep: dict[str, list[str]]
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


def _number(source: str, name: str, value: object, low: float, high: float) -> float | None:
    if value is None:
        return None
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        number = float("nan")
    if not low <= number <= high:
        raise MeasurementError(
            f"{source}: --{name} {value} came where a number from {low:g} to {high:g} was wanted."
        )
    return number


def _pairs(source: str, name: str, value: object) -> dict[str, str]:
    """Return the pairs of ``A=1,B=2`` or a mapping; a part without = belongs to the one before."""
    if value is None:
        return {}
    if isinstance(value, Mapping):
        value = [f"{k}={','.join(map(str, v)) if isinstance(v, (list, tuple)) else v}"
                 for k, v in value.items()]  # fmt: skip
    parts = value if isinstance(value, (list, tuple)) else [value]
    pairs: dict[str, str] = {}
    key = ""
    for part in ",".join(map(str, parts)).split(","):
        left, equals, right = map(str.strip, part.partition("="))
        if equals and left in pairs:
            raise MeasurementError(
                f"{source}: --{name} gives {left} twice, {pairs[left]} and {right}."
            )
        if equals:
            key, pairs[left] = left, right
        elif key:
            pairs[key] += "," + left
    if not pairs:
        raise MeasurementError(f"{source}: --{name} {value} came where NAME=VALUE was wanted.")
    return pairs


def _one_of(source: str, name: str, value: object, wanted: tuple[str, ...]) -> str:
    if value is None:
        return ""
    text = str(value).strip()
    found = text if text in wanted else unit_of(text)
    if found not in wanted:
        raise MeasurementError(
            f"{source}: --{name} {value} is not known; it can be {', '.join(wanted)}."
        )
    return found


def _polarization(source: str, value: object) -> tuple[str, dict[str, str], str]:
    if value is None:
        return "", {}, ""
    text = "" if isinstance(value, (Mapping, list, tuple)) else plain(str(value)).strip().lower()
    if light_of(text):
        return light_of(text), {}, ""
    if text in POLARIZER_FROM:
        return "", {}, text
    codes = {}
    if not text or "=" in text:
        pairs = _pairs(source, "polarization", value)
        codes = {key.lower(): light_of(item.lower()) for key, item in pairs.items()}
    if not codes or not all(codes.values()):
        raise MeasurementError(
            f"{source}: --polarization {value} is not known; it can be s, p or unpolarized for the "
            "whole file, codes of a column such as 0=s,1=p, or angle-from-p or angle-from-s for "
            "the angle of a polariser from the plane of incidence or from its normal."
        )
    return "", codes, ""


def parse_options(source: str, given: Mapping[str, object]) -> Options:
    """Return the options of ``read_csv`` by their names, checked; None is not given.

    Raises MeasurementError for one that means nothing.
    """

    def number(name: str, low: float, high: float) -> float | None:
        return _number(source, name.replace("_", "-"), given.get(name), low, high)

    def one_of(name: str, wanted: tuple[str, ...]) -> str:
        return _one_of(source, name.replace("_", "-"), given.get(name), wanted)

    columns = _pairs(source, "columns", given.get("columns"))
    stray = [role for role in columns if role not in ROLES]
    if stray:
        raise MeasurementError(
            f"{source}: --columns has {stray[0]}, which is none of {', '.join(ROLES)}."
        )
    light, codes, polarizer = _polarization(source, given.get("polarization"))
    words = [] if given.get("missing") is None else given["missing"]
    words = words if isinstance(words, (list, tuple)) else [words]
    gaps = [part.strip() for word in words for part in str(word).split(",")]
    keep = _pairs(source, "keep", given.get("keep"))
    return Options(
        columns=columns,
        keep={k: [part.strip() for part in v.split(",")] for k, v in keep.items()},
        angle_deg=number("angle_deg", 0.0, 90.0),
        angle_unit=one_of("angle_unit", ANGLE_UNITS),
        wavelength_um=number("wavelength_um", 1e-9, 1e9),
        wavelength_unit=one_of("wavelength_unit", WAVELENGTH_UNITS),
        light=light,
        codes=codes,
        polarizer=polarizer,
        scale=number("scale", 1e-300, 1e300),
        sigma=number("sigma", 1e-300, 1e300),
        psi_unit=one_of("psi_unit", ("deg", "rad")),
        missing=gaps,
        zero_is_value="none" in gaps,
    )
