"""``python -m fitting FILE``, the same as ``fresnel-fit FILE``."""

import contextlib
import os
import sys
import warnings
from typing import NoReturn

from fitting.cli import PROGRAM, main
from fitting.interrupt import INTERRUPTED, end_on_interrupt

DEFECT, NO_MEMORY = 70, 71  # as sysexits.h numbers an internal software error and a system's


def _say(text: str) -> None:
    with contextlib.suppress(OSError):  # stderr may be full or closed as well
        print(text, file=sys.stderr)


def _status() -> int:
    try:
        return main()
    except SystemExit as end:  # argparse
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except OSError as error:  # a stream that argparse writes to
        _say(f"{PROGRAM}: {error.strerror or error}")
        return 2
    except KeyboardInterrupt:  # before or behind what `main` hears
        return INTERRUPTED
    except BaseException as error:
        if isinstance(error, MemoryError) or "RESOURCE_EXHAUSTED" in str(error):
            _say(f"{PROGRAM}: there is not enough memory for this many data.")
            return NO_MEMORY
        import traceback

        _say(traceback.format_exc())
        _say(f"{PROGRAM}: this is a defect of the program. Please report it with the lines above.")
        return DEFECT


def run() -> NoReturn:
    """Run the command and end the process, whose files are written and closed by then.

    At once: taking jax apart, object by object, would cost 0.35 s after the answer is there.
    """
    end_on_interrupt()
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by who started the command
            setattr(sys, name, open(os.devnull, "r" if name == "stdin" else "w"))  # noqa: SIM115
    warnings.showwarning = lambda message, *_, **__: _say(f"{PROGRAM}: {message}")
    # Pictures go to files; a backend for windows, which may not exist here, is of no use.
    os.environ.pop("MPLBACKEND", None)
    status = _status()
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:  # a full disk, or a reader that has gone
            status = status or 2
    os._exit(status)


if __name__ == "__main__":
    run()
