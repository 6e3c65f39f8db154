"""Settings of the command line before jax is used: float64, the CPU, a cache of programs."""

from __future__ import annotations

import glob
import os
import re
import warnings
from pathlib import Path
from typing import Any


def cache_folder(programs: str | Path | None = None) -> Path | None:
    """Return the folder for compiled programs, created if needed; None if there can be none.

    Programs are run from there, so it must belong to the user, and others may not write to it; nor
    enter it from now on, since where the umask is 002 jax makes files that the group may write.
    XDG_CACHE_HOME is used if it is an absolute path, as in the XDG Base Directory Specification.
    """
    try:
        if programs is None:
            base = os.environ.get("XDG_CACHE_HOME", "")
            base = Path(base) if os.path.isabs(base) else Path.home() / ".cache"
            folders = [base / "fresnel-fit", base / "fresnel-fit" / "jax"]
        else:
            folders = [Path(programs).absolute()]
        for folder in folders:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            status = folder.stat()
            if hasattr(os, "getuid") and (status.st_uid != os.getuid() or status.st_mode & 0o022):
                return None
        folders[-1].chmod(0o700)
        return folders[-1] if os.access(folders[-1], os.W_OK) else None
    except (OSError, RuntimeError):  # RuntimeError: no home folder
        return None


def cache_programs(folder: str | Path | None = None) -> Path | None:
    """Keep compiled programs on disk, so that the next process loads instead of compiling them.

        import fitting

        fitting.cache_programs()  # before jax's first computation

    A process whose programs lie on disk from an earlier one took 0.5 to 0.6 of the processor time
    for the fit of a film, imports and tracing included (docs/versions.md). The programs of
    everything that jax compiles in this process are kept. The command ``fresnel-fit`` does the same
    by itself.

    Programs are run from the folder: it must belong to the user and must not be writable by others,
    and is made private to the user (mode 700). An entry that is damaged is removed and compiled
    again, without a message. With jax 0.9 and 0.10 XLA writes lines "Target machine feature ... is
    not supported" on some Intel processors, although it loads the program; TF_CPP_MIN_LOG_LEVEL=3
    in the environment silences them.

    Args:
        folder: where; created if needed. None: fresnel-fit/jax in XDG_CACHE_HOME or ~/.cache.

    Returns:
        The folder, or None, with a warning, if no folder can be used. If the environment variable
        JAX_COMPILATION_CACHE_DIR is set, jax keeps programs there, and that folder is returned.
    """
    programs = _use_cache(folder)
    if programs is None:
        warnings.warn(
            f"compiled programs are not kept: {folder or 'the cache folder of the user'} cannot be "
            "created or written, or belongs to or can be changed by somebody else. Name another "
            "folder: cache_programs(folder), or XDG_CACHE_HOME.",
            stacklevel=2,
        )
    return programs


def _use_cache(folder: str | Path | None) -> Path | None:
    """Do what `cache_programs` promises, but for its warning: the command does without a cache."""
    if given := os.environ.get("JAX_COMPILATION_CACHE_DIR"):
        return Path(given)
    programs = cache_folder(folder)
    if programs is not None:
        import jax

        jax.config.update("jax_compilation_cache_dir", str(programs))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
        jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
        _mend_cache(programs)
    return programs


def _mend_cache(programs: Path) -> None:
    """Remove an entry that jax cannot read, without a message; jax would not replace it.

    jax names the program in a warning and compiles it; it writes the new one if there is no file.
    An entry for another processor would be refused in every run: that is said, once.
    """
    tell = warnings.showwarning
    refused = False

    def show(message: Warning | str, *rest: Any, **more: Any) -> None:
        nonlocal refused
        text = str(message)
        if "persistent compilation cache" not in text:
            tell(message, *rest, **more)
        elif damaged := re.search(r"Error reading .* entry for '([^']+)'", text):
            for file in programs.glob(glob.escape(damaged[1]) + "-*"):
                file.unlink(missing_ok=True)
            if "achine" in text and not refused:  # "Machine type used for XLA:CPU compilation ..."
                refused = True
                tell(UserWarning(_REFUSED.format(programs)), *rest, **more)

    warnings.showwarning = show
    warnings.filterwarnings("always", message=".*persistent compilation cache.*")


_REFUSED = (
    "XLA refuses to load the compiled programs in {} on this processor, so they are compiled "
    "again (jax-ml/jax#38445). If that is so in every run, install jax 0.11 or newer "
    "(Python 3.12 or newer); if several machines share the folder, give each its own by "
    "XDG_CACHE_HOME."
)


def set_up_jax() -> None:
    """Turn on float64 and the compile cache, on the CPU (unless JAX_PLATFORMS says otherwise)."""
    import jax

    jax.config.update("jax_enable_x64", True)
    if not os.environ.get("JAX_PLATFORMS"):
        jax.config.update("jax_platforms", "cpu")
    try:
        jax.devices()
    except RuntimeError as error:
        raise ValueError(
            f"JAX_PLATFORMS={os.environ.get('JAX_PLATFORMS')}: jax cannot use it "
            f"({' '.join(str(error).split())}). Unset it, or set it to cpu."
        ) from error
    _use_cache(None)
