"""Compiled programs that outlive the process, for the command line's second start.

jax keeps what XLA compiled (its persistent compile cache), but a process still traces and lowers
a program before it can look there, and imports whatever the tracing needs. Here the executable is
kept whole, found by the shapes of its arguments. Nothing is written before `use_folder` says where.
"""

from __future__ import annotations

import functools
import hashlib
import os
import pickle
import platform
import sys
import threading
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jaxlib.version
import numpy as np

# A handful of shapes serves nearly every file (angles are rounded up to 16, 32, 64, ...).
MOST_FILES = 64
_PACKAGES = ("fitting", "fresnel_jax")

_folder: Path | None = None


def _cpu() -> str:
    """Return what the machine code depends on; a home folder may be shared by several machines."""
    try:
        with open("/proc/cpuinfo", encoding="ascii", errors="replace") as file:
            lines = [line for line in file if line.startswith(("model name", "flags", "Features"))]
        return "".join(sorted(set(lines)))
    except OSError:
        return platform.processor()


@functools.cache
def _build() -> str:
    """Return a digest of all that a program is made from beside its arguments."""
    digest = hashlib.sha256()
    parts = [sys.version, jax.__version__, jaxlib.version.__version__, platform.machine(), _cpu()]
    parts.append(os.environ.get("XLA_FLAGS", ""))
    root = Path(__file__).resolve().parent.parent
    for package in _PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            parts += [path.name, hashlib.sha256(path.read_bytes()).hexdigest()]
    for part in parts:
        digest.update(part.encode() + b"\0")
    return digest.hexdigest()


def use_folder(folder: Path | None) -> None:
    """Keep executables in ``folder`` from now on; None keeps none. It must be the user's own.

    An executable is machine code: whoever can write to the folder can run programs as its reader.
    """
    global _folder
    _folder = folder


def _described(argument: Any) -> str | None:
    """Return shapes and dtypes of arrays in tuples; None where one is not a plain NumPy value."""
    if isinstance(argument, tuple):
        parts = [_described(a) for a in argument]
        return None if None in parts else f"({' '.join(map(str, parts))})"
    if isinstance(argument, np.ndarray | np.generic):
        return f"{argument.dtype.str}{argument.shape}"
    return None


def _load(path: Path) -> Callable[..., Any] | None:
    from jax.experimental import serialize_executable

    try:
        return serialize_executable.deserialize_and_load(
            *pickle.loads(zlib.decompress(path.read_bytes()))
        )
    except FileNotFoundError:
        return None
    except Exception:  # of whatever kind: a file that cannot be used is replaced
        return None


def _save(path: Path, compiled: Any) -> None:
    from jax.experimental import serialize_executable

    try:
        data = zlib.compress(pickle.dumps(serialize_executable.serialize(compiled)), 1)
        temporary = path.with_suffix(f".{os.getpid()}")
        temporary.write_bytes(data)
        os.replace(temporary, path)
        files = sorted(path.parent.glob("*.xla"), key=lambda p: p.stat().st_mtime)
        for old in files[:-MOST_FILES]:
            old.unlink(missing_ok=True)
    except Exception:  # a full disk, say; the answer does not depend on it
        return


def stored(function: Callable[..., Any], program: Callable[[], Any]) -> Callable[..., Any]:
    """Return ``program()``, which is ``jax.jit(function)``, with executables kept on disk.

    They are kept in the folder of `use_folder`. ``program`` is called when there is something to
    trace. Arguments by position are arrays, static ones come by name. With no folder, or with
    arguments that are not NumPy values (tracers, say), this is ``program()`` and nothing else.
    """
    loaded: dict[str, Callable[..., Any]] = {}
    lock = threading.Lock()

    @functools.wraps(function)
    def call(*arguments: Any, **static: Any) -> Any:
        described = None if _folder is None else _described(arguments)
        if _folder is None or described is None:
            return program()(*arguments, **static)
        precision = jax.dtypes.canonicalize_dtype(np.float64)  # as jax_enable_x64 is just now
        key = f"{function.__qualname__} {described} {sorted(static.items())} {precision}"
        with lock:  # threads that ask for the same program wait for one compilation
            if key not in loaded:
                name = hashlib.sha256(f"{_build()} {key}".encode()).hexdigest()[:32]
                path = _folder / f"{name}.xla"
                found = _load(path)
                if found is None:
                    found = program().lower(*arguments, **static).compile()
                    _save(path, found)
                loaded[key] = found
        return loaded[key](*arguments)

    return call
