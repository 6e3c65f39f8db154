"""From a measured reflectance curve to a complex index of refraction with an error bar."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .curves import curve as curve
    from .curves import fitted_values as fitted_values
    from .fitter import FitResult as FitResult
    from .fitter import fit as fit
    from .fitter import fit_many as fit_many
    from .measurement import Measurement as Measurement
    from .measurement import MeasurementError as MeasurementError
    from .measurement import read_csv as read_csv
    from .model_fit import fit_model as fit_model
    from .model_fit import model_names as model_names
    from .model_fit import predict as predict
    from .model_result import ModelFit as ModelFit
    from .point_fits import PointFits as PointFits
    from .point_fits import fit_points as fit_points

# The command line answers --help and refuses bad files without waiting 0.4 s for jax, so each name
# is imported when it is first used.
_HOME = {
    "FitResult": "fitter",
    "Measurement": "measurement",
    "MeasurementError": "measurement",
    "ModelFit": "model_result",
    "PointFits": "point_fits",
    "curve": "curves",
    "fit": "fitter",
    "fit_many": "fitter",
    "fit_model": "model_fit",
    "fit_points": "point_fits",
    "fitted_values": "curves",
    "model_names": "model_fit",
    "predict": "model_fit",
    "read_csv": "measurement",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(_HOME)
