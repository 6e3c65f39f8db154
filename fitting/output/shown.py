"""How a fit is shown: one line, table, page, picture, files. What `Fit` calls is here.

A command line writes a text of its own width with `text_of`, and files with `files.write_files`.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from fitting.output import as_data, fit_page, material, text_table
from fitting.output.fit_page import Comparison as Comparison
from fitting.result import Fit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

one_line, table, html = text_table.one_line, text_table.table, fit_page.notebook
to_dict, to_dataframe = as_data.to_dict, as_data.to_dataframe
text_of = text_table.text_of
write_material = material.write


def figure(fit: Fit, reference: str | None = None) -> Figure:
    """Return a matplotlib Figure of the fit; see `picture.draw`."""
    from fitting.output.picture import draw

    return draw(fit, reference)


def report(fit: Fit, folder: str | os.PathLike[str], overwrite: bool = False) -> None:
    """Write report.html, fit.json, data.csv, index.csv and fit.png into ``folder``."""
    from fitting.output.files import report as write

    write(fit, folder, overwrite=overwrite)
