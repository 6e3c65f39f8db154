"""The files of a fit: JSON, CSV, picture and page, written into places that are open already."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path

from fitting.output import as_data, material
from fitting.output.estimates import index_waves
from fitting.output.fit_page import fit_page
from fitting.output.outputs import Outputs
from fitting.output.style import check_matplotlib, save
from fitting.output.text_table import Comparison
from fitting.result import Fit

# What a report folder holds. The page comes last, since the picture goes into it.
REPORT = {
    "report json": "fit.json",
    "report csv": "data.csv",
    "report index": "index.csv",
    "report plot": "fit.png",
    "report page": "report.html",
}
# What each file was asked for by, for messages.
FLAGS = {"json": "--json", "csv": "--csv", "index": "--csv", "plot": "--plot"}
FLAGS |= {"material": "--material", "material errors": "--material"}


def has_index_table(fit: Fit) -> bool:
    """Whether there is more than one index, or a batch, which has a CSV of its own."""
    return bool(fit.shape) or len(index_waves(fit)) > 1


def _text(
    kind: str, fit: Fit, png: bytes, command: str, comparison: Comparison | None, decimal: str
) -> str:
    if kind == "json":
        return as_data.json_text(fit, None if comparison is None else comparison.data)
    if kind == "csv":
        return as_data.data_csv(fit, decimal)
    if kind == "index":
        return as_data.index_csv(fit, decimal)
    if kind.startswith("material"):
        part, _, medium = kind.partition(": ")
        return material.texts_of(fit, medium or None)[part != "material"]
    return fit_page(fit, png, command, comparison)


def write_files(
    fit: Fit,
    staged: Mapping[str, Path],
    *,
    plot_suffix: str = ".png",
    reference: str | None = None,
    command: str = "",
    comparison: Comparison | None = None,
    decimal: str = ".",
    step: Callable[[str], None] = lambda what: None,
) -> None:
    """Write every file that was asked for.

    Args:
        fit: what was found.
        staged: what -> the file to write to (see `Outputs.open`); "json", "csv" (the data),
            "index", "plot", "page", "material" and "material errors" (with
            ": film" behind it where there are several media), and the same of a
            report folder with "report " before.
        plot_suffix: format of "plot": .png, .pdf or .svg.
        reference: a named material, drawn beside eta and k.
        command: how the fit was asked for, for the foot of the page.
        comparison: what was compared, if a model was chosen.
        decimal: decimal mark of the tables; with "," their cells are parted by semicolons.
        step: told the name of each file before it is written.

    Raises: OSError where the file system refuses, with the option or the file's name as its third
        argument.
    """
    for kind, path in staged.items():
        step(REPORT.get(kind, kind))
        what = kind.removeprefix("report ")
        try:
            if what == "plot":
                from fitting.output.picture import draw

                save(draw(fit, reference), path, plot_suffix if kind == "plot" else ".png")
                continue
            png = staged["report plot"].read_bytes() if kind == "report page" else b""
            text = _text(what, fit, png, command, comparison, decimal)
            # Line ends are the same on every system; a name that is no text is shown with escapes.
            path.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")
        except OSError as error:  # a full disk, for one, which has no file's name
            name = (
                f"--report {REPORT[kind]}"
                if kind in REPORT
                else FLAGS.get(kind.partition(":")[0], kind)
            )
            raise OSError(error.errno, error.strerror, name) from error


def report(
    fit: Fit,
    folder: str | os.PathLike[str],
    comparison: Comparison | None = None,
    *,
    overwrite: bool = False,
) -> None:
    """Write the report of a fit into ``folder``: all of it or, if that fails, nothing.

    report.html, fit.json, data.csv, fit.png, and index.csv of a spectrum or a batch. The folder is
    made if there is none; overwrite: it may hold other files. Raises ImportError without
    matplotlib, ValueError for a folder that cannot be made or written to.
    """
    check_matplotlib("report")
    left_out = {"report index"} if not has_index_table(fit) else set()
    if fit.measurement is None:
        left_out.add("report csv")
    with Outputs() as outputs:
        place = outputs.folder(folder, overwrite=overwrite)
        staged = {
            kind: outputs.open(place / name)
            for kind, name in REPORT.items()
            if kind not in left_out
        }
        write_files(fit, staged, comparison=comparison)
        outputs.publish()
