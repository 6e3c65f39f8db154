"""From a measured reflectance curve to a complex index of refraction with an error bar."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .bare_surface.curves import curve as curve
    from .bare_surface.curves import fitted_values as fitted_values
    from .bare_surface.solution import FitResult as FitResult
    from .bare_surface.solution import fit as fit
    from .bare_surface.solution import fit_many as fit_many
    from .measurement import Measurement as Measurement
    from .measurement import MeasurementError as MeasurementError
    from .measurement import read_csv as read_csv
    from .model.fit import fit_model as fit_model
    from .model.fit import model_names as model_names
    from .model.fit import predict as predict
    from .model.points import PointFits as PointFits
    from .model.points import fit_points as fit_points
    from .model.result import ModelFit as ModelFit
    from .selection import choose as choose

# The command line answers --help and refuses bad files without waiting 0.4 s for jax, so each name
# is imported when it is first used.
_HOME = {
    "FitResult": "bare_surface.solution",
    "Measurement": "measurement",
    "MeasurementError": "measurement",
    "ModelFit": "model.result",
    "PointFits": "model.points",
    "choose": "selection",
    "curve": "bare_surface.curves",
    "fit": "bare_surface.solution",
    "fit_many": "bare_surface.solution",
    "fit_model": "model.fit",
    "fit_points": "model.points",
    "fitted_values": "bare_surface.curves",
    "model_names": "model.fit",
    "predict": "model.fit",
    "read_csv": "measurement",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(_HOME)
