"""The command ``fresnel-fit FILE``: a measured curve in; a table, JSON, CSV and a picture out.

Modules are imported where they are needed, so that ``--help`` and a mistyped option answer at once
and only ``--plot`` takes the time to import matplotlib.
"""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fitting.command.cli_options import (
    PROGRAM,
    expanded,
    fit_options,
    input_files,
    parser,
    reading_options,
)
from fitting.command.terminal import MISUSED, Refused, complain, exit_status, refusals, say
from fitting.process.interrupt import INTERRUPTED
from fitting.process.visible import visible

if TYPE_CHECKING:
    from fitting.choice.candidates import Choice
    from fitting.measurements.measurement import Measurement
    from fitting.output.files import Staged
    from fitting.output.outputs import Outputs
    from fitting.results.result import Fit


def _check(arguments: argparse.Namespace) -> None:
    """Raise ValueError for a picture that cannot be drawn, or a file that is given twice."""
    from fitting.output.outputs import refuse_repeats

    refuse_repeats(arguments.file)
    if arguments.plot:
        from fitting.output.style import check_picture

        check_picture(arguments.plot)
    if arguments.report:
        from fitting.output.style import check_matplotlib

        check_matplotlib("--report")


def _stage(
    outputs: Outputs,
    arguments: argparse.Namespace,
    spectrum: bool,
    media: Sequence[str | None] = (),
) -> list[Staged]:
    """Return the files that were asked for, as they are to be written.

    spectrum: whether there is an index for each wavelength, which has a CSV of its own. media: the
    media whose index is written, None for the only one.
    Raises OutputError (a ValueError) where a file cannot be written.
    """
    from fitting.output.as_data import INDEX_MARK
    from fitting.output.files import Staged, stage_report
    from fitting.output.material import ERRORS_HEAD, MATERIAL_MARK, errors_beside, of_medium

    inputs, staged = input_files(arguments), []

    def add(
        what: str, flag: str, name: str | Path | None, mark: str = "", medium: str | None = None
    ) -> None:
        """mark: how a file must begin to be replaced, if the user did not name it."""
        if name is not None:
            over = "" if arguments.overwrite else mark
            path = outputs.open(name, flag=flag, inputs=inputs, only_over=over)
            staged.append(Staged(what, path, Path(name).suffix, flag, medium))

    add("csv", "--csv", arguments.csv)
    if arguments.csv and spectrum:
        path = Path(arguments.csv)
        add("index", "--csv", path.with_name(f"{path.stem}.index{path.suffix}"), INDEX_MARK)
    add("plot", "--plot", arguments.plot)
    add("json", "--json", None if arguments.json == "-" else arguments.json)
    for medium in media:
        file = of_medium(arguments.material, medium)
        add("material", "--material", file, MATERIAL_MARK if medium else "", medium)
        add("errors", "--material", errors_beside(file, "--material"), ERRORS_HEAD, medium)
    if arguments.report:
        left_out = () if spectrum else ("index",)
        staged += stage_report(
            outputs, arguments.report, left_out, flag="--report", overwrite=arguments.overwrite,
            inputs=inputs,
        )  # fmt: skip
    return staged


def _fit(
    measurements: list[Measurement], arguments: argparse.Namespace
) -> tuple[Fit, Choice | None]:
    """Return the fit that was asked for, and the comparison if a model was to be chosen."""
    from fitting.output.progress_bar import shown
    from fitting.process.start_up import set_up_jax

    options = fit_options(arguments)
    set_up_jax()
    from fitting.choice.sample_choice import several_samples
    from fitting.fits import fit

    samples = several_samples(arguments.sample)
    with shown("fit", quiet=arguments.quiet):
        if len(samples) == 1 and not samples[0].open:
            return fit(measurements, samples[0], **options), None
        from fitting.choice.selection import choose

        choice = choose(measurements, samples, **options)
        return choice.fit, choice


def _run(arguments: argparse.Namespace) -> int:
    import numpy as np

    from fitting.measurements.measurement import read_csv
    from fitting.measurements.several_files import told_apart
    from fitting.output import as_data, files
    from fitting.output.material import fitted_media, texts_of
    from fitting.output.outputs import Outputs
    from fitting.output.progress_bar import Progress
    from fitting.output.reference import check_reference
    from fitting.output.text_table import Comparison, text_of

    width = min(os.get_terminal_size().columns, 100) if sys.stdout.isatty() else 80
    with refusals():
        _check(arguments)
        read = reading_options(arguments)
        if arguments.ratio_to:
            from fitting.process.start_up import set_up_jax

            set_up_jax()  # the reflectance of the reference is computed while the files are read
        measurements = told_apart(
            [read_csv(file, **read) for file in arguments.file], arguments.file
        )
        wavelength = np.concatenate([m.wavelength_um for m in measurements])
        if arguments.reference:
            check_reference(arguments.reference, wavelength, "--reference")
    with Outputs() as outputs:
        with refusals():
            media: tuple[str | None, ...] = ()
            if arguments.material:
                from fitting.choice.sample_choice import several_samples

                media = fitted_media(several_samples(arguments.sample))
            staged = _stage(outputs, arguments, len(np.unique(wavelength)) > 1, media)
            found, choice = _fit(measurements, arguments)
            for medium in media:
                texts_of(found, medium)
        compared = None
        if choice is not None:
            reasons = [reason.text for reason in choice.reasons]
            compared = Comparison(choice.table(), reasons, choice.to_dict())
        if arguments.json == "-":
            say(as_data.json_text(found, None if compared is None else compared.data))
        elif not arguments.quiet:
            say(text_of(found, width, arguments.reference or "", compared))
        with Progress("files written", quiet=arguments.quiet) as bar:
            files.write_files(
                found, staged, reference=arguments.reference, command=arguments.command,
                comparison=compared, decimal=arguments.csv_decimal, step=bar.step,
            )  # fmt: skip
        outputs.publish()
    return exit_status([found])


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command with ``argv`` (default: the process's arguments) and return its exit status.

    0: every curve was fitted. 1: one or more curves have no index. 2: the command, a file or a
    value in it cannot be understood, or a result cannot be written. 130: interrupted. An error that
    the user can correct ends in one line on stderr that says what to do. ``--help``, ``--version``
    and a mistyped option end in SystemExit, as usual with argparse.
    """
    try:
        arguments = parser().parse_args(argv)
        given = sys.argv[1:] if argv is None else argv
        arguments.command = visible(shlex.join([PROGRAM, *given]))
        with refusals():
            arguments.file = expanded(arguments.file)
        from fitting.process.start_up import cheap_start

        with cheap_start():
            if arguments.each:
                from fitting.command.cli_each import run_each

                return run_each(arguments, _fit)
            return _run(arguments)
    except KeyboardInterrupt:
        print(file=sys.stderr)
        return INTERRUPTED
    except OSError as error:
        complain(f"{error.filename or 'a result file'}: {error.strerror}")
    except Refused as error:
        complain(str(error))
    return MISUSED
