"""The progress bar: on a terminal, where tqdm is installed, and never in the way."""

import io
import sys
import threading
import time
from importlib.machinery import ModuleSpec
from types import ModuleType

import numpy as np
import pytest

from fitting import Measurement, fit, simulate
from fitting.output import progress_bar as progress
from fitting.output.progress_bar import Progress, shown
from fitting.process.progress import Step, listening, tell


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
            self.options, self.bar_format = options, options["bar_format"]
            self.total, self.n, self.closed, self.start_t = None, 0, 0, 7.0
            self.seen = []
            made.append(self)

        def set_postfix_str(self, text, refresh):
            assert refresh
            self.seen.append((self.n, self.total, text))

        def close(self):
            self.closed += 1

    module = ModuleType("tqdm")
    module.tqdm = Bar  # pyright: ignore[reportAttributeAccessIssue]
    module.__spec__ = ModuleSpec("tqdm", None)
    monkeypatch.setitem(sys.modules, "tqdm", module)
    monkeypatch.setattr(progress, "EVERY", 0.001)
    return made


def wait_for(true):
    """Wait until ``true()`` holds, for at most a minute."""
    end = time.monotonic() + 60.0
    while not true():
        assert time.monotonic() < end, "nothing was shown"
        time.sleep(0.001)


def test_steps_are_counted_on_a_terminal(bars, monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setattr(progress, "DELAY", 0.001)
    with Progress("models") as bar:
        wait_for(lambda: bars and bars[0].seen)
        bar.take(Step(1, None, "first"))
        bar.take(Step(1, None, "second"))
        wait_for(lambda: bars[0].seen[-1] == (2, None, "second"))
        assert not bars[0].closed
    assert len(bars) == 1 and bars[0].closed == 1
    assert bars[0].start_t == 7.0 - progress.DELAY  # the time runs from the start
    assert bars[0].options["leave"] is False and bars[0].options["file"] is sys.stderr


def test_a_bar_is_filled_once_the_number_of_steps_is_known(bars, monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setattr(progress, "DELAY", 0.001)
    with shown("wavelengths"):
        wait_for(lambda: bars and bars[0].seen)
        assert "bar" not in bars[0].bar_format  # no total: only the time
        tell(total=20, done=0)
        tell(done=16)
        tell("errors", done=4)
        wait_for(lambda: bars[0].seen[-1] == (20, 20, "errors"))
        assert "{bar}" in bars[0].bar_format
        # Another fit, as of errors that were too small.
        tell(total=10, done=0)
        tell(done=5)
        wait_for(lambda: bars[0].seen[-1] == (25, 30, "errors"))
    tell(done=5)  # nobody listens any more
    assert bars[0].seen[-1] == (25, 30, "errors")


@pytest.mark.parametrize("count", [2, 30])
def test_the_steps_of_wavelengths_end_at_their_total(count):
    """Those that are solved again, from the wavelengths beside them, are further steps."""
    wave, angle = (a.ravel() for a in np.meshgrid(np.linspace(0.5, 0.7, count), [55.0, 70.0]))
    psi, delta = (simulate("air | 1.6+0.1i", {}, angle, wave, q) for q in ("psi", "delta"))
    random = np.random.default_rng(0)
    # The errors are too small at every third wavelength, which no start helps.
    psi += np.where(np.arange(len(wave)) % 3, 0.0, 0.5) * random.standard_normal(len(wave))
    m = Measurement.from_columns(
        angle, wave, psi=psi, delta=delta, sigma={"psi": 0.01, "delta": 0.01}
    )
    bar = Progress("wavelengths", quiet=True)
    with listening(bar.take):
        fit(m, "free", errors="scaled")
    assert bar._done == bar._total > 2 * count


def test_nothing_is_shown_in_the_first_second(bars, monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    assert progress.DELAY == 1.0
    monkeypatch.setattr(progress, "DELAY", 60.0)  # however slow this machine is
    with Progress("models") as bar:
        bar.take(Step(1, None, ""))
    assert bars == []


def test_nothing_is_shown_in_a_pipe_or_if_asked_to_be_quiet(bars, monkeypatch):
    monkeypatch.setattr(progress, "DELAY", 0.001)
    before = threading.active_count()
    for stderr, quiet in ((io.StringIO(), False), (Terminal(), True), (None, False)):
        monkeypatch.setattr(sys, "stderr", stderr)
        with Progress("models", quiet=quiet) as bar:
            assert threading.active_count() == before
            bar.take(Step(1, None, ""))
    assert bars == []


def test_without_tqdm_there_is_silence(monkeypatch):
    monkeypatch.setitem(sys.modules, "tqdm", None)
    looked = threading.Event()

    def find_spec(name):
        looked.set()

    monkeypatch.setattr("importlib.util.find_spec", find_spec)
    monkeypatch.setattr(progress, "DELAY", 0.001)
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with Progress("models") as bar:
        assert looked.wait(60.0)
        bar.take(Step(1, None, ""))
    assert terminal.getvalue() == ""


def test_the_bar_is_cleared_away_before_an_error_is_shown(bars, monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setattr(progress, "DELAY", 0.001)
    with pytest.raises(KeyboardInterrupt), Progress("models"):
        wait_for(lambda: bars and bars[0].seen)
        raise KeyboardInterrupt
    assert bars[0].closed == 1
