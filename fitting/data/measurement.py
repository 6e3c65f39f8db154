"""A checked measurement: every value of a file or of arrays is checked here, once.

Angles are degrees of incidence from the normal, wavelengths micrometres, powers
fractions; psi and Delta are degrees in the ellipsometer's convention
(Delta = -arg(r_p / r_s) for indices eta + i k; R. M. A. Azzam and N. M. Bashara,
*Ellipsometry and Polarized Light*, 1977, section 4.2).
"""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fitting.data import units
from fitting.data.checks import Data, checked, unmasked
from fitting.data.errors import MeasurementError as MeasurementError
from fitting.data.errors import MissingExtra, named, refuse
from fitting.data.quantities import QUANTITIES as QUANTITIES
from fitting.data.quantities import are_powers
from fitting.process.visible import visible

# How many rows of a measurement a notebook shows.
_ROWS = 10
# Where what is no quantity belongs, by the first part of its name.
_PLACES = {
    "wavelength": " (wavelengths are wavelength_um, their unit is wavelength_unit)",
    "angle": " (angles are angle_deg, their unit is angle_unit)",
    "sigma": " (standard errors are sigma, of several quantities {'R_s': .., 'R_p': ..})",
}


@dataclass(frozen=True, eq=False)
class Measurement:
    """Measured values in long form: row i of every array is one datum.

    Build it with :func:`read_csv` (files, data frames) or :meth:`from_columns` (arrays); both check
    every value. The arrays are read-only. Gaps are left out, rows keep the order of the file within
    one quantity, and repeated points are kept.

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

    def _repr_html_(self) -> str:
        """Return how it was read, and its first rows, as HTML for a cell of a notebook."""
        read = html.escape(visible(f"{self.source}: {self.understood}"))
        columns, body = self._columns(), ""
        for row in zip(*(column[:_ROWS] for column in columns.values()), strict=True):
            cells = (x if isinstance(x, str) else "" if np.isnan(x) else f"{x:.6g}" for x in row)
            body += "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"
        head = "".join(f"<th>{name}</th>" for name in columns)
        more = f"<p>{len(self) - _ROWS} more rows</p>" * (len(self) > _ROWS)
        return f"<p>{read}</p><table><tr>{head}</tr>{body}</table>{more}"

    def _columns(self) -> dict[str, np.ndarray]:
        """Return the arrays (N,) by name, but for those without a value."""
        each = dict(zip(Data._fields, _arrays(self), strict=True))
        return {n: a for n, a in each.items() if n == "quantity" or not np.isnan(a).all()}

    def to_dataframe(self) -> Any:
        """Return a pandas DataFrame: a row for each datum, in the units of the attributes."""
        try:
            import pandas
        except ImportError:
            raise MissingExtra("to_dataframe", "pandas", "dataframe") from None
        return pandas.DataFrame(self._columns())

    def plot(self) -> Any:
        """Return a matplotlib Figure of the data over the wavelength or the angle."""
        from fitting.data.drawing import draw_measurement

        return draw_measurement(self)

    def __len__(self) -> int:
        """Return the number of values."""
        return len(self.value)

    @property
    def s_share(self) -> np.ndarray:
        """Share of s in the light that a sum of R_s and R_p takes (N,); one half if unpolarized."""
        s = np.sin(np.radians(self.polarizer_deg)) ** 2
        return np.where(np.isnan(s), 0.5, s)

    def where(self, keep: np.ndarray) -> Measurement:
        """Return the rows that the boolean mask or index array ``keep`` selects."""
        columns = [frozen(column[keep]) for column in _arrays(self)]
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
        wavelength_unit: str | None = None,
        scale: float = 1.0,
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
            angle_unit: deg, rad, grazing-deg, ... as in :func:`read_csv`.
            wavelength_unit: um, nm, angstrom, eV, cm-1, THz, ... as in :func:`read_csv`. None is
                um, but refused where all are above 100, since they may be nm.
            scale: factor that makes powers (and their errors) fractions: 0.01 for percent.
            values: one array per quantity, named as in ``QUANTITIES``: ``R_s=..., R_p=...``. NaN
                is a gap and leaves the datum out. A ratio to a reference times the reflectance of
                the latter, ``simulate("Si", {}, angle_deg, wavelength_um, "R_s")``, is R_s.

        Returns:
            A `Measurement` whose ``understood`` states the ranges of the values.

        Raises:
            MeasurementError: for an unknown name, unequal lengths, or a value out of its range.
        """
        source = visible(str(source))
        with named(source):
            scale = float(scale)
            if not (np.isfinite(scale) and scale > 0.0):
                refuse(f"scale is {scale:g}; a factor above 0 was wanted.")
            for option, unit, known in (
                ("wavelength_unit", wavelength_unit or "um", units.WAVELENGTH_UNITS),
                ("angle_unit", angle_unit, units.ANGLE_UNITS),
            ):
                if unit not in known:
                    refuse(f"{option} is {unit!r}; it can be {', '.join(known)}.")
            unknown = [name for name in values if name not in QUANTITIES]
            if unknown or not values:
                came = f"there is no quantity {unknown[0]}" if unknown else "no values came"
                place = _PLACES.get(unknown[0].partition("_")[0], "") if unknown else ""
                refuse(f"{came}{place}; give one or more of {', '.join(QUANTITIES)}.")
            sigmas = sigma if isinstance(sigma, Mapping) else dict.fromkeys(values, sigma)
            for name in sigmas:
                if name not in values:
                    refuse(
                        f"sigma has standard errors of {name}, of which no values came. Give both, "
                        "or neither."
                    )
            columns = [angle_deg, wavelength_um, polarizer_deg, *map(sigmas.get, values)]
            columns += values.values()
            try:
                arrays = [
                    np.asarray(np.nan if c is None else unmasked(c), dtype=float) for c in columns
                ]
                length = np.broadcast_shapes((1,), *(a.shape for a in arrays))
                if len(length) != 1:
                    raise ValueError(f"{len(length)} dimensions came")
                angle, wavelength, polarizer, *rest = (np.broadcast_to(a, length) for a in arrays)
            except (ValueError, TypeError) as error:
                refuse(f"the columns must be numbers of one length ({error}).")
            if not wavelength_unit and units.is_doubtful(wavelength, "um"):
                refuse(
                    f"wavelengths of {units.span_of(wavelength, 'um')} came; these may be nm. Say "
                    "--wavelength-unit nm, or --wavelength-unit um if they are in the far infrared."
                )
            wavelength = units.wavelength_um(wavelength, wavelength_unit or "um")
            angle = units.incidence_deg(angle, angle_unit, wavelength)
            scales = [scale if are_powers(name) else 1.0 for name in values]
            columns = [
                np.tile(angle, len(values)), np.tile(wavelength, len(values)),
                np.repeat([*values], length),
                np.concatenate([*map(units.scaled, rest[len(values) :], scales)]),
                np.concatenate([*map(units.scaled, rest[: len(values)], scales)]),
                np.tile(polarizer, len(values)),
            ]  # fmt: skip
            kept = np.flatnonzero(~np.isnan(columns[3]))
            data = Data(*(column[kept] for column in columns))

            def where(i: int, role: str) -> str:
                of = {"value": "", "sigma": "sigma of "}.get(role, f"{role} of ")
                return f"{source}, {of}{data.quantity[i]}[{kept[i] % length[0]}]"

            def hint(i: int) -> str:
                percent = data.value[i] > 1.0 and are_powers(data.quantity[i])
                return "Powers are fractions: for percent give scale=0.01." if percent else ""

            waves = units.span_of(data.wavelength_um, "um")
            waves = "no wavelength" if np.isnan(data.wavelength_um).all() else waves
            text = f"took {len(kept)} values of {', '.join(values)} from arrays, "
            text += f"{units.span_of(data.angle_deg, 'degrees')}, {waves}"
            data, said = checked(data, where, hint)
        return Measurement(*map(frozen, data), source=source, understood=text + said)

    @staticmethod
    def from_dataframe(table: Any, **options: Any) -> Measurement:
        """Return the measurement in a data frame, xarray or mapping: :func:`read_csv` of it."""
        # By the public name: the reader makes measurements, and is a room above.
        from fitting import read_csv

        return read_csv(table, **options)


def _arrays(m: Measurement) -> tuple[np.ndarray, ...]:
    return m.angle_deg, m.wavelength_um, m.quantity, m.value, m.sigma, m.polarizer_deg


def frozen(column: np.ndarray) -> np.ndarray:
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
        *(frozen(np.concatenate(column)) for column in columns),
        source=", ".join(dict.fromkeys(m.source for m in measurements)),
        understood="; ".join(f"{m.source}: {m.understood}" for m in measurements),
    )


def told_apart(measurements: Sequence[Measurement], paths: Sequence[str]) -> list[Measurement]:
    """Return measurements of files of one name (a/scan.csv, b/scan.csv) named by their paths."""
    sources = [m.source for m in measurements]
    return [
        replace(m, source=visible(path)) if sources.count(m.source) > 1 else m
        for m, path in zip(measurements, paths, strict=True)
    ]
