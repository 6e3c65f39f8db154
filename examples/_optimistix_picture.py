"""The picture of `fit_with_optimistix`: the scan and its fits, and how often fits fail."""

import numpy as np
from _picture import BLUE, GREEN, GREY, ORANGE, figure


def _scan(axes, data, lines) -> None:
    """The measured gold scan; whole lines: eta and k; broken: scale and angle offset as well."""
    for share, color, name in ((1.0, BLUE, "$R_s$"), (0.0, ORANGE, "$R_p$")):
        mine = data.share_s == share
        axes.plot(data.angle_deg[mine], data.value[mine], "o", color=color, markersize=4)
        angle = np.linspace(0.0, 90.0, len(lines[share][0]))
        axes.plot(angle, lines[share][0], color=color, label=name)
        axes.plot(angle, lines[share][1], "--", color=color)
    axes.plot([], [], "--", color=GREY, label="with scale and offset")
    axes.set(xlabel="angle of incidence (degrees)", ylabel="R", xlim=(0, 90), ylim=(0.6, 1.01))
    axes.set_title("gold at 532 nm, measured")
    axes.legend(loc="upper left")


def _failures(axes, kind, counts) -> None:
    """One bar for each set of unknowns and start: how often the fit misses the best one."""
    mine = [x for x in counts if x.kind == kind]
    names = list(dict.fromkeys(x.unknowns for x in mine))[::-1]
    starts = {"1.5 + 0 i": ORANGE, "1.5 + 0.5 i": BLUE, "mesh": GREEN, "ten of the mesh": GREY}
    for i, (start, color) in enumerate(starts.items()):
        for x in mine:
            if x.start != start:
                continue
            place, width = names.index(x.unknowns) + 0.2 * (1.5 - i), 100.0 * x.missed
            axes.barh(place, width, 0.18, color=color)
            axes.text(width + 1.5, place, f"{width:.1f}", va="center", fontsize=8)
        axes.barh([np.nan], [np.nan], color=color, label=start)
    axes.set_yticks(range(len(names)), names)
    axes.set(xlim=(0, 112), xlabel="fits that miss the best one (%)")
    axes.set_title(f"simulated, {kind}")
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="y", length=0)


def draw(path, data, lines, counts) -> None:
    """Three panels: the scan, and the failures where both polarizations or R_p alone are known."""
    with figure(path, 14.5, 5.0) as fig:
        scan, both, p_alone = fig.subplots(1, 3, width_ratios=(1.15, 1.0, 1.0))
        _scan(scan, data, lines)
        _failures(both, "R_s and R_p", counts)
        _failures(p_alone, "R_p", counts)
        p_alone.set_yticklabels([])
        both.legend(title="start", loc="lower right")
