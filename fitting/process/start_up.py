"""Settings of the command line before jax is used: float64, the CPU, a cache of programs."""

from __future__ import annotations

import contextlib
import gc
import glob
import os
import re
import stat
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

FOLDER = "fresnel-fit"


def _foreign(status: os.stat_result) -> bool:
    """Return whether somebody else owns a file or folder, or may write to it."""
    return hasattr(os, "getuid") and bool(status.st_uid != os.getuid() or status.st_mode & 0o022)


def cache_folder() -> Path | None:
    """Return the folder for compiled programs, created if needed; None if there can be none.

    Programs are run from there, so it, and every file in it, must belong to the user and must not
    be writable by others; other files are removed. XDG_CACHE_HOME is used if it is an absolute
    path, as in the XDG Base Directory Specification.
    """
    try:
        base = os.environ.get("XDG_CACHE_HOME", "")
        folder = (Path(base) if os.path.isabs(base) else Path.home() / ".cache") / FOLDER
        programs = folder / "jax"
        for each in (folder, programs):
            each.mkdir(mode=0o700, parents=True, exist_ok=True)
            if _foreign(each.stat()):
                return None
        with os.scandir(programs) as entries:
            for entry in entries:
                status = entry.stat(follow_symlinks=False)
                # A link, or a file of somebody else: compiling again is cheap.
                if not stat.S_ISREG(status.st_mode) or _foreign(status):
                    os.unlink(entry.path)
        return programs if os.access(programs, os.W_OK) else None
    except (OSError, RuntimeError):  # RuntimeError: no home folder
        return None


def _mend_cache(programs: Path) -> None:
    """Remove an entry that jax finds damaged, without a message; jax would not replace it.

    jax names the program in a warning and compiles it; it writes the new one if there is no file.
    """
    tell = warnings.showwarning

    def show(message: Warning | str, *rest: Any, **more: Any) -> None:
        text = str(message)
        if "persistent compilation cache" not in text:
            tell(message, *rest, **more)
        elif damaged := re.search(r"Error reading .* entry for '([^']+)'", text):
            for file in programs.glob(glob.escape(damaged[1]) + "-*"):
                file.unlink(missing_ok=True)

    warnings.showwarning = show
    warnings.filterwarnings("always", message=".*persistent compilation cache.*")


def set_up_jax() -> None:
    """Turn on float64 and the compile cache, on the CPU (unless JAX_PLATFORMS says otherwise)."""
    import jax

    jax.config.update("jax_enable_x64", True)
    # The place in the source of each operation is not needed here, and takes 0.02 s to write.
    jax.config.update("jax_traceback_in_locations_limit", 0)
    if not os.environ.get("JAX_PLATFORMS"):
        jax.config.update("jax_platforms", "cpu")
    try:
        jax.devices()
    except RuntimeError as error:
        raise ValueError(
            f"JAX_PLATFORMS={os.environ.get('JAX_PLATFORMS')}: jax cannot use it "
            f"({' '.join(str(error).split())}). Unset it, or set it to cpu."
        ) from error
    folder = cache_folder()
    if folder is not None and not os.environ.get("JAX_COMPILATION_CACHE_DIR"):
        jax.config.update("jax_compilation_cache_dir", str(folder))
        _mend_cache(folder)
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
        jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


@contextlib.contextmanager
def cheap_start() -> Iterator[None]:
    """Switch the garbage collector off meanwhile: searching what jax imports takes 0.05 s."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
