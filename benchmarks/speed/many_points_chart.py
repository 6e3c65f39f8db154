"""The chart of a million points and more: speed by the number of points, in every way."""

from pathlib import Path

from benchmarks.picture import figure


def draw(ways: dict[str, dict], jobs: tuple[str, ...], path: Path) -> None:
    """ways: {way: {(job, points): {"s": seconds}}}, of float64; a panel for each of ``jobs``."""
    with figure(path, 3.4 * len(jobs), 3.6) as page:
        axes = page.subplots(1, len(jobs), squeeze=False)[0]
        for axis, job in zip(axes, jobs, strict=True):
            for number, (way, times) in enumerate(ways.items()):
                rates = sorted(
                    (n, n / 1e6 / x["s"]) for (what, n), x in times.items() if what == job
                )
                if rates:
                    axis.plot(*zip(*rates, strict=True), "o-", label=way, color=f"C{number}", ms=4)
            axis.set(xscale="log", xlabel="points", title=job)
            axis.set_ylim(bottom=0.0)
        axes[0].set_ylabel("million points a second, float64")
        axes[1].legend(fontsize="small")
