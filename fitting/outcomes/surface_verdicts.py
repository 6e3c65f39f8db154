"""What powers of a bare surface leave open of its index, told to fits by any model and search.

Whether reflectances over the angle determine eta and k is a matter of the data and of the index at
which they are fitted, not of the model: R_s of a metal fits any index on the circle of one R(0),

    n = cosh xi + sinh xi cos phi,   k = sinh xi sin phi,   cosh xi = (1 + n^2 + k^2) / 2n,

of which a lossless index of 130 is one. What wavelengths tell of each other through a dispersion
model is that of the model alone. Indices n + ik are relative to the medium in front.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import numpy as np

from fitting.outcomes.doubtful_index import CONSTANT, index_at
from fitting.outcomes.findings import other_formulas
from fitting.outcomes.outcome import Solutions
from fitting.problem.curve_lanes import shown_at
from fitting.problem.problem import Problem
from fitting.problem.programs import Targets
from fitting.problem.unknowns import Unknowns
from fitting.process.side_by_side import side_by_side
from fitting.residuals.pattern import repeats
from fitting.results import result_parts as status
from fitting.results.diagnostics import Finding, ranked
from fitting.results.result import FitData
from fitting.results.result_parts import Estimate
from fitting.samples.dispersion import Model
from fitting.samples.parameters import from_parameter
from fitting.searching.batch_search import BatchSearch
from fitting.searching.minima import scatters
from fitting.uncertainty.covariance import End
from fitting.uncertainty.limits import ROUNDING

OPEN = ("perfect_mirror", "circle", "same_at_45_degrees", "combination")
# What remains true of a fit whose index is open.
_OF_DATA = ("does_not_describe", "residuals_in_order", "chi2_large", "chi2_small", "refused")
# What is not so of a boundary that reflects nothing: its curve does not change with the index.
_OF_SLOPES = ("not_seen", "one_value", "no_slope", "compatible_with_zero", "at_bound",
              "not_converged", "other_minima", "few_starts_agree")  # fmt: skip
# Two standard errors reach 0: the value is known to an order of magnitude at best.
_VAGUE = 0.5
# 1 - correlation^2 of eta and k below this is rounding; the k in place of 0 for slopes.
_SINGULAR, _LEAST_K = 1e-11, 1e-6
# Two indices fit equally well if their chi2 differs by less than the first number (two standard
# errors), and the data do not distinguish them at all if by less than the second.
_ALIKE, _THE_SAME = 4.0, 0.01
# Change of x = log cosh xi along what the data see least, over all k, beyond which it is no circle.
_CIRCLE = 0.1
# An eta in total reflection is not determined if this part of it fits as well, with another k.
_SMALL_PART, _STEPS_IN_K = 0.1, 6
# A mirror, 1 - R = a h / (1 + a h / 2): of which rms of the data and up to which a it may be, and
# by how little chance it is worse than an index.
_LEAST_RMS, _MOST_A, _CHANCE, _NORMAL_95 = 0.85, 0.3, 0.01, 1.645
_FLAT_DEG = 30.0
_BLOCK = 256  # curves that are looked at together: their arrays fit in the cache
# Of solids that transmit light tellurium has the highest index, 6.3 (S. Caldwell and H. Y. Fan,
# Physical Review 114, 664 (1959)).
_MOST_LOSSLESS = 7.0
_OF_MODEL = "by_the_model_alone"


def _powers(
    cos: np.ndarray, s: np.ndarray, n: np.ndarray, k: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return R = s R_s + (1 - s) R_p of indices (N,), (N, M), and its derivatives by n and k."""
    N = (n + 1j * k if k.any() or (n < 1.0).any() else n)[:, None]  # real ones take half the time
    square = N * N
    q = np.sqrt(square - (1.0 - cos * cos))
    of_s, of_p, slope = 1.0 / (cos + q), 1.0 / (square * cos + q), N / q
    r_s, r_p = (cos - q) * of_s, (square * cos - q) * of_p
    by_s = -2.0 * cos * slope * of_s * of_s
    by_p = 2.0 * cos * (2.0 * N * q - square * slope) * of_p * of_p
    s_, p_ = s * r_s.conj(), (1.0 - s) * r_p.conj()
    by = 2.0 * (s_ * by_s + p_ * by_p)
    return (s_ * r_s + p_ * r_p).real, by.real, -by.imag


def _xi(n: np.ndarray, k: np.ndarray) -> np.ndarray:
    """Return xi of the circle of an index."""
    return 2.0 * np.arcsinh(0.5 * np.sqrt(((n - 1.0) ** 2 + k**2) / n))


class Surface(NamedTuple):
    """N fitted curves of M powers, and the index of each fit.

    cos, s: of the angles, and the share of s, (N, M). weight: 1 / sigma, 0 without datum. miss:
    weighted, model - data, with all that the model holds besides the index (a scale). n, k: (N,).
    fitted: R (N, M) of that index.
    """

    cos: np.ndarray
    s: np.ndarray
    weight: np.ndarray
    miss: np.ndarray
    n: np.ndarray
    k: np.ndarray
    fitted: np.ndarray

    @classmethod
    def of(cls, columns: np.ndarray, n: np.ndarray, k: np.ndarray) -> Surface:
        """Return those of angles (degrees), s, weight and miss (4, N, M)."""
        angle_deg, s, weight, miss = columns
        cos = np.cos(np.radians(angle_deg))
        return cls(cos, s, weight, miss, n, k, _powers(cos, s, n, k)[0])

    def take(self, some: np.ndarray) -> Surface:
        """Return some of the curves."""
        return Surface(*(a[some] for a in self))

    def at(self, n: np.ndarray, k: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return what other indices miss, and the derivatives by n and k, with weights, (N, M)."""
        R, by_n, by_k = _powers(self.cos, self.s, n, k)
        off = self.miss + self.weight * (R - self.fitted)
        return off, self.weight * by_n, self.weight * by_k

    def lossless(self, xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the least cost of n = exp(xi), k = 0, the end of a circle, near xi, and its xi."""
        cost = np.full_like(xi, np.inf)
        for _ in range(2):
            n = np.exp(xi)
            off, by_n, _ = self.at(n, np.zeros_like(n))
            slope = by_n * n[:, None]
            g, h = np.vecdot(slope, off), np.vecdot(slope, slope)
            cost, xi = np.vecdot(off, off) - g * g / h, np.clip(xi - g / h, 0.5 * xi, 2.0 * xi)
        return cost, xi


class Verdicts(NamedTuple):
    """Of N curves: the codes with their values, (N,) each; which are open, and which reflect none.

    eta, k: what is shown, NaN for nothing. Of many indices that fit alike it is the lossless one.
    """

    codes: dict[str, np.ndarray]
    values: dict[str, dict[str, Any]]
    open: np.ndarray
    none: np.ndarray
    eta: np.ndarray
    k: np.ndarray


def _like_mirrors(
    d: Surface, most: np.ndarray, scatter: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the bound of R(0), 95 %, of curves that a mirror fits at a cost of ``most``, else NaN.

    With |N|^2 far above 1 an index enters through a = 4 n / |N|^2 = 1 - R(0) alone, h = cos(theta)
    of s and 1 / cos(theta) of p. Of R_s of a metal (.06 + 3.6 i, noise .01) the best fit was total
    reflection with eta = .76 +- .004 in a fifth of the repeats, its critical angle next to one
    datum that chance had made low. And where R = 1, a = 0, does.
    """
    cos = np.maximum(d.cos, 1e-6)
    half = 0.5 * (d.s * cos + (1.0 - d.s) / cos)
    dark = (1.0 - d.fitted) * d.weight + d.miss
    a = np.zeros(len(dark))
    for _ in range(5):
        fall = 1.0 + a[:, None] * half
        slope = 2.0 * half * d.weight / fall
        off, slope = dark - a[:, None] * slope, slope / fall
        cost, information = np.vecdot(off, off), np.vecdot(slope, slope)
        at, a = a, np.clip(a + np.vecdot(slope, off) / information, 0.0, _MOST_A)
    high = at + _NORMAL_95 * np.sqrt(scatter / information)
    bound = np.maximum(1.0 - high / (1.0 + 0.5 * high), 0.0)
    return np.where(cost <= most, bound, np.nan), np.vecdot(dark, dark) <= most


def _only_a_product(d: Surface, most: np.ndarray) -> np.ndarray:
    """Return where a small part of eta in total reflection fits as well, with another k.

    Far beyond the critical angle 1 - R = A(theta) k, and A depends on eta through a factor that is
    nearly the same at all angles.
    """
    n = _SMALL_PART * d.n
    k, least = np.maximum(d.k, 1e-4 * d.n), np.full(len(n), np.inf)
    for _ in range(_STEPS_IN_K):
        off, _, by_k = d.at(n, k)
        least = np.fmin(least, np.vecdot(off, off))
        k = np.clip(k - np.vecdot(by_k, off) / np.vecdot(by_k, by_k), 1e-9 * n, 10.0)
    return least <= most


@np.errstate(all="ignore")
def verdicts(
    d: Surface, eta_i: np.ndarray, scatter: np.ndarray, dof: np.ndarray, stated: np.ndarray
) -> Verdicts:
    """Return what the data leave open of the index. All arrays (N,).

    scatter: the unit of differences of the cost. stated: whether that is known beforehand, and not
    from ``dof`` degrees of freedom.
    """
    n, k = d.n, d.k
    used, near = d.weight > 0.0, np.maximum(k, _LEAST_K * n)
    count = used.sum(1)
    _, by_n, by_k = d.at(n, near)
    nn, nk, kk = np.vecdot(by_n, by_n), np.vecdot(by_n, by_k), np.vecdot(by_k, by_k)
    cost, value = np.vecdot(d.miss, d.miss), d.fitted * d.weight - d.miss
    least = ROUNDING * np.vecdot(value, value)
    alike = cost + _ALIKE * scatter + least
    the_same = cost + _THE_SAME * scatter + least
    nothing = d.miss - d.weight * d.fitted  # of no boundary
    none = np.vecdot(nothing, nothing) <= the_same
    independent = 1.0 - nk**2 / (nn * kk)
    spread = np.sqrt(scatter / (nn * independent)) / n
    # In total reflection by an index of k > n the two are fixed in one product.
    far = np.where(used, d.cos, 1.0).min(1) ** 2 < 1.0 - n**2
    spread_k = np.sqrt(scatter / (kk * independent)) / near
    spread = np.where((n < 1.0) & far & (k >= n), np.fmax(spread, spread_k), spread)
    open_ = ~(independent > _SINGULAR) | (count < 2) | (spread > _VAGUE)
    # Near normal incidence the noise decides at which end of the circle, n > 1 or n < 1, the
    # minimum lies, and at n < 1, close to total reflection, the index looks well determined.
    xi = _xi(n, k)
    end, xi_end = d.lossless(xi)
    open_ |= (n < 1.0) & (end <= alike)
    strong = np.vecdot(value, value) > _LEAST_RMS**2 * np.vecdot(d.weight, d.weight)
    some = np.flatnonzero(strong & ~open_ & (n < 1.0) & far & (k < n))
    if len(some):
        open_[some] = _only_a_product(d.take(some), alike[some])
    bound, perfect = np.full_like(n, np.nan), np.zeros_like(none)
    some = np.flatnonzero(strong)
    if len(some):
        many = np.maximum(dof, 1)
        # Quantile of chi2 with 2 degrees of freedom; of a scatter from the residuals twice that of
        # F with 2 and dof.
        # With less than 3 a scatter is assumed.
        rise = np.where(
            stated | (dof < 3), -2.0 * np.log(_CHANCE), many * (_CHANCE ** (-2.0 / many) - 1.0)
        )
        most = (cost + rise * scatter + least)[some]
        bound[some], perfect[some] = _like_mirrors(d.take(some), most, scatter[some])
    # Where R = 1 does not fit, a best fit that is such a reflector itself (and not a critical angle
    # next to one low datum, of a small R(0)) names its circle.
    loss = 4.0 * n / ((1.0 + n) ** 2 + k**2)
    on_circle = ~perfect & (loss <= 2.0 * (1.0 - bound))
    open_ |= np.isfinite(bound)
    bound[on_circle] = np.nan
    mirror = np.isfinite(bound)
    open_, none = open_ & (~none | mirror), none & ~mirror
    lossless = open_ & (end <= the_same)
    # dx along what is seen least, of one k, and dw of the second coordinate w = 2 xi -+ log|N|^2,
    # which runs from 0 to 4 xi
    of_n, square = -nk / nn, n**2 + near**2
    dx = 2.0 * (n * of_n + near) / (1.0 + square) - of_n / n
    dw = 2.0 * dx / np.tanh(xi) - np.copysign(2.0, square - 1.0) * (n * of_n + near) / square
    circle = ~(np.abs(dx / dw) * 4.0 * xi > _CIRCLE) | (count == 1) | on_circle
    s = np.where(used, d.s, np.nan)
    kinds = [np.fmin.reduce(s, axis=1), np.fmax.reduce(s, axis=1)]
    angle = np.where(used, np.degrees(np.arccos(d.cos)), np.nan)
    high = np.fmax.reduce(angle, axis=1)
    at_45 = (np.fmin.reduce(angle, axis=1) > 44.9) & (high < 45.1)
    at_45 &= (kinds[0] == 0.0) & (kinds[1] == 1.0) & ((s == 0.0) | (s == 1.0) | ~used).all(1)
    eta = eta_i * np.select([mirror, none, lossless], [np.nan, 1.0, np.exp(xi_end)], n)
    shown_k = eta_i * np.select([mirror, none | lossless], [np.nan, 0.0], k)
    codes = {
        "perfect_mirror": mirror, "no_reflection": none,
        "same_at_45_degrees": open_ & ~mirror & at_45,
        "circle": open_ & ~mirror & ~at_45 & circle,
        "combination": open_ & ~mirror & ~at_45 & ~circle,
        "flat_curve": ~open_ & ~none & (kinds[0] == kinds[1]) & (high < _FLAT_DEG),
    }  # fmt: skip
    index = {"eta": eta, "k": shown_k, "eta_i": eta_i}
    values = {
        "perfect_mirror": {"least_reflectance": bound}, "no_reflection": {"eta_i": eta_i},
        "same_at_45_degrees": index, "circle": index,
        "flat_curve": {"below_deg": np.full(len(n), _FLAT_DEG)},
        "combination": {**index, "slope": 2.0 * eta_i * near / of_n},
    }  # fmt: skip
    return Verdicts(codes, values, open_, none, eta, shown_k)


def _place(u: Unknowns) -> list[int] | None:
    """Return which unknowns are eta and k, if nothing but the data tells them."""
    free = [n.rpartition(".")[2] if w.free and not w.prior else ""
            for n, w in zip(u.spec.moving, u.moving, strict=True)]  # fmt: skip
    return [free.index("eta"), free.index("k")] if {"eta", "k"} <= {*free} else None


def _with_index(u: Unknowns, y: np.ndarray, v: Verdicts) -> np.ndarray:
    """Return y (n, p) with the index that is shown, where there is another one."""
    out, new = y.copy(), (v.open | v.none) & np.isfinite(v.eta)
    for i, x in zip(_place(u) or (), (v.eta, v.k), strict=False):  # none of a model
        w = u.moving[i]
        x = from_parameter(w.parameter.coordinate, np.clip(x, w.low, w.high))
        out[:, i] = np.where(new, x, y[:, i])
    return out


def _asked(fit: Problem) -> bool:
    """Whether a fit is one of powers of a bare surface, of whose index nothing else is known."""
    media, known = fit.u.spec.media, {*fit.settings.names} - {*fit.settings.variants}
    return (
        len(media.index) == 1 and media.bare and isinstance(media.index[0], Model)
        and {*fit.u.spec.channels} <= {"R_s", "R_p", "R"}
        and not {"eta", "k"} & {n.rpartition(".")[2] for n in known}
    )  # fmt: skip


@np.errstate(all="ignore")
def verdicts_of_batch(
    search: BatchSearch, m: Solutions, scatter: np.ndarray
) -> tuple[np.ndarray, Verdicts, np.ndarray] | None:
    """Return which of n curves were asked, the verdicts on them, and y to be shown.

    Most curves determine their index, as errors show.
    """
    u, curves, which, ask = search.job.u, search.curves, m.which, np.ones(len(m.which), bool)
    if not _asked(search.job):
        return None
    outside, stated, dof = curves.outside[which], curves.stated[which], search.dof[which]
    if place := _place(u):
        eta = m.y[:, place[0]]
        values = np.concatenate([v[which] for v in curves.values.values()], 1)
        unit = np.maximum(m.known.variance, scatter)
        spread = m.known.edge[:, place[0]] * np.sqrt(unit) / eta
        ask = m.known.hidden.any(1) | ~(spread < 0.5 * _VAGUE) | (eta < outside)
        ask |= np.nanmean(values**2, 1) > _LEAST_RMS**2
        ask |= m.squares <= m.cost + 2.0 * _THE_SAME * scatter
        ask |= curves.of_points("angle_deg", which).max(1) < _FLAT_DEG
        if not ask.any():
            return None

    def asked_of(some: np.ndarray) -> Verdicts:
        shown = shown_at(u.spec, curves, m.y[some].T, which[some])
        each = (a[some] for a in (m.y, outside, scatter, dof, stated))
        return _verdicts_at(search.job, curves.targets(which[some]), shown, *each)

    at = np.flatnonzero(ask)
    parts = side_by_side(asked_of, np.split(at, range(_BLOCK, len(at), _BLOCK)))
    v = jax.tree.map(lambda *a: np.concatenate(a), *parts)
    return at, v, _with_index(u, m.y[at], v)


@np.errstate(all="ignore")
def verdicts_of_fit(fit: Problem, end: End, noise: float) -> tuple[Verdicts | None, np.ndarray]:
    """Return the verdicts on a single fit, None if it was not asked, and y (p,) to be shown."""
    targets, square = fit.targets, float(np.sum((end.slopes.residual / noise) ** 2))
    if not _asked(fit) or np.ndim(targets.eta_i):
        return None, end.y
    targets = targets._replace(noise=noise)
    scatter, _ = scatters(square, fit.dof, fit.asked.scaled, fit.seen.stated)
    each = (np.array([a]) for a in (targets.eta_i, scatter, fit.dof, fit.seen.stated))
    v = _verdicts_at(fit, targets, end.slopes.seen[None], end.y[None], *each)
    return v, _with_index(fit.u, end.y[None], v)[0]


@np.errstate(all="ignore")  # each thread has its own
def _verdicts_at(
    fit: Problem, targets: Targets, shown: np.ndarray, y: np.ndarray, outside: np.ndarray,
    scatter: np.ndarray, dof: np.ndarray, stated: np.ndarray,
) -> Verdicts:  # fmt: skip
    """Return the verdicts on n fits at y (n, p), whose channels show ``shown`` (n, K, M).

    Of a dispersion model each wavelength is asked alone. Where all of them are open, wavelengths
    tell of each other through the model.
    """
    constant, points, one = fit.u.spec.media.index[0] == CONSTANT, targets.points, shown.shape[::2]
    value, weight = (np.concatenate(a).T for a in (targets.values, targets.weights))
    shares = {"R_s": 1.0, "R_p": 0.0, "R": np.transpose(points.s_share)}
    share = [np.broadcast_to(shares[c], one) for c in fit.u.spec.channels]
    angle = [np.broadcast_to(np.transpose(points.angle_deg), one)] * len(share)
    weight = weight / np.transpose(np.atleast_2d(targets.noise))  # of each fit, or of all
    miss = weight * (shown.reshape(value.shape) - value)
    used = weight.any(0)
    columns = np.stack([np.concatenate(a, 1) for a in (angle, share)] + [weight, miss])[..., used]
    waves = np.tile(np.asarray(points.wavelength_um)[:, 0], len(share))[used]
    waves, which = np.unique(np.where(constant, 1.0, waves), return_inverse=True)
    eta, k = (a.T.ravel() for a in index_at(fit, 0, y, waves))
    n, size = len(y), len(waves)
    if size > 1:
        slot, rows = repeats(which), columns
        columns = np.zeros((4, n, size, slot.max() + 1))
        columns[:, :, which, slot] = rows
        columns = columns.reshape(4, n * size, -1)
    eta_i, scatter, dof, stated = (np.repeat(a, size) for a in (outside, scatter, dof, stated))
    v = verdicts(Surface.of(columns, eta / eta_i, k / eta_i), eta_i, scatter, dof, stated)
    if constant:
        return v
    eta, open_ = eta.reshape(n, size), v.open.reshape(n, size).all(1)
    absorbs = k.reshape(n, size).any(1)
    v = jax.tree.map(lambda a: a[np.arange(n) * size + eta.argmax(1)], v)
    told = open_ & ~absorbs & (eta.max(1) >= _MOST_LOSSLESS)
    codes = {code: at & told for code, at in v.codes.items()}
    return v._replace(
        codes={**codes, _OF_MODEL: open_ & absorbs}, values={**v.values, _OF_MODEL: {}},
        open=told, none=v.none & told,
    )  # fmt: skip


def marked(found: FitData, v: Verdicts, put: Callable[..., Any]) -> FitData:
    """Return fits with the verdicts on some of them. put: gives arrays the shape of the batch.

    Of eta and k that are parameters the ranges by profile are kept.
    """
    open_, none = put(v.open, False), put(v.none, False)
    blank, index = np.logical_or(open_, none), _OF_MODEL not in v.codes

    def estimate(name: str, e: Estimate) -> Estimate:
        if not e.free:
            return e
        value, last = e.value, name.rpartition(".")[2]
        if index and last in ("eta", "k"):
            value = np.where(blank, put(getattr(v, last)), value)[()]
        no_range = open_ & (
            (e.interval_kind != np.str_(status.PROFILE)) | np.isnan(value) | (not index)
        )
        return replace(
            e, value=value, sigma=np.where(blank, np.nan, e.sigma)[()],
            interval=np.where(np.asarray(no_range)[..., None], np.nan, e.interval),
            interval_kind=np.where(no_range, status.NONE, e.interval_kind)[()],
            upper_limit=np.where(blank, np.nan, e.upper_limit)[()],
            status=np.select(
                [open_, none],
                [status.UNDETERMINED, status.AT_LOWER if last == "k" else status.FITTED], e.status,
            )[()],
        )  # fmt: skip

    hidden = {**dict.fromkeys(_OF_SLOPES, blank), **dict.fromkeys(_OF_DATA, False)}
    new = [
        Finding(code, put(at, False), {n: put(a) for n, a in v.values[code].items()}
                | (other_formulas(found.sample) if code == _OF_MODEL else {}))
        for code, at in v.codes.items()
    ]  # fmt: skip
    hidden |= {f.code: f.at for f in new}
    told = [replace(f, at=f.at & np.logical_not(hidden.get(f.code, open_))) for f in found.findings]
    return replace(
        found, parameters={n: estimate(n, e) for n, e in found.parameters.items()},
        covariance=np.where(np.asarray(blank)[..., None, None], np.nan, found.covariance),
        status=np.select([open_, none], [status.UNDETERMINED, status.CONVERGED], found.status)[()],
        findings=ranked(f for f in (*told, *new) if np.any(f.at)),
        others=() if np.all(open_) else found.others,
    )  # fmt: skip
