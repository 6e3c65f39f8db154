"""Fitted indices that are hardly those of a material: a pseudo-index, and implausible ones.

The pseudo-index: eta and k from psi and Delta if nothing is known of the surface.

    <n> + i <k> = sin(theta) sqrt(1 + tan^2(theta) [(1 - rho) / (1 + rho)]^2)

is the index of one bare, smooth boundary with this psi and Delta at one angle (R. M. A. Azzam and
N. M. Bashara, Ellipsometry and Polarized Light, 1977, section 4.2). For a surface with a film it is
not the index of a material, and may even need a k below 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fitting.data.quantities import ANGLES
from fitting.optics.observe import medium_index
from fitting.optics.spec import NCS
from fitting.problem.problem import Problem
from fitting.problem.unknowns import Unknowns
from fitting.process.compiled import fit_settings
from fitting.results.diagnostics import Finding, Warning
from fitting.results.result import FitData
from fitting.samples.dispersion import CAUCHY_NAMES, Model
from fitting.searching.film_starts import film_index, films_of
from fitting.uncertainty.covariance import End

# N, C, S of a bare crystal are fitted within .003 (the errors of an ellipsometer), with the wrong
# sign of Delta within .009, and those of 100 nm of hafnia on silica within .2, in measured files.
MISSED = 0.006
# At one angle there are as many data as unknowns, so that the fit is exact, except at the bound
# k = 0: by chance chi2 exceeds this there in one of a thousand.
MISSED_CHI2 = 10.8


def notes_on(found: FitData) -> tuple[tuple[Warning, ...], tuple[Finding, ...]]:
    """Return the notes and findings on a pseudo-index of each wavelength; none on other fits."""
    sample, m = found.sample, found.measurement
    bare = sample is not None and sample.bare and sample.by_wavelength
    if not bare or m is None or not np.isin(m.quantity, ANGLES).any():
        return (), ()
    wavelengths, chi2, dof = map(np.atleast_1d, (found.wavelength_um, found.chi2, found.dof))
    missed = np.nan_to_num(np.atleast_1d(found.rms_of.get(NCS, 0.0)))
    # No bare boundary has psi and Delta there. chi2 is NaN without stated errors.
    off = (missed > MISSED) | ((dof == 0) & (chi2 > MISSED_CHI2))
    # With a misfit, k at its lower end would continue below 0.
    stuck = (np.asarray(found.k) == 0.0) & off
    out = [Warning("pseudo_index", {}, {"missed": bool(off.any())})]
    for hit, cause in ((stuck, "k_negative"), (off & ~stuck, "film")):
        if hit.any():
            at = wavelengths[hit]
            out.append(Warning("pseudo_index_misfit", {}, {
                "cause": cause, "count": int(hit.sum()), "of": len(hit),
                "range_um": (float(at.min()), float(at.max())),
                "misfit": float(missed[hit].max()), "delta": "delta" in m.quantity,
            }))  # fmt: skip
    told = {f.code: np.atleast_1d(f.at) for f in found.findings}
    new = off & ~told.get("does_not_describe", np.zeros(len(off), bool))
    if not new.any():
        return tuple(out), ()
    values = {"rms": found.rms, "sample": "one bare surface", "noise": np.nan}
    return tuple(out), (Finding("does_not_describe", new.reshape(found.shape), values),)


# The rise of eta with the logarithm of the wavelength from which on it is told, if it is more than
# so many standard errors.
_LEAST, _ERRORS = 1e-3, 3.0
# Of compact solids that transmit light an amorphous fluoropolymer has the lowest index, 1.29.
# Porous layers have lower ones; so have metals, which absorb more than that.
_LOW_ETA, _LOW_K = 1.25, 0.1


CONSTANT = Model("constant", 1)
# An index that rises over the spectrum by more than this is none of a material that is clear there,
# and none of these has a higher one.
_RISE, _CLEAR, _HIGHEST = 0.02, 1e-3, 6.0


def index_at(fit: Problem, medium: int, y: np.ndarray, wavelength_um: np.ndarray) -> Any:
    """Return eta and k (W, L) of a medium at wavelengths (W,) and unknowns y (L, p)."""
    u, size = fit.u, len(y)
    values = u.spec.numbers(y.T, u.held)
    if u.spec.media.index[medium] == CONSTANT:  # without a program
        own = (values[f"{u.spec.media.places[medium]}.{part}"] for part in ("eta", "k"))
        return tuple(np.broadcast_to(x, (len(wavelength_um), size)) for x in own)
    lanes: Any = {n: np.broadcast_to(x, size) for n, x in values.items()}
    with fit_settings():
        return tuple(map(np.asarray, medium_index(u.spec, medium, lanes, wavelength_um[:, None])))


def of_solids(fit: Problem, y: np.ndarray) -> np.ndarray:
    """Return whether all fitted indices at y (L, p) can be those of solids, where measured.

    That is from 1.25 (see `_low`) to 6 (lead telluride) where little absorbs, without a rise with
    the wavelength where nothing does (see `_rising`). A film on a substrate of index m reflects
    along the normal as one of index m / eta does: 1.39 on glass as 1.09.
    """
    u, waves = fit.u, np.unique(fit.seen.points.wavelength_um[fit.seen.measured, 0])
    out = np.ones(len(y), bool)
    for i, (place, model) in enumerate(zip(u.spec.media.places, u.spec.media.index, strict=True)):
        fitted = any(n.startswith(f"{place}.") and "thickness" not in n for n in u.spec.moving)
        if not isinstance(model, Model) or not fitted:
            continue
        eta, k = index_at(fit, i, y, waves)
        clear = np.maximum(k[1:], k[:-1]) < _CLEAR
        rise = np.where(clear, np.maximum(np.diff(eta, axis=0), 0.0), 0.0).sum(0)
        out &= (rise <= _RISE) & ((k >= _LOW_K) | ((eta >= _LOW_ETA) & (eta <= _HIGHEST))).all(0)
    return out


def implausible_indices(
    fit: Problem, end: End, wavelength_um: np.ndarray
) -> dict[str, dict[str, Any]]:
    """Return the findings on such indices, their values by code."""
    out: dict[str, dict[str, Any]] = {}
    if rising := _rising(fit.u, end, wavelength_um):
        out["rising_index"] = {"indices": rising}
    if low := _low(fit, end):
        first = tuple(name for name, _ in low.values())
        most = max(eta for _, eta in low.values())
        out["low_index"] = {"indices": tuple(low), "most": most, "first": first}
    return out


def _rising(u: Unknowns, end: End, wavelength_um: np.ndarray) -> tuple[str, ...]:
    """Return which eta rise with the wavelength somewhere in the data, as parameters are named.

    Source: the Kramers-Kronig relations; L. D. Landau and E. M. Lifshitz, Electrodynamics of
    Continuous Media, sec. 84: where nothing is absorbed, the permittivity rises with the frequency.
    """
    values = u.spec.numbers(end.y, u.held)
    covariance = np.nan_to_num(end.known.covariance)
    out = []
    for place, model in zip(u.spec.media.places, u.spec.media.index, strict=True):
        if not isinstance(model, Model) or model.name != "cauchy":
            continue
        rise, slopes = np.zeros(len(wavelength_um)), np.zeros((len(wavelength_um), len(end.y)))
        for j, letter in enumerate(CAUCHY_NAMES[: model.terms]):
            name, by = f"{place}.{letter}", -2 * j * wavelength_um ** (-2.0 * j)
            rise += by * values[name]
            if name in u.spec.moving:
                slopes[:, u.spec.moving.index(name)] = by
        sigma = np.sqrt(np.maximum(np.einsum("wi,ij,wj->w", slopes, covariance, slopes), 0.0))
        if (rise > np.maximum(_ERRORS * sigma, _LEAST)).any():
            out.append(f"{u.labels[f'{place}.A'].removesuffix('A')}eta")
    return tuple(out)


def _low(fit: Problem, end: End) -> dict[str, tuple[str, float]]:
    """Return the transparent films of low index, by the names of their eta.

    Of each the name of the first parameter of its index, and the highest eta.

    A thick film of low index reflects like a thin one of higher index, but for weak fringes. 22 nm
    of eta 1.4 on silicon ended as 73 nm of eta 1.05, within the noise.
    """
    out = {}
    for film in films_of(fit.u.spec, fit.u.moving):
        place = fit.u.spec.media.places[film.medium]
        acting = [n for n in fit.u.spec.moving if n.startswith(f"{place}.") and "thick" not in n]
        eta, k = film_index(fit, film, end.y[:, None])[:, fit.seen.measured]
        if acting and eta.max() < _LOW_ETA and k.max() < _LOW_K:
            name = fit.u.labels[f"{place}.thickness_nm"].removesuffix("thickness_nm")
            out[f"{name}eta"] = fit.u.labels[acting[0]], float(eta.max())
    return out
