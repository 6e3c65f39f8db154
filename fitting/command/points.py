"""``fresnel-fit`` without a model, where an index is not from R alone: a slab, or psi and Delta."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fitting.command import results
from fitting.index.arrange import check_quantities
from fitting.index.problem import CHANNELS
from fitting.output import point_report
from fitting.output.outputs import Outputs
from fitting.output.progress import Progress, shown
from fitting.output.reference import check_reference

if TYPE_CHECKING:
    from fitting.measurement import Measurement
    from fitting.model.points import PointFits


def _fit(measurement: Measurement, arguments: argparse.Namespace) -> PointFits:
    from fitting.start_up import set_up_jax

    set_up_jax()
    from fitting.model.points import fit_points
    from fitting.model.structures import INTERFACE, SLAB

    # By profile where it is asked for; at a single wavelength where it is better; and from a denser
    # medium, since in total reflection a quadratic limit of k can be 12 times too small.
    many = len(np.unique(measurement.wavelength_um)) > 1
    quick = arguments.intervals == "auto" and many and arguments.eta_i <= 1.0
    return fit_points(
        measurement,
        SLAB if arguments.slab else INTERFACE,
        thickness_um=arguments.slab,
        eta_i=arguments.eta_i,
        sigma="equal" if arguments.equal_weights else "given",
        absolute_sigma=arguments.absolute_sigma,
        intervals="quadratic" if quick else arguments.intervals,
    )


def _contents(fits: PointFits) -> results.Contents:
    def plot(path: Path, suffix: str, reference: str | None) -> None:
        from fitting.output.plot_points import save_point_plot

        save_point_plot(fits, path, suffix, reference)

    def page(png: bytes, command: str) -> str:
        from fitting.output.point_page import point_page

        return point_page(fits, png, command)

    return results.Contents(
        json=lambda: point_report.json_text(fits),
        csv=lambda: point_report.data_csv(fits),
        index=lambda: point_report.index_csv(fits),
        plot=plot,
        page=page,
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
    if arguments.reference:
        check_reference(arguments.reference, measurement.wavelength_um)
    if not arguments.slab:
        check_quantities(measurement, (*CHANNELS, "psi", "delta"))
    spectrum = len(np.unique(measurement.wavelength_um)) > 1
    with Outputs() as outputs:
        staged = results.stage(outputs, arguments, spectrum)
        with shown("wavelengths fitted", quiet=arguments.quiet):
            fits = _fit(measurement, arguments)
        if arguments.json == "-":
            show(point_report.json_text(fits))
        elif not arguments.quiet:
            beside = results.reference_lines(arguments, measurement.wavelength_um, width)
            show(point_report.table(fits, width) + beside)
        with Progress("files written", quiet=arguments.quiet) as bar:
            results.write(staged, _contents(fits), arguments, bar)
        outputs.publish()
    return bool((fits.status == "converged").all())
