"""Executables kept on disk: used again without tracing, replaced where they cannot be used."""

import threading
import time

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fitting import start_up
from fitting.stored import stored, use_folder


@pytest.fixture
def folder(tmp_path):
    use_folder(tmp_path)
    yield tmp_path
    use_folder(None)


class Counted:
    """A jitted function that counts its traces; each instance is new, as in another process."""

    def __init__(self, seconds=0.0):
        self.traces = self.compilations = 0

        def scaled(x, pair, *, power):
            self.traces += 1
            time.sleep(seconds)
            return pair[0] * x**power + pair[1], x.sum()

        jitted = jax.jit(scaled, static_argnames=("power",))

        def program():
            self.compilations += 1
            return jitted

        self.call = stored(scaled, program)

    def __call__(self, n=4, power=2, dtype=np.float64):
        x = np.arange(n, dtype=dtype)
        value, total = self.call(x, (dtype(2.0), dtype(1.0)), power=power)
        np.testing.assert_array_equal(value, 2.0 * x**power + 1.0)
        assert total == x.sum()
        assert value.dtype == dtype


def test_a_second_process_needs_no_trace(folder):
    first, second = Counted(), Counted()
    first()
    first()
    assert first.traces == 1
    assert len(list(folder.glob("*.xla"))) == 1
    second()
    assert second.traces == 0


@pytest.mark.parametrize("change", [{"n": 5}, {"power": 3}, {"dtype": np.float32}])
def test_other_shapes_types_and_static_values_are_other_programs(folder, change):
    Counted()()
    second = Counted()
    second(**change)
    assert second.traces == 1
    assert len(list(folder.glob("*.xla"))) == 2


def test_without_x64_the_same_arguments_are_another_program(folder):
    Counted()()
    second = Counted()
    with jax.enable_x64(False):
        value, _ = second.call(np.arange(4.0), (np.float64(2.0), np.float64(1.0)), power=2)
    assert value.dtype == np.float32
    assert second.traces == 1


@pytest.mark.parametrize("damage", [b"", b"not a program", None])
def test_a_damaged_file_is_replaced(folder, damage):
    Counted()()
    (path,) = folder.glob("*.xla")
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2] if damage is None else damage)
    second, third = Counted(), Counted()
    second()
    assert second.traces == 1
    third()
    assert third.traces == 0


def test_nothing_is_kept_before_a_folder_is_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    counted = Counted()
    counted()
    counted()
    assert counted.traces == 1
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_written_to_costs_nothing_but_the_time(tmp_path):
    use_folder(tmp_path / "missing")
    try:
        Counted()()
    finally:
        use_folder(None)


def test_tracers_and_jax_arrays_go_to_jit(folder):
    counted = Counted()
    pair = (jnp.float64(2.0), jnp.float64(1.0))
    slope = jax.grad(lambda x: counted.call(x, pair, power=2)[0].sum())(jnp.arange(3.0))
    np.testing.assert_array_equal(slope, [0.0, 4.0, 8.0])
    assert not list(folder.glob("*.xla"))


def test_the_folder_does_not_grow_without_end(folder, monkeypatch):
    monkeypatch.setattr("fitting.stored.MOST_FILES", 2)
    counted = Counted()
    for n in (2, 3, 4):
        counted(n)
    assert len(list(folder.iterdir())) == 2


def test_threads_compile_a_program_once(folder):
    counted = Counted(0.1)  # long enough for all threads to ask while the first one traces
    threads = [threading.Thread(target=counted) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert counted.compilations == 1


def test_the_cache_folder_is_the_users_own(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folder = start_up.cache_folder()
    assert folder == tmp_path / "cache" / "fresnel-fit"
    assert folder.stat().st_mode & 0o077 == 0
    folder.chmod(0o777)  # somebody else could put a program there
    assert start_up.cache_folder() is None


def test_no_cache_folder_where_none_can_be_made(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert start_up.cache_folder() is None


def test_the_default_is_in_the_home_folder(tmp_path, monkeypatch):
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    assert start_up.cache_folder() == tmp_path / ".cache" / "fresnel-fit"
