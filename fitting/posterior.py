"""`log_density`: the log likelihood and priors of a fit as a function, for samplers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from fitting.data.measurement import Measurement
from fitting.fits import checked_sample, measurements_of
from fitting.optics.observe import predicted
from fitting.problem.problem import FitOptions, Problem
from fitting.problem.programs import weighted
from fitting.process.compiled import fit_settings
from fitting.samples.parameters import settings_of
from fitting.samples.sample import Sample
from fitting.wavelengths import problem_of


@dataclass(frozen=True, eq=False)
class LogDensity:
    """A log density of named parameters, as `log_density` returns it.

    bounds: name -> (low, high) of every parameter; outside of them the log density is -inf.
    """

    bounds: dict[str, tuple[float, float]]
    _job: Problem

    def __call__(self, values: Mapping[str, Any]) -> jax.Array:
        """Return the log density, (), at values: name -> number, of all names in ``bounds``."""
        if set(values) != set(self.bounds):
            raise ValueError(
                f"values of {', '.join(values) or 'no parameter'} came; those of "
                f"{', '.join(self.bounds)} were wanted."
            )
        if not jax.config.jax_enable_x64:  # pyright: ignore[reportAttributeAccessIssue]
            raise ValueError(
                "in 32 bits a sum of squares over many data loses its digits; switch on 64: "
                'jax.config.update("jax_enable_x64", True).'
            )
        u, targets = self._job.u, self._job.targets
        with fit_settings(own_function=True):
            v = {n: jnp.full(1, x) for n, x in zip(u.spec.held, u.held, strict=True)}
            inside, off = [], []
            for w in u.moving:
                label = u.labels.get(w.parameter.name, "")
                x = jnp.asarray(values[label] if label in self.bounds else w.low, float)
                # At the bound and not beyond, where the model may be NaN, and its gradient with it.
                within = (w.low <= x) & (x <= w.high)
                v[w.parameter.name] = jnp.where(within, x, jnp.clip(x, w.low, w.high))[None]
                inside.append(within)
                off += [(x - w.prior[0]) / w.prior[1]] if w.prior else []
            v |= {name: factor * v[of] for name, factor, of in u.spec.tied}
            found = predicted(u.spec, v, targets.points, targets.eta_i)
            chi2 = sum(jnp.sum(r * r) for r in [*weighted(u.spec, found, targets), *off])
            return jnp.where(jnp.all(jnp.stack(inside)), -0.5 * chi2, -jnp.inf)


def log_density(
    measurement: Measurement | Sequence[Measurement],
    sample: str | Sample = "free",
    *,
    free: str | Iterable[str] = (),
    fixed: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    tie: Mapping[str, str] | None = None,
) -> LogDensity:
    """Return the log density of a sample's parameters, given a measurement, for a sampler.

        log p = -1/2 sum [(predicted - value) / sigma]^2 - 1/2 sum of squares of priors + constant

    It is a function of a dictionary name -> number, with names and units as in a `Fit`, on which
    `jax.jit`, `jax.grad` and `jax.vmap` work. Without ``priors`` it is flat in the named
    parameters; a caller adds the log density of another prior.

    Args:
        measurement: as in `fit`. Every datum needs a standard error; it is taken as stated.
        sample, free, fixed, bounds, priors, tie: as in `fit`. An index that is free at every
            wavelength needs data of one wavelength.

    Returns:
        `LogDensity`, of the model that `fit` compares with the data, in float64. Its ``bounds``
        are the names of the parameters with their ranges.

    Raises:
        ValueError: as `fit`, and for data without standard errors; from the function for other
            names than those in ``bounds``, and if jax_enable_x64 is off.
    """
    measurements = measurements_of(measurement)
    settings = settings_of(free, fixed, bounds, priors, tie)
    which = checked_sample(measurements, Sample.parse(sample))
    joined = [
        np.concatenate([getattr(m, n) for m in measurements]) for n in ("sigma", "wavelength_um")
    ]
    if not np.isfinite(joined[0]).all():
        raise ValueError(
            f"{int((~np.isfinite(joined[0])).sum())} of {len(joined[0])} data have no standard "
            "error, without which there is no likelihood. Give them (sigma)."
        )
    if which.by_wavelength and len(np.unique(joined[1])) > 1:
        raise ValueError(
            f"the sample {str(which)!r} has parameters of its own at every wavelength. Give the "
            "data of one wavelength, or the index a dispersion model."
        )
    job = problem_of(measurements, which, settings, FitOptions("stated"))
    known = {job.u.labels[w.parameter.name]: (w.low, w.high) for w in job.u.moving if w.free}
    if not known:
        raise ValueError(
            f"every parameter of the sample {str(which)!r} is known, fixed or tied; leave one free."
        )
    return LogDensity(known, job)
