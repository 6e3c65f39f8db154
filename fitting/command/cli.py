"""The command ``fresnel-fit FILE``: a measured curve in; a table, JSON, CSV and a picture out.

Modules are imported where they are needed, so that ``--help`` and a mistyped option answer at once
and only ``--plot`` takes the time to import matplotlib.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fitting.command.cli_options import (
    PROGRAM,
    expanded,
    fit_options,
    parser,
    reading_options,
)
from fitting.command.terminal import MISUSED, Refused, complain, exit_status, refusals, say
from fitting.process.interrupt import INTERRUPTED
from fitting.process.visible import visible

if TYPE_CHECKING:
    from fitting.choice.candidates import Choice
    from fitting.data.measurement import Measurement
    from fitting.output.each_file import OfFile
    from fitting.output.files import Staged
    from fitting.output.outputs import Outputs
    from fitting.results.result import Fit


def _stage(outputs: Outputs, arguments: argparse.Namespace, spectrum: bool) -> list[Staged]:
    """Return the files that were asked for, as they are to be written.

    spectrum: whether there is an index for each wavelength, which has a CSV of its own.
    Raises OutputError (a ValueError) where a file cannot be written.
    """
    from fitting.choice.sample_choice import several_samples
    from fitting.output.files import REPORT, Staged
    from fitting.output.material import errors_beside, files_named, fitted_media, of_medium
    from fitting.process.start_up import set_up_jax

    set_up_jax()
    samples = several_samples(arguments.sample)
    references = several_samples([arguments.ratio_to] if arguments.ratio_to else [])
    inputs = [*arguments.file, *files_named([*samples, *references])]
    inputs += [arguments.divide_by] if arguments.divide_by else []
    staged = []

    def add(what: str, flag: str, name: str | Path, medium: str | None = None) -> None:
        path = outputs.open(name, flag=flag, inputs=inputs)
        staged.append(Staged(what, path, Path(name).suffix, flag, medium))

    if arguments.csv:
        add("csv", "--csv", arguments.csv)
    if arguments.csv and spectrum:
        path = Path(arguments.csv)
        add("index", "--csv", path.with_name(f"{path.stem}.index{path.suffix}"))
    if arguments.plot:
        add("plot", "--plot", arguments.plot)
    if arguments.json not in (None, "-"):
        add("json", "--json", arguments.json)
    for medium in fitted_media(samples) if arguments.material else ():
        file = of_medium(arguments.material, medium)
        add("material", "--material", file, medium)
        add("errors", "--material", errors_beside(file, "--material"), medium)
    if arguments.report:
        folder = outputs.folder(arguments.report, flag="--report")
        for what, name in REPORT.items():
            if what != "index" or spectrum:
                add(what, "--report", folder / name)
    return staged


def _fit(
    measurements: list[Measurement], arguments: argparse.Namespace
) -> tuple[Fit, Choice | None]:
    """Return the fit that was asked for, and the comparison if a model was to be chosen."""
    options = fit_options(arguments)
    from fitting.choice.sample_choice import several_samples
    from fitting.fits import fit

    samples = several_samples(arguments.sample)
    if len(samples) == 1 and not samples[0].open:
        return fit(measurements, samples[0], **options), None
    from fitting.choice.selection import choose

    choice = choose(measurements, samples, **options)
    return choice.fit, choice


def _run(arguments: argparse.Namespace) -> int:
    """Fit all files together, and report and write the result."""
    import numpy as np

    from fitting.data.measurement import told_apart
    from fitting.measured_file import read_csv
    from fitting.output import as_data, files, style
    from fitting.output.material import texts_of
    from fitting.output.outputs import Outputs
    from fitting.output.progress_bar import shown
    from fitting.output.reference import check_reference
    from fitting.output.text_table import text_of

    width = min(os.get_terminal_size().columns, 100) if sys.stdout.isatty() else 80
    with Outputs(overwrite=arguments.overwrite) as outputs:
        with refusals():
            if arguments.plot:
                style.check_picture(arguments.plot)
            if arguments.report:
                style.check_matplotlib("--report")
            read = reading_options(arguments)
            measurements = told_apart(
                [read_csv(file, **read) for file in arguments.file], arguments.file
            )
            wavelength = np.concatenate([m.wavelength_um for m in measurements])
            if arguments.reference:
                check_reference(arguments.reference, wavelength, "--reference")
            staged = _stage(outputs, arguments, len(np.unique(wavelength)) > 1)
            with shown("fit", quiet=arguments.quiet):
                found, choice = _fit(measurements, arguments)
            for one in staged:
                if one.what == "material":
                    texts_of(found, one.medium)
        if arguments.json == "-":
            say(as_data.json_text(found, choice))
        elif not arguments.quiet:
            say(text_of(found, width, arguments.reference or "", choice))
        with shown("files written", quiet=arguments.quiet):
            files.write_files(
                found, staged, reference=arguments.reference, command=arguments.command,
                choice=choice, decimal=arguments.csv_decimal,
            )  # fmt: skip
        outputs.publish()
    return exit_status([found])


def _fit_file(file: str, arguments: argparse.Namespace) -> OfFile:
    """Return the fit of one file, or why there is none."""
    from fitting.data.errors import for_command
    from fitting.measured_file import read_csv
    from fitting.output.each_file import OfFile
    from fitting.reader.text import source_of

    try:
        found, _ = _fit([read_csv(file, **reading_options(arguments))], arguments)
        return OfFile(file, found)
    except (ValueError, ImportError) as error:
        # the whole path: there may be a/scan.csv and b/scan.csv
        source, text = source_of(file), for_command(error)
        own = text.startswith((f"{source}:", f"{source},"))
        return OfFile(file, None, file + (text.removeprefix(source) if own else f": {text}"))


def _run_each(arguments: argparse.Namespace) -> int:
    """Fit every file by itself (``--each``), and report and write a row of results for each."""
    from fitting.output import each_file
    from fitting.output.outputs import Outputs, begins, write_text
    from fitting.output.progress_bar import Progress
    from fitting.process.progress import Step

    mark = re.compile(f"# {each_file.EACH_MARK}".encode())
    results = [file for file in arguments.file if begins(file, mark)]
    for file in results:
        complain(f"{file}: left out, since it is a table of results that --each wrote.")
    # a table that an earlier --each wrote may be replaced, since it is no input
    arguments.file = [file for file in arguments.file if file not in results]
    with Outputs(overwrite=arguments.overwrite) as outputs:
        with refusals():
            if not arguments.file:
                raise ValueError("none of the files is a measurement; there is nothing to fit.")
            for flag in ("plot", "report", "reference", "material"):
                if getattr(arguments, flag):
                    raise ValueError(
                        f"--{flag} shows a single fit, but --each makes one for every file. Use "
                        "--csv or --json with --each, or fit one file without it."
                    )
            fit_options(arguments)
            staged = _stage(outputs, arguments, False)
        each = []
        with Progress("files", quiet=arguments.quiet) as bar:
            bar.take(Step(0, len(arguments.file), ""))
            for file in arguments.file:
                bar.take(Step(0, None, Path(file).name))
                each.append(_fit_file(file, arguments))
                bar.take(Step(1, None, ""))
        for one in each:
            if one.error:
                complain(one.error)
        if arguments.json == "-":
            say(each_file.rows_json(each))
        elif not arguments.quiet:
            say(each_file.rows_text(each))
        for one in staged:
            write_text(
                one.path,
                each_file.rows_json(each) if one.what == "json"
                else each_file.rows_csv(each, arguments.csv_decimal),
            )  # fmt: skip
        outputs.publish()
    fits = [one.fit for one in each if one.fit is not None]
    return exit_status(fits) if len(fits) == len(each) else MISUSED


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command with ``argv`` (default: the process's arguments) and return its exit status.

    0: every curve was fitted. 1: one or more curves have no index. 2: the command, a file or a
    value in it cannot be understood, or a result cannot be written. 130: interrupted. An error that
    the user can correct ends in one line on stderr that says what to do. ``--help``, ``--version``,
    ``--materials`` and a mistyped option end in SystemExit, as usual with argparse.
    """
    try:
        arguments = parser().parse_args(argv)
        given = sys.argv[1:] if argv is None else argv
        arguments.command = visible(shlex.join([PROGRAM, *given]))
        from fitting.output.outputs import refuse_repeats
        from fitting.process.start_up import cheap_start, set_up_jax

        with refusals():
            arguments.file = expanded(arguments.file)
            refuse_repeats(arguments.file)
        with cheap_start():
            if arguments.ratio_to:
                with refusals():
                    set_up_jax()  # R of the reference is computed while the files are read
            return _run_each(arguments) if arguments.each else _run(arguments)
    except KeyboardInterrupt:
        print(file=sys.stderr)
        return INTERRUPTED
    except OSError as error:
        complain(f"{error.filename or 'a result file'}: {error.strerror}")
    except Refused as error:
        complain(str(error))
    return MISUSED
