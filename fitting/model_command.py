"""``fresnel-fit --model NAME``: a dispersion model over whole curves, from the command line."""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fitting import model_report, results
from fitting.model_options import fit_options
from fitting.outputs import Outputs

if TYPE_CHECKING:
    from fitting.measurement import Measurement
    from fitting.model_result import ModelFit


def _fit(measurements: Sequence[Measurement], arguments: argparse.Namespace) -> ModelFit:
    from fitting.start_up import set_up_jax

    options = fit_options(arguments)
    set_up_jax()
    from fitting.model_fit import fit_model

    if arguments.reference:
        from fresnel_jax.dispersion import material

        material(arguments.reference)  # refuses a name that it does not know
    with warnings.catch_warnings():
        # A cache folder that is full or was taken away is not the user's business here.
        warnings.filterwarnings("ignore", message=".*persistent compilation cache.*")
        return fit_model(measurements, arguments.model, **options)


def _write(staged: dict[str, Path], fit: ModelFit, arguments: argparse.Namespace) -> None:
    for kind, path in staged.items():
        what = kind.removeprefix("report ")
        if what == "plot":
            from fitting.plot_model import save_model_plot

            suffix = Path(arguments.plot).suffix if kind == "plot" else ".png"
            save_model_plot(fit, path, suffix, arguments.reference)
            continue
        text = {
            "json": model_report.json_text,
            "csv": model_report.data_csv,
            "index": model_report.index_csv,
        }[what](fit)
        # File names that are no text are shown with escapes; line ends are the same everywhere.
        path.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")


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

    if arguments.report:
        raise ValueError("--report is for fits without --model; use --json, --csv and --plot.")
    wavelength = np.concatenate([m.wavelength_um for m in measurements])
    with Outputs() as outputs:
        staged = results.stage(outputs, arguments, len(np.unique(wavelength)) > 1)
        fit = _fit(measurements, arguments)
        if arguments.json == "-":
            show(model_report.json_text(fit))
        elif not arguments.quiet:
            show(model_report.table(fit, width))
        _write(staged, fit, arguments)
        outputs.publish()
    return fit.status == "converged"
