"""Cubes of known truth, and the command as a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from tests.truth import textbook

ROOT = Path(__file__).resolve().parents[2]
ANGLE_DEG = np.linspace(25.0, 80.0, 12)
SIGMA = 0.002


def surfaces(shape: tuple[int, ...] = (24, 20)) -> tuple[np.ndarray, np.ndarray]:
    """Return R_s and R_p of bare surfaces, shape + (2, 12), and their eta."""
    random = np.random.default_rng(4)
    eta, k = random.uniform(1.3, 5.0, shape), random.uniform(0.2, 4.0, shape)
    both = textbook.reflectances(np.cos(np.deg2rad(ANGLE_DEG)), (eta + 1j * k)[..., None])
    exact = np.stack([both["R_s"], both["R_p"]], -2)
    return exact + SIGMA * random.standard_normal(exact.shape), eta


def labelled(values: np.ndarray, **more: Any) -> Any:
    """Return R_s and R_p over pixels and angles as a DataArray."""
    import xarray

    coords = {"quantity": ["R_s", "R_p"], "angle": ("angle", ANGLE_DEG, {"units": "deg"})}
    return xarray.DataArray(values, dims=("y", "x", "quantity", "angle"), coords={**coords, **more})


def arguments(cube: Path, out: Path, *more: str) -> list[str]:
    """Return the command that fits a cube of R_s and R_p in an .npy file."""
    angles = ",".join(f"{a!r}" for a in ANGLE_DEG.tolist())
    return [
        sys.executable, "-m", "fitting", "--map", str(cube), "--out", str(out), "--quiet",
        "--quantity", "R_s,R_p", "--angle-deg", angles, "--sigma", str(SIGMA), *more,
    ]  # fmt: skip


def environment(cache: Path) -> dict[str, str]:
    """Return the environment of a command whose programs are kept in a folder."""
    return {**os.environ, "XDG_CACHE_HOME": str(cache), "PYTHONPATH": str(ROOT)}


def run(command: list[str], cache: Path, **more: Any) -> subprocess.CompletedProcess[str]:
    """Run a command to its end."""
    return subprocess.run(
        command, capture_output=True, text=True, cwd=ROOT, env=environment(cache), **more
    )  # fmt: skip


def chunks(out: Path) -> dict[str, bytes]:
    """Return the bytes of all chunks of a store, by name."""
    return {str(p.relative_to(out)): p.read_bytes() for p in out.glob("*/c/**/*") if p.is_file()
            and not p.name.endswith(".partial")}  # fmt: skip
