"""The result files of a fit: JSON, CSV, picture and page, written to files opened before."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from fitting.output import as_data, material
from fitting.output.estimates import index_waves
from fitting.output.outputs import Outputs, write_text
from fitting.output.page import fit_page
from fitting.output.style import check_matplotlib, save
from fitting.process.progress import tell
from fitting.results.result import Fit

if TYPE_CHECKING:
    from fitting.choice.candidates import Choice

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


def write_files(
    fit: Fit,
    staged: Iterable[Staged],
    *,
    reference: str | None = None,
    command: str = "",
    choice: Choice | None = None,
    decimal: str = ".",
) -> None:
    """Write every file that was asked for.

    Args:
        fit: what was found.
        staged: the files; a page comes after the picture that it contains.
        reference: a named material, drawn beside eta and k.
        command: how the fit was asked for, for the foot of the page.
        choice: what was compared, if a model was chosen.
        decimal: decimal mark of the tables; with "," their cells are separated by semicolons.

    Raises: OSError where the file system refuses, with the option or the file's name as its third
        argument.
    """
    png = b""
    for what, path, suffix, asked, medium in staged:
        tell(asked)
        try:
            if what == "plot":
                from fitting.output.picture import draw

                save(draw(fit, reference), path, suffix)
                png = path.read_bytes()
                continue
            if what == "json":
                text = as_data.json_text(fit, choice)
            elif what == "csv":
                text = as_data.data_csv(fit, decimal)
            elif what == "index":
                text = as_data.index_csv(fit, decimal)
            elif what == "page":
                text = fit_page(fit, png, command, choice)
            else:
                text = material.texts_of(fit, medium)[what == "errors"]
            write_text(path, text)
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
    with Outputs(overwrite=overwrite) as outputs:
        place = outputs.folder(folder)
        _write(fit, outputs, {w: place / name for w, name in REPORT.items() if w not in left_out})


def write_material(
    fit: Fit,
    path: str | os.PathLike[str],
    medium: str | None = None,
    *,
    overwrite: bool = False,
) -> tuple[Path, Path]:
    """Write the index of a medium and its errors, or neither, and return the paths.

    overwrite: replace files that no fit wrote, too.
    """
    file, errors = Path(path), material.errors_beside(path)
    with Outputs(overwrite=overwrite) as outputs:
        _write(fit, outputs, {"material": file, "errors": errors}, medium)
    return file, errors


def _write(
    fit: Fit, outputs: Outputs, files: Mapping[str, Path], medium: str | None = None
) -> None:
    inputs = material.files_named([fit.sample] if fit.sample is not None else [])
    staged = [
        Staged(what, outputs.open(path, inputs=inputs), path.suffix, str(path), medium)
        for what, path in files.items()
    ]
    write_files(fit, staged)
    outputs.publish()
