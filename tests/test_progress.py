"""The progress bar: on a terminal, where tqdm is installed, and never in the way."""

import io
import sys
from importlib.machinery import ModuleSpec
from types import ModuleType

import pytest

from fitting.output.progress import Progress


class Terminal(io.StringIO):
    """What stderr is when somebody looks at it."""

    def isatty(self):
        return True


@pytest.fixture
def bars(monkeypatch):
    """Stand in for tqdm, which the tests do not need: what was done to each bar."""
    made = []

    class Bar:
        def __init__(self, **options):
            self.options, self.total, self.done, self.doing, self.closed = options, None, 0, "", 0
            made.append(self)

        def update(self):
            self.done += 1

        def refresh(self):
            pass

        def set_postfix_str(self, text):
            self.doing = text

        def close(self):
            self.closed += 1

    module = ModuleType("tqdm")
    module.tqdm = Bar  # pyright: ignore[reportAttributeAccessIssue]
    module.__spec__ = ModuleSpec("tqdm", None)
    monkeypatch.setitem(sys.modules, "tqdm", module)
    return made


def use():
    with Progress("models", quiet=False) as bar:
        bar.expect(2)
        bar.step("first")
        bar.step("second")


def test_steps_are_counted_on_a_terminal_after_a_second(bars, monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    use()
    (bar,) = bars
    assert (bar.total, bar.done, bar.doing, bar.closed) == (2, 2, "second", 1)
    assert bar.options["delay"] == 1.0
    assert bar.options["leave"] is False


def test_nothing_is_shown_in_a_pipe_or_if_asked_to_be_quiet(bars, monkeypatch):
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    use()
    monkeypatch.setattr(sys, "stderr", Terminal())
    with Progress("models", quiet=True) as bar:
        bar.step()
    assert bars == []


def test_without_tqdm_there_is_silence(monkeypatch):
    monkeypatch.setitem(sys.modules, "tqdm", None)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    use()
    assert terminal.getvalue() == ""
