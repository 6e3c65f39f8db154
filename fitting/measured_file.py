"""`read_csv`: the checked measurement in a file, a buffer or a data frame."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from fitting.data.checks import EXCURSION, checked
from fitting.data.errors import named, place, refuse
from fitting.data.measurement import Measurement, frozen
from fitting.data.quantities import ANGLES, POWERS, letter_of
from fitting.reader.conversion import long_columns
from fitting.reader.options import parse_options
from fitting.reader.text import source_of

# A column named as a ratio of p to s, which is tan(psi)^2.
_S_TO_P = re.compile(r"(?i)r[ _]?[sp]\W*/\W*r[ _]?[sp]\b")


def read_csv(
    path: Any,
    *,
    columns: Mapping[str, object] | str | None = None,
    angle_deg: float | str | None = None,
    angle_unit: str | None = None,
    wavelength_um: float | str | None = None,
    wavelength_unit: str | None = None,
    polarization: Mapping[str, str] | str | None = None,
    scale: float | str | None = None,
    divide_by: Any = None,
    ratio_to: object = None,
    sigma: float | str | None = None,
    psi_unit: str | None = None,
    delta_range: str | int | None = None,
    missing: object = None,
    ignore: object = None,
    lines: str | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
    encoding: str | None = None,
    sheet: str | None = None,
) -> Measurement:
    """Return the measurement in a file, buffer or data frame, with a sentence of how it was read.

    Delimiter, decimal mark, encoding, header, units and layout are found out; an option overrules
    each. What could mean two things, or contradicts itself, is refused. Every option is also a flag
    of the command line with the same name and the same text.

    Args:
        path: the file, text or a spreadsheet (.xlsx; extra ``spreadsheet``), - is standard input;
            a buffer that is open for reading (io.StringIO, io.BytesIO); or a table with named
            columns: a data frame (pandas, polars, Arrow), xarray, a mapping from names to arrays.
            The rows of a table are counted from 2, below the names, as a spreadsheet does.
        columns: role -> header name or number from 1, ``"angle=1,R_s=2,sigma_R_s=3"`` or a mapping;
            then these columns alone are read. Roles: angle, wavelength, polarization, polarizer,
            the names in ``QUANTITIES``, and sigma_ before one.
        angle_deg: angle of incidence of a file without a column for it, degrees.
        angle_unit: deg, rad, grazing-deg (from the surface), or 1/angstrom, 1/nm for
            Q = (4 pi / wavelength) cos(angle).
        wavelength_um: wavelength of a file without a column for it, micrometres.
        wavelength_unit: nm, um, angstrom, mm, eV, meV, keV, cm-1, 1/um, THz, GHz, Hz, rad/s,
            rad/fs, all of light in vacuum.
        polarization: s, p or unpolarized for the whole file; what the codes of its column mean,
            ``"0=s,1=p"``; or angle-from-p, angle-from-s for the angle of a polarizer in degrees.
        scale: factor that makes R and T (and their standard errors) fractions; 0.01 for percent.
        divide_by: the name of a column of a reference, or a second file, the scan of a reference,
            read with the same options: R and T are divided by its values at the same angle and
            wavelength, or between them by straight lines; both may be counts. The standard errors
            of two files are propagated.
        ratio_to: text of a sample without anything to be fitted, "Si": values of R and their errors
            are ratios to its reflectance, and are multiplied by it.
        sigma: standard error of the values that have none: of R and T a fraction, of percent too
            (0.002 is 0.2 %), of psi and delta degrees; of the ratio, where there is one.
        psi_unit: deg or rad, for psi and delta.
        delta_range: 180 for an ellipsometer that measures cos Delta (a rotating analyzer without a
            compensator), whose Delta is compared as that or 360 - Delta; 360 for one that tells
            them apart. Without it 180 is taken where a spectrum turns sharply at 0 or 180.
        missing: numbers or words that stand for a gap in the values, "0" or "-9999,bad"; "none" if
            zeros were measured.
        ignore: columns that shall not be read, by header or number from 1, "temperature,7". A
            column that is not read is else refused, unless it is constant, a running number, or of
            no use by its name (a raw signal, an error of the angle); a file need not have it.
        lines: range of lines that may hold rows, 10-200, 10- or -200.
        delimiter: tab, semicolon, comma, pipe, blank, or the sign.
        decimal: "." or ",".
        encoding: a name that Python knows.
        sheet: name of the sheet of a spreadsheet that has several.

    Returns:
        A `Measurement`. Its numbers are ``float`` of their text to the last bit; percent, nm and
        angstrom are one division.

    Raises:
        MeasurementError: the only error; it names file, line, column, what came, what was wanted
            and the option that settles it.
    """
    source = source_of(path)
    with named(source):
        options = parse_options(dict(
            columns=columns, ignore=ignore, angle_deg=angle_deg, angle_unit=angle_unit,
            wavelength_um=wavelength_um, wavelength_unit=wavelength_unit, polarization=polarization,
            scale=scale, sigma=sigma, psi_unit=psi_unit, delta_range=delta_range, missing=missing,
            lines=lines, delimiter=delimiter, decimal=decimal, encoding=encoding, sheet=sheet,
        ))  # fmt: skip
        each = options if divide_by is None else options._replace(sigma=None, divided=True)
        column = divide_by if isinstance(divide_by, str) else ""
        long = long_columns(path, each._replace(reference=column))
        raw = long.data.value
        if divide_by is not None:
            from fitting.ratios import divided  # with jax, which reading other files does not need

            if long.reference is not None:
                long = long.by(divided(long.data, f"column {column}", long.reference, True))
            else:
                reference, same_unit = source_of(divide_by), options.scale is not None
                with named(reference):
                    by = long_columns(divide_by, each).data
                long = long.by(divided(long.data, reference, by, same_unit))
            if options.sigma is not None:
                stated = np.where(np.isnan(long.data.sigma), options.sigma, long.data.sigma)
                long = long._replace(data=long.data._replace(sigma=stated))
        if ratio_to is not None:
            from fitting.ratios import times_reflectance

            for _, label, _ in long.places:
                if _S_TO_P.search(label):
                    refuse(
                        f"column {label!r} is the ratio of two polarizations, not that to a "
                        "reference, and cannot go with --ratio-to. psi is arctan(sqrt(R_p / R_s)): "
                        "write it in degrees in a column psi."
                    )
            long = long.by(times_reflectance(long.data, ratio_to))
        data = long.data
        # of the values: counts are larger than percent
        typical = float(np.median(np.abs(data.value))) if len(data.value) else 0.0

        def where(i: int, role: str) -> str:
            line, value, error = long.places[i]
            columns = {"value": value, "sigma": error, **long.labels}
            return place(source, line, columns.get(role, ""))

        def hint(i: int) -> str:
            """Return what to do about a value that lies outside its range."""
            value, quantity, line = float(data.value[i]), data.quantity[i], long.places[i][0]
            leave = f"If the row is no measurement, mark line {line} with # or leave it out with "
            leave += "--lines A-B."
            if quantity in ANGLES:
                return "If it is not in degrees, say --psi-unit rad. " + leave
            if quantity not in POWERS:
                return leave
            text = "" if raw is data.value else f"Without the reference it is {raw[i]:.6g}. "
            noise = ""
            if -EXCURSION <= value <= 1.0 + EXCURSION:
                noise = (
                    f"If it is noise about {int(value > 0.5)}, give its standard deviation with "
                )
                noise += "--sigma. "
            if value < 0.0 or options.scale is not None:
                return text + noise + leave
            if typical > 110.0:
                text += "If these are counts or volts, divide them by those of the direct beam, "
                return text + "with --divide-by FILE or --scale FACTOR. " + leave
            text += "If the column is in percent, say --scale 0.01. "
            if letter_of(quantity) == "R" and value <= 3.0:
                text += (
                    "If R is relative to a mirror or a wafer, name its material: --ratio-to Si. "
                )
            return text + noise

        data, said = checked(data, where, hint)
    return Measurement(*map(frozen, data), source=source, understood=long.understood + said)
