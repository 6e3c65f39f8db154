"""Shared by all tests: float64 is on (float32 is tested with float32 arrays)."""

from pathlib import Path

import jax
import pytest

jax.config.update("jax_enable_x64", True)


@pytest.fixture(scope="session")
def measured_files() -> Path:
    """The folder of measured files, which are not part of the project."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the measured files (../shared/data) are not here; they are not distributed")
    return folder
