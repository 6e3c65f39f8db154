"""The warnings of a fit as sentences; for a batch each kind once, with the fits it concerns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting.output.estimates import by_wavelength, wave_text
from fitting.results.result import Fit


class WarningTexts(NamedTuple):
    """texts: a sentence for each kind of warning. at: for each kind the mask of its fits."""

    texts: list[str]
    at: list[np.ndarray]

    def marks(self, index: tuple[int, ...]) -> str:
        """Return the numbers of the warnings of one fit, counted from 1."""
        return " ".join(str(i) for i, at in enumerate(self.at, 1) if at[index])


def _where(fit: Fit, at: np.ndarray, own: bool) -> str:
    places = np.argwhere(at)
    waves = by_wavelength(fit)
    first = wave_text(fit, tuple(places[0]))
    where = f"at {first} um" if waves else f"curve {first}"
    if len(places) > 1:
        many = "more wavelength" if waves else "more curve"
        other = "with other numbers " if own else ""
        count = len(places) - 1
        where += f"; {other}{'at' if waves else 'in'} {count} {many}{'s' * (count > 1)}"
    return where


def warning_texts(fit: Fit) -> WarningTexts:
    """Return the warnings of a fit, the most serious first."""
    if not fit.shape:
        texts = [w.text for w in fit.warnings]
        return WarningTexts(texts, [np.ones((), bool)] * len(texts))
    texts, masks = [], []
    for finding in fit.findings:
        at = np.broadcast_to(np.asarray(finding.at, bool), fit.shape)
        if not at.any():
            continue
        text = finding.of(tuple(np.argwhere(at)[0]), {}).text
        own = any(isinstance(value, np.ndarray) for value in finding.values.values())
        texts.append(f"{text.removesuffix(chr(46))} ({_where(fit, at, own)}).")
        masks.append(at)
    return WarningTexts(texts, masks)
