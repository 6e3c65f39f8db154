"""The page of fits wavelength by wavelength, in one HTML file."""

from __future__ import annotations

from fitting.model.points import PointFits
from fitting.output.page import Table, page
from fitting.output.point_report import eta_text, facts, k_text, names_of, notes_of, told_of
from fitting.output.report import number
from fitting.output.report_page import data_table


def _index_table(fits: PointFits) -> Table:
    names = ("<n>", "<k>") if fits.pseudo else ("eta", "k")
    rows = [
        [f"{w:.6g}", eta_text(fits, i), k_text(fits, i), number(fits.rms[i], 3), fits.status[i]]
        for i, w in enumerate(fits.wavelength_um.tolist())
    ]
    return Table("Index over wavelength", ["wavelength, um", *names, "rms", "status"], rows)


def point_page(fits: PointFits, png: bytes, command: str) -> str:
    """Return the page of fits wavelength by wavelength.

    png: the picture (`plot_points`). command: how the fit was asked for, for the foot.
    """
    spectrum = len(fits.fits) > 1
    over = f", and {names_of(fits)} over wavelength" if spectrum else ""
    fitted, _ = fits.fitted()
    return page(
        fits.measurement.source,
        facts(fits),
        [*notes_of(fits), *told_of(fits).texts],
        [],
        [(f"Data and fit, data - fit{over}.", png)],
        [*([_index_table(fits)] if spectrum else []), data_table(fits.measurement, fitted)],
        command,
    )
