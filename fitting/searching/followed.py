"""Starts that are followed as long as they may be worth it, from a minimum that is known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fitting.searching.minima import shown_below
from fitting.searching.search import in_order
from fitting.searching.starts import STAGE, Ends

if TYPE_CHECKING:
    from fitting.searching.search import Solving

# Largest number of stages of STAGE evaluations.
_FURTHER = 8


def followed(fit: Solving, start: np.ndarray, noise: float, best: float) -> Ends:
    """Return the ends of starts (p, S); those far above the best cost are stopped on the way."""
    low, high = (np.repeat(a[:, None], start.shape[1], 1) for a in fit.limits)
    ends = fit.held(start, low, high, noise, STAGE)
    shown = shown_below(fit, best)
    for _ in range(_FURTHER):
        live = np.flatnonzero(~ends.done & (ends.cost < shown))
        if not len(live):
            break
        ends.put(live, fit.held(ends.y[:, live], low[:, live], high[:, live], noise, STAGE))
        # After the first stage only starts go on that are below the best minimum known.
        shown = best - fit.unit(best)
    return ends._replace(y=in_order(fit.u, ends.y, fit.settings))
