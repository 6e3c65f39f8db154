"""Where each method fails: `make stability`, or `python -m benchmarks.stability`.

Every method computes R of unpolarized light, and its gradient if it is in JAX, PyTorch or Dr.Jit,
at the hard sets of the tests; truth is the textbook's quotient of amplitudes in 100 digits. Most
methods take only an index relative to vacuum, so all of them get the relative index, rounded to the
precision of the run, and the truth is that of the rounded one: nobody is charged for the division.

Counted are values off by more than 1e-3 and by more than 1e3 eps of R (of eps^2 where R is less),
NaN and infinities; of gradients the same, relative to the gradient's norm. Where the true gradient
is infinite or undefined (the critical angle itself; matched media at grazing) nothing is counted.
At exactly normal incidence on epsilon near zero or a huge k dR_s/dcos and dR_p/dcos are up to 1e7
times their sum: the average of what `powers` gives, each right to an eps, loses these digits;
`reflectance` does not.

Writes a table, a JSON file and two pictures to docs/stability/.
"""

import argparse
import contextlib
import io
import json
import time
import warnings
from dataclasses import dataclass
from pathlib import Path

import jax
import mpmath as mp
import numpy as np

from benchmarks.__main__ import machine
from benchmarks.contestants import APPROXIMATE, CONTESTANTS, OURS, PEER, PRINTED, TIER, build
from tests.truth import adversarial, oracle

DTYPES = ("float64", "float32")
FAMILIES = (OURS, TIER, PRINTED, APPROXIMATE, PEER)
KINDS = ("points", "wrong", "inexact", "nan", "inf")
WRONG = 1e-3  # a value off by more is of no use
INEXACT_EPS = 1e3  # off by more: most of the digits that the inputs determine are lost
CHUNK = 100  # some packages compute every angle with every material, and fill the memory


@dataclass(frozen=True)
class Method:
    """R, and its gradient if the method has one, on NumPy arrays (c, eta, k)."""

    name: str
    family: str
    lossless: bool
    lossy: bool
    value: object
    gradient: object  # None, or -> array (variables, points)

    def takes_part(self, k: np.ndarray) -> np.ndarray:
        return np.where(k == 0, self.lossless, self.lossy)


def method(contestant, dtype: str) -> Method:
    """A contestant of the speed benchmark as a method to be judged."""
    arguments = 3 if contestant.lossy else 2
    with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        built = build(contestant.name, dtype)

    def of_peer(function, point):
        starts = range(0, len(point[0]), CHUNK)
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            parts = [function([_piece(x, i) for x in point]) for i in starts]
        return np.concatenate(parts, -1)[..., : len(point[0])]

    def value(*point):
        point = point[:arguments]
        if contestant.family == PEER:
            return of_peer(lambda some: _call(built, some), point)
        return _call(built, point)

    gradient = None
    if built.in_jax is not None:
        of_one = jax.grad(lambda *x: _first(built.in_jax(*x)), argnums=tuple(range(arguments)))
        compiled = jax.jit(jax.vmap(of_one))

        def gradient(*point):
            return np.array([np.asarray(x) for x in compiled(*point[:arguments])])
    elif built.gradient is not None:

        def gradient(*point):
            return of_peer(lambda some: built.gradient(*some), point)

    return Method(
        contestant.name, contestant.family, contestant.lossless, contestant.lossy, value, gradient
    )


def _piece(x, start):
    """CHUNK points from `start`, the last one repeated: every call has one shape."""
    return np.pad(x[start : start + CHUNK], (0, max(0, start + CHUNK - len(x))), mode="edge")


def _first(result):
    return result[0] if isinstance(result, tuple) else result  # R, T_s, T_p


def _call(built, point):
    result = _first(built.points(*(built.to_device(x) for x in point)))
    return np.real(np.asarray(result)).reshape(-1)


def methods(dtype: str) -> tuple[list[Method], dict[str, str]]:
    """Those that are installed and can compute in `dtype`; the others' names with the reason."""
    found, left_out = [], {}
    for contestant in CONTESTANTS:
        if contestant.family not in FAMILIES or contestant.variant:
            continue
        if not contestant.installed():
            left_out[contestant.name] = f"{contestant.package} is not installed"
        elif dtype in contestant.dtypes:
            try:
                found.append(method(contestant, dtype))
            except Exception as error:  # a foreign package may fail in any way
                left_out[contestant.name] = f"{type(error).__name__}: {str(error)[:100]}"
    return found, left_out


def hard_sets(dtype: str) -> dict[str, tuple[np.ndarray, ...]]:
    """The hard sets of the tests as (cos, eta, k) with relative indices, exact in `dtype`."""
    return {
        name: (c, n / m, k / m)
        for name, (c, n, k, m) in adversarial.hard_sets(np.dtype(dtype).type).items()
    }


def truth(points) -> tuple[list, list]:
    """R, and dR/d(cos, eta, k) or None where it does not exist, of every point."""
    values, gradients = [], []
    for c, eta, k in zip(*points, strict=True):
        values.append(oracle.reflectance(c, eta, k, 1.0))
        both = oracle.reflectance_gradients(c, eta, k, 1.0)
        gradients.append(both and [(s + p) / 2 for s, p in zip(*both, strict=True)][:3])
    return values, gradients


def count(found: np.ndarray, true: list, floor: float, largest: float, eps: float) -> dict:
    """How many of `found`, of shape (components, points), fail, and how."""
    result = dict.fromkeys(KINDS, 0)
    worst = 0.0
    for column, vector in zip(found.T, true, strict=True):
        norm = None if vector is None else mp.norm(vector[: len(column)])
        if norm is None or norm > largest:
            continue
        result["points"] += 1
        if not np.isfinite(column).all():
            result["nan" if np.isnan(column).any() else "inf"] += 1
            continue
        differences = [mp.mpf(float(x)) - t for x, t in zip(column, vector, strict=False)]
        error = float(mp.norm(differences) / max(norm, floor))
        worst = max(worst, error)
        result["wrong"] += error > WRONG
        result["inexact"] += error > INEXACT_EPS * eps
    return result | {"largest_eps": worst / eps}


def judge(method: Method, dtype: str, sets: dict, truths: dict) -> dict:
    """{set: {"value": counts, "gradient": counts}}."""
    eps, largest = float(np.finfo(dtype).eps), float(np.finfo(dtype).max)
    result = {}
    for name, points in sets.items():
        chosen = method.takes_part(points[2])
        if not chosen.any():
            continue
        values, gradients = truths[name]
        all_values = method.value(*points)[None, chosen]
        true = [[v] for v, yes in zip(values, chosen, strict=True) if yes]
        result[name] = {"value": count(all_values, true, eps**2, largest, eps)}
        if method.gradient is not None:
            slopes = method.gradient(*points)[:, chosen]
            true = [g for g, yes in zip(gradients, chosen, strict=True) if yes]
            result[name]["gradient"] = count(slopes, true, eps**2, largest, eps)
    return result


def share(counts: dict, kinds=("wrong", "nan", "inf")) -> float:
    return sum(counts[x] for x in kinds) / max(counts["points"], 1)


def total(sets: dict, what: str) -> dict | None:
    """The counts of all sets together."""
    cells = [x[what] for x in sets.values() if what in x]
    if not cells:
        return None
    return {kind: sum(x[kind] for x in cells) for kind in KINDS} | {
        "largest_eps": max(x["largest_eps"] for x in cells)
    }


def _row(*cells):
    return "| " + " | ".join(map(str, cells)) + " |"


def _percent(counts):
    if counts is None:
        return ""
    failed = sum(counts[x] for x in ("wrong", "nan", "inf"))
    mark = " N" if counts["nan"] else ""
    return "." if failed == 0 else f"{max(1, round(100 * share(counts)))}{mark}"


def markdown(results: dict) -> str:
    facts = results["machine"]
    versions = ", ".join(f"{k} {v}" for k, v in facts["versions"].items())
    lines = [
        "# Where methods fail\n",
        "Made by `make stability` (`python -m benchmarks.stability`). "
        f"{facts['date']}; {facts['processor']}; {facts['system']}; {versions}.\n",
        *(text.strip() + "\n" for text in __doc__.split("\n\n")[1:]),
        "![Error of R over angle and index](stability_value.png)\n",
        "![Error of its gradient over angle and index](stability_gradient.png)\n",
    ]
    for dtype, run in results["runs"].items():
        lines += [f"## All sets together, {dtype}\n"]
        head = ["method", "of R: points", "> 1e-3", "> 1e3 eps", "NaN", "inf", "largest, eps"]
        lines += [_row(*head, *(x.replace("of R", "of gradient") for x in head[1:]))]
        lines += [_row(*["---"] * (2 * len(head) - 1))]
        for name, sets in run.items():
            cells = [name]
            for what in ("value", "gradient"):
                counts = total(sets, what)
                cells += [""] * 6 if counts is None else [counts[x] for x in KINDS]
                cells += [] if counts is None else [f"{counts['largest_eps']:.2g}"]
            lines += [_row(*cells)]
        for what in ("value", "gradient"):
            lines += [f"\n## Failures by set, {what}, {dtype}\n"]
            lines += ["Percent of points off by more than 1e-3 or not finite; N: some are NaN.\n"]
            named = [x for x in run if any(what in s for s in run[x].values())]
            lines += [_row("set", *named), _row(*["---"] * (len(named) + 1))]
            for name in results["sets"]:
                cells = (_percent(run[x].get(name, {}).get(what)) for x in named)
                lines += [_row(name, *cells)]
        lines.append("")
    reasons = [f"- {name}: {reason}" for name, reason in results["left_out"].items()]
    lines += ["## Left out\n", *reasons] if reasons else []
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(prog="benchmarks.stability", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("docs/stability"))
    parser.add_argument("--no-picture", action="store_true")
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    started = time.perf_counter()
    results = {"machine": machine(), "sets": [], "left_out": {}, "runs": {}}
    options.out.mkdir(parents=True, exist_ok=True)
    for dtype in DTYPES:
        sets = hard_sets(dtype)
        truths = {name: truth(points) for name, points in sets.items()}
        results["sets"] = list(sets)
        present, left_out = methods(dtype)
        results["left_out"] |= left_out
        results["runs"][dtype] = {x.name: judge(x, dtype, sets, truths) for x in present}
        print(f"{dtype}: {len(present)} methods, {time.perf_counter() - started:.0f} s", flush=True)
        if dtype == "float32" and not options.no_picture:
            from benchmarks.stability.map import draw

            draw(present, dtype, options.out)
    (options.out / "stability.json").write_text(json.dumps(results, indent=1) + "\n")
    (options.out / "stability.md").write_text(markdown(results))
    for name, reason in results["left_out"].items():
        print(f"left out: {name}: {reason}")
    print(f"wrote {options.out}/stability.md, .json and pictures")


if __name__ == "__main__":
    main()
