"""Curves of a bare surface that contradict their stated errors, fitted with a further error."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting.bare_surface.answer import Answer, answer
from fitting.bare_surface.arrange import Arranged
from fitting.bare_surface.curve_data import Data, of_rows, put_rows
from fitting.bare_surface.curves import fitted_curves
from fitting.residuals.error_model import (
    GAIN,
    ROUNDS,
    added_kinds,
    likeliest_added,
    one_factor,
    sizes,
    worth_a_fit,
)
from fitting.results.result_parts import NO_DATA


class Taken(NamedTuple):
    """What was added to the errors of N curves.

    kind: "" where nothing was, else a kind of `error_model.sizes`; s: how much; gain: in log
    likelihood, above one factor. by_factor: eta and k (N, 2) with one factor on the stated errors
    instead.
    """

    kind: np.ndarray
    s: np.ndarray
    gain: np.ndarray
    by_factor: np.ndarray


class _Residuals(NamedTuple):
    """Residuals, stated errors and fitted values (N, C M); errors inf where there is no datum."""

    off: np.ndarray
    sigma: np.ndarray
    fitted: np.ndarray


def _residuals(data: Data, f: Answer) -> _Residuals:
    value, weight, fitted = (
        np.concatenate(of, axis=1)
        for of in (data.values, data.wide_weights, fitted_curves(data, f.solved))
    )
    with np.errstate(divide="ignore"):
        return _Residuals(np.where(weight > 0.0, value - fitted, 0.0), 1.0 / weight, fitted)


def _with_added(a: Arranged, rows: np.ndarray, further: np.ndarray) -> Arranged:
    """Return the curves ``rows`` with further errors (N, C M) added to their own in squares."""
    data = a.data.take(rows)
    each = np.split(further, len(data.channels), axis=1)
    weights = tuple(
        w / np.sqrt(1.0 + (w * s) ** 2) for w, s in zip(data.wide_weights, each, strict=True)
    )
    angle = a.angle_deg[rows] if a.angle_deg.ndim == 2 else a.angle_deg
    return a._replace(data=data._replace(weights=weights), angle_deg=angle)


def with_added_error(
    a: Arranged, f: Answer, errors: str, start: np.ndarray | None, wanted: str
) -> tuple[Answer, Taken]:
    """Return the answer with a further error where it is asked for, or likelier than one factor.

    errors: "floor" or "relative": wherever there is a degree of freedom; "auto": where reduced chi2
    is far too large and one of them is likelier than the factor; else nowhere. start: (3, N), one
    more start. chi2 stays that of the stated errors.
    """
    count = a.data.curves
    taken = Taken(
        np.full(count, "", "<U8"), np.zeros(count), np.full(count, np.nan),
        np.full((count, 2), np.nan),
    )  # fmt: skip
    kinds = added_kinds(errors)
    if not a.stated or not kinds:
        return f, taken
    far = f.codes["chi2_large"] if errors == "auto" else f.dof > 0
    # Also fits that did not converge: if a part of the data has far smaller stated errors than the
    # rest, that part alone was fitted, and may have determined nothing.
    far = np.flatnonzero(far & (f.status != NO_DATA) & np.isfinite(f.solved.cost))
    if not len(far):
        return f, taken

    def fitted_with(rows: np.ndarray, further: np.ndarray, kind: str) -> Answer:
        part = _with_added(a, rows, further)
        return answer(part, False, None if start is None else start[:, rows], kind)

    by_factor = _residuals(a.data.take(far), of_rows(f, far))
    least = one_factor(by_factor.off, by_factor.sigma)
    further = np.zeros_like(by_factor.off)
    for kind in kinds:
        now = by_factor
        size = sizes(kind, now.fitted)
        added = likeliest_added(now.off, now.sigma, size)
        here = np.flatnonzero(worth_a_fit(errors, now.off, now.sigma, added))
        if not len(here):
            continue
        s, size = added.s[here], size[here]
        for _ in range(ROUNDS - 1):
            found = fitted_with(far[here], s[:, None] * size, "quadratic")
            now = _residuals(a.data.take(far[here]), found)
            size = sizes(kind, now.fitted)
            added = likeliest_added(now.off, now.sigma, size)
            s = added.s
        gain = 0.5 * (least[here] - added.minus_two_log)
        better = (s > 0.0) & ((gain >= GAIN) | (errors != "auto"))
        better &= ~(gain <= taken.gain[far[here]])
        here, s, size, gain = here[better], s[better], size[better], gain[better]
        further[here] = s[:, None] * size
        taken.kind[far[here]], taken.s[far[here]], taken.gain[far[here]] = kind, s, gain
    here = np.flatnonzero(taken.kind[far] != "")
    todo = far[here]
    if not len(todo):
        return f, taken
    found = fitted_with(todo, further[here], wanted)
    off, sigma, _ = _residuals(a.data.take(todo), found)
    chi2 = np.where(np.isfinite(sigma), (off / sigma) ** 2, 0.0).sum(1)
    found = found._replace(values={**found.values, "chi2": chi2})
    taken.by_factor[todo] = np.stack([f.values["eta"][todo], f.values["k"][todo]], -1)
    return put_rows(f, found, todo), taken
