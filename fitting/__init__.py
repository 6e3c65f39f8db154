"""From a measured reflectance curve to a complex index of refraction with an error bar."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .index.curves import curve as curve
    from .index.curves import fitted_values as fitted_values
    from .index.fit import FitResult as FitResult
    from .index.fit import fit as fit
    from .index.fit import fit_many as fit_many
    from .measurement import Measurement as Measurement
    from .measurement import MeasurementError as MeasurementError
    from .measurement import read_csv as read_csv
    from .model.fit import fit_model as fit_model
    from .model.fit import model_names as model_names
    from .model.fit import predict as predict
    from .model.points import PointFits as PointFits
    from .model.points import fit_points as fit_points
    from .model.result import ModelFit as ModelFit
    from .model.select import choose as choose

# The command line answers --help and refuses bad files without waiting 0.4 s for jax, so each name
# is imported when it is first used.
_HOME = {
    "FitResult": "index.fit",
    "Measurement": "measurement",
    "MeasurementError": "measurement",
    "ModelFit": "model.result",
    "PointFits": "model.points",
    "choose": "model.select",
    "curve": "index.curves",
    "fit": "index.fit",
    "fit_many": "index.fit",
    "fit_model": "model.fit",
    "fit_points": "model.points",
    "fitted_values": "index.curves",
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
