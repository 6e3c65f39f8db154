"""What a `Fit` says of its fitted parameters, as arrays and texts for assertions."""

import numpy as np

from fitting import Fit
from fitting.results.result_parts import ErrorModel, Estimate
from fitting.samples.sample import Sample


def of(fit, field):
    """A field of every fitted parameter, in the order of `Fit.names`."""
    return [getattr(fit.parameters[name], field) for name in fit.names]


def values(fit):
    return np.array(of(fit, "value"))


def sigmas(fit):
    return np.array(of(fit, "sigma"))


def intervals(fit):
    return np.array(of(fit, "interval"))


def kinds(fit):
    return tuple(of(fit, "interval_kind"))


def limits(fit):
    return np.array(of(fit, "upper_limit"))


def bounds(fit):
    """ "", "low" or "high" for each fitted parameter."""
    short = {"at lower bound": "low", "at upper bound": "high"}
    return tuple(short.get(status, "") for status in of(fit, "status"))


def fixed(fit):
    return {name: e.value for name, e in fit.parameters.items() if not e.free}


def correlation(fit):
    """Of eta and k, of each fit of a batch."""
    return fit.correlation[..., 0, 1]


def at_zero(fit):
    """Where the best k is 0."""
    return np.asarray(fit.parameters["k"].status) == "at lower bound"


def texts(fit):
    return [w.text for w in fit.warnings]


def codes(fit):
    return [w.code for w in fit.warnings]


def second(fit):
    """eta, k and the rise of chi2 of the second solution of each fit of a batch; NaN for none."""
    if not fit.others:
        return (np.full(fit.shape, np.nan),) * 3
    other = fit.others[0]
    return other.parameters["eta"].value, other.parameters["k"].value, other.delta_chi2


def outcome(size, bic, status="converged", error=1e-3, data=None):
    """A fit with that many parameters and that BIC, for the tests of how candidates compare."""
    known = Estimate(
        name="", value=1.0, sigma=0.1, interval=np.zeros(2), interval_kind="quadratic"
    )  # fmt: skip
    return Fit(
        sample=Sample.parse("constant"), parameters=dict.fromkeys("abcdefgh"[:size], known),
        covariance=np.eye(size), wavelength_um=0.5, chi2=1.0, chi2_reduced=(error / 1e-3) ** 2,
        dof=100, n_data=100 + size, rms=error, status=status, bic=bic,
        errors=ErrorModel("scaled", 1.0, 0.0, True), measurement=data,
    )  # fmt: skip
