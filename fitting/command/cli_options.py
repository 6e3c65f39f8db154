"""The options of ``fresnel-fit``, their help, and the arguments of `fit` that they stand for."""

from __future__ import annotations

import argparse
import difflib
import glob
import os
import re
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

import fitting
from fitting.process.visible import visible

PROGRAM = "fresnel-fit"

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
tauc-lorentz, with the number of its terms: drude-lorentz:2.

examples:
  fresnel-fit gold.csv --plot gold.png --json gold.json
  fresnel-fit ellipsometer.txt --reference Si --report out
  fresnel-fit gold.csv --free scale --prior scale=1+-0.02
  fresnel-fit glass.csv --sample 'air | cauchy-urbach 3.05 mm thick | air'
  fresnel-fit film.csv --divide-by wafer.csv --ratio-to Si --sample auto
  fresnel-fit --each 'scans/*.csv' --csv results.csv

where gold.csv has angles in degrees and reflectances as fractions or percent:
  angle_deg,R_s,sigma_R_s,R_p,sigma_R_p
  30,0.76,0.002,0.67,0.002
  45,0.79,0.002,0.66,0.002
A value that begins with a minus sign needs the equals sign: --missing=-9999.

exit status:
  0    every curve was fitted
  1    for one curve or more there is no index: the fit did not converge, or
       the data determine only a combination of eta and k (the table and the
       field "status" of the JSON say which)
  2    the command, a file or a value in it cannot be understood, or a result
       cannot be written; with --each the other files were fitted
  70   a defect of the program: please report it, with what it printed
  71   not enough memory
  130  interrupted

Compiled programs are kept in $XDG_CACHE_HOME/fresnel-fit or
~/.cache/fresnel-fit, which may be deleted at any time.
"""

_READING = (
    ("columns", "ROLE=COLUMN,..", "columns by header or number: angle=1,R_s=2,sigma_R_s=3"),
    ("angle-deg", "DEGREES", "angle of incidence of a file that has no column for it"),
    ("angle-unit", "UNIT", "deg, rad, mrad, deg.arcmin, grazing-deg, 1/angstrom, ..."),
    ("wavelength-um", "UM", "wavelength of a file that has no column for it, micrometres"),
    ("wavelength-unit", "UNIT", "nm, um, angstrom, eV, cm-1, THz, ..."),
    ("polarization", "LIGHT", "s, p or unpolarized; or what the codes in a column mean: 0=s,1=p"),
    ("scale", "FACTOR", "factor that makes R a fraction: 0.01 for percent"),
    ("divide-by", "FILE", "divide the values by this scan of a reference, read in the same way"),
    (
        "ratio-to",
        "SAMPLE",
        "the values are ratios to R of this known sample: Si, or 'air | SiO2 2 nm held | Si'",
    ),
    ("sigma", "SIGMA", "standard error of values that have none, as a fraction (0.002)"),
    ("psi-unit", "UNIT", "unit of psi and Delta: deg or rad"),
    ("missing", "VALUES", "numbers or words that mark missing values: 0 or -9999,bad"),
    ("keep", "COLUMN=VALUES", "rows to read, by the value of a column: Zone=1,2 or Zone=1-4"),
    ("ignore", "COLUMN,..", "columns that shall not be read: temperature,7"),
    ("lines", "FROM-TO", "lines to read: 10-200, 10- or -200"),
    ("delimiter", "NAME", "between columns: tab, semicolon, comma, pipe, blank, or the sign"),
    ("decimal", "SIGN", "decimal mark, . or ,"),
    ("encoding", "NAME", "text encoding: utf-8, latin-1, utf-16, ..."),
)


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from fitting.command.terminal import say

        say(f"{PROGRAM} {fitting.__version__}\n")
        parser.exit()


class _Materials(argparse.Action):
    def __call__(
        self, parser: argparse.ArgumentParser, _: object, words: object, *__: object
    ) -> NoReturn:
        from fitting.command.terminal import say
        from fitting.output.material_list import material_list

        try:
            say(material_list(str(words or "")) + "\n")
        except ValueError as error:
            parser.error(str(error))
        parser.exit()


# Name, metavar, help, and what else argparse is to know of each option.
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
)  # fmt: skip
_MANY = {"action": "append", "default": []}
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
     "data with outliers a sum in which large residuals weigh less (huber, student)",
     {"choices": ("squares", "huber", "student"), "default": "squares"}),
    ("errors", None, "how the standard errors that a file states are used. stated: as they are; "
     "scaled: times sqrt(chi2/dof); floor: with one common error added in squares; relative: with "
     "an error in proportion to each R or T added in squares; equal: not at all, all data have "
     "equal weights; auto (the default): scaled, or floor or relative where they are far too small "
     "and such an error describes the residuals better",
     {"choices": ("auto", "stated", "scaled", "floor", "relative", "equal"), "default": "auto"}),
    ("intervals", None, "95 %% intervals from the standard errors (quadratic), from the profile "
     "likelihood (profile), or by profile likelihood where the quadratic approximation fails "
     "(auto)", {"choices": ("auto", "quadratic", "profile"), "default": "auto"}),
    ("starts", "N", "number of starting points from which the best fit is searched for (default 64 "
     "or more, by the number of parameters; not used for one bare surface)", {"type": int}),
)  # fmt: skip


def _add(group: Any, options: Sequence[Any]) -> None:
    for name, metavar, text, *more in options:
        group.add_argument(f"--{name}", metavar=metavar, help=text, **(more[0] if more else {}))


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
        from fitting.command.terminal import say

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
        help="text file with the measurement (CSV or similar), - for standard input, or a quoted "
        "pattern such as '*.csv'; several files are fitted together, as measurements of one "
        "sample",
    )  # fmt: skip
    out.add_argument(
        "--each", action="store_true",
        help="fit every file by itself, and show a row of results for each, which --csv and --json "
        "write as a table; a file that is refused is reported, and the others are fitted",
    )  # fmt: skip
    out.add_argument(
        "--materials", action=_Materials, nargs="?", metavar="ri:WORDS",
        help="print names, wavelengths and sources of the materials that --sample knows, and exit; "
        "with ri:gold the entries of refractiveindex.info that have gold in name or title",
    )  # fmt: skip
    out.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    results = out.add_argument_group("results", "Files are written whole or not at all.")
    _add(results, _RESULTS)
    results.add_argument(
        "--overwrite", action="store_true",
        help="let --report use a folder that holds other files, and let results replace files that "
        "were not written by a fit; a file that this fit reads is never replaced",
    )  # fmt: skip
    results.add_argument("--quiet", action="store_true", help="print no table and no progress")
    fitting_group = out.add_argument_group(
        "fitting",
        "NAME is a parameter of the sample, as the table of a fit lists them (A,\n"
        "film.thickness_nm), or of the instrument: scale and background (of every\n"
        "curve; scale[R_s]: of R_s only), angle-offset (degrees), leak (share of the\n"
        "other polarization behind a polarizer), divergence of the beam (standard\n"
        "deviation, degrees), bandwidth of the slit (full width at half maximum, nm).",
    )
    _add(fitting_group, _FITTING)
    reading = out.add_argument_group(
        "reading",
        'Columns, units and layout are found out from the file; the line "read" of the\n'
        "table states them. Each of these options overrules what was found.",
    )
    _add(reading, _READING)
    return out


def expanded(files: Sequence[str]) -> list[str]:
    """Return the files with the wildcards * ? [ ] expanded, where the shell has not done it.

    Raises ValueError for a pattern that no file matches.
    """
    out = []
    for name in files:
        found = [name]
        if glob.has_magic(name) and not os.path.exists(name):
            found = sorted(f for f in glob.glob(name, recursive=True) if os.path.isfile(f))
        if not found:
            raise ValueError(f"{name}: no file matches this pattern.")
        out += found
    return out


def reading_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the keyword arguments of `read_csv`."""
    names = [name.replace("-", "_") for name, *_ in _READING]
    return {name: getattr(arguments, name) for name in names}


def fit_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the keyword arguments of `fit`, or raise ValueError for a text of its own."""
    from fitting.samples.parameters import parse_setting

    settings: dict[str, dict[str, Any]] = {"fixed": {}, "bounds": {}, "priors": {}}
    wanted = {
        "--fix": ("fixed", "NAME=VALUE", "k=0"),
        "--bound": ("bounds", "NAME=LOW..HIGH", "eta=1.4..1.6"),
        "--prior": ("priors", "NAME=VALUE+-SIGMA", "scale=1+-0.02"),
    }
    for flag, (kind, form, example) in wanted.items():
        for text in getattr(arguments, flag[2:]):
            try:
                name, found, value = parse_setting(text)
            except ValueError:
                name, found, value = "", "", None
            if found != kind:
                other = next((f"; {f} takes this" for f, w in wanted.items() if w[0] == found), "")
                raise ValueError(f"{flag} {text}: {form} was wanted, for example {example}{other}.")
            settings[kind][name] = value
    tie = {}
    for text in arguments.tie:
        name, equal, other = (part.strip() for part in text.partition("="))
        if not (name and equal and other):
            raise ValueError(f"--tie {text}: NAME=OTHER was wanted, for example film_2.A=film_1.A.")
        tie[name] = other
    free = [name for text in arguments.free for name in text.split(",") if name.strip()]
    return {
        **settings, "tie": tie, "free": free, "loss": arguments.loss, "errors": arguments.errors,
        "starts": arguments.starts, "intervals": arguments.intervals,
    }  # fmt: skip
