"""Which result files were asked for, and what goes into each."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from fitting.command.options import of_a_model
from fitting.output.outputs import Outputs, refuse_repeats

if TYPE_CHECKING:
    import numpy as np

    from fitting.bare_surface.solution import FitResult
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
    refuse_repeats((arguments.file, *arguments.more))
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
    inputs = (arguments.file, *arguments.more)
    names: dict[str, str] = {"csv": arguments.csv, "plot": arguments.plot}
    if arguments.json != "-":
        names["json"] = arguments.json
    if arguments.csv and spectrum:
        path = Path(arguments.csv)
        names["index"] = str(path.with_name(f"{path.stem}.index{path.suffix}"))
    staged = {
        kind: outputs.open(name, flag=_FLAGS[kind], inputs=inputs)
        for kind, name in names.items()
        if name is not None
    }
    if arguments.report:
        folder = outputs.folder(arguments.report, flag="--report", overwrite=arguments.overwrite)
        for kind, name in REPORT.items():
            if spectrum or kind != "report index":
                staged[kind] = outputs.open(folder / name, flag="--report", inputs=inputs)
    return staged


def reference_lines(arguments: argparse.Namespace, wavelength_um: np.ndarray, width: int) -> str:
    """Return the line of the table on the material that was named beside; "" for none."""
    if not arguments.reference:
        return ""
    from fitting.output.reference import reference_text
    from fitting.output.report import wrapped

    text = reference_text(arguments.reference, wavelength_um)
    return "\n" + wrapped("reference", text, width) + "\n"


class Contents(NamedTuple):
    """What goes into each kind of file, made when it is wanted.

    plot: writes a picture of this name ending and with this reference material. page: HTML around
    that picture, for a command line. The others: text.
    """

    json: Callable[[], str]
    csv: Callable[[], str]
    index: Callable[[], str]
    plot: Callable[[Path, str, str | None], None]
    page: Callable[[bytes, str], str]


def contents(result: FitResult, measurement: Measurement) -> Contents:
    """Return the contents of the files on a fit of one index a wavelength."""
    from fitting.bare_surface.curves import fitted_values
    from fitting.output import export

    def plot(path: Path, suffix: str, reference: str | None) -> None:
        from fitting.output.plot import save_plot

        save_plot(result, measurement, path, suffix, reference)

    def page(png: bytes, command: str) -> str:
        from fitting.output.report_page import fit_page

        fitted, _ = fitted_values(result, measurement)
        return fit_page(result, measurement, fitted, png, command)

    return Contents(
        json=lambda: export.json_text(result, measurement),
        csv=lambda: export.data_csv(result, measurement, *fitted_values(result, measurement)),
        index=lambda: export.index_csv(result, measurement),
        plot=plot,
        page=page,
    )


def write(
    staged: dict[str, Path], of: Contents, arguments: argparse.Namespace, bar: Progress
) -> None:
    """Write all of ``staged``; ``bar`` is told of each file."""
    for kind, path in staged.items():
        bar.step(REPORT.get(kind, kind))
        what = kind.removeprefix("report ")
        try:
            if what == "plot":
                suffix = Path(arguments.plot).suffix if kind == "plot" else ".png"
                of.plot(path, suffix, arguments.reference)
                continue
            if what == "page":
                text = of.page(staged["report plot"].read_bytes(), arguments.command)
            else:
                text = getattr(of, what)()
            # File names that are no text are shown with escapes; line ends are the same everywhere.
            path.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")
        except OSError as error:  # a full disk, for one, which has no file's name
            name = f"--report {REPORT[kind]}" if kind in REPORT else _FLAGS[kind]
            raise OSError(error.errno, error.strerror, name) from error
