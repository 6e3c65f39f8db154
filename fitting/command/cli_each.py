"""``fresnel-fit --each``: every file fitted by itself, a row of results for each."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fitting.command.cli_options import fit_options, input_files, reading_options
from fitting.command.terminal import MISUSED, complain, exit_status, refusals, say

if TYPE_CHECKING:
    from fitting.output.each_file import OfFile


def _check(arguments: argparse.Namespace) -> None:
    """Raise ValueError for an option that is wrong for every file."""
    from fitting.choice.sample_choice import several_samples
    from fitting.output.outputs import refuse_repeats

    for flag in ("plot", "report", "reference", "material"):
        if getattr(arguments, flag):
            raise ValueError(
                f"--{flag} shows a single fit, but --each makes one for every file. Use --csv or "
                "--json with --each, or fit one file without it."
            )
    refuse_repeats(arguments.file)
    several_samples(arguments.sample)
    fit_options(arguments)


def _of(file: str, arguments: argparse.Namespace, fit_one: Callable[..., Any]) -> OfFile:
    """Return the fit of one file, or why there is none."""
    from fitting.measurements.errors import for_command
    from fitting.measurements.measurement import read_csv
    from fitting.measurements.reader.lines import source_of
    from fitting.output.each_file import OfFile

    try:
        found, _ = fit_one([read_csv(file, **reading_options(arguments))], arguments)
        return OfFile(file, found)
    except (ValueError, ImportError) as error:
        # the whole path: there may be a/scan.csv and b/scan.csv
        return OfFile(file, None, f"{file}{for_command(error).removeprefix(source_of(file))}")


def run_each(arguments: argparse.Namespace, fit_one: Callable[..., Any]) -> int:
    """Fit and report every file, write the tables that were asked for, and return the exit status.

    fit_one: (measurements, arguments) -> (fit, comparison).
    """
    from fitting.output import each_file
    from fitting.output.outputs import Outputs
    from fitting.output.progress_bar import Progress
    from fitting.process.progress import Step

    results = [file for file in arguments.file if each_file.is_result(file)]
    for file in results:
        complain(f"{file}: left out, since it is a table of results that --each wrote.")
    files = [file for file in arguments.file if file not in results]
    with Outputs() as outputs:
        with refusals():
            if not files:
                raise ValueError("none of the files is a measurement; there is nothing to fit.")
            _check(arguments)
            if arguments.ratio_to:
                from fitting.process.start_up import set_up_jax

                set_up_jax()
            staged: dict[str, Path] = {}
            for kind, name in (("csv", arguments.csv), ("json", arguments.json)):
                if name and not (kind == "json" and name == "-"):
                    # a table that an earlier --each wrote may be replaced
                    inputs = [file for file in input_files(arguments) if file not in results]
                    staged[kind] = outputs.open(name, flag=f"--{kind}", inputs=inputs)
        # one progress bar for all files, none for each of them
        alone = argparse.Namespace(**{**vars(arguments), "quiet": True})
        each = []
        with Progress("files", quiet=arguments.quiet) as bar:
            for file in files:
                bar.take(Step(0, len(files), Path(file).name))
                each.append(_of(file, alone, fit_one))
                bar.take(Step(1, len(files), ""))
        texts = {
            "csv": lambda: each_file.rows_csv(each, arguments.csv_decimal),
            "json": lambda: each_file.rows_json(each),
        }
        for one in each:
            if one.error:
                complain(one.error)
        if arguments.json == "-":
            say(each_file.rows_json(each))
        elif not arguments.quiet:
            say(each_file.rows_text(each))
        for kind, path in staged.items():
            path.write_text(
                texts[kind](), encoding="utf-8", errors="backslashreplace", newline="\n"
            )
        outputs.publish()
    fits = [one.fit for one in each if one.fit is not None]
    return exit_status(fits) if len(fits) == len(each) else MISUSED
