"""The options of ``fresnel-fit`` for a dispersion model, a slab and their parameters."""

from __future__ import annotations

import argparse
import re
from typing import Any

_MODELS = "constant, cauchy, cauchy-urbach, sellmeier, drude, drude-lorentz, lorentz, tauc-lorentz"
_LENGTHS_UM = {"mm": 1e3, "um": 1.0, "nm": 1e-3, "cm": 1e4}


def _thickness_um(text: str) -> float:
    found = re.fullmatch(r"\s*([0-9.eE+-]+)\s*(mm|um|nm|cm)?\s*", text)
    try:
        value = float(found[1]) if found else float("nan")
    except ValueError:
        value = float("nan")
    if not found or not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(
            f"{text!r} is no thickness; millimetres (3.05) or a number with its unit (500um) was "
            "wanted."
        )
    return value * _LENGTHS_UM[found[2] or "mm"]


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the group of options for a model over whole curves."""
    group = parser.add_argument_group(
        "a model over whole curves",
        "Without --model each wavelength is fitted by itself. NAME is a parameter of\n"
        "the model, thickness_um, or a nuisance: scale, background (of every curve;\n"
        "scale[R_s] is one of them), angle-offset, leak, divergence.",
    )
    group.add_argument(
        "--model",
        metavar="NAME[:TERMS]",
        help=f"{_MODELS}; with terms: drude-lorentz:2; or auto: the simplest that the data ask for",
    )
    group.add_argument(
        "--slab", metavar="MM", type=_thickness_um,
        help="a thick slab with both faces, of so many millimetres (or 500um), instead of one "
        "interface",
    )  # fmt: skip
    group.add_argument(
        "--free", metavar="NAME,..", action="append", default=[], help="what is held otherwise"
    )
    for flag, metavar, text in (
        ("--fix", "NAME=VALUE", "hold a parameter"),
        ("--bound", "NAME=LOW..HIGH", "keep a parameter between, either end may be left out"),
        ("--prior", "NAME=VALUE+-SIGMA", "a parameter known beforehand, with its standard error"),
    ):
        group.add_argument(flag, metavar=metavar, action="append", default=[], help=text)
    group.add_argument(
        "--loss", choices=("squares", "huber", "student"), default="squares",
        help="huber or student for data with outliers (default squares)",
    )  # fmt: skip
    group.add_argument("--starts", metavar="N", type=int, help="number of starts (default 64 up)")


def of_a_model(arguments: argparse.Namespace) -> str:
    """Return the first option that makes sense with a model only and was given; "" for none."""
    given = {
        "--free": arguments.free, "--fix": arguments.fix, "--bound": arguments.bound,
        "--prior": arguments.prior, "--loss": arguments.loss != "squares",
        "--starts": arguments.starts is not None,
    }  # fmt: skip
    return next((flag for flag, value in given.items() if value), "")


def fit_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the keyword arguments of `fit_model`, or raise ValueError for a text of its own."""
    from fitting.parameters import parse_setting

    settings: dict[str, dict[str, Any]] = {"fixed": {}, "bounds": {}, "priors": {}}
    wanted = {"--fix": "fixed", "--bound": "bounds", "--prior": "priors"}
    for flag, kind in wanted.items():
        for text in getattr(arguments, flag[2:]):
            name, found, value = parse_setting(text)
            if found != kind:
                other = next(f for f, k in wanted.items() if k == found)
                raise ValueError(f"{flag} {text}: this is what {other} takes.")
            settings[kind][name] = value
    free = [name for text in arguments.free for name in text.split(",") if name.strip()]
    return {
        **settings,
        "free": free,
        "structure": "slab" if arguments.slab else "interface",
        "thickness_um": arguments.slab,
        "loss": arguments.loss,
        "eta_i": arguments.eta_i,
        "sigma": "equal" if arguments.equal_weights else "given",
        "absolute_sigma": arguments.absolute_sigma,
        "starts": arguments.starts,
        "intervals": arguments.intervals,
    }
