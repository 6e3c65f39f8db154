"""What is looked at when the package is imported: the compiler, and which `fitting` there is."""

from __future__ import annotations

import importlib.util
import os
import sys
import warnings
from pathlib import Path

import jaxlib.version

# Of jaxlib 0.8.0 to 0.12.0.1 this one alone fails tests/package/test_platform.py.
_WRONG_JAXLIB = "0.10.2"
_RIGHT_FLAG = "xla_cpu_experimental_ynn_fusion_type"
_HERE = Path(__file__).resolve().parent


def warn_of_environment() -> None:
    """Warn of a compiler that makes wrong programs, and of another package named `fitting`.

    An import happens once in a process, so each warning is given once.
    """
    for text in (_wrong_programs(), _other_fitting()):
        if text:
            warnings.warn(text, stacklevel=3)


def _wrong_programs() -> str:
    """Return what is wrong with this jaxlib; "" if nothing, or if the user has set the flag."""
    if jaxlib.version.__version__ != _WRONG_JAXLIB or _RIGHT_FLAG in os.environ.get(
        "XLA_FLAGS", ""
    ):
        return ""
    return (
        f"jaxlib {_WRONG_JAXLIB} compiles wrong programs on the CPU: under jax.jit a sum of "
        "squares of matrix products over more than 16,384 points can be off by 76 % "
        "(jax-ml/jax#39103). Install another one (pip install 'jax!=0.10.2' 'jaxlib!=0.10.2'), or "
        f"set XLA_FLAGS=--{_RIGHT_FLAG}= before Python starts. To silence this warning: "
        f"warnings.filterwarnings('ignore', message='jaxlib {_WRONG_JAXLIB}')."
    )


def _other_fitting() -> str:
    """Return which file `import fitting` would run, if it is not the package beside this one.

    A script or module fitting.py of the user's own hides the package, and another distribution
    with a package of that name may have replaced it.
    """
    ours = _HERE.parent / "fitting" / "__init__.py"
    if not ours.with_name("py.typed").is_file():
        return ""  # fresnel_jax alone
    try:
        spec = importlib.util.find_spec("fitting")
    except ValueError:  # a module that somebody has put into sys.modules by hand
        spec = None
    if spec is None:
        file = getattr(sys.modules.get("fitting"), "__file__", None)
    else:
        file = spec.origin
    if file is None or (Path(file).resolve() == ours and "fit_residuals" in ours.read_text()):
        return ""
    return (
        f"import fitting gives {file}, not the package fitting of fresnel-jax in {ours.parent}. "
        "To fit with the latter rename that file if it is yours, or run Python with -P and without "
        "its folder on PYTHONPATH; if another distribution brought it, install that one in an "
        "environment of its own and fresnel-jax again. To silence this warning: "
        "warnings.filterwarnings('ignore', message='import fitting')."
    )
