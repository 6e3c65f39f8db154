"""Starts that are followed as long as they may be worth it, from a minimum that is known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fitting.searching.minima import ALTERNATIVE_CHI2
from fitting.searching.search import in_order
from fitting.searching.starts import STAGE, Ends

if TYPE_CHECKING:
    from fitting.searching.search import Solving

# Stages in which starts go on.
_FURTHER = 8


def followed(fit: Solving, start: np.ndarray, noise: float, best: float) -> Ends:
    """Return where starts (p, S) end; those that are far above the best cost on the way."""
    low, high = (np.repeat(a[:, None], start.shape[1], 1) for a in fit.limits)
    ends = fit.held(start, low, high, noise, STAGE)
    shown = best + ALTERNATIVE_CHI2 * fit.unit(best)
    for _ in range(_FURTHER):
        live = np.flatnonzero(~ends.done & (ends.cost < shown))
        if not len(live):
            break
        ends.put(live, fit.held(ends.y[:, live], low[:, live], high[:, live], noise, STAGE))
        # After the first of them what still crawls along a valley, unless it is the lowest of all.
        shown = best - fit.unit(best)
    return ends._replace(y=in_order(fit.u, ends.y, fit.settings))
