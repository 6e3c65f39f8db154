"""The candidates of a choice as they are tried: side by side, and the likely ones thoroughly.

Where no model describes the data, a thorough search of films takes longer than all else, and finds
a lower minimum of few models. Candidates are therefore compared by the minima that the first stages
of a search find (see `stages`). Those that may then be taken are searched as thoroughly as `fit`
does, until this changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from fitting.choice.candidates import Candidate, Key, candidate, contenders, simplest
from fitting.process.progress import tell
from fitting.process.side_by_side import side_by_side
from fitting.results.result import FitData


class Trials:
    """The candidates tried so far.

    run: fits a candidate; the second argument is whether its minima are searched thoroughly.
    progress: called with each label. errors: how the stated errors are used, as in `fit`.
    """

    def __init__(
        self, run: Callable[[Key, bool], FitData], progress: Callable[[str], None], errors: str
    ):
        self.run, self.progress, self.errors = run, progress, errors
        self.tried: dict[Key, Candidate] = {}

    def attempt(self, *keys: Key) -> list[Candidate]:
        """Return the candidates, fitted side by side if they were not tried before."""
        self.attempt_chains(*((key,) for key in keys))
        return [self.tried[key] for key in keys]

    def attempt_chains(self, *chains: Sequence[Key]) -> None:
        """Try chains of candidates in parallel, each until one of its candidates is not good."""
        new = [c for c in dict.fromkeys(map(tuple, chains)) if any(k not in self.tried for k in c)]
        if new:
            self._announce(dict.fromkeys(k for c in new for k in c if k not in self.tried))
            side_by_side(self._try_chain, new)

    def _announce(self, keys: Iterable[Key], what: str = "") -> None:
        for key in keys:
            self.progress(key.label + what)
            tell(key.label + what)

    def _try_chain(self, chain: Sequence[Key]) -> None:
        for key in chain:
            if key not in self.tried:
                self._fit(key, thorough=False)
            if not self.tried[key].good:
                return

    def _fit(self, key: Key, thorough: bool) -> None:
        self.tried[key] = candidate(key, self.run(key, thorough), self.errors)

    def settle(self) -> None:
        """Search thoroughly for the minima of the candidates that may be taken."""
        done: set[Key] = set()
        while new := [c.key for c in contenders(list(self.tried.values())) if c.key not in done]:
            # Those with most parameters take longest: none of them should be left alone at the end.
            new.sort(key=lambda key: -self.tried[key].size)
            self._announce(new, ", searched thoroughly")
            side_by_side(lambda key: self._fit(key, thorough=True), new)
            done |= {*new}

    def best(self) -> Candidate:
        """Return the candidate that would be taken now."""
        return simplest(list(self.tried.values()))
