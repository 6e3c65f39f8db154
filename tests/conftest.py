"""Shared by all tests: float64 is on (float32 is tested with float32 arrays)."""

from pathlib import Path

import jax
import pytest

jax.config.update("jax_enable_x64", True)
# Most of the time goes to compiling. Programs are kept in the checkout, for the other worker and for
# the next run; only those of this process, not of the commands that tests start.
PROGRAMS = Path(__file__).resolve().parents[1] / ".pytest_cache" / "programs"
jax.config.update("jax_compilation_cache_dir", str(PROGRAMS))
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.5)


@pytest.fixture(scope="session")
def measured_files() -> Path:
    """The folder of measured files, which are not part of the project."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the measured files (../shared/data) are not here; they are not distributed")
    return folder
