"""Ctrl-C ends the command at any time.

Python raises KeyboardInterrupt between two of its own instructions. A compilation, of seconds on a
quiet machine and of a minute on a busy one, is one instruction, and so is a compiled program;
neither can be interrupted. But the number of a signal is written to a pipe at once, and a thread
reads it.
"""

from __future__ import annotations

import os
import signal
import threading
import time

INTERRUPTED = 130
# If KeyboardInterrupt has not ended the process after so many seconds, the thread ends it.
GRACE_S = 2.0


def end_on_interrupt() -> None:
    """End the process ``GRACE_S`` after the first SIGINT at the latest; for the command alone."""
    if signal.getsignal(signal.SIGINT) != signal.SIG_IGN:  # as that of a job in the background
        signal.signal(signal.SIGINT, signal.default_int_handler)
    read, write = os.pipe()
    os.set_blocking(write, False)
    signal.set_wakeup_fd(write, warn_on_full_buffer=False)

    def watch() -> None:
        while signal.SIGINT not in os.read(read, 64):
            pass
        time.sleep(GRACE_S)
        os._exit(INTERRUPTED)

    threading.Thread(target=watch, daemon=True).start()
