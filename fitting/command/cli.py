"""The command ``fresnel-fit FILE``: a measured curve in; a table, JSON, CSV and a picture out.

Modules are imported where they are needed, so that ``--help`` and a mistyped option answer at once
and only ``--plot`` takes the time to import matplotlib.
"""

from __future__ import annotations

import argparse
import difflib
import glob
import os
import re
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import fitting
from fitting.command import map_command
from fitting.command.terminal import (
    MISUSED,
    PROGRAM,
    Refused,
    complain,
    exit_status,
    refusals,
    say,
)
from fitting.process.interrupt import INTERRUPTED
from fitting.process.progress import listening, shown, tell
from fitting.process.visible import visible

if TYPE_CHECKING:
    from fitting.choice.candidates import Choice
    from fitting.data.measurement import Measurement
    from fitting.fit_result import Fit
    from fitting.output.export import OfFile
    from fitting.output.files import ResultFile

_DESCRIPTION = """\
Fit the complex refractive index eta + i k of a surface, a plate or a film to
measured R, T, R_s, R_p, ... or psi and Delta, over the angle of incidence and
the wavelength. Without --sample the sample is one bare surface, whose eta and k
are fitted wavelength by wavelength.
"""

_EPILOG = """\
samples (media in the order in which the light meets them, separated by |):
  free                                   one bare surface, eta and k at every
                                         wavelength (the default)
  cauchy                                 one bare surface with that dispersion
  auto                                   the simplest dispersion model that
                                         describes the data
  1.515 | free                           light from inside glass
  air | cauchy-urbach 3 mm thick | air   a plate: both faces, no interference
  air | cauchy 110 nm | Si               a coherent film, thickness fitted
  air | cauchy 5..20000 nm | Si          the same, its thickness within a range
  air | rough 2 nm | film.yml 110 nm | Si   rough: half air, half film
  Si or air | SiO2 1..50 nm | Si         the simplest of several samples that
                                         describes the data: is there an oxide?
An index is a number (1.45, 0.2+3.1i), a named material (gold, BK7; --materials
lists them), a file (refractiveindex.info YAML, or CSV of wavelength, n and k),
a mixture (bruggeman(SiO2, water 30 %)), free, auto, or a dispersion model:
constant, cauchy, cauchy-urbach, sellmeier, drude, lorentz, drude-lorentz,
tauc-lorentz, cody-lorentz, gaussian, pole, with the number of its terms:
drude-lorentz:2; the last seven can be added:
'tauc-lorentz + gaussian:2 + pole'.

examples:
  fresnel-fit gold.csv --plot gold.png --json gold.json
  fresnel-fit ellipsometer.txt --reference Si --report out
  fresnel-fit gold.csv --free scale --prior scale=1+-0.02
  fresnel-fit glass.csv --sample 'air | cauchy-urbach 3.05 mm thick | air'
  fresnel-fit film.csv --divide-by wafer.csv --ratio-to Si --sample auto
  fresnel-fit --each 'scans/*.csv' --csv results.csv
  fresnel-fit --map cube.zarr --out maps.zarr --plot map.html

where gold.csv has angles in degrees and reflectances as fractions or percent:
  angle_deg,R_s,sigma_R_s,R_p,sigma_R_p
  30,0.76,0.002,0.67,0.002
  45,0.79,0.002,0.66,0.002
A value that begins with a minus sign needs the equals sign: --missing=-9999.

exit status:
  0    every curve was fitted
  1    for one curve or more there is no index: the fit did not converge, the
       data determine only a combination of eta and k, or the sample does not
       describe them (the table and the field "status" of the JSON say which)
  2    the command, a file or a value in it cannot be understood, or a result
       cannot be written; with --each the other files were fitted
  3    of a map, some blocks ended every worker that fitted them; the others are
       done (0: all are; the table says how many pixels have an index)
  70   a defect of the program: please report it, with what it printed
  71   not enough memory
  130  interrupted

Compiled programs are kept in $XDG_CACHE_HOME/fresnel-fit or
~/.cache/fresnel-fit, which may be deleted at any time.
"""


class _Materials(argparse.Action):
    """Print names, wavelengths in micrometres, source and conditions of all named materials, or
    the entries of the refractiveindex.info database with these words in name or title, and exit."""

    def __call__(self, parser: Any, _: object, words: Any, *__: object) -> None:
        from fitting.output.summary import rows_aligned
        from fresnel_jax import materials

        prefix = materials.DATABASE_PREFIX
        rows: Any = [("name", "wavelengths, um", "source; conditions")]
        for name in () if words else materials.names():
            record = materials.lookup(name)
            known = "{:.4g} to {:.4g}".format(*record.range_um) if record.range_um else "all"
            notes = (record.source, record.doi and f"doi:{record.doi}", record.note)
            rows.append((", ".join((name, *record.aliases)), known, "; ".join(filter(None, notes))))
        if words:
            if not words.startswith(prefix):
                parser.error(f"{words!r} came; {prefix}gold looks for gold in the database.")
            try:
                rows = materials.search_database(words)
            except ValueError as error:
                parser.error(str(error))
            if not rows:
                parser.error(f"no entry of the database has {words.removeprefix(prefix)!r}.")
        say("\n".join(rows_aligned(rows, margin="")) + "\n")
        parser.exit()


# Name, metavar, help, and what else argparse is to know of each option. Those of _READING and
# _FITTING are arguments of `read_csv` and `fit`, which have the defaults.
_FLAG: dict[str, Any] = {"action": "store_true"}
_MANY: dict[str, Any] = {"action": "append", "default": []}
_READING = (
    ("columns", "ROLE=COLUMN,..", "columns by header or number: angle=1,R_s=2,sigma_R_s=3"),
    ("angle-deg", "DEGREES", "angle of incidence of a file that has no column for it"),
    ("angle-unit", "UNIT", "deg, rad, grazing-deg, 1/angstrom, 1/nm"),
    ("wavelength-um", "UM", "wavelength of a file that has no column for it, micrometres"),
    ("wavelength-unit", "UNIT", "nm, um, angstrom, eV, cm-1, THz, ..."),
    ("polarization", "LIGHT", "s, p or unpolarized; or what the codes in a column mean: 0=s,1=p"),
    ("scale", "FACTOR", "factor that makes R a fraction: 0.01 for percent"),
    ("divide-by", "FILE", "divide the values by this scan of a reference, read in the same way, or "
     "by the column of the file with this name"),
    ("ratio-to", "SAMPLE", "the values are ratios to R of this known sample: Si, or "
     "'air | SiO2 2 nm held | Si'"),
    ("sigma", "SIGMA", "standard error of the values that have none; of R and T a fraction, of "
     "percent too: 0.002 is 0.2 %%; of psi and Delta degrees"),
    ("psi-unit", "UNIT", "unit of psi and Delta: deg or rad"),
    ("delta-range", "DEGREES", "180 if Delta may be 360 - Delta (rotating analyzer), else 360"),
    ("missing", "VALUES", "numbers or words that mark missing values: 0 or -9999,bad"),
    ("ignore", "COLUMN,..", "columns that shall not be read: temperature,7"),
    ("lines", "FROM-TO", "lines to read: 10-200, 10- or -200"),
    ("delimiter", "NAME", "between columns: tab, semicolon, comma, pipe, blank, or the sign"),
    ("decimal", "SIGN", "decimal mark, . or ,"),
    ("encoding", "NAME", "text encoding: utf-8, latin-1, utf-16, ..."),
    ("sheet", "NAME", "sheet of a spreadsheet (.xlsx) that has several"),
)  # fmt: skip


_GENERAL = (
    ("each", None, "fit every file by itself, and show a row of results for each, which --csv and "
     "--json write as a table; a file that is refused is reported, and the others are fitted",
     _FLAG),
    ("materials", "ri:WORDS", "print names, wavelengths and sources of the materials that --sample "
     "knows, and exit; with ri:gold the entries of refractiveindex.info that have gold in name or "
     "title", {"action": _Materials, "nargs": "?"}),
    ("version", None, "print the version and exit",
     {"action": "version", "version": f"{PROGRAM} {fitting.__version__}"}),
)  # fmt: skip
_RESULTS = (
    ("json", "OUT", "write all results as JSON: eta, k, errors, status, ...; - for stdout"),
    ("csv", "OUT", "write data, fitted values and residuals; for a spectrum also eta and k, "
     "in out.index.csv beside out.csv"),
    ("plot", "OUT", "draw data, fit and residuals: .png, .pdf or .svg"),
    ("material", "OUT.yml", "write the fitted eta and k as a refractiveindex.info file, which "
     "--sample takes as a material, and their errors as OUT_errors.csv; several media as "
     "OUT_film.yml, OUT_substrate.yml, .."),
    ("reference", "MATERIAL", "show eta and k of a material for comparison, in the table and "
     "in pictures over the wavelength: gold, BK7, .."),
    ("report", "DIR", "write report.html (one page, pictures inside), fit.json, data.csv, "
     "index.csv of a spectrum, and fit.png to a folder that is new, empty, or of an earlier "
     "report"),
    ("csv-decimal", "MARK", "decimal mark of the tables that are written: . with commas between "
     "the cells (the default), or , with semicolons between the cells, for spreadsheets that "
     "expect these", {"choices": (".", ","), "default": "."}),
    ("overwrite", None, "let --report use a folder that holds other files, and let results replace "
     "files that were not written by a fit; a file that this fit reads is never replaced", _FLAG),
    ("quiet", None, "print no table and no progress", _FLAG),
)  # fmt: skip
_FITTING = (
    ("sample", "TEXT", "the sample that was measured; see \"samples\" below",
     {"default": "free"}),
    ("free", "NAME,..", "parameters to fit that are fixed by default: scale,angle-offset", _MANY),
    ("fix", "NAME=VALUE", "keep a parameter at this value instead of fitting it", _MANY),
    ("bound", "NAME=LOW..HIGH", "fit a parameter within a range; either end may be left out",
     _MANY),
    ("prior", "NAME=VALUE+-SIGMA",
     "fit a parameter whose value is known beforehand, with this standard error", _MANY),
    ("tie", "NAME=OTHER", "make a parameter equal to another, or to a multiple: 2*OTHER", _MANY),
    ("loss", None, "what is minimised: the sum of squared residuals (squares, the default), or for "
     "data with outliers a sum in which large residuals weigh less (huber)",
     {"choices": ("squares", "huber")}),
    ("errors", None, "how the standard errors that a file states are used. stated: as they are; "
     "scaled: times sqrt(chi2/dof); floor: with one common error added in squares; relative: with "
     "an error in proportion to each R or T added in squares; equal: not at all, all data have "
     "equal weights; auto (the default): scaled, or floor or relative where they are far too small "
     "and such an error describes the residuals better",
     {"choices": ("auto", "stated", "scaled", "floor", "relative", "equal")}),
    ("intervals", None, "95 %% intervals from the standard errors (quadratic), from the profile "
     "likelihood (profile), or by profile likelihood where the quadratic approximation fails "
     "(auto)", {"choices": ("auto", "quadratic", "profile")}),
    ("starts", "N", "number of starting points from which the best fit is searched for (default 64 "
     "or more, by the number of parameters; not used for one bare surface)", {"type": int}),
)  # fmt: skip


_EXAMPLES = {"fixed": ("--fix", "NAME=VALUE", "k=0"),
             "bounds": ("--bound", "NAME=LOW..HIGH", "eta=1.4..1.6"),
             "priors": ("--prior", "NAME=VALUE+-SIGMA", "scale=1+-0.02")}  # fmt: skip


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        if unknown := re.match("unrecognized arguments: .*?(--[^ =]+)", message):
            options, name = self._option_string_actions, unknown[1]
            near = [o for o in options if o.startswith(name)]
            near = near or difflib.get_close_matches(name, options, cutoff=0.7)
            message += f"; like it: {', '.join(near)}" * bool(near)
            message += f". {PROGRAM} --help lists all options."
        super().error(visible(message))

    def _print_message(self, message: str, file: Any = None) -> None:
        if file is sys.stdout:
            say(message)
        elif message:  # argparse itself says nothing of a full disk
            (file or sys.stderr).write(message)


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command."""
    out = _Parser(
        PROGRAM,
        usage="%(prog)s [options] FILE [FILE ...]",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    out.add_argument(
        "file", metavar="FILE", nargs="+",
        help="file with the measurement (CSV or similar text, or .xlsx), - for standard input, or "
        "a quoted pattern such as '*.csv'; several files are fitted together, as measurements of "
        "one sample",
    )  # fmt: skip
    for title, text, options in _GROUPS:
        group: Any = out.add_argument_group(title, text) if title else out
        for name, metavar, help_text, *more in options:
            own = {"metavar": metavar} if metavar else {}
            group.add_argument(f"--{name}", help=help_text, **own, **(more[0] if more else {}))
    return out


_GROUPS: tuple[tuple[str, str, Any], ...] = (
    ("", "", _GENERAL),
    ("results", "Files are written whole or not at all.", _RESULTS),
    (
        "fitting",
        "NAME is a parameter of the sample, as the table of a fit lists them (A,\n"
        "film.thickness_nm), or of the instrument: scale and background (of every\n"
        "curve; scale[R_s]: of R_s only), angle-offset (degrees), wavelength-offset\n"
        "(nm), leak (share of the other polarization behind a polarizer), divergence of\n"
        "the beam (standard deviation, degrees), bandwidth of the slit (full width at\n"
        "half maximum, nm).",
        _FITTING,
    ),
    (
        "maps",
        "What --map takes. The same command again goes on with what is missing in\n"
        "the store. --plot writes a picture, or with a name ending in .html a page.",
        map_command.OPTIONS,
    ),
    (
        "reading",
        'Columns, units and layout are found out from the file; the line "read" of the\n'
        "table states them. Each of these options overrules what was found.",
        _READING,
    ),
)


def expanded(files: Sequence[str]) -> list[str]:
    """Return the files with the wildcards * ? [ ] expanded, where the shell has not done it.

    Raises ValueError for a pattern that no file matches.
    """
    out = []
    for name in files:
        if not glob.has_magic(name) or os.path.exists(name):
            out.append(name)
        elif found := sorted(f for f in glob.glob(name, recursive=True) if os.path.isfile(f)):
            out += found
        else:
            raise ValueError(f"{name}: no file matches this pattern.")
    return out


def _given(arguments: argparse.Namespace, options: Any) -> dict[str, Any]:
    names = {name.replace("-", "_") for name, *_ in options}
    return {n: value for n, value in vars(arguments).items() if n in names and value is not None}


def _fit_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the keyword arguments of `fit`, or raise ValueError for a text of its own."""
    from fitting.samples.parameters import parse_setting

    given = _given(arguments, _FITTING)
    del given["sample"]
    given["free"] = [n for text in given["free"] for n in text.split(",") if n.strip()]
    for kind, (flag, form, example) in _EXAMPLES.items():
        given[kind] = {}
        for text in given.pop(flag[2:]):
            try:
                name, found, value = parse_setting(text)
            except ValueError:
                name, found, value = "", "", None
            if found != kind:
                other = f"; {_EXAMPLES[found][0]} takes this" if found else ""
                raise ValueError(f"{flag} {text}: {form} was wanted, for example {example}{other}.")
            given[kind][name] = value
    ties, given["tie"] = given["tie"], {}
    for text in ties:
        name, equal, other = (part.strip() for part in text.partition("="))
        if not (name and equal and other):
            raise ValueError(f"--tie {text}: NAME=OTHER was wanted, for example film_2.A=film_1.A.")
        given["tie"][name] = other
    return given


def _files(arguments: argparse.Namespace, spectrum: bool) -> list[ResultFile]:
    """Return the files that were asked for, if they can be written; else raise OutputError.

    spectrum: whether there is an index for each wavelength, which has a CSV of its own.
    """
    from fitting.output import files
    from fitting.samples.sample import several_samples

    samples = several_samples(arguments.sample)
    references = several_samples([arguments.ratio_to] if arguments.ratio_to else [])
    inputs = [*arguments.file, *files.files_named(*samples, *references)]
    inputs += [arguments.divide_by] if arguments.divide_by else []
    wanted = []
    for what, name in (("csv", arguments.csv), ("plot", arguments.plot), ("json", arguments.json)):
        path = Path(name or "-")
        if name and (name != "-" or what != "json"):
            wanted.append(files.ResultFile(what, path, f"--{what}"))
        if name and what == "csv" and spectrum:
            path = path.with_name(f"{path.stem}.index{path.suffix}")
            wanted.append(files.ResultFile("index", path, "--csv"))
    if arguments.material:
        media = files.fitted_media(samples)
        wanted += files.material_files(arguments.material, media, "--material")
    if arguments.report:
        without = () if spectrum else ("index",)
        wanted += files.report_files(arguments.report, without, "--report", arguments.overwrite)
    return files.checked(wanted, inputs, arguments.overwrite)


def _fit(
    measurements: list[Measurement], arguments: argparse.Namespace
) -> tuple[Fit, Choice | None]:
    """Return the fit that was asked for, and the comparison if a model was to be chosen."""
    options = _fit_options(arguments)
    from fitting.fits import fit
    from fitting.samples.sample import several_samples

    samples = several_samples(arguments.sample)
    if len(samples) == 1 and not samples[0].open:
        return fit(measurements, samples[0], **options), None
    from fitting.choice.selection import choose

    choice = choose(measurements, samples, **options)
    return choice.fit, choice


def _run(arguments: argparse.Namespace) -> int:
    """Fit all files together, and report and write the result."""
    import numpy as np

    from fitting.data.drawing import check_matplotlib
    from fitting.data.measurement import told_apart
    from fitting.measured_file import read_csv
    from fitting.output import export, files, pictures
    from fitting.output.summary import reference_text, table

    with refusals():
        if arguments.plot:
            pictures.check_picture(arguments.plot)
        if arguments.report:
            check_matplotlib("--report")
        read = _given(arguments, _READING)
        measurements = told_apart(
            [read_csv(file, **read) for file in arguments.file], arguments.file
        )
        wavelength, reference = np.concatenate([m.wavelength_um for m in measurements]), ""
        if arguments.reference:
            reference = reference_text(arguments.reference, wavelength, "--reference")
        wanted = _files(arguments, len(np.unique(wavelength)) > 1)
        with shown("fit", quiet=arguments.quiet):
            found, choice = _fit(measurements, arguments)
        for one in wanted:
            if one.what == "material":
                export.material_of(found, one.medium)
    if arguments.json == "-":
        say(export.json_text(found, choice))
    elif not arguments.quiet:
        width = min(os.get_terminal_size().columns, 100) if sys.stdout.isatty() else 80
        say(table(found, width, reference, choice))
    with refusals(files.OutputError), shown("files written", quiet=arguments.quiet):
        files.write_files(
            found, wanted, reference=arguments.reference, command=arguments.command,
            choice=choice, decimal=arguments.csv_decimal,
        )  # fmt: skip
    return exit_status([found])


def _fit_file(file: str, arguments: argparse.Namespace) -> OfFile:
    """Return the fit of one file, or why there is none."""
    from fitting.data.errors import for_command
    from fitting.measured_file import read_csv
    from fitting.output.export import OfFile
    from fitting.reader.text import source_of

    try:
        found, _ = _fit([read_csv(file, **_given(arguments, _READING))], arguments)
        return OfFile(file, found)
    except (ValueError, ImportError) as error:
        # the whole path: there may be a/scan.csv and b/scan.csv
        source, text = source_of(file), for_command(error)
        own = text.startswith((f"{source}:", f"{source},"))
        return OfFile(file, None, file + (text.removeprefix(source) if own else f": {text}"))


def _run_each(arguments: argparse.Namespace) -> int:
    """Fit every file by itself (``--each``), and report and write a row of results for each."""
    from fitting.output import export, files

    mark = re.compile(f"# {export.EACH_MARK}".encode())
    results = [file for file in arguments.file if files.begins(file, mark)]
    for file in results:
        complain(f"{file}: left out, since it is a table of results that --each wrote.")
    # a table that an earlier --each wrote may be replaced, since it is no input
    arguments.file = [file for file in arguments.file if file not in results]
    with refusals():
        if not arguments.file:
            raise ValueError("none of the files is a measurement; there is nothing to fit.")
        for flag in ("plot", "report", "reference", "material"):
            if getattr(arguments, flag):
                raise ValueError(
                    f"--{flag} shows a single fit, but --each makes one for every file. Use "
                    "--csv or --json with --each, or fit one file without it."
                )
        _fit_options(arguments)
        wanted = _files(arguments, False)
    each = []
    with shown("files", quiet=arguments.quiet):
        tell(total=len(arguments.file), done=0)
        for file in arguments.file:
            tell(Path(file).name, done=0)
            with listening(None):  # files are counted here, not the steps of their fits
                each.append(_fit_file(file, arguments))
            tell()
    for one in each:
        if one.error:
            complain(one.error)
    if arguments.json == "-":
        say(export.rows_json(each))
    elif not arguments.quiet:
        say(export.rows_text(each))
    tables = {"json": export.rows_json(each), "csv": export.rows_csv(each, arguments.csv_decimal)}
    with refusals(files.OutputError):
        files.write_whole({one.path: tables[one.what] for one in wanted})
    fits = [one.fit for one in each if one.fit is not None]
    return exit_status(fits) if len(fits) == len(each) else MISUSED


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command with ``argv`` (default: the process's arguments) and return its exit status.

    An error that the user can correct ends in one line on stderr that says what to do; what
    argparse answers (``--help``, a mistyped option) in SystemExit.
    """
    try:
        arguments = parser().parse_args(argv)
        given = sys.argv[1:] if argv is None else argv
        arguments.command = visible(shlex.join([PROGRAM, *given]))
        from fitting.output.files import refuse_repeats
        from fitting.process.start_up import set_up_jax

        with refusals():
            arguments.file = expanded(arguments.file)
            refuse_repeats(arguments.file)
            set_up_jax()
            options = _fit_options(arguments) if arguments.map else {}
        if arguments.map:
            return map_command.run_map(arguments, options)
        return _run_each(arguments) if arguments.each else _run(arguments)
    except KeyboardInterrupt:
        print(file=sys.stderr)
        return INTERRUPTED
    except OSError as error:
        complain(f"{error.filename or 'a result file'}: {error.strerror}")
    except Refused as error:
        complain(str(error))
    return MISUSED
