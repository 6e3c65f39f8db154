"""Which result files were asked for, and what goes into each."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from fitting.command.options import of_a_model
from fitting.output.outputs import Outputs

if TYPE_CHECKING:
    import numpy as np

    from fitting.index.fit import FitResult
    from fitting.measurement import Measurement
    from fitting.output.progress import Progress

# What a report folder holds. The page comes last, since the picture goes into it.
REPORT = {
    "report json": "fit.json",
    "report csv": "data.csv",
    "report index": "index.csv",
    "report plot": "fit.png",
    "report page": "report.html",
}
_FLAGS = {"json": "--json", "csv": "--csv", "index": "--csv", "plot": "--plot"}


def check(arguments: argparse.Namespace) -> None:
    """Raise ValueError where a picture is asked for that cannot be drawn, or an option is idle."""
    stray = "" if arguments.model else of_a_model(arguments)
    if stray:
        raise ValueError(f"{stray} needs --model NAME: it is about a model over whole curves.")
    written = {os.path.realpath(n) for n in (arguments.json, arguments.csv, arguments.plot) if n}
    for file in arguments.more:
        if os.path.realpath(file) in written:
            raise ValueError(f"{file}: this is a measurement; choose another name for the result.")
    if arguments.plot:
        from fitting.output.plot import check_picture

        check_picture(arguments.plot)
    if arguments.report:
        from fitting.output.plot import check_matplotlib

        check_matplotlib("--report")


def stage(outputs: Outputs, arguments: argparse.Namespace, spectrum: bool) -> dict[str, Path]:
    """Return what goes into files ("json", "csv", "index", "plot", "report ...") -> where to write.

    spectrum: whether there is an index a wavelength, which has a CSV of its own.
    Raises OutputError (a ValueError) where a file cannot be written.
    """
    names: dict[str, str] = {"csv": arguments.csv, "plot": arguments.plot}
    if arguments.json != "-":
        names["json"] = arguments.json
    if arguments.csv and spectrum:
        path = Path(arguments.csv)
        names["index"] = str(path.with_name(f"{path.stem}.index{path.suffix}"))
    staged = {
        kind: outputs.open(name, flag=_FLAGS[kind], source=arguments.file)
        for kind, name in names.items()
        if name is not None
    }
    if arguments.report:
        folder = outputs.folder(arguments.report, flag="--report")
        for kind, name in REPORT.items():
            if spectrum or kind != "report index":
                staged[kind] = outputs.open(folder / name, flag="--report", source=arguments.file)
    return staged


def reference_lines(arguments: argparse.Namespace, wavelength_um: np.ndarray, width: int) -> str:
    """Return the line of the table on the material that was named beside; "" for none."""
    if not arguments.reference:
        return ""
    from fitting.output.reference import reference_text
    from fitting.output.report import wrapped

    text = reference_text(arguments.reference, wavelength_um)
    return "\n" + wrapped("reference", text, width) + "\n"


def write_texts(
    staged: dict[str, Path], text_of: Callable[[str, Path], str | None], bar: Progress
) -> None:
    """Write all of ``staged``.

    text_of: what goes into a file of this kind ("json", "plot", ..., without "report"); None where
    it has written the file itself. bar: is told of each file.
    """
    for kind, path in staged.items():
        bar.step(REPORT.get(kind, kind))
        text = text_of(kind, path)
        if text is not None:
            # File names that are no text are shown with escapes; line ends are the same everywhere.
            path.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")


def _text(kind: str, result: FitResult, measurement: Measurement) -> str:
    from fitting.output import export

    if kind == "json":
        return export.json_text(result, measurement)
    if kind == "index":
        return export.index_csv(result, measurement)
    from fitting.index.curves import fitted_values

    return export.data_csv(result, measurement, *fitted_values(result, measurement))


def write(
    staged: dict[str, Path],
    result: FitResult,
    measurement: Measurement,
    arguments: argparse.Namespace,
    bar: Progress,
) -> None:
    """Write all of ``staged``."""

    def text_of(kind: str, path: Path) -> str | None:
        what = kind.removeprefix("report ")
        if what == "plot":
            from fitting.output.plot import save_plot

            suffix = Path(arguments.plot).suffix if kind == "plot" else ".png"
            save_plot(result, measurement, path, suffix, arguments.reference)
            return None
        if what == "page":
            from fitting.index.curves import fitted_values
            from fitting.output.report_page import fit_page

            fitted, _ = fitted_values(result, measurement)
            png = staged["report plot"].read_bytes()
            return fit_page(result, measurement, fitted, png, arguments.command)
        return _text(what, result, measurement)

    write_texts(staged, text_of, bar)
