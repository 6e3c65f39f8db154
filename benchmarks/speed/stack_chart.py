"""The chart of stacks: error of R against layer-points a second, a panel for each layer count."""

from pathlib import Path

from benchmarks.picture import figure

HIGHEST = 1e4  # a larger error is drawn here


def draw(rows: dict[int, list[tuple[str, float, float | None]]], path: Path) -> None:
    """rows: {layers: [(name, 1e6 layer-points a second, error of R in eps)]}."""
    from matplotlib import colormaps

    names = list(dict.fromkeys(name for found in rows.values() for name, _, e in found if e))
    with figure(path, 3.4 * len(rows), 4.4) as page:
        axes = page.subplots(1, len(rows), sharey=True, squeeze=False)[0]
        for axis, (layers, programs) in zip(axes, rows.items(), strict=True):
            for name, rate, error in programs:
                if error is None:
                    continue
                i, ours = names.index(name), name.startswith("stack")
                colour = "C0" if name == "stack" else "C5" if ours else colormaps["Set2"](i % 8)
                axis.plot(
                    rate, min(max(error, 0.5), HIGHEST), "*" if ours else "osD^vPX<>"[i % 9],
                    label=name, color=colour, markersize=15 if ours else 8, markeredgecolor="0.2",
                    clip_on=False,
                )  # fmt: skip
            axis.set(
                xscale="log", yscale="log", ylim=(0.5, HIGHEST),
                xlabel="1e6 layer-points a second", title=f"{layers} layer" + "s" * (layers > 1),
            )  # fmt: skip
            axis.margins(0.1)
        axes[0].set_ylabel("largest error of R, eps; top: 1e4 and more")
        page.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
