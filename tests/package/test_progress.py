"""The progress bar: tqdm's, on a terminal, where it is installed, and never in the way."""

import io
import sys
from importlib.machinery import ModuleSpec
from types import ModuleType

import numpy as np
import pytest

from fitting import Measurement, fit, simulate
from fitting.process.progress import listening, shown, tell


class Terminal(io.StringIO):
    """What stderr is when somebody looks at it."""

    def isatty(self):
        return True


@pytest.fixture
def bars(monkeypatch):
    """Stand in for tqdm, which the tests do not need: what each bar showed."""
    made = []

    class Bar:
        def __init__(self, **options):
            self.options = options
            self.total, self.n, self.text, self.closed, self.seen = None, 0, "", 0, []
            made.append(self)

        def set_postfix_str(self, text, refresh):
            assert not refresh
            self.text = text

        def update(self, count):
            self.n += count
            self.seen.append((self.n, self.total, self.text))

        def __enter__(self):
            return self

        def __exit__(self, *_):
            self.closed += 1

    module = ModuleType("tqdm")
    module.tqdm = Bar  # pyright: ignore[reportAttributeAccessIssue]
    module.__spec__ = ModuleSpec("tqdm", None)
    monkeypatch.setitem(sys.modules, "tqdm", module)
    return made


def test_steps_are_counted_on_a_terminal(bars, monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    with shown("wavelengths"):
        (bar,) = bars
        tell("first")
        assert bar.seen == [(1, None, "first")]  # no total: the number of steps and the time
        tell(total=19, done=0)
        tell(done=15)
        tell("errors", done=4)
        assert bar.seen[-1] == (20, 20, "errors")
        # Another fit, as of errors that were too small.
        tell(total=10, done=0)
        tell(done=5)
        assert bar.seen[-1] == (25, 30, "errors")
        assert not bar.closed
    tell(done=5)  # nobody listens any more
    assert bar.seen[-1] == (25, 30, "errors")
    assert bar.closed == 1
    # Nothing is shown in the first second, and nothing stays.
    assert (bar.options["delay"], bar.options["leave"]) == (1.0, False)
    assert bar.options["file"] is sys.stderr


@pytest.mark.parametrize("count", [2, 30])
def test_the_steps_of_wavelengths_end_at_their_total(count):
    """Each is solved, also again from those beside it, and then gets its errors."""
    wave, angle = (a.ravel() for a in np.meshgrid(np.linspace(0.5, 0.7, count), [55.0, 70.0]))
    psi, delta = (simulate("air | 1.6+0.1i", {}, angle, wave, q) for q in ("psi", "delta"))
    random = np.random.default_rng(0)
    # The errors are too small at every third wavelength, which no start helps.
    psi += np.where(np.arange(len(wave)) % 3, 0.0, 0.5) * random.standard_normal(len(wave))
    m = Measurement.from_columns(
        angle, wave, psi=psi, delta=delta, sigma={"psi": 0.01, "delta": 0.01}
    )
    done = total = 0

    def take(step):
        nonlocal done, total
        total = done + step.total if step.total else total
        done += step.done

    with listening(take):
        fit(m, "free", errors="scaled")
    assert done == total == 2 * count


def test_nothing_is_shown_in_a_pipe_or_if_asked_to_be_quiet(bars, monkeypatch):
    for stderr, quiet in ((io.StringIO(), False), (Terminal(), True), (None, False)):
        monkeypatch.setattr(sys, "stderr", stderr)
        with shown("models", quiet=quiet):
            tell("one")
    assert bars == []


def test_without_tqdm_there_is_silence(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with shown("models"):
        tell("one")
    assert terminal.getvalue() == ""


def test_the_bar_is_cleared_away_before_an_error_is_shown(bars, monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    with pytest.raises(KeyboardInterrupt), shown("models"):
        raise KeyboardInterrupt
    assert bars[0].closed == 1
