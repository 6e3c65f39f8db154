"""The command `python -m examples.advisor`."""

import argparse
import importlib.util
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from . import FORMS, Advice, Scene, advise, measured

_ROOT = Path(__file__).resolve().parents[2]
_STYLE = _ROOT / "fitting" / "output" / "fresnel_fit.mplstyle"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        "python -m examples.advisor", description="Which simplifications are safe in this scene?"
    )
    parser.add_argument(
        "material",
        nargs="+",
        help="name (gold, 'window glass', ...), ETA, ETA,K, or FILE.csv with wavelength_um,eta,k",
    )
    pair = {"nargs": 2, "type": float, "metavar": ("LOW", "HIGH")}
    parser.add_argument("--wavelength-um", default=(0.38, 0.78), **pair, help="default 0.38 0.78")
    parser.add_argument("--angle-deg", default=(0.0, 90.0), **pair, help="default 0 90")
    parser.add_argument("--accuracy", type=float, default=0.01, help="of R; default 0.01")
    parser.add_argument("--eta-i", default="1", help="where light comes from, as material; 1")
    parser.add_argument("--samples", type=int, default=31, help="wavelengths of the full spectrum")
    parser.add_argument("--measure", action="store_true", help="time the costs on this machine")
    parser.add_argument("--plot", metavar="OUT", help="picture of the errors: .png, .pdf or .svg")
    return parser


def _from_text(text: str):
    """NAME, ETA, ETA,K, or the name of a CSV file with columns wavelength_um, eta, k."""
    if text.endswith(".csv"):
        rows = np.genfromtxt(text, delimiter=",", comments="#")
        return tuple(rows[np.isfinite(rows).all(axis=1)].T)
    try:
        eta, k = (float(x) for x in (text + ",0").split(",")[:2])
    except ValueError:
        return text
    return eta, k


def _save_plot(advice: Advice, path: str):
    from matplotlib import style
    from matplotlib.figure import Figure

    labels = list(advice.findings)[::-1]
    with style.context(_STYLE, after_reset=True):
        figure = Figure(figsize=(8.0, 0.8 + 0.33 * len(labels)), layout="constrained")
        axis = figure.subplots()
        smallest = 1e-8
        for light, marker in (("polarized", "o"), ("unpolarized", "D")):
            errors = [getattr(advice.findings[x], light).error for x in labels]
            label = "unpolarized R" if light == "unpolarized" else "R_s and R_p"
            axis.plot(np.maximum(errors, smallest), labels, marker, label=label)
        axis.axvline(advice.scene.accuracy, color="black", linestyle="--", label="accuracy wanted")
        axis.set_xscale("log")
        axis.set_xlim(smallest / 2.0, 2.0)
        axis.set_xlabel("largest error of R (less than 1e-8 at the left edge)")
        axis.set_title(advice.table().splitlines()[0], fontsize="small")
        axis.grid(axis="y", visible=False)
        figure.legend(loc="outside lower center", ncols=3)
        figure.savefig(path)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0, or 2 where the user has something to mend."""
    given = _parser().parse_args(arguments)
    try:
        if given.plot and importlib.util.find_spec("matplotlib") is None:
            raise ValueError("--plot needs matplotlib: pip install matplotlib")
        scene = Scene(
            {text: _from_text(text) for text in given.material},
            tuple(given.wavelength_um), tuple(given.angle_deg), given.accuracy,
            _from_text(given.eta_i), given.samples,
        )  # fmt: skip
        forms = FORMS
        if given.measure:
            forms = measured()
            print(f"{'measured cost':28}{'float64':>8}{'float32':>8}")
            for name, form in forms.items():
                print(f"{name:28}{form.costs['float64']:8.2f}{form.costs['float32']:8.2f}")
            print()
        advice = advise(scene, forms)
        print(advice.table())
        if given.plot:
            _save_plot(advice, given.plot)
    except (ValueError, OSError) as error:
        print(f"examples.advisor: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
