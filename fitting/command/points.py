"""``fresnel-fit --slab MM`` without a model: eta and k of a slab wavelength by wavelength."""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from fitting.command import results
from fitting.output import point_report
from fitting.output.outputs import Outputs

if TYPE_CHECKING:
    from fitting.measurement import Measurement
    from fitting.model.points import PointFits


def _fit(measurement: Measurement, arguments: argparse.Namespace) -> PointFits:
    from fitting.start_up import set_up_jax

    set_up_jax()
    from fitting.model.points import fit_points

    if arguments.reference:
        from fresnel_jax.dispersion import material

        material(arguments.reference)  # refuses a name that it does not know
    with warnings.catch_warnings():
        # A cache folder that is full or was taken away is not the user's business here.
        warnings.filterwarnings("ignore", message=".*persistent compilation cache.*")
        return fit_points(
            measurement,
            thickness_um=arguments.slab,
            eta_i=arguments.eta_i,
            sigma="equal" if arguments.equal_weights else "given",
            absolute_sigma=arguments.absolute_sigma,
        )


def run_points(
    measurement: Measurement,
    arguments: argparse.Namespace,
    width: int,
    show: Callable[[str], None],
) -> bool:
    """Fit every wavelength, show and write what was asked for; whether all of them converged.

    show: prints a text. Raises ValueError for what is the user's to mend.
    """
    if arguments.report:
        raise ValueError("--report is not for --slab without --model; use --json, --csv, --plot.")
    with Outputs() as outputs:
        staged = results.stage(outputs, arguments, spectrum=True)
        fits = _fit(measurement, arguments)
        if arguments.json == "-":
            show(point_report.json_text(fits))
        elif not arguments.quiet:
            show(point_report.table(fits, width))
        for kind, path in staged.items():
            if kind == "plot":
                from fitting.output.plot_points import save_point_plot

                save_point_plot(fits, path, Path(arguments.plot).suffix, arguments.reference)
                continue
            text = {
                "json": point_report.json_text,
                "csv": point_report.data_csv,
                "index": point_report.index_csv,
            }[kind](fits)
            path.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")
        outputs.publish()
    return bool((fits.status == "converged").all())
