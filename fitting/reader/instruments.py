"""Files of instruments that are no plain tables, each made into one.

Each function takes the lines of a file and returns those of a tabbed table with a header, each with
the number of the line of the file from which it comes, and sentences on how they were read; None
for a file of another kind.
"""

from __future__ import annotations

import math
import re
from collections import Counter, defaultdict
from collections.abc import Sequence
from decimal import Decimal
from itertools import chain

from fitting.data.errors import refuse
from fitting.data.units import FORM_OF
from fitting.reader.names import unit_of

Plain = tuple[list[tuple[int, str]], list[str]] | None

_DAMAGED = ". The file is damaged; export it anew."
_NOT_A_POWER = re.compile(r"(?i).*(absorb|extinc|log|kubelka|munk|emi)|a$")
_ROUNDED = 2e-3  # of N^2 + C^2 + S^2 = 1, where they are given to five decimals; damage is larger
_PERKIN_ELMER = re.compile(r"PE [A-Z]{2}\s.*\bASCII\s+PEDS\b")
_DESCRIPTION = 9  # line of a Perkin-Elmer file with the description of the sample
_SPECTRARAY = re.compile(r";\s*WAVELENGTH((?:\s+[0-9]+(?:[.,][0-9]+)?)+)\s*")
_WOOLLAM = ("angle (deg)", "psi (deg)", "delta (deg)", "sigma psi (deg)", "sigma delta (deg)")
# Of JCAMP-DX: of FIRSTY, since factors are rounded, and wrong ones are off by far more.
_FACTOR_ERROR = Decimal("0.01")
_TABLES = ("XYDATA", "XYPOINTS", "PEAKTABLE")
_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[Ee][+-]?[0-9]{1,3})?"
_PAIR = re.compile(rf"({_NUMBER})(?:\s*,\s*|\s+)({_NUMBER})\s*(?:;\s*|(?<=\s)|$)")
_SQUEEZED = re.compile("[Ee][0-9]")  # the exponent of a number, or an ordinate of its own in SQZ
_TOLD = ("TITLE", "SAMPLEDESCRIPTION", "SAMPLINGPROCEDURE", "$")  # may say angle and polarization


def _spectrum_header(x_line: int, x_units: str, y_line: int, y_units: str) -> str:
    """Return the header of a table of ``y_units`` over ``x_units``, which stand on lines alone.

    Refuses an axis that is no wavelength, wavenumber, energy or frequency, and absorbance and the
    like. Other values are left to the rest of the reader.
    """
    unit = unit_of(x_units) or ""
    form = FORM_OF.get(unit, "q")
    if form == "q" or unit == "Hz":  # NMR
        refuse(
            f"the unit {x_units[:30]!r} came where 1/CM, NANOMETERS or MICROMETERS were wanted. "
            "Export the spectrum over one of them.",
            x_line,
        )
    if not y_units or _NOT_A_POWER.match(y_units):
        refuse(
            f"values in {y_units[:30]!r} came where fractions of the incident light were wanted. "
            "Export the spectrum as REFLECTANCE or TRANSMITTANCE (the absorbance A of transmitted "
            "light is T = 10^-A).",
            y_line,
        )
    name = re.sub(r"(?i)\bpercent\b", "%", y_units).replace("\t", " ")
    return f"{form} ({unit})\t{name}"


def _numbers(texts: Sequence[str], line: int, count: int) -> list[float]:
    """Return the first numbers of a line, of which there must be ``count`` at least."""
    try:
        numbers = [float(cell) for cell in "".join(texts[line - 1 : line]).split("\t")[:count]]
    except ValueError:
        numbers = []
    if len(numbers) < count or not all(map(math.isfinite, numbers)):
        refuse(f"{count} numbers were wanted" + _DAMAGED, line)
    return numbers


def film_sense(texts: Sequence[str]) -> Plain:
    """Read a Film Sense file.

    Counts and the angle of incidence with a minus; a line for each wavelength, in nm; then N = cos
    2 psi, C = sin 2 psi cos Delta, S = sin 2 psi sin Delta, a line each; then a fit.
    """
    kind = texts[0].strip() if texts else ""
    if not kind.startswith("Film_Sense_"):
        return None
    if kind != "Film_Sense_Data":
        refuse(
            f"{kind} is a measurement over time, of which one time was wanted. Export it as "
            "Film_Sense_Data.",
            1,
        )
    count, measurements, angle = _numbers(texts, 2, 3)
    if measurements != 1 or count != int(count) or not 1 <= count < len(texts) / 2:
        refuse("one measurement at some wavelengths was wanted. Export one of them alone.", 2)
    out = [(2, "wavelength (nm)\tangle (deg)\tpsi (deg)\tdelta (deg)")]
    for line in range(3 + int(count), 3 + 2 * int(count)):
        n, c, s = _numbers(texts, line, 3)
        if abs(n * n + c * c + s * s - 1.0) > _ROUNDED:
            refuse("N^2 + C^2 + S^2 is not 1" + _DAMAGED, line)
        psi = math.degrees(math.atan2(math.hypot(c, s), n)) / 2.0
        delta = math.degrees(math.atan2(s, c))
        wavelength = _numbers(texts, line - int(count), 1)[0]
        out.append((line, f"{wavelength!r}\t{abs(angle)!r}\t{psi!r}\t{delta!r}"))
    return out, ["a Film Sense file: psi and Delta from N, C and S"]


def perkin_elmer(texts: Sequence[str]) -> Plain:
    """Read a Perkin-Elmer file (PEDS; .asc of UV WinLab and Spectrum).

    Below #GR stand the units of abscissa and ordinate, and in the seventh line the number of
    points; below #DATA the points.
    """
    if not texts or not _PERKIN_ELMER.match(texts[0]):
        return None
    stripped = [text.strip() for text in texts]
    if "#GR" not in stripped or "#DATA" not in stripped[stripped.index("#GR") :]:
        refuse("this Perkin-Elmer file has no lines #GR and #DATA. Export the spectrum anew.", 1)
    units = stripped.index("#GR") + 1
    start = stripped.index("#DATA", units)
    count = "".join(stripped[units:start][6:7])
    points = sum(bool(text) for text in stripped[start + 1 :])
    if count != str(points):
        refuse(
            f"the file says {count or 'nothing'} of the number of points, and has {points} rows "
            "below #DATA. Rows are missing or damaged; export it anew.",
            units + 7,
        )
    out = []
    if units > _DESCRIPTION and not stripped[_DESCRIPTION - 1].startswith("#"):
        out.append((_DESCRIPTION, "# " + stripped[_DESCRIPTION - 1]))
    header = _spectrum_header(units + 1, stripped[units], units + 2, stripped[units + 1])
    out += enumerate([header, *texts[start + 1 :]], start + 1)
    return out, [f"a Perkin-Elmer file: {points} points"]


def spectraray(texts: Sequence[str]) -> Plain:
    """Read a file of SENTECH's SpectraRay.

    "; WAVELENGTH 60.20 60.20 70.20 70.20" names the angle of incidence of each column; rows of the
    wavelength follow, without a unit, and of psi and Delta in degrees.
    """
    head = _SPECTRARAY.fullmatch(texts[0]) if texts else None
    if head is None:
        return None
    angles = head[1].replace(",", ".").split()
    if angles[::2] != angles[1::2]:
        refuse(
            "each angle of incidence was wanted twice, for psi and for Delta; other angles came. "
            "Export psi and Delta (not tan psi and cos Delta, and no Mueller matrix).",
            1,
        )
    names = [f"psi ({angle} deg)\tdelta ({angle} deg)" for angle in angles[::2]]
    table = [["wavelength", *names], *(text.split() for text in texts[1:])]
    out = list(enumerate(map("\t".join, table), start=1))
    return out, ["a SpectraRay file: psi, Delta at an angle"]


def woollam(texts: Sequence[str], ignore: Sequence[str] = ()) -> Plain:
    """Read a file of J. A. Woollam (WVASE, CompleteEASE).

    A title, a line VASEmethod[...], often Original[...], the unit of the wavelength; then rows of
    wavelength, angle, psi, Delta and their errors, bare or after the word E. Rows that begin with
    another word (uR, mm12) hold something else; dPolE is the share of depolarized light that comes
    with psi and Delta. ignore: words whose rows may be left out, in small letters.
    """
    head = next((i for i, text in enumerate(texts[:4]) if text.startswith("VASEmethod[")), 9)
    near = range(head + 1, min(head + 4, len(texts)))
    unit_line = next((i for i in near if unit_of(texts[i])), 0)
    if not unit_line:
        return None
    rows = []
    left_out: Counter[str] = Counter()
    for line, text in enumerate(texts[unit_line + 1 :], start=unit_line + 2):
        cells = text.split()
        word = cells[0] if cells and cells[0][0].isalpha() else ""
        if word not in ("", "E"):
            if word.lower() not in ("dpole", *ignore):
                refuse(
                    f"rows that begin with {word} hold another quantity than psi and Delta, "
                    f"which is not read. If the fit may do without them, say --ignore {word}.",
                    line,
                )
            left_out[word] += 1
        elif cells:
            rows.append((line, cells[bool(word) :]))
    width = len(rows[0][1]) if rows else 0
    if width not in (4, 6):
        return None
    names = [f"wavelength ({texts[unit_line].strip()})", *_WOOLLAM][:width]
    out = [(line, "# " + text) for line, text in enumerate(texts[:unit_line], start=1) if text]
    out += [(line, "\t".join(cells)) for line, cells in [(unit_line + 1, names), *rows]]
    notes = ["a Woollam file: wavelength, angle, psi, delta"]
    return out, notes + [f"{count} rows {word} left out" for word, count in left_out.items()]


class _Records:
    """The records of a JCAMP-DX file: label -> (line, value), and the further lines of each."""

    def __init__(self, texts: Sequence[str]) -> None:
        self.found = defaultdict[str, list[tuple[int, str]]](list)
        self.rows = defaultdict[str, list[tuple[int, str]]](list)
        label = ""
        for line, text in enumerate(texts, start=1):
            text = text.split("$$")[0].strip()
            if text.startswith("##"):
                name, _, value = text[2:].partition("=")
                label = re.sub(r"[\s/_-]", "", name).upper()
                self.found[label].append((line, value.strip()))
            elif text:
                self.rows[label].append((line, text))

    def text(self, label: str, at: int) -> tuple[int, str]:
        """Return line and value of a record that must be there once."""
        if not self.found[label]:
            refuse(f"this JCAMP-DX file has no record ##{label}=, which its table needs.", at)
        if len(self.found[label]) > 1:
            line = self.found[label][1][0]
            refuse(f"a second record ##{label}= came. Delete the wrong one.", line)
        return self.found[label][0]

    def number(self, label: str, at: int, default: Decimal | None = None) -> Decimal:
        """Return the number of a record that must be there once, or may be missing."""
        if default is not None and not self.found[label]:
            return default
        line, value = self.text(label, at)
        if not re.fullmatch(_NUMBER, value):
            refuse(f"##{label}= is {value[:30]!r}; a number was wanted. Correct it.", line)
        return Decimal(value)


def _unit(number: Decimal) -> Decimal:
    """Return one unit of the last digit of a number as it is written."""
    return Decimal(1).scaleb(int(number.as_tuple().exponent))


def _points_of_line(
    records: _Records, line: int, text: str, at: int, count: int, before: int
) -> list[tuple[Decimal, Decimal | None, int]]:
    """Return the points of a line of (X++(Y..Y)), before which there are others."""
    first, last, x_factor, y_factor = (
        records.number(label, at) for label in ("FIRSTX", "LASTX", "XFACTOR", "YFACTOR")
    )
    numbers = [None if cell == "?" else cell for cell in text.split()]
    for cell in filter(None, numbers):
        if not re.fullmatch(_NUMBER, cell) or _SQUEEZED.search(cell):
            refuse(
                f"{cell[:30]!r} came where numbers parted by blanks (AFFN) were wanted. If they "
                "are packed (PAC, SQZ, DIF, DUP), export the spectrum unpacked, as AFFN or as "
                "pairs (XY..XY); else the file is damaged.",
                line,
            )
    if numbers[0] is None or len(numbers) < 2:
        refuse(f"{text[:30]!r} came where an abscissa and ordinates were wanted" + _DAMAGED, line)
    step = (last - first) / max(count - 1, 1)
    start, at_x = Decimal(numbers[0]), first + step * before
    if abs(start * x_factor - at_x) > abs(step) / 2 + abs(_unit(start) * x_factor) / 2:
        refuse(
            f"the line begins at x = {start * x_factor}, but ##FIRSTX=, ##LASTX=, ##NPOINTS= and "
            f"the {before} points before it give {at_x:.10g}. Points are missing or damaged; "
            "export the file anew.",
            line,
        )
    values = [None if y is None else Decimal(y) * y_factor for y in numbers[1:]]
    return [(first + step * n, y, line) for n, y in enumerate(values, start=before)]


def jcamp(texts: Sequence[str]) -> Plain:
    """Read a spectrum in JCAMP-DX 4.24 (McDonald and Wilks, Appl. Spectrosc. 42, 151, 1988).

    Records ``##LABEL= value``, one of which is the table: ``(X++(Y..Y))``, where a line has its
    first abscissa and then ordinates at equal steps, or ``(XY..XY)``, pairs. Numbers are written
    out (AFFN); packed ones (PAC, SQZ, DIF, DUP) are refused. Whatever the file says twice must
    agree: the points, the abscissa of each line, the first ordinate.
    """
    if not next((text for text in texts if text.strip()), "").lstrip().startswith("##"):
        return None
    records = _Records(texts)
    if not records.found["JCAMPDX"]:
        return None
    start = records.found["JCAMPDX"][0][0]
    tables = [(at, label) for label in _TABLES for at, _ in records.found[label]]
    blocks = max(len(records.found["TITLE"]), len(tables))
    if blocks > 1:
        refuse(
            f"this JCAMP-DX file has {blocks} blocks, of which one was wanted. Save each alone.",
            start,
        )
    if not tables:
        wanted = "##XYDATA=, ##XYPOINTS= or ##PEAK TABLE=. Export the spectrum as one of them."
        refuse(f"this JCAMP-DX file has no {wanted}", start)
    at, table = tables[0]
    header = _spectrum_header(*records.text("XUNITS", at), *records.text("YUNITS", at))
    count = records.number("NPOINTS", at)
    form = re.sub(r"\s", "", records.found[table][0][1]).upper()
    if form not in ("(X++(Y..Y))", "(XY..XY)"):
        refuse(
            f"the table has the form {form[:30]}; (X++(Y..Y)) or (XY..XY) was wanted. Export the "
            "spectrum in one of them.",
            at,
        )
    points: list[tuple[Decimal, Decimal | None, int]] = []
    x_factor, y_factor = (records.number(f"{axis}FACTOR", at, Decimal(1)) for axis in "XY")
    for line, text in records.rows[table]:
        if form != "(XY..XY)":
            points += _points_of_line(records, line, text, at, int(count), len(points))
        elif rest := _PAIR.sub(" ", text).split():
            refuse(f"{rest[0][:30]!r} came where pairs x, y were wanted" + _DAMAGED, line)
        else:
            pairs = _PAIR.findall(text)
            points += [(Decimal(x) * x_factor, Decimal(y) * y_factor, line) for x, y in pairs]
    if len(points) != count or not points:
        refuse(
            f"the table has {len(points)} points, ##NPOINTS= says {count}. Points are missing or "
            "damaged; export the file anew.",
            at,
        )
    for label, i, column in (("FIRSTX", 0, 0), ("LASTX", -1, 0), ("FIRSTY", 0, 1)):
        found = points[i][column]
        if not records.found[label] or not isinstance(found, Decimal):
            continue
        said = records.number(label, at)
        close = _unit(said) if column == 0 else _unit(said) + abs(said) * _FACTOR_ERROR
        if abs(said - found) >= max(close, _unit(found)):
            refuse(
                f"##{label}= {said}, the table gives {found:.10g} (with the factor ##"
                f"{label[-1]}FACTOR=). Correct the wrong one of them.",
                records.found[label][0][0],
            )
    told = [lines for label, lines in records.found.items() if label.startswith(_TOLD)]
    out = [(line, "# " + value) for line, value in sorted(chain(*told)) if line < at]
    out += [(at, header), *((n, f"{x}\t{'nan' if y is None else y}") for x, y, n in points)]
    return out, [f"a JCAMP-DX file: {len(points)} points"]
