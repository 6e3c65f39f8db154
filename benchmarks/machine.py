"""What the figures of a study depend on, in one line."""

from __future__ import annotations

import datetime
import importlib.metadata
import os
import platform

PACKAGES = ("jax", "optimistix", "numpy", "scipy", "lmfit")


def cores() -> int:
    """Return how many processors this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not Linux
        return os.cpu_count() or 1


def conditions(load: float | None = None) -> str:
    """Return date, processors, load and versions.

    load: the load average before the run; that of now if None.
    """
    versions = []
    for package in PACKAGES:
        try:
            versions.append(f"{package} {importlib.metadata.version(package)}")
        except importlib.metadata.PackageNotFoundError:
            continue
    if load is None:
        load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    return (
        f"{datetime.date.today().isoformat()}; {cores()} processors "
        f"({platform.machine()}), load {load:.1f} before the run; "
        f"Python {platform.python_version()}, {', '.join(versions)}"
    )
