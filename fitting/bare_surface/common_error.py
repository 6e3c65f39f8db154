"""Curves of a bare surface that contradict their stated errors, fitted with a common error."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting.bare_surface.answer import Answer, answer
from fitting.bare_surface.arrange import Arranged
from fitting.bare_surface.curve_data import Data, of_rows, put_rows
from fitting.bare_surface.curves import fitted_curves
from fitting.residuals.error_model import GAIN, ROUNDS, likeliest_floor
from fitting.results.result_parts import NO_DATA


class Taken(NamedTuple):
    """What was taken for the errors of N curves: s, its gain in log likelihood (NaN: no s), and
    eta and k (N, 2) with one factor on the stated errors instead."""

    floor: np.ndarray
    gain: np.ndarray
    by_factor: np.ndarray


def _residuals(data: Data, f: Answer) -> tuple[np.ndarray, np.ndarray]:
    """Return residuals and stated errors (N, C M), inf where there is no datum."""
    value, weight, fitted = (
        np.concatenate(of, axis=1)
        for of in (data.values, data.wide_weights, fitted_curves(data, f.solved))
    )
    with np.errstate(divide="ignore"):
        return np.where(weight > 0.0, value - fitted, 0.0), 1.0 / weight


def _with_floor(data: Data, s: np.ndarray) -> Data:
    """Return the data with s added to every error in squares."""
    return data._replace(
        weights=tuple(w / np.sqrt(1.0 + (w * s[:, None]) ** 2) for w in data.wide_weights)
    )


def with_common_error(
    a: Arranged, f: Answer, errors: str, start: np.ndarray | None, wanted: str
) -> tuple[Answer, Taken]:
    """Return the answer with a common error where it is asked for, or likelier than one factor.

    errors: "floor": wherever there is a degree of freedom; "auto": where reduced chi2 is far too
    large and s likelier than the factor; else nowhere. start: (3, N), one more start. chi2 stays
    that of the stated errors.
    """
    count = a.data.curves
    taken = Taken(np.zeros(count), np.full(count, np.nan), np.full((count, 2), np.nan))
    if not a.stated or errors not in ("auto", "floor"):
        return f, taken
    far = (f.dof > 0) if errors == "floor" else f.codes["chi2_large"]
    # Also fits that did not converge: if a part of the data has far smaller stated errors than the
    # rest, that part alone was fitted, and may have determined nothing.
    todo = np.flatnonzero(far & (f.status != NO_DATA) & np.isfinite(f.solved.cost))
    if not len(todo):
        return f, taken
    data = a.data.take(todo)
    off, sigma = _residuals(data, of_rows(f, todo))
    floor = likeliest_floor(off, sigma)
    better = (floor.s > 0.0) & ((floor.gain >= GAIN) | (errors == "floor"))
    todo, s = todo[better], floor.s[better]
    if not len(todo):
        return f, taken
    data = a.data.take(todo)
    angle = a.angle_deg[todo] if a.angle_deg.ndim == 2 else a.angle_deg
    for left in reversed(range(ROUNDS)):
        part = a._replace(data=_with_floor(data, s), angle_deg=angle)
        kind = "quadratic" if left else wanted
        found = answer(part, False, None if start is None else start[:, todo], kind)
        off, sigma = _residuals(data, found)
        floor = likeliest_floor(off, sigma)
        if left:
            s = floor.s
    chi2 = np.where(np.isfinite(sigma), (off / sigma) ** 2, 0.0).sum(1)
    found = found._replace(values={**found.values, "chi2": chi2})
    taken.by_factor[todo] = np.stack([f.values["eta"][todo], f.values["k"][todo]], -1)
    taken.floor[todo], taken.gain[todo] = s, floor.gain
    return put_rows(f, found, todo), taken
