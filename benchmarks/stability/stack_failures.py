"""Where programs for stacks fail: `python -m benchmarks.stability.stack_failures`.

Every program computes R and T for s and p of the stacks of `stack_cases`, in float64; truth is
the product of characteristic matrices in mpmath, with digits to spare. Drawn is the largest error
of the four in eps; a value that is not finite, or a call that fails, is drawn at the top.
Writes a table and a picture to docs/stability; part of `make stability`.
"""

import argparse
import warnings
from pathlib import Path

import jax
import numpy as np

from benchmarks import stack_peers
from benchmarks.picture import figure
from fresnel_jax.layers import stack
from tests.truth import stack_cases, stack_oracle

FAILED = 1e20  # drawn for values that are not finite


class Ours:
    def __init__(self, exact: bool):
        self.exact = exact

    def powers(self, index, thickness_um, angles, wavelengths_um):
        out = stack(
            np.cos(angles),
            index,
            thickness_um=thickness_um,
            wavelength_um=wavelengths_um,
            exact=self.exact,
        )
        return np.array(out[:4])[:, :, None]


def errors(case, programs) -> dict[str, float]:
    """The error of each program at one stack, in eps."""
    c, index, thickness, wavelength = case
    angle = np.arccos(c)
    # What they are given is the angle: its rounding must not count as their error.
    exact = stack_oracle.stack(np.cos(angle), index, thickness, wavelength)[:4]
    found = {}
    for name, program in programs.items():
        try:
            with np.errstate(all="ignore"), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                values = program.powers(
                    np.array(index, complex),
                    np.array(thickness),
                    np.array([angle]),
                    np.array([wavelength]),
                )
            found[name] = stack_cases.error_eps(np.asarray(values)[:, 0, 0], exact)
        except Exception:  # a foreign package may fail in any way
            found[name] = np.inf
    return found


def main(argv=None) -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("docs/stability"))
    given = parser.parse_args(argv)
    jax.config.update("jax_enable_x64", True)
    peers, left_out = stack_peers.installed()
    programs = {"stack": Ours(True), "stack, exact=False": Ours(False)} | peers
    curves = {}
    for family, (_, values, case) in stack_cases.FAMILIES.items():
        rows = [errors(case(float(value)), programs) for value in values]
        curves[family] = {name: [row[name] for row in rows] for name in programs}
        worst = ", ".join(f"{name} {max(y):.2g}" for name, y in curves[family].items())
        print(f"{family}: {worst}", flush=True)
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "stacks.md").write_text(table(curves, left_out))
    draw(curves, given.out / "stacks.png")


def table(curves, left_out) -> str:
    names = list(next(iter(curves.values())))
    lines = [
        "# Stacks: where programs fail",
        "",
        "`python -m benchmarks.stability.stack_failures`: the largest error of R_s, R_p, T_s and",
        "T_p in eps (2.2e-16) of each value, an R below 1e-2 relative to its root, values below",
        "1e-30 relative to that and a T of 0 relative to 1, in float64; inf where a value is not",
        "finite or the program stops. The ranges are those of the picture. tmmax computes in",
        "float32, whose eps is 5e8 of these.",
        "",
        "| stack | " + " | ".join(names) + " |",
        "| --- |" + " --- |" * len(names),
    ]
    for family, found in curves.items():
        worst = " | ".join(f"{max(found[name]):.2g}" for name in names)
        lines.append(f"| {family} | {worst} |")
    lines += ["", *(f"Left out: {name} ({why})." for name, why in left_out.items())]
    return "\n".join(lines).rstrip() + "\n\n![](stacks.png)\n"


def draw(curves, path: Path) -> None:
    with figure(path, 15.0, 7.5) as page:
        axes = page.subplots(2, 4, sharey=True).ravel()
        for axis, (family, found) in zip(axes, curves.items(), strict=False):
            quantity, values, _ = stack_cases.FAMILIES[family]
            for i, (name, y) in enumerate(found.items()):
                # black is ours; of the palette's other colours the seventh peer is the first again
                style = (
                    {"color": "k", "lw": 3 - i, "ls": "--" if i else "-"}
                    if i < 2
                    else {"color": f"C{(i - 2) % 6}", "lw": 1.2, "ls": "-" if i < 8 else ":"}
                )
                axis.plot(values, np.clip(y, 0.3, FAILED), marker=".", label=name, **style)
            axis.axhline(64, color="0.6", lw=0.8, ls="--")
            axis.set(xscale="log", yscale="log", xlabel=quantity, title=family)
        for axis in axes[::4]:
            axis.set_ylabel("largest error of R and T, eps")
        axes[-1].set_axis_off()
        axes[-1].legend(*axes[0].get_legend_handles_labels(), loc="center")


if __name__ == "__main__":
    main()
