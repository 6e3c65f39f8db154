"""Fit a dispersion model over whole curves, angles and wavelengths at once, of one file or several.

    minimise over the parameters   sum_i loss[(model_i - value_i) / sigma_i] + priors

from many quasi-random starts, which are lanes of `solver.BatchLevenbergMarquardt` behind optimistix
(`problem`); the result says how many of them agree. Fits run in float64, whether or not the
caller has switched on jax_enable_x64.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from fitting.checks import one_number
from fitting.measurement import Measurement
from fitting.model.dispersion import Model, parse_model
from fitting.model.dispersion import model_names as model_names
from fitting.model.intervals import check_intervals
from fitting.model.multistart import start_at, usual_starts
from fitting.model.multistart import starts as start_points
from fitting.model.observations import Observations, observations
from fitting.model.outcome import model_fit_of
from fitting.model.parameters import LOG, Settings, check_settings, names_of, plain_name
from fitting.model.predictions import predict as predict
from fitting.model.problem import LOSSES, Targets
from fitting.model.result import ModelFit as ModelFit
from fitting.model.solve import Fit, solved
from fitting.model.structures import INTERFACE
from fitting.model.unknowns import Unknowns, check_quantities, spectrum_of, unknowns


def targets_of(u: Unknowns, seen: Observations, eta_i: float) -> Targets:
    """Return what the unknowns are compared with."""
    prior = np.array([w.prior[0] if w.prior else 0.0 for w in u.moving])
    weight = np.array([1.0 / w.prior[1] if w.prior else 0.0 for w in u.moving])
    return Targets(
        seen.points, seen.values, seen.weights, seen.ncs, seen.ncs_weights, np.float64(1.0),
        prior, weight, u.held, np.float64(eta_i),
    )  # fmt: skip


def check_choices(
    seen: Observations,
    loss: str,
    sigma: str,
    absolute_sigma: bool,
    eta_i: float,
    starts: int | None,
) -> None:
    """Raise ValueError for an option that is none, or asks for errors that are not stated."""
    if loss not in LOSSES:
        raise ValueError(f"loss is {loss!r}; one of {', '.join(LOSSES)} was wanted.")
    if sigma not in ("given", "equal"):
        raise ValueError(f'sigma is {sigma!r}; "given" or "equal" was wanted.')
    one_number("eta_i", eta_i, "the index of a lossless medium", 1e-3, 1e3)
    if not (starts is None or (isinstance(starts, int) and starts > 0)):
        raise ValueError(f"starts is {starts!r}; a whole number above 0 was wanted.")
    if absolute_sigma and not seen.stated:
        raise ValueError("absolute_sigma was asked for, but there are no stated errors to take.")


def _inside(u: Unknowns, start: Mapping[str, float]) -> dict[str, float]:
    """Return the caller's start by the names inside, of what is free."""
    given = {plain_name(n): float(v) for n, v in start.items()}
    unknown = {w.parameter.name: w for w in u.moving if w.free}
    out = {}
    for name, label in u.labels.items():
        value = given.pop(label, None)
        if value is None or name not in unknown:
            continue
        w = unknown[name]
        positive = w.parameter.coordinate == LOG
        if not w.low <= value <= w.high or (positive and value <= 0.0):
            above = "above 0 " if positive and w.low <= 0.0 else f"from {w.low:g} "
            raise ValueError(
                f"the start of {label} is {value:g}; a number {above}to {w.high:g} was wanted."
            )
        out[name] = value
    if given:
        raise ValueError(
            f"start names {', '.join(given)}; the parameters are {', '.join(u.labels.values())}."
        )
    return out


def fit_model(
    measurement: Measurement | Sequence[Measurement],
    model: str | Model = "cauchy",
    structure: str = INTERFACE,
    *,
    thickness_um: float | None = None,
    free: Iterable[str] = (),
    fixed: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    loss: str = "squares",
    eta_i: float = 1.0,
    sigma: str = "given",
    absolute_sigma: bool = False,
    starts: int | None = None,
    seed: int = 0,
    start: Mapping[str, float] | None = None,
    intervals: str = "auto",
) -> ModelFit:
    """Return a dispersion model fitted to all angles, wavelengths and files at once.

    measurement: one, or several that share all parameters but scale and background.
    model: one of `model_names`, with a number of terms if it takes one: "drude-lorentz:2".
    structure: "interface" (one bare boundary) or "slab" (a thick one with both faces).
    thickness_um: of the slab; held unless it is in ``free`` or has bounds or a prior.
    free: names (or one) of what is held otherwise: the nuisances "scale" and "background" (one for
        each curve), "angle_offset", "leak", "divergence" (see `structures`), "thickness_um",
        "edge_ev".
    fixed, bounds, priors: name -> value, (low, high), (value, standard error). "scale" is all
        scales, "scale[R_s]" one of them.
    loss: "squares"; "huber" or "student" for data with outliers, with the noise found from the
        residuals unless it is stated and ``absolute_sigma``.
    eta_i: index of the lossless medium that the light comes from (and of a slab, goes to).
    sigma, absolute_sigma: as in `fitting.fit`.
    starts, seed: number of quasi-random starts (None: by the number of unknowns) and their origin.
    start: name -> value of one more start, in which what is not named is in the middle; of what is
        held nothing is used.

    intervals: how `ModelFit.intervals` are found, as in `fitting.fit`: "quadratic" (from the
        standard errors), "profile" (from the likelihood), or "auto": by profile where the quadratic
        ones are wrong (at a bound, near 0, or where the fit is not linear enough).

    psi and Delta are compared as cos 2psi, sin 2psi cos Delta, sin 2psi sin Delta. Result: a
    `ModelFit`. Takes .02 to .2 s for Cauchy and Drude, some seconds for three oscillators, once the
    program for a kind of fit is compiled (some seconds); figures are in docs/fitting.md.
    Raises ValueError for names, values and quantities that do not go together.
    """
    measurements = [measurement] if isinstance(measurement, Measurement) else list(measurement)
    if not measurements:
        raise ValueError("no measurement came.")
    which = parse_model(model)
    check_quantities(measurements, which, structure)
    settings = check_settings(Settings(names_of(free), fixed or {}, bounds or {}, priors or {}))
    seen = observations(measurements, sigma)
    check_choices(seen, loss, sigma, absolute_sigma, eta_i, starts)
    check_intervals(intervals)
    known = np.concatenate([np.isfinite(m.sigma) for m in measurements])
    notes = []
    if sigma == "given" and known.any() and not known.all():
        notes.append(
            f"sigma is missing for {int((~known).sum())} of {len(known)} data: all are weighted "
            "alike, and the errors come from the scatter."
        )
    spectrum = spectrum_of(measurements, structure, eta_i)
    u = unknowns(which, structure, spectrum, thickness_um, settings, seen, loss)
    if not u.free.any():
        raise ValueError("every parameter is held; leave one free.")
    fit = Fit(u, seen, targets_of(u, seen, eta_i), settings)
    scaled = not absolute_sigma
    count = usual_starts(int(u.free.sum())) if starts is None else starts
    points = start_points(u.moving, count, seed)
    if start is not None:
        points = np.concatenate([points, start_at(u.moving, _inside(u, start))[:, None]], 1)
    ends, noise = solved(fit, points, scaled, absolute_sigma)
    how = {
        "scaled": scaled, "eta_i": float(eta_i), "notes": tuple(notes), "starts": points.shape[1],
        "intervals": intervals,
    }  # fmt: skip
    return model_fit_of(fit, ends, noise, how, measurements)
