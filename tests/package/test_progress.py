"""Progress: a line every two seconds, on a terminal, and never in the way."""

import io
import sys
import threading

import numpy as np
import pytest

from fitting import Measurement, fit, simulate
from fitting.process import progress
from fitting.process.progress import Lines, listening, shown, tell


class Terminal(io.StringIO):
    """What stderr is when somebody looks at it; ``written``: that a line was."""

    def __init__(self):
        super().__init__()
        self.written = threading.Event()

    def isatty(self):
        return True

    def flush(self):
        self.written.set()


@pytest.fixture
def terminal(monkeypatch):
    """Stand in for stderr, for the test to set: pytest sets it between a fixture and its test."""
    monkeypatch.setattr(progress, "EVERY", 1e-3)
    return Terminal()


def test_a_line_says_what_is_done_how_far_and_the_best_so_far(monkeypatch):
    monkeypatch.setattr(progress, "EVERY", 1e6)
    lines = Lines("fit")
    with listening(lines.take):
        tell("first")
        assert lines.text() == "fit: first, 0 s"  # no total: the time alone
        tell(total=19, done=0)
        tell(done=15)
        tell("errors", done=4)
        assert "errors, 20 of 20, " in lines.text()
        # Another fit, as of errors that were too small.
        tell(total=10, done=0)
        tell(done=5, stage="search", best="eta 1.5 (rms .01)")
        assert "errors, search, 25 of 30, " in lines.text()
        assert lines.text().endswith("; best so far: eta 1.5 (rms .01)")
        tell("second")
        assert "best" not in lines.text()  # of another model
    lines.close()
    tell(done=5)  # nobody listens any more
    assert lines.done == 26


def test_lines_are_written_on_a_terminal_until_the_end(terminal, monkeypatch):
    monkeypatch.setattr(sys, "stderr", terminal)
    with shown("wavelengths"):
        tell("first")
        assert terminal.written.wait(10.0)
    said = terminal.getvalue()
    assert said.splitlines()[-1].startswith("wavelengths: ")
    tell("second")
    assert terminal.getvalue() == said


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


def test_a_search_reports_its_stages_and_the_best_so_far():
    m = Measurement.from_columns(np.linspace(20.0, 80.0, 20), R_s=np.linspace(0.05, 0.5, 20))
    steps = []
    with listening(steps.append):
        fit(m, "constant", starts=8, intervals="quadratic")
    assert any(step.stage for step in steps)
    best = [step.best for step in steps if step.best]
    assert best and best[-1].startswith("eta ") and "rms" in best[-1]


def test_nothing_is_shown_in_a_pipe_or_if_asked_to_be_quiet(terminal, monkeypatch):
    pipe = io.StringIO()
    for stderr, quiet in ((pipe, False), (terminal, True), (None, False)):
        monkeypatch.setattr(sys, "stderr", stderr)
        count = threading.active_count()
        with shown("models", quiet=quiet):
            tell("one")
            assert threading.active_count() == count
    assert pipe.getvalue() == terminal.getvalue() == ""


def test_the_lines_end_before_an_error_is_shown(terminal, monkeypatch):
    monkeypatch.setattr(sys, "stderr", terminal)
    count = threading.active_count()
    with pytest.raises(KeyboardInterrupt), shown("models"):
        raise KeyboardInterrupt
    assert threading.active_count() == count
