"""The chart of stacks: error of R against layer-points a second, a panel for each layer count."""

from pathlib import Path


def draw(rows: dict[int, list[tuple[str, float, float | None]]], path: Path) -> None:
    """rows: {layers: [(name, 1e6 layer-points a second, error of R in eps)]}."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.2 * len(rows), 4.2), layout="constrained")
    axes = figure.subplots(1, len(rows), sharey=True, squeeze=False)[0]
    for axis, (layers, programs) in zip(axes, rows.items(), strict=True):
        for name, rate, error in programs:
            if error is None:
                continue
            ours = name.startswith("stack")
            axis.plot(rate, max(error, 0.5), "o", color="C3" if ours else "0.4")
            axis.annotate(
                name, (rate, max(error, 0.5)), (4, 5), textcoords="offset points",
                fontsize=8, fontweight="bold" if ours else "normal",
            )  # fmt: skip
        axis.set(
            xscale="log",
            yscale="log",
            xlabel="1e6 layer-points a second",
            title=f"{layers} layer" + "s" * (layers > 1),
        )
        axis.margins(0.25)
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("largest error of R, eps")
    figure.savefig(path, dpi=120)
