"""The folder of compiled programs: code is run from it, so it is looked at, and mended."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from fitting.process.start_up import cache_folder
from tests.truth.simulated import GOLD

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]


def run(home):
    """What the command prints of a fit whose two programs compile in half a second."""
    command = [sys.executable, "-W", "error", "-m", "fitting", str(GOLD), "--errors", "equal"]
    done = subprocess.run(
        [*command, "--json", "-"],
        capture_output=True, text=True, cwd=ROOT, env={**os.environ, "XDG_CACHE_HOME": str(home)},
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def entries(home):
    return {path.name: path.read_bytes() for path in (home / "fresnel-fit" / "jax").glob("*-cache")}


def test_damaged_entries_are_compiled_anew_and_replaced(tmp_path):
    first = run(tmp_path)
    whole = before = entries(tmp_path)
    a, b, c, *_ = sorted(whole)
    rounds = (
        {a: b"", b: whole[b][: len(whole[b]) // 2], c: bytes(len(whole[c]))},
        {a: b"junk"},  # the others are read as they were mended
    )
    for damages in rounds:
        for name, content in damages.items():
            (tmp_path / "fresnel-fit" / "jax" / name).write_bytes(content)
        assert run(tmp_path) == first
        mended = entries(tmp_path)
        assert mended.keys() == whole.keys()
        # a program is written anew in nearly as many bytes
        assert all(len(mended[name]) > 0.9 * len(whole[name]) for name in whole)
        assert all(mended[name] == before[name] for name in whole.keys() - damages)
        before = mended


@pytest.fixture
def programs(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder = cache_folder()
    assert folder == tmp_path / "fresnel-fit" / "jax"
    return folder


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="this system has no owners and modes")
def test_a_folder_that_others_may_write_to_is_not_used(programs, tmp_path, monkeypatch):
    programs.chmod(0o755)
    assert cache_folder() == programs
    # Nobody else may enter it: where the umask is 002 jax makes files that the group may write.
    assert programs.stat().st_mode & 0o777 == 0o700
    for folder in (programs, programs.parent):
        for mode in (0o777, 0o770, 0o702):
            folder.chmod(mode)
            assert cache_folder() is None
            assert cache_folder(programs) == (programs if folder == programs.parent else None)
        folder.chmod(0o700)
    assert cache_folder() == programs
    monkeypatch.setattr(os, "getuid", lambda: programs.stat().st_uid + 1)
    assert cache_folder() is None


def test_a_relative_cache_home_is_no_cache_home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", "here")
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    assert cache_folder() == tmp_path / ".cache" / "fresnel-fit" / "jax"
    assert not (tmp_path / "here").exists()


SCRIPT = """
import sys, fitting
print(fitting.cache_programs(*sys.argv[1:]))
import jax
from collections import Counter
events = Counter()
jax.monitoring.register_event_listener(lambda name, **_: events.update([name.split("/")[-1]]))
print(fitting.fit(fitting.read_csv({gold!r})).eta)
print(events["cache_hits"], events["cache_misses"])
"""


def script(*arguments, code=SCRIPT, **environment):
    """The lines that a script prints which keeps its programs, and its warnings."""
    done = subprocess.run(
        [sys.executable, "-c", code.format(gold=str(GOLD)), *arguments],
        capture_output=True, text=True, cwd=ROOT,
        env={**os.environ, "TF_CPP_MIN_LOG_LEVEL": "3", **environment},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines(), done.stderr


def test_one_call_keeps_the_programs_of_a_script(tmp_path):
    folder, value, events = script(str(tmp_path / "programs"))[0]
    assert folder == str(tmp_path / "programs")
    assert events.startswith("0 ")
    again = script(str(tmp_path / "programs"))[0]
    assert again[:2] == [folder, value]
    hits, misses = map(int, again[2].split())
    assert hits > 1
    assert misses == 0


def test_a_folder_that_cannot_be_used_is_named_in_a_warning(tmp_path):
    (tmp_path / "file").write_text("")
    code = "import sys, fitting; print(fitting.cache_programs(*sys.argv[1:]))"
    (folder,), warning = script(str(tmp_path / "file"), code=code)
    assert folder == "None"
    assert "file cannot be created or written" in warning
    (folder,), warning = script(code=code, JAX_COMPILATION_CACHE_DIR=str(tmp_path / "jax"))
    assert (folder, warning) == (str(tmp_path / "jax"), "")


def test_a_processor_that_refuses_its_programs_is_told_once(tmp_path):
    """The words are those of jax-ml/jax#38445."""
    code = """
import warnings, fitting
fitting.cache_programs()
for name in ("jit_a", "jit_b"):
    warnings.warn(
        f"Error reading persistent compilation cache entry for {{name!r}}: INTERNAL: Machine type "
        "used for XLA:CPU compilation doesn't match the machine type for execution."
    )
"""
    _, warning = script(code=code, XDG_CACHE_HOME=str(tmp_path))
    assert warning.count("XLA refuses to load") == 1
    assert "install jax 0.11 or newer" in warning
