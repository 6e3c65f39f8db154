"""The command ``fresnel-fit FILE``: a measured curve in; a table, JSON, CSV and a picture out.

What the command needs is imported where it is needed, so that ``--help`` and a mistyped option
answer at once and only ``--plot`` pays for matplotlib.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import shlex
import sys
import warnings
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NoReturn

from fitting.command import options as model_options

if TYPE_CHECKING:
    from fitting.index.fit import FitResult
    from fitting.measurement import Measurement

PROGRAM = "fresnel-fit"
FITTED, NOT_FITTED, MISUSED, INTERRUPTED = 0, 1, 2, 130
# What a script may take as an index. "undetermined" is not: it is one of many that fit alike.
GOOD = ("converged", "converged at k = 0")

_DESCRIPTION = """\
Fit the complex refractive index eta + i k of one bare interface to measured
R_s, R_p or unpolarised R, or to psi and Delta, over the angle of incidence, at
one wavelength or wavelength by wavelength; or, with --model, a dispersion model
of an interface or a slab to R, T, psi and Delta over angles and wavelengths.
"""

_EPILOG = """\
examples:
  fresnel-fit gold.csv --plot gold.png --json gold.json
  fresnel-fit ellipsometer.txt --reference Si --report out
  fresnel-fit gold.csv --model constant --free scale --prior scale=1+-0.02
  fresnel-fit glass.csv --model cauchy-urbach --slab 3.05 --plot glass.png

where gold.csv has angles in degrees and reflectances as fractions or percent:
  angle_deg,R_s,sigma_R_s,R_p,sigma_R_p
  30,0.76,0.002,0.67,0.002
  45,0.79,0.002,0.66,0.002
The first line of the table says how the file was understood; the options under
"reading" overrule it. A value that begins with a minus sign needs the equals
sign: --missing=-9999.

exit status:
  0    every curve was fitted
  1    of a curve or more the data give no index: the fit did not converge, or
       the data determine only a combination of eta and k (the table and the
       field "status" of the JSON say which)
  2    the command, the file or a value in it cannot be understood, or a result
       cannot be written
  130  interrupted

Compiled programs are kept in $XDG_CACHE_HOME/fresnel-fit or
~/.cache/fresnel-fit, which may be deleted at any time.
"""

_READING = (
    ("columns", "ROLE=COLUMN,..", "columns by header name or number: angle=1,R_s=2,sigma_R_s=3"),
    ("angle-deg", "DEGREES", "angle of incidence of a file that has no column for it"),
    ("angle-unit", "UNIT", "deg, rad, mrad, deg.arcmin, grazing-deg, 1/angstrom, ..."),
    ("wavelength-um", "UM", "wavelength of a file that has no column for it, micrometres"),
    ("wavelength-unit", "UNIT", "nm, um, angstrom, eV, cm-1, THz, ..."),
    ("polarization", "LIGHT", "s, p or unpolarized; or what a column's codes mean: 0=s,1=p"),
    ("scale", "FACTOR", "factor that makes R a fraction: 0.01 for percent"),
    ("sigma", "SIGMA", "standard error of values that have none, a fraction"),
    ("psi-unit", "UNIT", "deg or rad"),
    ("missing", "VALUES", "numbers or words that stand for a gap: 0 or -9999,bad"),
    ("keep", "COLUMN=VALUES", "rows to read, by the value of a column: Zone=1,2"),
    ("lines", "FROM-TO", "lines to read: 10-200, 10- or -200"),
    ("delimiter", "NAME", "tab, semicolon, comma, pipe, blank, or the sign"),
    ("decimal", "SIGN", "decimal mark, . or ,"),
    ("encoding", "NAME", "text encoding: utf-8, latin-1, utf-16, ..."),
)


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from importlib.metadata import PackageNotFoundError, version

        try:
            found = version("fresnel-jax")
        except PackageNotFoundError:
            found = "(not installed)"
        print(f"{PROGRAM} {found}")
        parser.exit()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        PROGRAM,
        usage="%(prog)s [options] FILE [FILE ...]",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument(
        "file", metavar="FILE", nargs="+",
        help="text file with the measurement (CSV and its kin); several are fitted together",
    )  # fmt: skip
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    results = parser.add_argument_group("results", "Files are written whole or not at all.")
    results.add_argument(
        "--json", metavar="OUT", help="eta, k, errors, status and all else; - for stdout"
    )
    results.add_argument(
        "--csv",
        metavar="OUT",
        help="data, fitted values and residuals; of a spectrum also eta and k, in OUT with .index "
        "before the suffix",
    )
    results.add_argument(
        "--plot", metavar="OUT", help="picture of data, fit and residuals: .png, .pdf or .svg"
    )
    results.add_argument(
        "--reference",
        metavar="MATERIAL",
        help="show eta and k of a material beside, and draw them over wavelength: gold, BK7, ..",
    )
    results.add_argument(
        "--report",
        metavar="DIR",
        help="folder for report.html (one page, pictures inside), fit.json, data.csv, index.csv "
        "of a spectrum, and fit.png",
    )
    results.add_argument("--quiet", action="store_true", help="print no table")
    fitting = parser.add_argument_group("fitting")
    fitting.add_argument(
        "--eta-i", metavar="INDEX", type=float, default=1.0,
        help="index of the medium that the light comes from (default 1)",
    )  # fmt: skip
    errors = fitting.add_mutually_exclusive_group()
    errors.add_argument(
        "--equal-weights", action="store_true", help="weigh all data alike, whatever their errors"
    )
    errors.add_argument(
        "--absolute-sigma",
        action="store_true",
        help="take the stated errors as they are; by default the errors of eta and k are "
        "multiplied by sqrt(chi2/dof)",
    )
    fitting.add_argument(
        "--intervals",
        choices=("auto", "quadratic", "profile"),
        default="auto",
        help="95 %% ranges from the standard errors, from the likelihood (profile), or from that "
        "where the errors do not tell (auto, the default)",
    )
    model_options.add_options(parser)
    reading = parser.add_argument_group("reading")
    for name, metavar, text in _READING:
        reading.add_argument(f"--{name}", metavar=metavar, help=text)
    return parser


class _Refused(Exception):
    """The user's to mend; the text says how."""


@contextlib.contextmanager
def _refusals() -> Iterator[None]:
    """Turn the ValueErrors of reading and fitting, whose texts are for the user, into _Refused.

    Only there: a ValueError from anywhere else is a defect and should show its traceback.
    """
    try:
        yield
    except ValueError as error:
        raise _Refused(error) from error


def _read(arguments: argparse.Namespace) -> list[Measurement]:
    from fitting.measurement import read_csv

    names = [name.replace("-", "_") for name, *_ in _READING]
    options = {name: getattr(arguments, name) for name in names}
    return [read_csv(file, **options) for file in (arguments.file, *arguments.more)]


def _fit(
    measurement: Measurement, files: list[Measurement], arguments: argparse.Namespace
) -> FitResult:
    from fitting.start_up import set_up_jax

    set_up_jax()
    from fitting.index.fit import fit

    with warnings.catch_warnings():
        # A cache folder that is full or was taken away is not the user's business here.
        warnings.filterwarnings("ignore", message=".*persistent compilation cache.*")
        options = {
            "eta_i": arguments.eta_i,
            "sigma": "equal" if arguments.equal_weights else "given",
            "absolute_sigma": arguments.absolute_sigma,
        }
        result = fit(measurement, intervals=arguments.intervals, **options)
        if len(files) > 1:
            from fitting.command.files import disagreement

            said = disagreement(files, intervals="quadratic", **options)
            result = result._replace(notes=(*result.notes, *said))
        return result


def _run(arguments: argparse.Namespace) -> int:
    import numpy as np

    from fitting.command import results
    from fitting.measurement import concatenate
    from fitting.output import export, report
    from fitting.output.outputs import Outputs
    from fitting.output.progress import Progress

    width = min(os.get_terminal_size().columns, 100) if sys.stdout.isatty() else 80
    with _refusals():
        results.check(arguments)
        measurements = _read(arguments)
        if arguments.slab and len(measurements) > 1:
            from fitting.command.files import refuse_several_thicknesses

            refuse_several_thicknesses([m.source for m in measurements])
        if arguments.model:
            from fitting.command.model import run_model

            return FITTED if run_model(measurements, arguments, width, _print) else NOT_FITTED
        measurement = concatenate(*measurements)
        if arguments.slab or np.isin(measurement.quantity, ("psi", "delta")).any():
            from fitting.command.points import run_points

            return FITTED if run_points(measurement, arguments, width, _print) else NOT_FITTED
        if arguments.reference:
            from fitting.output.reference import check_reference

            check_reference(arguments.reference, measurement.wavelength_um)
    with Outputs() as outputs:
        spectrum = len(np.unique(measurement.wavelength_um)) > 1
        with _refusals(), Progress("fit", quiet=arguments.quiet):
            staged = results.stage(outputs, arguments, spectrum)
            result = _fit(measurement, measurements, arguments)
        if arguments.json == "-":
            _print(export.json_text(result, measurement))
        elif not arguments.quiet:
            beside = results.reference_lines(arguments, measurement.wavelength_um, width)
            _print(report.table(result, measurement, width) + beside)
        with Progress("files written", quiet=arguments.quiet) as bar:
            results.write(staged, results.contents(result, measurement), arguments, bar)
        outputs.publish()
    return FITTED if all(status in GOOD for status in np.atleast_1d(result.status)) else NOT_FITTED


def _print(text: str) -> None:
    """Print ``text``; a reader who stops early (``| head``) has seen enough, files are written."""
    # A name or unit may hold letters that a terminal of another encoding cannot show.
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    try:
        sys.stdout.write(text.encode(encoding, "backslashreplace").decode(encoding))
        sys.stdout.flush()
    except BrokenPipeError:
        # Python flushes stdout once more when it exits, and would complain.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command with ``argv`` (default: the process's arguments) and return its exit status.

    0: every curve was fitted. 1: of a curve or more the data give no index. 2: the command, the
    file or a value in it cannot be understood, or a result cannot be written. 130: interrupted.
    A mistake of the user ends in one line on stderr that says what to do. ``--help``, ``--version``
    and a mistyped option end in SystemExit, as argparse does it.
    """
    try:
        arguments = _parser().parse_args(argv)
        given = sys.argv[1:] if argv is None else argv
        arguments.file, *arguments.more = arguments.file
        arguments.command = shlex.join([PROGRAM, *given])
        from fitting.start_up import cheap_start

        with cheap_start():
            return _run(arguments)
    except KeyboardInterrupt:
        print(file=sys.stderr)
        return INTERRUPTED
    except OSError as error:
        print(f"{PROGRAM}: {error.filename or 'writing'}: {error.strerror}", file=sys.stderr)
    except _Refused as error:
        print(f"{PROGRAM}: {error}", file=sys.stderr)
    return MISUSED
