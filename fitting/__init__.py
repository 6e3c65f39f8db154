"""From measured curves to a complex index of refraction, and the thickness of films, with errors.

m = read_csv("gold.csv")
found = fit(m)                       # one bare surface, eta and k at every wavelength
print(found)
found = fit(m, "air | cauchy 3 mm thick | air", free="scale")
found = choose(m).fit                # the simplest model that describes the data
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .batches import fit_many as fit_many
    from .choice.selection import choose as choose
    from .data.errors import MeasurementError as MeasurementError
    from .data.measurement import Measurement as Measurement
    from .fit_result import Fit as Fit
    from .fits import fit as fit
    from .maps.map_fit import fit_map as fit_map
    from .maps.map_page import plot_map as plot_map
    from .measured_file import read_csv as read_csv
    from .own_residuals import fit_residuals as fit_residuals
    from .posterior import log_density as log_density
    from .predictions import simulate as simulate
    from .process.start_up import cache_programs as cache_programs
    from .samples.dispersion import model_names as model_names
    from .samples.sample import Sample as Sample

# The command line answers --help and refuses bad files without waiting 0.4 s for jax, so each name
# is imported when it is first used.
_HOME = {
    "Fit": "fit_result",
    "Measurement": "data.measurement",
    "MeasurementError": "data.errors",
    "Sample": "samples.sample",
    "cache_programs": "process.start_up",
    "choose": "choice.selection",
    "fit": "fits",
    "fit_many": "batches",
    "fit_map": "maps.map_fit",
    "fit_residuals": "own_residuals",
    "log_density": "posterior",
    "model_names": "samples.dispersion",
    "plot_map": "maps.map_page",
    "read_csv": "measured_file",
    "simulate": "predictions",
}

__all__ = sorted(_HOME)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        metadata = importlib.import_module("importlib.metadata")
        try:
            return metadata.version("fresnel-jax")
        except metadata.PackageNotFoundError:
            return "(not installed)"
    if name in _HOME:
        return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)
    try:
        return importlib.import_module(f"{__name__}.{name}")
    except ModuleNotFoundError as error:
        if error.name != f"{__name__}.{name}":
            raise
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}") from None


def __dir__() -> list[str]:
    return sorted({*_HOME, "__version__", "__all__", "__doc__", "__file__", "__name__", "__path__"})
