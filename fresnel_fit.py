"""Where the command fresnel-fit begins: `fitting` is taken from beside this file.

A folder on PYTHONPATH that holds a `fitting.py` of the user's own comes before installed packages,
so that a plain import would run that file. `import fitting` in Python cannot be helped
(docs/faq.md); the command can.
"""

import os
import signal
import sys
from typing import NoReturn

INTERRUPTED = 130


def run() -> NoReturn:
    """Run the command and end the process."""
    if signal.getsignal(signal.SIGINT) != signal.SIG_IGN:
        # Until `run_command` takes over: nothing is open yet, and an import would show where it was
        signal.signal(signal.SIGINT, lambda *_: os._exit(INTERRUPTED))
    import importlib.util
    from pathlib import Path

    package = Path(__file__).resolve().parent / "fitting"
    spec = importlib.util.spec_from_file_location(
        "fitting", package / "__init__.py", submodule_search_locations=[str(package)]
    )
    assert spec is not None and spec.loader is not None  # a path to a Python file has both
    module = importlib.util.module_from_spec(spec)
    sys.modules["fitting"] = module
    spec.loader.exec_module(module)

    from fitting.__main__ import run as run_command

    run_command()
