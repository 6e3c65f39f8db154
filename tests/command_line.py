"""Runs of the command fresnel-fit in tests, with a cache of compiled programs of their own."""

import subprocess
import sys
from pathlib import Path

import pytest

from fitting.command import cli

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(autouse=True)
def own_cache(cache, monkeypatch):
    """No test reads or writes the cache of who runs it; no test leaves jax pointed at it."""
    import jax

    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
    names = (
        "jax_compilation_cache_dir",
        "jax_persistent_cache_min_compile_time_secs",
        "jax_persistent_cache_min_entry_size_bytes",
    )
    before = {name: getattr(jax.config, name) for name in names}
    yield
    for name, value in before.items():
        jax.config.update(name, value)


def run(*arguments, **options):
    """Run the command in a process of its own."""
    return subprocess.run(
        [sys.executable, "-W", "error", "-m", "fitting", *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=ROOT,
        timeout=120,
        **options,
    )


def refused(capsys, *arguments):
    """Run in this process, expect status 2, and return the one line that it says."""
    assert cli.main([str(a) for a in arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("fresnel-fit: ")
    assert err.count("\n") == 1
    return err


def nothing_in(folder, *but):
    return {p.name for p in folder.iterdir()} == set(but)
