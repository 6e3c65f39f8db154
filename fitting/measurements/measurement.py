"""A checked measurement: every value of a file or of arrays is checked here, once.

Angles are degrees of incidence from the normal, wavelengths micrometres, powers
fractions; psi and Delta are degrees in the ellipsometer's convention
(Delta = -arg(r_p / r_s) for indices eta + i k; R. M. A. Azzam and N. M. Bashara,
*Ellipsometry and Polarized Light*, 1977, section 4.2).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from fitting.measurements.checks import beyond, check_data, hint_for
from fitting.measurements.errors import MeasurementError as MeasurementError
from fitting.measurements.errors import named, place
from fitting.measurements.from_arrays import from_arrays
from fitting.measurements.quantities import QUANTITIES as QUANTITIES
from fitting.measurements.ratios import divided, refuse_s_to_p, times_reflectance
from fitting.measurements.reader.columns import choose_columns
from fitting.measurements.reader.formats import read_formatted
from fitting.measurements.reader.lines import read_lines, source_of
from fitting.measurements.reader.longform import LongColumns, long_columns
from fitting.measurements.reader.options import Options, parse_options
from fitting.measurements.reader.own_export import own_columns, own_header
from fitting.measurements.reader.reading import keep_rows
from fitting.process.visible import visible


@dataclass(frozen=True, eq=False)
class Measurement:
    """Measured values in long form: row i of every array is one datum.

    Build it with :func:`read_csv` or :meth:`from_columns`; both check every value. The arrays
    are read-only. Gaps of the file are left out, rows keep the order of the file within one
    quantity, and repeated points are kept.

    angle_deg: (N,) float64, degrees from the normal, 0 to 90.
    wavelength_um: (N,) float64, vacuum wavelength in micrometres; NaN where none is known.
    quantity: (N,) strings out of ``QUANTITIES``.
    value: (N,) float64; fractions for R and T, degrees for psi (0 to 90) and delta.
    sigma: (N,) float64, one standard error in the unit of the value; NaN where none is known.
    polarizer_deg: (N,) float64, for R and T alone: angle of a linear polarizer from the plane of
        incidence, so that R = R_p cos^2 + R_s sin^2; NaN (the usual case) means that ``quantity``
        says all. 0 and 90 never appear: they are R_p and R_s.
    source: name of the file, or of the arrays.
    understood: sentences that say how the numbers were read.
    """

    angle_deg: np.ndarray
    wavelength_um: np.ndarray
    quantity: np.ndarray
    value: np.ndarray
    sigma: np.ndarray
    polarizer_deg: np.ndarray
    source: str
    understood: str

    def __repr__(self) -> str:
        return f"Measurement({self.source}: {self.understood})"

    def __len__(self) -> int:
        """Return the number of values."""
        return len(self.value)

    def where(self, keep: np.ndarray) -> Measurement:
        """Return the rows that the boolean mask or index array ``keep`` selects."""
        columns = [_frozen(column[keep]) for column in _arrays(self)]
        return Measurement(*columns, source=self.source, understood=self.understood)

    def at_wavelength(self, wavelength_um: float) -> np.ndarray:
        """Return the mask of the rows at a wavelength; NaN: of those of which none is known."""
        known = self.wavelength_um
        return np.isnan(known) if np.isnan(wavelength_um) else known == wavelength_um

    @staticmethod
    def from_columns(
        angle_deg: object,
        wavelength_um: object = None,
        *,
        sigma: object = None,
        polarizer_deg: object = None,
        angle_unit: str = "deg",
        wavelength_unit: str = "um",
        scale: float = 1.0,
        divide_by: Mapping[str, object] | None = None,
        ratio_to: object = None,
        source: str = "arrays",
        **values: object,
    ) -> Measurement:
        """Return the checked measurement in arrays of one length (or scalars).

        Args:
            angle_deg: angles of incidence, 0 to 90 degrees, or in ``angle_unit``.
            wavelength_um: micrometres above 0, or in ``wavelength_unit``; None where unknown.
            sigma: standard errors above 0: one number or array for all quantities, or a mapping
                from quantity to one; None where unknown.
            polarizer_deg: see :class:`Measurement`.
            angle_unit: deg, rad, mrad, grazing-deg, ... as in :func:`read_csv`.
            wavelength_unit: um, nm, angstrom, eV, cm-1, THz, mm or keV.
            scale: factor that makes powers (and their errors) fractions: 0.01 for percent.
            divide_by: quantity -> array of the same length (or a number), the scan of a reference,
                by which values are divided; "sigma_R" -> its standard errors.
            ratio_to: text of a sample without anything to be fitted, "Si": values (after that
                division) are ratios to its reflectance, and are multiplied by it.
            values: one array per quantity, named as in ``QUANTITIES``: ``R_s=..., R_p=...``. NaN
                is a gap and leaves the datum out.

        Returns: a `Measurement` whose ``understood`` states the ranges of the values.

        Raises:
            MeasurementError: for an unknown name, unequal lengths, or a value out of its range.
        """
        source = visible(str(source))
        with named(source):
            data, understood = from_arrays(
                [angle_deg, wavelength_um, polarizer_deg], values, sigma, source,
                angle_unit=angle_unit, wavelength_unit=wavelength_unit, scale=float(scale),
                divide_by=divide_by, ratio_to=ratio_to,
            )  # fmt: skip
        return Measurement(*map(_frozen, data), source=source, understood=understood)

    @staticmethod
    def from_dataframe(table: Mapping[str, object], **options: Any) -> Measurement:
        """Return the measurement in a table with named columns.

        Args:
            table: a pandas, polars or any other table with ``keys()`` and ``[name]``; a mapping.
                Columns "angle_deg", "wavelength_um" (or "wavelength_nm"), "polarizer_deg", the
                names in ``QUANTITIES``, and "sigma_" before one; others are left alone.
            options: as for :meth:`from_columns`; they overrule columns.
        """
        columns: dict[str, Any] = {}
        sigma: dict[str, Any] = {}
        if not hasattr(table, "keys"):
            raise MeasurementError(
                f"{type(table).__name__} came; a table with named columns was wanted, such as a "
                "data frame or a dictionary of arrays."
            )
        names = [*map(str, table.keys())]
        if "wavelength_um" in options:  # in micrometres, whatever the unit of a column
            names = [name for name in names if not name.startswith("wavelength_")]
        elif {"wavelength_um", "wavelength_nm"} <= set(names):
            raise MeasurementError(
                "the table has columns wavelength_um and wavelength_nm; leave one of them out."
            )
        for name in names:
            if name in (*QUANTITIES, "angle_deg", "wavelength_um", "polarizer_deg"):
                columns[name] = np.asarray(table[name])
            elif name == "wavelength_nm":
                columns["wavelength_um"] = np.asarray(table[name])
                columns["wavelength_unit"] = "nm"
            elif name.removeprefix("sigma_") in QUANTITIES:
                sigma[name.removeprefix("sigma_")] = np.asarray(table[name])
        if "angle_deg" not in {**columns, **options}:
            raise MeasurementError(
                "the table has no column angle_deg. Give the column of angles this name, or give "
                "angle_deg=..."
            )
        return Measurement.from_columns(
            **{**columns, **({"sigma": sigma} if sigma else {}), "source": "table", **options}
        )


def _arrays(m: Measurement) -> tuple[np.ndarray, ...]:
    return m.angle_deg, m.wavelength_um, m.quantity, m.value, m.sigma, m.polarizer_deg


def _frozen(column: np.ndarray) -> np.ndarray:
    column = np.array(column)
    column.flags.writeable = False
    return column


def concatenate(*measurements: Measurement) -> Measurement:
    """Return several measurements, such as one file for each polarization, as one, in order."""
    if not measurements:
        raise MeasurementError("no measurement came; at least one was wanted.")
    if len(measurements) == 1:
        return measurements[0]
    columns = zip(*(_arrays(m) for m in measurements), strict=True)
    return Measurement(
        *(_frozen(np.concatenate(column)) for column in columns),
        source=", ".join(dict.fromkeys(m.source for m in measurements)),
        understood="; ".join(f"{m.source}: {m.understood}" for m in measurements),
    )


def _columns_of(path: str | PathLike[str], options: Options) -> LongColumns:
    """Return the data of a file, not yet checked."""
    texts, notes = read_lines(Path(path), options.encoding)
    bare = options._replace(divided=False, encoding=None) == parse_options({})
    own = own_header(texts)
    if own >= 0 and bare:
        return own_columns(texts, own)
    texts[: max(own, 0)] = [""] * max(own, 0)  # they describe the fit
    table = read_formatted(texts, options)
    table = keep_rows(table._replace(notes=[*table.notes, *notes]), options)
    return long_columns(source_of(path), table, choose_columns(table, options), options)


def read_csv(
    path: str | PathLike[str],
    *,
    columns: Mapping[str, object] | str | None = None,
    angle_deg: float | str | None = None,
    angle_unit: str | None = None,
    wavelength_um: float | str | None = None,
    wavelength_unit: str | None = None,
    polarization: Mapping[str, str] | str | None = None,
    scale: float | str | None = None,
    divide_by: str | PathLike[str] | None = None,
    ratio_to: object = None,
    sigma: float | str | None = None,
    psi_unit: str | None = None,
    missing: object = None,
    keep: Mapping[str, object] | str | None = None,
    lines: str | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
    encoding: str | None = None,
) -> Measurement:
    """Return the measurement in the text file at ``path``, with a sentence of how it was read.

    A ``path`` of - is standard input.

    Delimiter, decimal mark, encoding, header, units and layout are found out; an option overrules
    each. What could mean two things, or contradicts itself, is refused. Every option is also a flag
    of the command line with the same name and the same text.

    columns: role -> header name or number from 1, ``"angle=1,R_s=2,sigma_R_s=3"`` or a mapping;
        then these columns alone are read. Roles: angle, wavelength, polarization, polarizer, the
        names in ``QUANTITIES``, and sigma_ before one.
    angle_deg: angle of incidence of a file without a column for it, degrees.
    angle_unit: deg, rad, mrad, deg.arcmin (29.40 is 29 degrees 40 minutes), grazing-deg,
        grazing-rad, 2theta-deg, or 1/angstrom, 1/nm for Q = (4 pi / wavelength) cos(angle).
    wavelength_um: wavelength of a file without a column for it, micrometres.
    wavelength_unit: nm, um, angstrom, eV, cm-1, THz, mm, keV.
    polarization: s, p or unpolarized for the whole file; what the codes of its column mean,
        ``"0=s,1=p"``; or angle-from-p, angle-from-s for the angle of a polarizer in degrees.
    scale: factor that makes R and T (and their standard errors) fractions; 0.01 for percent.
    divide_by: a second file, the scan of a reference, read with the same options: R and T are
        divided by its values at the same angle and wavelength, or between them by straight lines;
        both may be counts. The standard errors of both are propagated.
    ratio_to: text of a sample without anything to be fitted, "Si": values of R and their errors
        are ratios to its reflectance, and are multiplied by it.
    sigma: standard error of the values that have none, a fraction (degrees for psi and delta); of
        the ratio, where there is one.
    psi_unit: deg or rad, for psi and delta.
    missing: numbers or words that stand for a gap in the values, "0" or "-9999,bad"; "none" if
        zeros were measured.
    keep: column -> values of the rows to be read, ``"Zone=1,2,3,4"`` or ``"Zone=1-4"``.
    lines: range of lines that may hold rows, 10-200, 10- or -200.
    delimiter: tab, semicolon, comma, pipe, blank, or the sign. decimal: "." or ",".
    encoding: a name that Python knows.
    Numbers are ``float`` of their text to the last bit; percent, nm and angstrom are one division.
    Raises MeasurementError and no other error, with file, line, column, what came, what was wanted
        and the option that settles it.
    """
    source = source_of(path)
    with named(source):
        options = parse_options(dict(
            columns=columns, keep=keep, angle_deg=angle_deg, angle_unit=angle_unit,
            wavelength_um=wavelength_um, wavelength_unit=wavelength_unit, polarization=polarization,
            scale=scale, sigma=sigma, psi_unit=psi_unit, missing=missing, lines=lines,
            delimiter=delimiter, decimal=decimal, encoding=encoding,
        ))  # fmt: skip
        each = options if divide_by is None else options._replace(sigma=None, divided=True)
        long = _columns_of(path, each)
        raw = long.data.value
        if divide_by is not None:
            reference, same_unit = source_of(divide_by), options.scale is not None
            with named(reference):
                by = _columns_of(divide_by, each).data
            long = long.by(divided(long.data, reference, by, same_unit))
            if options.sigma is not None:
                stated = np.where(np.isnan(long.data.sigma), options.sigma, long.data.sigma)
                long = long._replace(data=long.data._replace(sigma=stated))
        if ratio_to is not None:
            refuse_s_to_p(label for _, label, _ in long.places)
            long = long.by(times_reflectance(long.data, ratio_to))
        data, understood = long.data, long.understood
        typical = float(np.median(np.abs(data.value))) if len(data.value) else 0.0

        def where(i: int, role: str) -> str:
            line, value, error = long.places[i]
            columns = {"value": value, "sigma": error, **long.labels}
            return place(source, line, columns.get(role, ""))

        def hint(i: int) -> str:
            line, scaled = long.places[i][0], options.scale is not None
            text = hint_for(float(data.value[i]), data.quantity[i], line, scaled, typical)
            return (
                text if raw is data.value else f"Without the reference it is {raw[i]:.6g}. {text}"
            )

        understood += beyond(check_data(data, where, hint))
    return Measurement(*map(_frozen, data), source=source, understood=understood)
