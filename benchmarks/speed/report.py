"""The measured figures as markdown tables."""

from benchmarks import scenes
from benchmarks.contestants import APPROXIMATE, PEER
from benchmarks.speed import turns

turns.MAIN_SIZE = 1_000_000
LATENCIES = (1, 100)


def run_of(results, dtype, platform):
    return next(
        (x for x in results["runs"] if x["dtype"] == dtype and x["platform"] == platform), None
    )


def main_platform(results):
    """The one of the tables and pictures that show one: the CPU where it was measured."""
    return min(x["platform"] for x in results["runs"])


def seconds(run, kind, name, what, size):
    """Seconds of the fastest call, or None where it was not measured."""
    return run[kind].get(name, {}).get(f"{what} {size}", {}).get("s")


def throughput(run, kind, name, size=turns.MAIN_SIZE, what="value"):
    """Points per second; a slow contestant counts with the largest size that it was given."""
    for tried in sorted((n for n in turns.SIZES if n <= size), reverse=True):
        taken = seconds(run, kind, name, what, tried)
        if taken is not None:
            return tried / taken
    return None


def ratio(run, kind, one, other, size=turns.MAIN_SIZE):
    """How often `one`'s time fits `other`'s, by the ratios within rounds where both have them."""
    (name, what), (other_name, other_what) = one, other
    cells = [
        run[kind].get(n, {}).get(f"{w} {size}", {})
        for n, w in ((name, what), (other_name, other_what))
    ]
    if all("to_reference" in x for x in cells) and what == other_what:
        return cells[1]["to_reference"] / cells[0]["to_reference"]
    if all("s" in x for x in cells):
        return cells[1]["s"] / cells[0]["s"]
    return None


def fastest_peer(results, run, kind):
    """(name, points per second) of the fastest optics package; Mitsuba is a renderer."""
    found = {
        name: throughput(run, kind, name)
        for name, family in results["families"].items()
        if family == PEER and name != "Mitsuba" and throughput(run, kind, name)
    }
    return max(found.items(), key=lambda x: x[1]) if found else (None, None)


def number(value, digits=2):
    if value is None:
        return ""
    if value == 0 or 1e-3 <= abs(value) < 1e5:
        return f"{value:.{digits}g}" if abs(value) < 100 else f"{value:.0f}"
    return f"{value:.0e}".replace("e-0", "e-").replace("e+0", "e")


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(map(str, row)) + " |" for row in rows]) + "\n"


def targets(results):
    """What was aimed at, and what this run shows."""
    rows = []
    for dtype in ("float64", "float32"):
        run = run_of(results, dtype, main_platform(results))
        ours = ("reflectance", "value")

        def add(text, wanted, value, at_least=True, dtype=dtype):
            if value is None:
                return
            met = value >= wanted if at_least else value <= wanted
            sign = ">=" if at_least else "<="
            rows.append(
                (dtype, text, f"{sign} {wanted:g}", number(value, 3), "yes" if met else "no")
            )

        add(
            "speed over FrComplex, lossy",
            6,
            ratio(run, "lossy", ours, ("pbrt-v4 FrComplex", "value")),
        )
        add(
            "speed over FrConductor, lossy",
            0.5,
            ratio(run, "lossy", ours, ("pbrt-v3 FrConductor", "value")),
        )
        add(
            "speed over FrDielectric, lossless",
            0.5,
            ratio(run, "lossless", ours, ("pbrt-v4 FrDielectric", "value")),
        )
        name, rate = fastest_peer(results, run, "lossy")
        if rate:
            own = throughput(run, "lossy", "reflectance")
            add(f"speed over the fastest optics package ({name}), lossy", 20, own / rate)
        for kind, plain in (
            ("lossless", "fewest divisions, lossless"),
            ("lossless", "reflectance, plain sums"),
            ("lossy", "reflectance, plain sums"),
        ):
            add(
                f"{plain}, {kind}: speed over jax.jit(a + b + c)",
                0.5,
                ratio(run, kind, (plain, "value"), ("jax.jit(a + b + c)", "value")),
            )
        for name in ("reflectance", "reflectance, memory kept"):
            for kind in ("lossless", "lossy"):
                for size in turns.LARGE_SIZES:
                    add(
                        f"{name}, {kind}: gradient with value over value, {size:.0e} points",
                        2,
                        ratio(run, kind, (name, "value"), (name, "gradient"), size),
                        at_least=False,
                    )
            for loss, plain in (
                ("loss", "one material value"),
                ("loss gradient", "one material gradient"),
            ):
                add(
                    f"{name}, lossy: {loss} over elementwise, 1e6 points",
                    1.5,
                    ratio(run, "lossy", (name, plain), (name, loss)),
                    at_least=False,
                )
    return table(("precision", "figure", "aim", "measured", "met"), rows)


def speeds(results, kind, platform):
    head = ["contestant"]
    for dtype in ("f64", "f32"):
        head += [f"{dtype} Mpt/s", "gradient / value", "1 pt, us", "100 pt, us", "first call, s"]
    rows = []
    for name in results["families"]:
        row, anything = [name + (" *" if name in results["one_material"] else "")], False
        for dtype in ("float64", "float32"):
            run = run_of(results, dtype, platform)
            if run is None or not run[kind].get(name):
                row += [""] * 5
                continue
            rate = throughput(run, kind, name)
            anything = anything or rate is not None
            row.append(number(rate / 1e6, 3) if rate else "")
            row.append(number(ratio(run, kind, (name, "value"), (name, "gradient"))))
            for size in LATENCIES:
                taken = seconds(run, kind, name, "value", size)
                row.append(number(taken * 1e6) if taken else "")
            row.append(number(run[kind][name].get("first call", {}).get("first_s")))
        if anything:
            rows.append(row)
    return table(head, rows)


def by_size(results, kind, dtype):
    run = run_of(results, dtype, main_platform(results))
    rows = []
    for name in results["families"]:
        rates = [
            (n / seconds(run, kind, name, "value", n) / 1e6)
            if seconds(run, kind, name, "value", n)
            else None
            for n in turns.SIZES[2:]
        ]
        if any(rates):
            rows.append((name, *(number(x, 3) for x in rates)))
    return table(("contestant", *(f"{n:.0e}" for n in turns.SIZES[2:])), rows)


def errors(results, dtype):
    run = run_of(results, dtype, main_platform(results))
    rows = []
    for name, classes in run["errors"].items():
        row = [name]
        for scene in scenes.CLASSES:
            found = classes.get(scene, {})
            if "largest_relative_eps" not in found:
                row.append("failed" if found else "")
                continue
            mark = f", {found['not_finite']} not finite" if found["not_finite"] else ""
            relative = number(found["largest_relative_eps"])
            absolute = number(found["largest_absolute"])
            if results["families"][name] == APPROXIMATE:
                row.append(absolute + mark)
            else:
                row.append(f"{relative} eps, {absolute}{mark}")
        rows.append(row)
    return table(("contestant", *scenes.CLASSES), rows)


def markdown(results) -> str:
    machine = results["machine"]
    versions = ", ".join(f"{k} {v}" for k, v in machine["versions"].items())
    parts = [
        "# Speed and accuracy, measured\n",
        "Made by `make bench` (`python -m benchmarks`); the charts beside it show the same.\n",
        f"{machine['date']}; {machine['processor']}; {machine['cores']} cores"
        f"{', ' + machine['gpu'] if 'gpu' in machine else ''}, load "
        f"{machine['load_before']:.1f} before the run; {machine['system']}; {versions}. "
        f"Median ratios of {results['rounds']} interleaved rounds, fastest calls; trust ratios "
        "rather than absolute speeds.\n",
        "## Aims\n",
        "1e6 points where nothing else is said.\n",
        targets(results),
    ]
    for platform in ("cpu", "gpu"):
        if run_of(results, "float64", platform) is None:
            continue
        for kind in ("lossless", "lossy"):
            parts += [f"## Speed on the {platform}, {kind} media, 1e6 points\n"]
            parts += [speeds(results, kind, platform)]
    parts.append(
        "A different material at every point; (*): one material and many angles. A contestant too "
        "slow for 1e6 points stands with the largest number that took under "
        f"{turns.LONGEST_CALL_S} s. The limits write into memory that is there already.\n"
    )
    for dtype in ("float64", "float32"):
        parts += [f"## Mpoint/s by number of points, lossy media, {dtype}\n"]
        parts += [by_size(results, "lossy", dtype)]
    for dtype in ("float64", "float32"):
        parts += [f"## Largest error of R, {dtype}\n"]
        parts += ["Relative to R (below eps^2: to eps^2) in eps, then absolute; approximations "]
        parts += [
            "absolute only. 240 points per class, against 100 digits.\n",
            errors(results, dtype),
        ]
    if results["left_out"]:
        reasons = (f"- {name}: {reason}" for name, reason in results["left_out"].items())
        parts += ["## Left out\n", "\n".join(reasons) + "\n"]
    return "\n".join(parts)
