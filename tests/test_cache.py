"""The folder of compiled programs: code is run from it, so it is looked at, and mended."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from simulated import GOLD

from fitting.process.start_up import cache_folder

ROOT = Path(__file__).resolve().parents[1]


def run(home):
    """What the command prints of a fit whose two programs compile in half a second."""
    command = [sys.executable, "-W", "error", "-m", "fitting", str(GOLD), "--sample", "constant"]
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
    whole = entries(tmp_path)
    assert len(whole) > 1
    damages = (
        (lambda content: b"", lambda content: content[: len(content) // 2]),
        (lambda content: bytes(len(content)), lambda content: b"junk"),
    )
    for pair in damages:
        for i, (name, content) in enumerate(sorted(whole.items())):
            (tmp_path / "fresnel-fit" / "jax" / name).write_bytes(pair[i % 2](content))
        assert run(tmp_path) == first
        mended = entries(tmp_path)
        assert mended.keys() == whole.keys()
        # a program is written anew in nearly as many bytes
        assert all(len(mended[name]) > 0.9 * len(whole[name]) for name in whole)
    assert run(tmp_path) == first
    assert entries(tmp_path) == mended


@pytest.fixture
def programs(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder = cache_folder()
    assert folder == tmp_path / "fresnel-fit" / "jax"
    return folder


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="this system has no owners and modes")
def test_what_others_may_write_to_is_not_loaded(programs, tmp_path, monkeypatch):
    (programs / "own-cache").write_text("")
    (programs / "shared-cache").write_text("")
    (programs / "shared-cache").chmod(0o664)
    (tmp_path / "elsewhere").write_text("")
    (programs / "linked-cache").symlink_to(tmp_path / "elsewhere")
    (programs / "own-cache").chmod(0o644)
    assert cache_folder() == programs
    assert [path.name for path in programs.iterdir()] == ["own-cache"]
    for folder in (programs, programs.parent):
        folder.chmod(0o777)
        assert cache_folder() is None
        folder.chmod(0o700)
    monkeypatch.setattr(os, "getuid", lambda: programs.stat().st_uid + 1)
    assert cache_folder() is None


def test_a_relative_cache_home_is_no_cache_home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", "here")
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    assert cache_folder() == tmp_path / ".cache" / "fresnel-fit" / "jax"
    assert not (tmp_path / "here").exists()
