"""Warnings and notes on a fit: each is a code with numbers, from which its sentence is made.

The sentences are in one table, `fitting.results.sentences.SENTENCES`, which lists every code, the
most serious first. The program itself goes by codes and never reads a sentence.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from fitting.results.result_parts import item
from fitting.results.sentences import SENTENCES, Tries, keywords

_RANK = {code: i for i, code in enumerate(SENTENCES)}


class Warning(NamedTuple):
    """One warning or note on a fit.

    code: its name in `SENTENCES`. where: what it refers to, for example {"wavelength_um": 0.532}
    or {"parameter": "k"}; empty for the whole fit. values: the numbers and names in its sentence.
    """

    code: str
    where: Mapping[str, Any] = {}
    values: Mapping[str, Any] = {}

    @property
    def sentence(self) -> str:
        """What is wrong."""
        text = SENTENCES[self.code][0]
        return text.format_map(self.values) if isinstance(text, str) else text(self.values)

    @property
    def tries(self) -> Tries:
        """What to try where it is right: a question or a reason, and options of the command."""
        tries = SENTENCES[self.code][1]
        return tries if isinstance(tries, tuple) else tries(self.values)

    @property
    def advice(self) -> str:
        """`tries` as text to copy: ``Glass? Try --fix k=0 (in Python: fixed={"k": 0}).``; or ""."""
        return " ".join(
            f"{why} {'T' if not why or why.endswith('?') else 't'}ry {option} "
            f"(in Python: {keywords(option)}).".lstrip()
            for why, option in self.tries
        )

    @property
    def text(self) -> str:
        """The sentence, and what to try."""
        return f"{self.sentence} {self.advice}".rstrip()

    def __str__(self) -> str:
        return self.text

    def to_dict(self) -> dict[str, Any]:
        """Return code, where, values and text as plain data."""
        return {**self._asdict(), "text": self.text}


@dataclass(frozen=True, eq=False)
class Finding:
    """One warning for all fits of a batch: the object of a single fit is made on request only.

    at: which fits have it, a bool array of the batch shape S. values: name -> a number, a text, or
    an array whose leading axes are S. where: place in the batch of a single fit picked from it.
    """

    code: str
    at: Any
    values: Mapping[str, Any]
    where: Mapping[str, Any] = field(default_factory=dict)

    def of(self, index: tuple[int, ...], where: Mapping[str, Any]) -> Warning:
        """Return the warning of the fit at ``index`` of the batch."""
        values = {name: item(value, index) for name, value in self.values.items()}
        return Warning(self.code, {**self.where, **where}, values)


def ranked(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the findings, the most serious first."""
    return tuple(sorted(findings, key=lambda f: _RANK[f.code]))


def those(values: Any, at: np.ndarray) -> Any:
    """Return the values S + (P, ..) where ``at`` S + (P,) holds: a tuple, or an array S of them."""
    values = np.broadcast_to(values, at.shape + np.shape(values)[at.ndim :])
    out = np.empty(at.shape[:-1], object)
    out.fill(())
    for i in map(tuple, np.argwhere(at.any(-1))):
        out[i] = tuple(values[i][at[i]].tolist())
    return out[()]
