"""``python -m fitting FILE``, the same as ``fresnel-fit FILE``."""

import contextlib
import math
import os
import sys
import warnings
from typing import NoReturn

from fitting.command.cli import main
from fitting.command.terminal import MISUSED, complain
from fitting.process.interrupt import INTERRUPTED, end_on_interrupt

DEFECT, NO_MEMORY = 70, 71  # the numbers in sysexits.h of a software error and a system error
# With less address space than this jax aborts the process when it starts its threads: on two cores
# it did with 1.0 GB, and did not with 1.5 GB.
LEAST_BYTES = 1_500_000_000
_OUT_OF_MEMORY = ("RESOURCE_EXHAUSTED", "failed to map segment", "Cannot allocate memory")


def _limit_bytes() -> float:
    """Return how much memory the process may address; infinity where no limit is known."""
    try:
        import resource
    except ImportError:  # Windows
        return math.inf
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    return math.inf if soft == resource.RLIM_INFINITY else soft


def _status() -> int:
    if (limit := _limit_bytes()) < LEAST_BYTES:
        complain(
            f"the memory of this process is limited to {limit / 1e9:.1f} GB, and "
            f"{LEAST_BYTES / 1e9:.1f} GB are needed. Raise the limit (ulimit -v, in kB)."
        )
        return NO_MEMORY
    try:
        return main()
    except SystemExit as end:  # argparse
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except OSError as error:  # a stream that argparse writes to
        complain(error.strerror or str(error))
        return MISUSED
    except KeyboardInterrupt:  # raised before or after the part in which `main` handles it
        return INTERRUPTED
    except BaseException as error:
        if isinstance(error, MemoryError) or any(text in str(error) for text in _OUT_OF_MEMORY):
            complain("there is not enough memory for this many data.")
            return NO_MEMORY
        import traceback

        with contextlib.suppress(OSError):
            traceback.print_exc()
        complain("this is a defect of the program. Please report it with the lines above.")
        return DEFECT


def run() -> NoReturn:
    """Run the command and end the process, whose files are written and closed by then.

    It ends at once: deleting all objects of jax one by one would take 0.35 s after the result.
    """
    end_on_interrupt()
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by the program that started the command
            setattr(sys, name, open(os.devnull, "r" if name == "stdin" else "w"))  # noqa: SIM115
    warnings.showwarning = lambda message, *_, **__: complain(str(message))
    # XLA's own lines say nothing that the command does not: what fails comes as an exception. jax
    # 0.9 and 0.10 write four for each kept program on Intel processors with AVX-512. It is read
    # when jax is imported; 1 is what jax sets, and what a process that has imported it hands on.
    if os.environ.get("TF_CPP_MIN_LOG_LEVEL", "1") == "1":
        os.environ["TF_CPP_MIN_LOG_LEVEL"] = "3"
    # Pictures go to files, so no backend with windows is needed, which may not exist here.
    os.environ.pop("MPLBACKEND", None)
    status = _status()
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:  # a full disk, or a reader that has gone
            status = status or MISUSED
    os._exit(status)


if __name__ == "__main__":
    run()
