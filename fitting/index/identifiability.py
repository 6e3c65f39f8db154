"""What the data do not determine: one bit per finding, and the sentence that says it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from fitting.index.result import FitResult
    from fitting.pattern import Pooled

CIRCLE = 1
AT_45_DEGREES = 2
COMBINATION = 4
K_BELOW_FLOOR = 8
SECOND_SOLUTION = 16
CORRELATED = 32
VAGUE = 64
CHI2_LARGE = 128
CHI2_SMALL = 256
FLAT_CURVE = 512
NO_DEGREES = 1024
NOT_CONVERGED = 2048
OUT_OF_MODEL = 4096
PERFECT_MIRROR = 8192
NO_REFLECTION = 16384
NOT_NOISE = 32768

CORRELATION_LIMIT = 0.995
VAGUE_LIMIT = 0.1
# Two standard errors reach 0: nothing is known but an order of magnitude, and the quadratic model
# behind the standard error no longer holds.
UNDETERMINED_LIMIT = 0.5
# Change of x = log[(1 + |N|^2) / 2n] along what the data do not see, over the whole range of k.
CIRCLE_LIMIT = 0.1
FLAT_BELOW_DEG = 30.0
# R(0) within 2 exp(-x) = 2.5e-4 of 1: no plain metal reflects so well, or shows it if it does.
MIRROR_LIMIT = 9.0
# exp(x) - 1 = |N - 1|^2 / 2n: R(0) below 5e-17, less than the rounding of any datum.
NOTHING_LIMIT = 1e-16


def chi2_flags(chi2_reduced: np.ndarray, dof: np.ndarray) -> np.ndarray:
    """Return CHI2_LARGE or CHI2_SMALL where chi2 / dof is off 1 by 5 of its errors and by half."""
    with np.errstate(all="ignore"):
        error = np.sqrt(2.0 / dof)
        large = (chi2_reduced > 1.0 + 5.0 * error) & (chi2_reduced > 1.5)
        # The law is skew: 5 errors below 1 lies below 0 for fewer than 50 degrees of freedom.
        small = (chi2_reduced < 1.0 / (1.0 + 5.0 * error)) & (chi2_reduced < 1.0 / 1.5)
    return np.where(large, CHI2_LARGE, 0) | np.where(small, CHI2_SMALL, 0)


def _number(value: float) -> str:
    return f"{value:.4g}"


def _circle(r: FitResult) -> str:
    m = r.eta_i
    a = (m * m + r.eta**2 + r.k**2) / (2.0 * r.eta)
    return (
        "eta and k are not determined separately: the data fix only the circle "
        f"(eta - {_number(a)})^2 + k^2 = {_number(a * a - m * m)}. {_member(r)}"
    )


def _member(r: FitResult) -> str:
    del r
    return (
        "The values shown are the best fit, one of many that fit alike; the 95 % intervals are "
        "what the data leave."
    )


def _mirror(r: FitResult) -> str:
    said = "the data are those of a perfect mirror, or of one as good within their noise"
    if not r.least_reflectance > 0.0:
        return said + ": they do not determine eta and k."
    return (
        f"{said}: every index with the same reflectance at normal incidence fits as well. That is "
        f"at least {r.least_reflectance:.4f} (95 %); nothing else is known of eta and k."
    )


def _no_reflection(r: FitResult) -> str:
    return (
        "the data show no reflection, as of no boundary at all: eta is that of the medium outside "
        f"({_number(r.eta_i)}) and k is 0. R grows as (eta - {_number(r.eta_i)})^2 + k^2 there, so "
        "that intervals, and no standard errors, tell how certain that is."
    )


def _combination(r: FitResult) -> str:
    eigenvalues, vectors = np.linalg.eigh(np.nan_to_num(r.information))
    if not np.abs(eigenvalues).max() > 0.0:
        return "the data say nothing about eta and k."
    along_eta, along_u = vectors[:, int(np.argmin(eigenvalues))]
    slope = f" (it trades a change of eta by 1 for one of k^2 by {_number(along_u / along_eta)})"
    return (
        "eta and k are not determined separately: the data fix only one combination of them"
        f"{slope if along_eta else ''}. {_member(r)}"
    )


def _at_45(r: FitResult) -> str:
    return (
        "eta and k are not determined separately: at 45 degrees R_p = R_s^2 for every material, so "
        f"that the two say the same. Measure at one more angle. {_member(r)}"
    )


def _floor(r: FitResult) -> str:
    said = f"k is below what these data can show: k < {_number(r.k_upper_limit)} (95 %)."
    # In total reflection R falls in proportion to k.
    return said if r.eta < r.eta_i else said + " External reflectance depends on k^2 there."


def _second(r: FitResult) -> str:
    return (
        f"a second solution fits nearly as well: eta {_number(r.alternative_eta)}, "
        f"k {_number(r.alternative_k)} (chi2 higher by {r.alternative_delta_chi2:.2g})."
    )


def _correlated(r: FitResult) -> str:
    return (
        f"eta and k are strongly correlated ({r.correlation:+.4f}): their combination is known far "
        "better than either."
    )


def _vague(r: FitResult) -> str:
    share = 100.0 * r.sigma_eta / r.eta
    return f"eta is poorly determined: its standard error is {share:.2g} % of it."


def _chi2_large(r: FitResult) -> str:
    factor = np.sqrt(r.chi2_reduced)
    then = (
        "the errors of eta and k are scaled up by that factor"
        if r.sigma_kind == "scaled"
        else "yet they are taken as absolute, so that the errors of eta and k are too small"
    )
    return (
        f"reduced chi2 is {_number(r.chi2_reduced)}: the residuals are {factor:.2g} times the "
        f"stated errors, which are too small or miss a systematic error; {then}."
    )


def _chi2_small(r: FitResult) -> str:
    factor = np.sqrt(r.chi2_reduced)
    then = "; the errors of eta and k are scaled down by that" if r.sigma_kind == "scaled" else ""
    if then and int(r.flags) & NOT_NOISE:
        then = ". The residuals are in order: the errors of eta and k are not scaled down"
    return (
        f"reduced chi2 is {_number(r.chi2_reduced)}: the residuals are only {factor:.2g} times the "
        f"stated errors, which look too large{then}."
    )


def _flat(r: FitResult) -> str:
    return (
        f"all data are one kind of reflectance below {FLAT_BELOW_DEG:.0f} degrees, where the curve "
        "is nearly flat: eta and k rest on its faint slope; a small systematic error moves both."
    )


def _no_degrees(r: FitResult) -> str:
    known = "as stated and unchecked" if np.isfinite(r.sigma_eta) else "unknown"
    return (
        f"{r.n_data} data for two unknowns leave nothing to test the fit; its errors are {known}."
    )


def _not_converged(r: FitResult) -> str:
    return f"the fit did not converge in {r.iterations} evaluations; its values mean nothing."


def _out_of_model(r: FitResult) -> str:
    noise = ""
    if np.isfinite(r.neighbour_noise) and r.neighbour_noise > 0.0:
        noise = (
            f", {r.rms / r.neighbour_noise:.2g} times the noise that neighbouring points show "
            f"({_number(r.neighbour_noise)})"
        )
    return (
        f"the fitted curve misses the data by {r.rms:.2g} (rms){noise}: a single bare interface "
        "does not describe them."
    )


def _not_noise(r: FitResult) -> str:
    if r.sigma_kind == "scaled":
        then = "the errors of eta and k are enlarged for it, yet a systematic error may be larger"
    else:
        then = "the errors of eta and k are too small"
    return (
        "what the fit leaves of the data is not noise: its neighbours along the angle are alike "
        f"(correlation {r.residual_correlation:.2f}). One index does not describe the data, or "
        f"they drift; {then}."
    )


def pooled_sentence(p: Pooled) -> str:
    """Return the sentence on residuals that all wavelengths share."""
    return (
        f"the residuals of all wavelengths share a pattern along the angle (probability by chance "
        f"{p.probability:.1g}): the mean of {p.quantity} at {p.angle_deg:g} degrees is "
        f"{p.mean:+.2g} standard errors off. One index does not describe the data, or the angles "
        "or intensities are off."
    )


_SENTENCES = {
    NOT_CONVERGED: _not_converged,
    PERFECT_MIRROR: _mirror,
    NO_REFLECTION: _no_reflection,
    CIRCLE: _circle,
    AT_45_DEGREES: _at_45,
    COMBINATION: _combination,
    SECOND_SOLUTION: _second,
    OUT_OF_MODEL: _out_of_model,
    NOT_NOISE: _not_noise,
    K_BELOW_FLOOR: _floor,
    VAGUE: _vague,
    CORRELATED: _correlated,
    CHI2_LARGE: _chi2_large,
    CHI2_SMALL: _chi2_small,
    FLAT_CURVE: _flat,
    NO_DEGREES: _no_degrees,
}


def sentences(r: FitResult) -> tuple[str, ...]:
    """Return what the flags of the result of one curve say, the gravest first."""
    return tuple(say(r) for bit, say in _SENTENCES.items() if int(r.flags) & bit)
