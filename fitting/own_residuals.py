"""`fit_residuals`: the caller's own model, with the starts, solver and errors of every fit."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from fitting.fit_result import Fit
from fitting.optics.spec import Media, Spec
from fitting.outcomes.findings import Subject
from fitting.outcomes.of_fit import Ended, fits_of
from fitting.problem.observations import Observations
from fitting.problem.problem import FitOptions, Problem
from fitting.problem.programs import SOLVER, Targets, targets_of, with_slopes
from fitting.problem.slopes import Slopes
from fitting.problem.unknowns import Unknowns, unknown_of
from fitting.process.compiled import compiled, fit_settings
from fitting.samples.parameters import (
    LOG,
    PLAIN,
    SQUARE,
    Parameter,
    Settings,
    check_search,
    settings_of,
)
from fitting.searching.last_steps import brought_to_rest
from fitting.searching.search import solved
from fitting.searching.starts import starts as start_points
from fitting.searching.starts import usual_starts, with_given_start
from fitting.uncertainty.intervals import check_choices

Residual = Callable[[dict[str, Array], Any], Array]
_COORDINATES = {"linear": PLAIN, "log": LOG, "square": SQUARE}


class OwnSpec(NamedTuple):
    """What a compiled program of the caller's residuals depends on; see `observe.Spec`."""

    residuals: Residual
    moving: tuple[str, ...]
    coordinates: tuple[str, ...]
    held: tuple[str, ...]
    tied: tuple[tuple[str, float, str], ...] = ()
    loss: str = "squares"
    priors: bool = False
    media: Media = Media((), ())
    channels: tuple[str, ...] = ()
    rank_promotion: str = "allow"  # the caller's own switches, for the caller's function
    dtype_promotion: str = "standard"

    def raw(self, y: Array, targets: Targets) -> list[Array]:
        """Return the residuals (n, L) at y (p, L), as a list of one."""
        values = Spec.values(self, y, targets.held)  # type: ignore[arg-type]

        def one(v: dict[str, Array]) -> Array:
            with (
                jax.numpy_rank_promotion(self.rank_promotion),
                jax.numpy_dtype_promotion(self.dtype_promotion),
            ):
                return jnp.ravel(self.residuals(v, targets.points))

        return [jax.vmap(one, out_axes=-1)(values) / targets.noise]

    def slopes(self, targets: Targets, y: np.ndarray) -> Slopes:
        """Return residuals and derivatives with respect to the solver's coordinates y (p,)."""
        with fit_settings(own_function=True):
            value, slope = (np.asarray(a) for a in _own_linearised(targets, y, spec=self))
        return Slopes(
            seen=value[None], residual=value, jacobian=slope, row=np.arange(len(value)),
            plain=value, kind=np.full(len(value), "residuals"),
        )  # fmt: skip


def _linearised(targets: Targets, y: Array, *, spec: OwnSpec) -> tuple[Array, Array]:
    """Return the residuals (n,) at y (p,) and their derivatives (n, p)."""
    return with_slopes(lambda lanes: spec.raw(lanes, targets)[0], y)


_own_linearised = compiled(_linearised, "spec")


def _range(name: str, what: Any, kind: str) -> tuple[float, float]:
    """Return the two ends of a range, or raise ValueError for another value."""
    try:
        low, high = map(float, what)
        if low <= high and (kind == "bounds" or np.isfinite([low, high]).all()):
            return low, high
    except (TypeError, ValueError):
        pass
    raise ValueError(
        f"the parameter {name} is {what!r}; a range (low, high) of starting values was wanted, or "
        "{'start': (low, high), 'bounds': ..., 'coordinate': 'log', 'unit': 'nm'}."
    )


def _parameter(name: str, what: Any) -> Parameter:
    """Return a parameter from its description by the caller."""
    said = dict(what) if isinstance(what, Mapping) else {"start": what}
    kind = said.pop("coordinate", "linear")
    if kind not in _COORDINATES:
        raise ValueError(
            f"the coordinate of {name} is {kind!r}; {' or '.join(_COORDINATES)} was wanted."
        )
    bounds, unit = said.pop("bounds", (-np.inf, np.inf)), said.pop("unit", "")
    if [*said] != ["start"]:
        raise ValueError(
            f"the parameter {name} is {what!r}; a mapping with 'start': (low, high) was wanted, "
            "and at most 'bounds', 'coordinate' and 'unit' beside it."
        )
    start, (low, high) = _range(name, said["start"], "start"), _range(name, bounds, "bounds")
    if kind == "log" and start[0] <= 0.0:
        raise ValueError(
            f"the parameter {name} has the coordinate 'log' and starts from {start[0]:g}; starting "
            "values above 0 were wanted."
        )
    low = max(low, 0.0) if kind != "linear" else low
    return Parameter(name, unit, start, low, high, _COORDINATES[kind], decades=kind == "log")


def _unknowns(
    residuals: Residual, parameters: Mapping[str, Any], settings: Settings, loss: str
) -> Unknowns:
    offered = [_parameter(name, what) for name, what in parameters.items()]
    strange = [n for n in settings.names if n not in parameters]
    if strange:
        raise ValueError(
            f"there is no parameter {strange[0]!r}; one of {', '.join(parameters)} was wanted."
        )
    for name, (_, of) in settings.tie.items():
        if of in settings.tie:
            raise ValueError(
                f"{name} is tied to {of}, which is tied itself; tie both to the same parameter."
            )
    tied = tuple((name, factor, of) for name, (factor, of) in settings.tie.items())
    moving = [unknown_of(p, p.name, settings)[0] for p in offered if p.name not in settings.tie]
    spec = OwnSpec(
        residuals=residuals, moving=tuple(u.parameter.name for u in moving),
        coordinates=tuple(u.parameter.coordinate for u in moving), held=(), tied=tied, loss=loss,
        priors=any(u.prior is not None for u in moving),
        rank_promotion=jax.config.jax_numpy_rank_promotion,  # pyright: ignore
        dtype_promotion=jax.config.jax_numpy_dtype_promotion,  # pyright: ignore
    )  # fmt: skip
    names = {p.name: p.name for p in offered}
    units = {p.name: p.unit for p in offered}
    return Unknowns(spec, tuple(moving), np.empty(0), names, units)  # type: ignore[arg-type]


def _first_finite(u: Unknowns, targets: Targets, points: np.ndarray) -> tuple[np.ndarray, Slopes]:
    """Return a starting point where the residuals are finite, and the derivatives there."""
    for point in points.T[::-1]:  # the caller's start, if there is one, is the last
        found = u.spec.slopes(targets, point)  # type: ignore[arg-type]
        if np.isfinite(found.residual).all():
            return point, found
    values = Spec.values(u.spec, jnp.asarray(points[:, :1]), jnp.empty(0))  # type: ignore[arg-type]
    strange = np.flatnonzero(~np.isfinite(found.residual))
    at = ", ".join(f"{name} = {float(values[name][0]):.4g}" for name in u.spec.moving)
    raise ValueError(
        f"at none of {points.shape[1]} starting points are all residuals finite; at {at} these are "
        f"not: {len(strange)} of {len(found.residual)}, the first of them number {strange[0]} "
        "(from 0). Look for NaN in the data, and for parameters out of the domain of the function."
    )


def _one(
    u: Unknowns, data: Any, settings: Settings, asked: FitOptions, points: np.ndarray
) -> Ended:
    """Return the fit of one set of data, searched."""
    none = np.empty(0)
    rows = Observations(
        channels=(), curves=(), points=data, values=(), weights=(), ncs=none, ncs_weights=none,
        row=none, quantity=none, channel=none, curve=none, curve_names=(),
        stated=asked.errors == "stated",
    )  # fmt: skip
    targets = targets_of(u, rows, np.float64(1.0))
    first = _first_finite(u, targets, points)
    residual = first[1].residual
    job = Problem(u, rows._replace(row=first[1].row), targets, settings, asked)
    job.starts, job.first = points.shape[1], first
    job.squares = float(np.nan_to_num(residual @ residual, nan=1.0, posinf=1.0))
    ends, noise = solved(job, points)
    return Ended(job, brought_to_rest(job, ends, noise), noise, Subject(None, None))


def fit_residuals(
    residuals: Residual,
    parameters: Mapping[str, Any],
    data: Any = (),
    *,
    free: str | Iterable[str] = (),
    fixed: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    tie: Mapping[str, str] | None = None,
    loss: str = "squares",
    errors: str = "scaled",
    intervals: str = "auto",
    starts: int | None = None,
    start: Mapping[str, float] | None = None,
    seed: int = 0,
    rtol: float = SOLVER.rtol,
    batch: bool = False,
) -> Fit:
    """Return the caller's own model fitted, with the starts, solver and errors of `fit`.

    Args:
        residuals: ``residuals(values, data)`` in JAX -> array of residuals, (model - measured) /
            sigma. values: name -> number; data as below. Use one function for all calls of a kind,
            since each function is compiled once.
        parameters: name -> the range (low, high) from which starting values are drawn; or a mapping
            with "start": that range; and, if wanted, "bounds": the smallest and largest value;
            "coordinate": "linear", "log" or "square", of the parameter in which the residuals are
            nearly linear; "unit".
        data: arrays, or any pytree of them; with ``batch`` each begins with the batch axis S.
        free, fixed, bounds, priors, tie, loss, intervals, starts, start, seed: as in `fit`.
        errors: "scaled": the noise is estimated from the residuals, and a warning says so if they
            are larger than 1 beyond chance; or "stated": the residuals are in units of their
            standard errors.
        rtol: a start ends when its next step is shorter than this many standard errors. The values
            are then far closer to the minimum, since the last steps converge quadratically.
        batch: whether to fit each entry of the batch axis by itself.

    Returns:
        `Fit` of batch shape (), or (S,) with ``batch``. Its `predict` and `index` raise ValueError,
        since it has no sample.

    Raises:
        ValueError: for names and values that are wrong or do not go together, and for residuals
            that are not finite at any starting point.
    """
    if errors not in ("scaled", "stated"):
        raise ValueError(f'errors is {errors!r}; "scaled" or "stated" was wanted.')
    check_choices(loss, errors, intervals)
    check_search(starts, start, seed)
    if not (isinstance(rtol, float | int) and 0.0 < rtol <= 1.0):
        raise ValueError(f"rtol is {rtol!r}; a number of standard errors in (0, 1] was wanted.")
    settings = settings_of(free, fixed, bounds, priors, tie)
    u = _unknowns(residuals, parameters, settings, loss)
    if not u.free.any():
        raise ValueError("every parameter is fixed or tied; leave one free to be fitted.")
    asked = FitOptions(errors, intervals, loss, seed, rtol=rtol)
    count = usual_starts(int(u.free.sum())) if starts is None else starts
    points = with_given_start(start_points(u.moving, count, seed), u.moving, u.labels, start)
    if any(np.iscomplexobj(a) for a in jax.tree.leaves(data)):
        raise ValueError("the data are complex; give their real and imaginary parts as two arrays.")
    data = jax.tree.map(lambda a: np.asarray(a, float), data)
    if not batch:
        return Fit.of(fits_of([_one(u, data, settings, asked, points)]))
    sizes = {len(a) if np.ndim(a) else 0 for a in jax.tree.leaves(data)}
    if len(sizes) != 1 or 0 in sizes:
        raise ValueError(
            f"the first axes of the arrays in data have lengths {sorted(sizes)}; with batch=True "
            "one common length above 0 was wanted."
        )
    (count,) = sizes
    each = (jax.tree.map(lambda a, i=i: a[i], data) for i in range(count))
    return Fit.of(fits_of([_one(u, one, settings, asked, points) for one in each], (count,)))
