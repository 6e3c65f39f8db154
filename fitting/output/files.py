"""The result files of a fit: JSON, CSV, picture and page, written to files opened before."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from fitting.output import as_data, material
from fitting.output.estimates import index_waves
from fitting.output.fit_page import fit_page
from fitting.output.outputs import Outputs
from fitting.output.style import check_matplotlib, save
from fitting.output.text_table import Comparison
from fitting.results.result import Fit

# What a report folder holds. The page comes last, since the picture goes into it.
REPORT = {
    "json": "fit.json",
    "csv": "data.csv",
    "index": "index.csv",
    "plot": "fit.png",
    "page": "report.html",
}


class Staged(NamedTuple):
    """A result file that is opened and not yet written.

    what: its content: "json", "csv" (the data), "index", "plot", "page", "material", or "errors"
        of a material.
    path: where to write; see `Outputs.open`. suffix: of its final name.
    asked: option by which it was asked for, for messages.
    medium: whose index it holds; None for the only one.
    """

    what: str
    path: Path
    suffix: str
    asked: str
    medium: str | None = None


def stage_report(
    outputs: Outputs,
    folder: str | os.PathLike[str],
    left_out: Collection[str],
    *,
    flag: str = "",
    overwrite: bool = False,
    inputs: Sequence[str] = (),
) -> list[Staged]:
    """Return the files of a report; the arguments are those of `Outputs.folder` and `open`."""
    place = outputs.folder(folder, flag=flag, overwrite=overwrite)
    return [
        Staged(
            what, outputs.open(place / name, flag=flag, inputs=inputs), Path(name).suffix,
            f"--report {name}",
        )
        for what, name in REPORT.items()
        if what not in left_out
    ]  # fmt: skip


def write_files(
    fit: Fit,
    staged: Iterable[Staged],
    *,
    reference: str | None = None,
    command: str = "",
    comparison: Comparison | None = None,
    decimal: str = ".",
    step: Callable[[str], None] = lambda asked: None,
) -> None:
    """Write every file that was asked for.

    Args:
        fit: what was found.
        staged: the files; a page comes after the picture that it contains.
        reference: a named material, drawn beside eta and k.
        command: how the fit was asked for, for the foot of the page.
        comparison: what was compared, if a model was chosen.
        decimal: decimal mark of the tables; with "," their cells are separated by semicolons.
        step: called with `Staged.asked` before each file is written.

    Raises: OSError where the file system refuses, with the option or the file's name as its third
        argument.
    """
    png = b""
    for what, path, suffix, asked, medium in staged:
        step(asked)
        try:
            if what == "plot":
                from fitting.output.picture import draw

                save(draw(fit, reference), path, suffix)
                png = path.read_bytes()
                continue
            if what == "json":
                text = as_data.json_text(fit, None if comparison is None else comparison.data)
            elif what == "csv":
                text = as_data.data_csv(fit, decimal)
            elif what == "index":
                text = as_data.index_csv(fit, decimal)
            elif what == "page":
                text = fit_page(fit, png, command, comparison)
            else:
                text = material.texts_of(fit, medium)[what == "errors"]
            # Line ends are the same on every system; bytes of a file name that are no text are
            # written as escapes.
            path.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")
        except OSError as error:  # the error of a full disk, for example, names no file
            raise OSError(error.errno, error.strerror, asked) from error


def report(fit: Fit, folder: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write the report of a fit into ``folder``: all of it or, if that fails, nothing.

    report.html, fit.json, data.csv, fit.png, and index.csv of a spectrum or a batch. The folder is
    created if there is none; overwrite: it may hold other files. Raises ImportError without
    matplotlib, ValueError for a folder that cannot be created or written to.
    """
    check_matplotlib("report")
    left_out = ["csv"] * (fit.measurement is None)
    left_out += ["index"] * (not fit.shape and len(index_waves(fit)) < 2)
    with Outputs() as outputs:
        staged = stage_report(outputs, folder, left_out, overwrite=overwrite)
        write_files(fit, staged)
        outputs.publish()
