"""What the command line arranges before jax is used: float64, the CPU, programs kept on disk."""

from __future__ import annotations

import contextlib
import gc
import os
from collections.abc import Iterator
from pathlib import Path

FOLDER = "fresnel-fit"


def cache_folder() -> Path | None:
    """Return the folder for compiled programs, made if need be; None where there can be none."""
    try:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        folder = base / FOLDER
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        # Programs are run from here, so it must be the user's own and nobody else's to write to.
        if hasattr(os, "getuid"):
            status = folder.stat()
            if status.st_uid != os.getuid() or status.st_mode & 0o022:
                return None
        return folder if os.access(folder, os.W_OK) else None
    except (OSError, RuntimeError):  # RuntimeError: no home folder
        return None


def set_up_jax() -> None:
    """Turn on float64 and the compile cache, on the CPU (unless JAX_PLATFORMS says otherwise)."""
    import jax

    jax.config.update("jax_enable_x64", True)
    # Where in the source each operation came from is of no use here, and costs 0.02 s to write.
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
        jax.config.update("jax_compilation_cache_dir", str(folder / "jax"))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
        jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


@contextlib.contextmanager
def cheap_start() -> Iterator[None]:
    """Leave cyclic garbage alone meanwhile: looking for it in what jax imports costs 0.05 s."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
