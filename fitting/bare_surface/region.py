"""The ends of the region in which eta and k fit nearly as well as the best: profile likelihood.

The profile likelihood interval of eta is every eta for which some k fits nearly as well as the
best,

    min over k of chi2(eta, k)  <=  chi2_best + rise,

that is the shadow of the region chi2 <= chi2_best + rise on the axis of eta; that of k is its
shadow on the other axis, with k >= 0.

The region is followed in the coordinates of the fit (`coordinates`): first its two ends in w, then,
on lines of constant phi (`valley`) from one end to the other, its two ends in x, each by Newton
steps on the sums that the solver's own program returns (no further program is compiled). Extremes
between the lines come from parabolas; with 8 steps from end to end they are within 1e-3 of the
interval's width of the true ones.

D. J. Venzon and S. H. Moolgavkar, Applied Statistics 37, 87 (1988), doi:10.2307/2347496.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting.bare_surface.coordinates import W_MIN, X_MAX, X_MIN, index_derivatives, xi_of
from fitting.bare_surface.curve_data import Data
from fitting.bare_surface.descent import Solved
from fitting.bare_surface.valley import Lanes, evaluate, from_nearer_end, on_line, share_of

LINES = 8
# Newton steps: 4 are the rule for the ends (a bend of the valley takes more), 1 for x at each of
# them, 4 for the lines.
END_STEPS, FLOOR_STEPS, LINE_STEPS = 40, 6, 5
# A fall of chi2 by this part of q moves an end by 5e-4 of the interval's half width.
CLOSE = 1e-3
# Where chi2 is higher than the best by this many q, the quadratic model says nothing of the end.
FAR = 25.0
TIGHT = 1e-5
# An end of the chart is met within this part of it, which moves an end of eta by 1e-3 at most.
AT_EDGE = 0.01


class Region(NamedTuple):
    """Ends of the region of N curves: eta, k (N, 2); NaN where it could not be followed."""

    eta: np.ndarray
    k: np.ndarray


class _Floor(NamedTuple):
    """The floor of the valley at one w: x, height above the best, dx/dw, slope of the height.

    found: whether x came to rest (where total reflection begins the floor breaks off).
    """

    x: np.ndarray
    height: np.ndarray
    turn: np.ndarray
    slope: np.ndarray
    found: np.ndarray


def _floor(data: Data, s: Solved, rise: np.ndarray, lanes: Lanes) -> _Floor:
    """Return the floor at these w, by Newton steps in x (at most halved or doubled each time)."""
    out = np.full((4, len(lanes.x)), np.nan)
    found, todo, x = np.zeros(len(lanes.x), bool), np.arange(len(lanes.x)), lanes.x.copy()
    for _ in range(FLOOR_STEPS):
        now = evaluate(data, lanes._replace(x=x).at(todo))
        drop, turn = now.g_x**2 / now.h_xx, -now.h_xw / now.h_xx
        height = now.cost - drop - s.cost[lanes.curve[todo]]
        here = np.clip(x[todo] - now.g_x / now.h_xx, 0.5 * x[todo], 2.0 * x[todo])
        x[todo] = np.clip(here, X_MIN, X_MAX)
        out[:, todo] = x[todo], height, turn, now.g_w + turn * now.g_x
        rest = drop <= CLOSE * np.maximum(rise[lanes.curve[todo]], 0.01 * height)
        found[todo] = rest
        todo = todo[~rest & np.isfinite(now.cost)]
        if not len(todo):
            break
    return _Floor(out[0], out[1], out[2], out[3], found)


def _end(
    data: Data, s: Solved, rise: np.ndarray, sign: float, first: np.ndarray | None = None
) -> tuple[np.ndarray, ...]:
    """Return w and x of the region's end in w, and whether the edge of what is possible cuts it.

    first: where to look first, NaN where nothing is known.

    Newton's method for the height of the floor, in its square root, which is linear for a quadratic
    cost. Too far outside, where that model says nothing, the bracket is halved. sign: +1 for the
    upper end, -1 for the lower.
    """
    schur = np.maximum(s.h_ww - s.h_xw**2 / s.h_xx, 1e-300)
    outward = np.maximum(sign * s.g_w, 0.0)  # on an edge the floor rises from its first step on
    new = s.w + sign * rise / (outward + np.sqrt(outward**2 + schur * rise))
    if first is not None:
        new = np.where(first > s.w, first, new)
    inside, outside = s.w.copy(), np.full_like(s.w, np.nan)
    # The last place near the region, and the direction of the floor there.
    base_x, base_w, base_turn = s.x.copy(), s.w.copy(), -s.h_xw / s.h_xx
    found_w, found_x = np.full_like(s.w, np.nan), np.full_like(s.w, np.nan)
    cut, todo = np.zeros(len(s.w), bool), np.arange(len(s.w))
    for _ in range(END_STEPS):
        high, x = rise[todo], base_x[todo]
        limit = 4.0 * xi_of(x) if sign > 0 else np.full(len(todo), W_MIN)
        beyond = sign * (new - limit) >= 0.0
        new = np.where(beyond, limit, new)
        guess = x + base_turn[todo] * (new - base_w[todo])
        guess = np.clip(np.clip(guess, 0.5 * x, 2.0 * x), X_MIN, X_MAX)
        floor = _floor(data, s, rise, Lanes(todo, guess, new, s.chart[todo]))
        near = floor.found & (floor.height <= FAR * high)
        low = near & (floor.height < high)
        for old, value in ((base_x, floor.x), (base_w, new), (base_turn, floor.turn)):
            old[todo] = np.where(near, value, old[todo])
        inside[todo] = np.where(low, new, inside[todo])
        outside[todo] = np.where(low, outside[todo], new)
        met = near & (np.abs(floor.height - high) <= CLOSE * high)
        tight = np.abs(outside[todo] - inside[todo]) <= TIGHT * np.abs(outside[todo])
        # The upper end of the chart moves with x: that of the last x need not be that of this one.
        edge = 4.0 * xi_of(base_x[todo]) if sign > 0 else limit
        over = low & ((new >= edge * (1.0 - AT_EDGE)) if sign > 0 else beyond)
        cut[todo] = over & ~met
        done = met | tight | over
        new = np.where(over, edge, np.where(tight & ~met, inside[todo], new))
        found_w[todo], found_x[todo] = np.where(done, (new, base_x[todo]), np.nan)
        root, far = np.sqrt(np.maximum(floor.height, 0.0)), 3.0 * np.abs(new - s.w[todo])
        step = (np.sqrt(high) - root) * root / floor.slope
        # Where the floor does not rise (rounding; a valley that bends down): further out.
        step = np.where(sign * floor.slope > 0.0, np.clip(step, -far, far), sign * far)
        ahead, between = new + step, 0.5 * (inside[todo] + outside[todo])
        astray = (sign * (ahead - inside[todo]) <= 0.0) | (sign * (outside[todo] - ahead) <= 0.0)
        new = np.where((astray | ~near) & np.isfinite(between), between, ahead)
        todo, new = todo[~done], new[~done]
        if not len(todo):
            break
    return found_w, found_x, cut


def _sides(
    data: Data, s: Solved, rise: np.ndarray, lanes: Lanes, share: np.ndarray, side: float
) -> Lanes:
    """Return the places where the cost on each line reaches its height, on the ``side`` (-1 or 1).

    share: sin(phi / 2)^2 of each line.
    """
    x, todo = lanes.x.copy(), np.arange(len(lanes.x))
    w, _ = on_line(x, share, lanes.chart)
    for _ in range(LINE_STEPS):
        here = lanes._replace(x=x, w=w).at(todo)
        now = evaluate(data, here)
        _, turn = on_line(now.x, share[todo], here.chart)
        g = now.g_x + turn * now.g_w
        h = now.h_xx + turn * (2.0 * now.h_xw + turn * now.h_ww)
        goal, high = (s.cost + rise)[here.curve], rise[here.curve]
        room = np.maximum(goal - (now.cost - g * g / h), 0.0)
        aim = np.clip(now.x - g / h + side * np.sqrt(room / h), X_MIN, X_MAX)
        x[todo], w[todo] = aim, on_line(aim, share[todo], here.chart)[0]
        todo = todo[~(np.abs(now.cost - goal) <= CLOSE * high) & np.isfinite(aim)]
        if not len(todo):
            break
    return lanes._replace(x=x, w=w)


def _parts(cut_low: np.ndarray, cut_high: np.ndarray, lines: int) -> np.ndarray:
    """Return where the lines lie between the ends, (N, lines + 1), dense at ends that are round."""
    t = np.arange(lines + 1) / lines
    kinds = np.stack([
        0.5 * (1.0 - np.cos(np.pi * t)), np.sin(0.5 * np.pi * t),
        1.0 - np.cos(0.5 * np.pi * t), t,
    ])  # fmt: skip
    return kinds[cut_low + 2 * cut_high.astype(int)]


def _extremes(low: np.ndarray, high: np.ndarray, cut_low: np.ndarray, cut_high: np.ndarray):
    """Return least and largest value along the contour; ``low``, ``high``: its sides (N, J + 1)."""
    found = []
    for side, other in ((low, high), (high, low)):
        before = np.where(cut_low, np.nan, other[:, 1])[:, None]
        after = np.where(cut_high, np.nan, other[:, -2])[:, None]
        wide = np.concatenate([before, side, after], axis=1)
        left, here, right = wide[:, :-2], wide[:, 1:-1], wide[:, 2:]
        bend = left - 2.0 * here + right
        peak = here - 0.125 * (right - left) ** 2 / bend
        near = np.abs(right - left) <= 2.0 * np.abs(bend)  # the peak of the parabola is here
        found += [here, np.where(near & np.isfinite(peak), peak, here)]
    every = np.concatenate(found, axis=1)  # NaN, where a line was lost, stays NaN
    return np.stack([every.min(axis=1), every.max(axis=1)], axis=-1)


def profile(
    data: Data, s: Solved, rise: np.ndarray, first: np.ndarray, lines: int = LINES
) -> Region:
    """Return the ends of {cost <= best + rise} in eta and k, around the minima ``s``.

    rise: (N,) above 0. first: (N,), w at the upper end as it is guessed, NaN where it is not: in
    total reflection at k = 0 the slope there, infinite in w, does not tell. lines: steps from end
    to end.
    Only the part of the region that holds the minimum: a second solution has an interval of its
    own.
    """
    with np.errstate(all="ignore"):
        s = from_nearer_end(s)
        w_high, x_high, cut_high = _end(data, s, rise, 1.0, first)
        w_low, x_low, cut_low = _end(data, s, rise, -1.0)
        count = len(s.x)
        part = _parts(cut_low, cut_high, lines)
        phi_low, phi, phi_high = (
            2.0 * np.arcsin(np.sqrt(share_of(x, w, s.chart)))[:, None]
            for x, w in ((x_low, w_low), (s.x, s.w), (x_high, w_high))
        )
        line = phi_low + (phi_high - phi_low) * part
        # The floor: straight in phi from either end to the minimum. A parabola through the three
        # leads far astray where the minimum lies close to one end.
        at = (phi - phi_low) / (phi_high - phi_low)
        below = part <= at
        end = np.where(below, x_low[:, None], x_high[:, None])
        way = np.where(below, part / at, (1.0 - part) / (1.0 - at))  # from there to the minimum
        floor = (end + (s.x[:, None] - end) * np.nan_to_num(way)).ravel()
        share = np.sin(0.5 * line).ravel() ** 2
        curve, chart = (np.repeat(a, lines + 1) for a in (np.arange(count), s.chart))
        good = np.flatnonzero(np.isfinite(floor) & np.isfinite(share))
        sides = np.full((2, 2, count * (lines + 1)), np.nan)  # log eta and k, lower and upper side
        if len(good):
            lanes = Lanes(curve, floor, floor, chart).at(good)
            for i, side in enumerate((-1.0, 1.0)):
                found = _sides(data, s, rise, lanes, share[good], side)
                n, k, *_ = index_derivatives(found.x, found.w, found.chart)
                at_end = (found.w <= W_MIN) | (share[good] >= 1.0 - 1e-12)
                sides[:, i, good] = np.log(n), np.where(at_end, 0.0, k)
        (low, high), (k_low, k_high) = sides.reshape(2, 2, count, lines + 1)
        eta = np.exp(_extremes(low, high, cut_low, cut_high))
        k = np.maximum(_extremes(k_low, k_high, cut_low, cut_high), 0.0)
    return Region(eta * data.eta_i, k * data.eta_i)


def rise_at_zero(data: Data, s: Solved, rise: np.ndarray) -> np.ndarray:
    """Return the least cost with k = 0 above the best, (N,); NaN where it was not found.

    rise: a rise that counts, to a thousandth of which it is right.
    """
    with np.errstate(all="ignore"):
        s = from_nearer_end(s)
        lanes = Lanes(np.arange(len(s.x)), s.x, np.full_like(s.w, W_MIN), s.chart)
        floor = _floor(data, s, rise, lanes)
    return np.where(floor.found, np.maximum(floor.height, 0.0), np.nan)


def around_nothing(data: Data, s: Solved, rise: np.ndarray) -> Region:
    """Return the same where nothing is reflected (x = 0 is best, of whatever w): a round region.

    Its edge is met once on each line of constant phi, so that there is no valley to follow.
    """
    count, lines = len(s.x), 4 * LINES + 1
    share = np.sin(np.linspace(0.0, 0.5 * np.pi, lines)) ** 2
    with np.errstate(all="ignore"):
        g = np.maximum(s.g_x, 0.0)
        x = s.x + rise / (g + np.sqrt(g * g + s.h_xx * rise))
        start, chart = np.repeat(x, lines), np.ones(count * lines)
        lanes = Lanes(np.repeat(np.arange(count), lines), start, start, chart)
        found = _sides(data, s, rise, lanes, np.tile(share, count), 1.0)
        n, k, *_ = index_derivatives(found.x, found.w, found.chart)
    n, k = (a.reshape(count, lines) * data.eta_i for a in (n, k))
    # Ends where k = 0, and 33 lines, between which k is less by a thousandth at most.
    k_most = np.stack([np.zeros(count), k.max(axis=1)], axis=-1)
    return Region(np.stack([n.min(axis=1), n.max(axis=1)], axis=-1), k_most)
