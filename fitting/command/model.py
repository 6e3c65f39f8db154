"""``fresnel-fit --model NAME``: a dispersion model over whole curves, from the command line."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fitting.command import results
from fitting.command.options import fit_options
from fitting.output import model_report, report
from fitting.output.outputs import Outputs
from fitting.output.progress import Progress, shown
from fitting.output.reference import check_reference

if TYPE_CHECKING:
    from fitting.measurement import Measurement
    from fitting.model.candidates import Choice
    from fitting.model.result import ModelFit

AUTO = "auto"


def _fit(
    measurements: Sequence[Measurement], arguments: argparse.Namespace
) -> tuple[ModelFit, Choice | None]:
    from fitting.start_up import set_up_jax

    options = fit_options(arguments)
    set_up_jax()
    from fitting.model.fit import fit_model

    if arguments.model != AUTO:
        with shown("rounds of the fit", quiet=arguments.quiet):
            return fit_model(measurements, arguments.model, **options), None
    from fitting.model.select import choose

    with Progress("models tried", quiet=arguments.quiet) as bar:
        choice = choose(measurements, step=bar.step, **options)
    return choice.fit, choice


def _comparison(choice: Choice, width: int) -> str:
    from fitting.model.candidates import choice_table

    lines = ["", "  models compared (BIC above the lowest; > is taken)"]
    lines += report.rows_aligned(choice_table(choice))
    lines += ["", *(report.wrapped("choice", reason, width) for reason in choice.reasons)]
    return "\n".join(lines) + "\n"


def _json(fit: ModelFit, choice: Choice | None) -> str:
    if choice is None:
        return model_report.json_text(fit)
    from fitting.model.candidates import choice_dict

    return model_report.json_text(fit, choice_dict(choice))


def _contents(fit: ModelFit, choice: Choice | None) -> results.Contents:
    def plot(path: Path, suffix: str, reference: str | None) -> None:
        from fitting.output.plot_model import save_model_plot

        save_model_plot(fit, path, suffix, reference)

    def page(png: bytes, command: str) -> str:
        from fitting.output.model_page import model_page

        return model_page(fit, png, command, choice)

    return results.Contents(
        json=lambda: _json(fit, choice),
        csv=lambda: model_report.data_csv(fit),
        index=lambda: model_report.index_csv(fit),
        plot=plot,
        page=page,
    )


def run_model(
    measurements: Sequence[Measurement],
    arguments: argparse.Namespace,
    width: int,
    show: Callable[[str], None],
) -> bool:
    """Fit the model that was asked for, show and write what was asked for; whether it converged.

    show: prints a text. Raises ValueError for what is the user's to mend.
    """
    import numpy as np

    wavelength = np.concatenate([m.wavelength_um for m in measurements])
    if arguments.reference:
        check_reference(arguments.reference, wavelength)
    with Outputs() as outputs:
        staged = results.stage(outputs, arguments, len(np.unique(wavelength)) > 1)
        fit, choice = _fit(measurements, arguments)
        if arguments.json == "-":
            show(_json(fit, choice))
        elif not arguments.quiet:
            compared = "" if choice is None else _comparison(choice, width)
            beside = results.reference_lines(arguments, wavelength, width)
            show(model_report.table(fit, width) + compared + beside)
        with Progress("files written", quiet=arguments.quiet) as bar:
            results.write(staged, _contents(fit, choice), arguments, bar)
        outputs.publish()
    return fit.status == "converged"
