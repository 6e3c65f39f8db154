"""Where the fits of a map begin: full searches on a coarse grid of its pixels.

Each pixel of a block starts from the result of the nearest pixel of the grid. Parameters that the
whole map shares are found from the same grid: the weighted mean of the pixels' values, with the
inverse of their covariances as weights, which is the joint least-squares estimate where the errors
are small beside the curvature of the model.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from fitting.batch_arrays import without_refused
from fitting.batches import fit_many
from fitting.fit_result import Fit
from fitting.maps.cube import Cube
from fitting.results.result_parts import DETERMINED
from fitting.samples.sample import Sample

# The warnings of a pixel that the sample, at this minimum, does not describe.
MISFITS = ("chi2_large", "does_not_describe")
# Values so many times as far from the median as is usual are of another minimum.
_FAR = 5.0


class Start(NamedTuple):
    """What all blocks begin with; plain data for the attributes of the store.

    units: of the fitted parameters, by name. grid: places of the grid's pixels along each axis.
    values: name -> values on the grid. others: the same of a second minimum nearly as low, where a
    pixel of the grid has one, else {}. shared: name -> (value, standard error) of parameters that
    all pixels share. slopes: name of a free parameter -> its derivatives by the shared ones, (grid
    pixels, shared). covariance: of the shared ones. describes: whether the sample describes most of
    these pixels. A bare surface needs no values.
    """

    units: dict[str, str]
    grid: list[list[int]]
    values: dict[str, list[float]]
    others: dict[str, list[float]]
    shared: dict[str, list[float]]
    slopes: dict[str, list[list[float]]]
    covariance: list[list[float]]
    describes: bool

    def nearest(self, index: tuple[slice, ...], block: tuple[int, ...]) -> np.ndarray:
        """Return which pixel of the grid is the nearest of each one of a block, flat numbers."""
        rows = []
        for places, part, length in zip(self.grid, index, block, strict=True):
            middles = 0.5 * (np.asarray(places[1:]) + np.asarray(places[:-1]))
            rows.append(np.searchsorted(middles, part.start + np.arange(length)))
        return np.ravel_multi_index(np.ix_(*rows), tuple(map(len, self.grid)))


def _longer(curves: Any, count: int, fill: float = np.nan) -> np.ndarray:
    """Return curves (..., M) as (count, M) at least; an array of less than one axis as it is."""
    if np.ndim(curves) < 2:
        return curves
    flat = curves.reshape(-1, curves.shape[-1])
    return np.pad(flat, ((0, max(count - len(flat), 0)), (0, 0)), constant_values=fill)


def usable(values: Any, sigma: Any, masked: Any = None) -> tuple[Any, Any, np.ndarray]:
    """Return values (..., M) and errors with NaN where a curve is masked or refused, and which is
    refused, (...). A datum without a standard error is left out."""
    values = dict(values)
    if masked is not None:
        values = {q: np.where(masked[..., None], np.nan, v) for q, v in values.items()}
    each = isinstance(sigma, Mapping) and all(np.ndim(s) for s in sigma.values())
    if each:
        values = {q: np.where(np.isfinite(sigma[q]), v, np.nan) for q, v in values.items()}
        sigma = {q: np.where(np.isfinite(values[q]), s, 1.0) for q, s in sigma.items()}
    shape = next(iter(values.values())).shape[:-1]

    # With one curve of NaN, which is never refused, no batch is refused as a whole.
    flat = {q: _longer(v, v[..., 0].size + 1) for q, v in values.items()}
    errors = {q: _longer(s, s[..., 0].size + 1, 1.0) for q, s in sigma.items()} if each else sigma
    flat, errors, reasons = without_refused(flat, errors)
    refused = np.zeros(shape, bool) if reasons is None else (reasons[:-1] != "").reshape(shape)
    values = {q: v[:-1].reshape(values[q].shape) for q, v in flat.items()}
    if each:
        sigma = {q: np.where(np.isnan(e[:-1]), 1.0, e[:-1]).reshape(values[q].shape)
                 for q, e in errors.items()}  # fmt: skip
    return values, sigma, refused


def has_data(values: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return which curves have a datum, (...)."""
    return np.any([np.isfinite(v).any(-1) for v in values.values()], axis=0)


def begin(cube: Cube, sample: Sample, options: Mapping[str, Any], shared: tuple[str, ...]) -> Start:
    """Return where the fits of a map begin; options: of `fit_many`."""
    values, sigma, _ = usable(*cube.on_grid())
    if not has_data(values).any():
        raise ValueError(
            "none of the pixels on a grid over the map has a curve that can be fitted: all are "
            "masked, missing or out of range. Look at units (fractions, not percent) and the mask."
        )

    def fitted(more: Mapping[str, Any]) -> Fit:
        return fit_many(
            cube.angle_deg, cube.wavelength, **values, sigma=sigma, sample=sample,
            **{**options, **more},
        )  # fmt: skip

    found = fitted({})
    held: dict[str, list[float]] = {}
    slopes: dict[str, list[list[float]]] = {}
    spread = np.zeros((0, 0))
    if shared:
        names = list(found.names)
        if stray := [n for n in shared if n not in names]:
            raise ValueError(
                f"shared names {stray[0]!r}; one of the fitted parameters was wanted: "
                f"{', '.join(names)}."
            )
        mean, spread, by_name = _joint(found, [names.index(n) for n in shared])
        held = {n: [float(v), float(s)] for n, v, s in
                zip(shared, mean, np.sqrt(np.diagonal(spread)), strict=True)}  # fmt: skip
        fixed = {**(options.get("fixed") or {}), **{n: v for n, (v, _) in held.items()}}
        bounds = {n: b for n, b in (options.get("bounds") or {}).items() if n not in shared}
        found = fitted({"fixed": fixed, "bounds": bounds})
        slopes = {n: by_name[:, names.index(n)].tolist() for n in found.names}
    good = np.ravel(np.isin(found.status, DETERMINED))
    good = good if good.any() else np.ravel(np.asarray(found.status) != "")
    starts, others = {}, {}
    # The pixels of a bare surface have starts of their own.
    searched = not sample.by_wavelength
    for n in found.names if searched else ():
        starts[n] = _filled(np.ravel(found.parameters[n].value), good, found.shape).tolist()
    if searched and found.others:
        other = found.others[0].parameters
        for n in found.names:
            value = np.ravel(other[n].value) if n in other else np.full(good.shape, np.nan)
            there = np.isfinite(np.ravel(found.others[0].delta_chi2)) & np.isfinite(value)
            others[n] = np.where(there, value, starts[n]).tolist()
    units = {n: found.parameters[n].unit for n in found.names}
    grid = [g.tolist() for g in cube.grid()]
    misfits = [np.mean(f.at) for f in found.findings if f.code in MISFITS]
    describes = max(misfits, default=0.0) < 0.5
    return Start(units, grid, starts, others, held, slopes, spread.tolist(), bool(describes))


def _joint(found: Fit, which: list[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the joint estimate of parameters from all pixels' fits, its covariance, and each
    pixel's derivatives of all parameters by them, (pixels, P, shared)."""
    covariance = found.covariance.reshape(-1, *found.covariance.shape[-2:])
    value = np.stack([np.ravel(found.parameters[n].value) for n in found.names], -1)
    good = np.ravel(np.isin(found.status, DETERMINED)) & np.isfinite(covariance).all((1, 2))
    good &= np.isfinite(value).all(1)
    if good.sum() < 2:
        raise ValueError(
            "fewer than two pixels of the grid determine all parameters, so that none can be "
            "shared; fix them instead."
        )

    def weights() -> np.ndarray:
        return np.linalg.inv(covariance[good][:, which][:, :, which])

    # A pixel that ended at another fringe order has other values: it is left out.
    apart = value[good][:, which] - np.median(value[good][:, which], 0)
    squares = np.einsum("ni,nij,nj->n", apart, weights(), apart)
    good[good] = squares <= _FAR**2 * max(float(np.median(squares)), len(which))
    weight = weights()
    spread = np.linalg.inv(weight.sum(0))
    mean = spread @ np.einsum("nij,nj->i", weight, value[good][:, which])
    apart = value[good][:, which] - mean
    chi2 = np.einsum("ni,nij,nj->", apart, weight, apart) / ((good.sum() - 1) * len(which))
    slopes = np.zeros((len(good), value.shape[1], len(which)))
    slopes[good] = covariance[good][:, :, which] @ weight
    flat = _filled(slopes.reshape(len(good), -1), good, found.shape)
    return mean, spread * max(chi2, 1.0), flat.reshape(slopes.shape)


def _filled(values: np.ndarray, good: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return values on a grid with those of the nearest good pixel where one is not good."""
    places = np.stack(np.unravel_index(np.arange(len(good)), shape), -1)
    good = good & np.isfinite(values.reshape(len(good), -1)).all(1)
    known = np.flatnonzero(good)
    if not len(known):
        return values
    apart = np.square(places[:, None] - places[None, known]).sum(-1)
    return values[known[np.argmin(apart, 1)]]
