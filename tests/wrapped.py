"""Fits for the tests of outputs: what today's engines find, in the form of the one result.

To be replaced by `fitting.fit` itself as soon as that returns `Fit`.
"""

import numpy as np

from fitting import fit as fit_index
from fitting import fit_model, fit_points, predictions
from fitting.bare_surface import identifiability as flags
from fitting.bare_surface.curves import curve as index_curve
from fitting.bare_surface.curves import fitted_values
from fitting.diagnostics import Finding, Warning
from fitting.measurement import Measurement
from fitting.result import Alternative, ErrorModel, Estimate, Fit, IndexBand, Prediction
from fitting.sample import Sample

NAN = np.nan
_of_a_model = predictions.predict


def _predict(fit, at=None, quantity="R", wavelength_um=None, *more, **options):
    """`Fit.predict` of today's engines; of a model's name what `fitting.predict` does."""
    if not isinstance(fit, Fit):
        return _of_a_model(fit, at, quantity, wavelength_um, *more, **options)
    assert at is None or isinstance(at, Measurement)
    return fit.evaluator.predict(at)


predictions.predict = _predict


def _item(x):
    x = np.asarray(x)
    return x.item() if x.ndim == 0 else x


class _OfIndex:
    def __init__(self, result, measurement):
        self.result, self.measurement = result, measurement

    def predict(self, measurement):
        return Prediction(*fitted_values(self.result, measurement or self.measurement))

    def over_angle(self, angle_deg, quantity):
        return Prediction(*index_curve(self.result, angle_deg, quantity))

    def index(self, wavelength_um, medium):
        r = self.result
        names = ("wavelength_um", "eta", "sigma_eta", "k", "sigma_k")
        return IndexBand(*(np.atleast_1d(getattr(r, n)) for n in names))

    def at(self, index):
        r = self.result
        rows = self.measurement.wavelength_um == r.wavelength_um[index]
        return _OfIndex(r.at(index), self.measurement.where(rows))


def _values(r):
    one = {"eta": r.eta, "k": r.k, "eta_i": r.eta_i, "rms": r.rms, "chi2_reduced": r.chi2_reduced,
           "factor": np.sqrt(r.chi2_reduced), "errors": "scaled", "sample": "one bare surface",
           "n_data": r.n_data, "unknowns": 2, "stated": False, "slope": NAN,
           "parameter": "k", "limit": r.k_upper_limit, "even": True, "below_deg": 30.0,
           "along": "angle", "correlation": r.residual_correlation, "chance": 0.5,
           "delta_chi2": r.alternative_delta_chi2, "count": 1}  # fmt: skip
    return {n: np.asarray(v) if np.ndim(v) else v for n, v in one.items()}


_CODES = {
    "perfect_mirror": flags.PERFECT_MIRROR, "no_reflection": flags.NO_REFLECTION,
    "circle": flags.CIRCLE, "same_at_45_degrees": flags.AT_45_DEGREES,
    "combination": flags.COMBINATION, "does_not_describe": flags.OUT_OF_MODEL,
    "residuals_in_order": flags.NOT_NOISE, "compatible_with_zero": flags.K_BELOW_FLOOR,
    "chi2_large": flags.CHI2_LARGE, "chi2_small": flags.CHI2_SMALL,
    "flat_curve": flags.FLAT_CURVE, "no_degrees_of_freedom": flags.NO_DEGREES,
}  # fmt: skip


def _of_index(result, measurement):
    r, shape = result, result.shape
    at_zero = np.asarray(r.status) == "converged at k = 0"
    estimates = {
        name: Estimate(
            name=name, value=getattr(r, name), sigma=getattr(r, f"sigma_{name}"),
            interval=np.asarray(getattr(r, f"{name}_interval")), interval_kind=r.interval_kind,
            upper_limit=r.k_upper_limit if name == "k" else _item(np.full(shape, NAN)),
            status=_item(np.where(
                np.asarray(r.status) == "undetermined", "undetermined",
                np.where(at_zero & (name == "k"), "at lower bound", "fitted"),
            )),
        )
        for name in ("eta", "k")
    }  # fmt: skip
    values = _values(r)
    findings = tuple(
        Finding(code, np.asarray((np.asarray(r.flags) & bit) != 0), values)
        for code, bit in _CODES.items()
        if ((np.asarray(r.flags) & bit) != 0).any()
    )
    others = ()
    if np.isfinite(r.alternative_eta).any():
        nothing = _item(np.full(shape, NAN))
        others = (Alternative(
            parameters={
                n: Estimate(name=n, value=getattr(r, f"alternative_{n}"), sigma=nothing,
                            interval=np.full((*shape, 2), NAN), interval_kind="none")
                for n in ("eta", "k")
            },
            delta_chi2=r.alternative_delta_chi2,
        ),)  # fmt: skip
    stated = bool(np.isfinite(measurement.sigma).all()) and bool(np.isfinite(r.chi2).any())
    scaled = r.sigma_kind == "scaled"
    return Fit(
        sample=Sample.parse("free" if r.eta_i == 1 else f"{r.eta_i} | free"), parameters=estimates,
        covariance=r.covariance,
        wavelength_um=r.wavelength_um, chi2=r.chi2, chi2_reduced=r.chi2_reduced, dof=r.dof,
        n_data=r.n_data, rms=r.rms,
        status=_item(np.where(at_zero, "converged", np.asarray(r.status))),
        errors=ErrorModel(
            ("scaled" if stated else "equal") if scaled else "stated",
            _item(np.sqrt(np.asarray(r.chi2_reduced)) if scaled else np.ones(shape)), 0.0, stated,
        ),
        evaluations=r.iterations, findings=findings, others=others, measurement=measurement,
        curve=np.unique(measurement.quantity, return_inverse=True)[1],
        curve_names=tuple(np.unique(measurement.quantity)),
        evaluator=_OfIndex(r, measurement),
    )  # fmt: skip


class _OfModel:
    def __init__(self, fit):
        self.fit = fit

    def predict(self, measurement):
        return Prediction(*self.fit.fitted(measurement))

    def index(self, wavelength_um, medium):
        if wavelength_um is None:
            wavelength_um = np.unique(self.fit.measurement.wavelength_um)
        return IndexBand(*self.fit.index(wavelength_um))


def _estimates(f, values, sigmas, intervals, kinds, limits, ends):
    bound = {"": "fitted", "low": "at lower bound", "high": "at upper bound"}
    out = {
        n: Estimate(name=n, unit=u, value=v, sigma=s, interval=np.asarray(i), interval_kind=k,
                    upper_limit=lim, status=bound[e])
        for n, u, v, s, i, k, lim, e in zip(
            f.names, f.units, values, sigmas, intervals, kinds, limits, ends, strict=True)
    }  # fmt: skip
    return out


def _text_of(f):
    first = f"{f.eta_i:.10g}"
    if f.structure == "interface":
        return f.model if f.eta_i == 1.0 else f"{first} | {f.model}"
    return f"{first} | {f.model} {f.parameters['thickness_um']:.8g} um thick | {first}"


def of_model(f):
    """The one result of a `ModelFit`."""
    estimates = _estimates(
        f, f.values.tolist(), f.sigmas.tolist(), f.intervals, f.interval_kinds,
        f.upper_limits.tolist(), f.at_bound,
    )  # fmt: skip
    for name, value in f.fixed.items():
        unit = "um" if name.endswith("_um") else "eV" if name.endswith("_ev") else ""
        estimates[name] = Estimate(
            name=name, value=value, sigma=0.0, interval=np.array([value, value]),
            interval_kind="none", status="fixed", unit=unit,
        )  # fmt: skip
    others = tuple(
        Alternative(
            parameters={
                n: Estimate(name=n, value=v, sigma=o["sigmas"][n], interval=np.full(2, NAN),
                            interval_kind="none")
                for n, v in o["values"].items()
            },
            delta_chi2=o["delta_chi2"], reached=o["reached"],
        )
        for o in f.others
    )  # fmt: skip
    m = f.measurement
    known = np.unique(m.wavelength_um[np.isfinite(m.wavelength_um)])
    stated = bool(np.isfinite(f.chi2))
    scaled = f.sigma_kind == "scaled"
    findings = []
    if "not determined separately" in " ".join(f.warnings):
        findings.append(Finding("not_seen", np.True_, {"parameters": list(f.names)}))
    if "not noise" in " ".join(f.warnings):
        findings.append(Finding("residuals_in_order", np.True_, {
            "along": "wavelength", "correlation": 0.9, "chance": 0.3}))  # fmt: skip
    return Fit(
        sample=Sample.parse(_text_of(f)), parameters=estimates, covariance=f.covariance,
        wavelength_um=known, chi2=f.chi2, chi2_reduced=f.chi2_reduced, dof=f.dof,
        n_data=f.n_data, rms=f.rms, rms_of=f.rms_of, status=f.status, loss=f.loss, noise=f.noise,
        errors=ErrorModel(
            ("scaled" if stated else "equal") if scaled else "stated",
            float(np.sqrt(f.chi2_reduced)) if scaled else 1.0, 0.0, stated,
        ),
        evaluations=f.iterations, starts=f.starts, reached=f.reached, cost=f.cost, bic=f.bic,
        aicc=f.aicc, findings=tuple(findings), others=others,
        measurement=m, curve=f.curve, curve_names=f.curve_names, evaluator=_OfModel(f),
    )  # fmt: skip


class _OfPoints:
    def __init__(self, fits):
        self.fits = fits

    def predict(self, measurement):
        if measurement is None:
            return Prediction(*self.fits.fitted())
        out = np.full((2, len(measurement)), NAN)
        for w, f in zip(self.fits.wavelength_um, self.fits.fits, strict=True):
            of = measurement.wavelength_um == w
            if np.isnan(w):
                of = np.isnan(measurement.wavelength_um)
            if of.any():
                out[:, of] = f.fitted(measurement.where(of))
        return Prediction(*out)

    def index(self, wavelength_um, medium):
        f = self.fits
        return IndexBand(f.wavelength_um, f.eta, f.sigma_eta, f.k, f.sigma_k)

    def at(self, index):
        return _OfModel(self.fits.fits[index[0]])


def of_points(fits):
    """The one result of `PointFits`; of one wavelength that of one curve."""
    one = len(fits.fits) == 1

    def picked(x):
        x = np.asarray(x)
        return (x[0].item() if x[0].ndim == 0 else x[0]) if one else x

    estimates = {
        n: Estimate(
            name=n, value=picked(getattr(fits, n)), sigma=picked(getattr(fits, f"sigma_{n}")),
            interval=picked(getattr(fits, f"{n}_interval")),
            interval_kind=picked(fits.interval_kind),
            upper_limit=picked(fits.k_upper_limit) if n == "k" else picked(
                np.full(len(fits.fits), NAN)),
            status=picked(np.where(fits.status == "undetermined", "undetermined", "fitted")),
        )
        for n in ("eta", "k")
    }  # fmt: skip
    d = fits.fits[0].fixed.get("thickness_um")
    first = f"{fits.eta_i:.10g}"
    if d is not None:
        estimates["thickness_um"] = Estimate(
            name="thickness_um", unit="um", value=d, sigma=0.0, interval=np.array([d, d]),
            interval_kind="none", status="fixed")  # fmt: skip
    text = "free" if d is None else f"{first} | free {d:.8g} um thick | {first}"
    notes = (Warning("pseudo_index"),) if fits.pseudo else ()
    f0 = fits.fits[0]
    findings, others = [], ()
    has = np.array([bool(f.others) for f in fits.fits])
    if has.any():

        def alt(n):
            return picked(np.array([
                f.others[0]["values"][n] if f.others else NAN for f in fits.fits]))  # fmt: skip

        delta = picked(np.array([
            f.others[0]["delta_chi2"] if f.others else NAN for f in fits.fits]))  # fmt: skip
        nothing = picked(np.full(len(fits.fits), NAN))
        others = (Alternative(
            parameters={
                n: Estimate(name=n, value=alt(n), sigma=nothing, interval_kind="none",
                            interval=picked(np.full((len(fits.fits), 2), NAN)))
                for n in ("eta", "k")
            }, delta_chi2=delta),)  # fmt: skip
    for code, words in (("residuals_in_order", "not noise"), ("chi2_small", "too large")):
        at = np.array([any(words in t for t in f.warnings) for f in fits.fits])
        if at.any():
            findings.append(Finding(code, np.asarray(picked(at)), {
                "along": "angle", "correlation": 0.84, "chance": 0.61, "errors": "scaled",
                "chi2_reduced": picked(fits.chi2_reduced),
                "factor": picked(np.sqrt(fits.chi2_reduced))}))  # fmt: skip
    covariance = np.array([f.covariance for f in fits.fits])
    m = fits.measurement
    stated = bool(np.isfinite(f0.chi2))
    scaled = f0.sigma_kind == "scaled"
    factor = picked(np.sqrt(fits.chi2_reduced))
    return Fit(
        sample=Sample.parse(text), parameters=estimates, covariance=picked(covariance),
        wavelength_um=picked(fits.wavelength_um), chi2=picked(fits.chi2),
        chi2_reduced=picked(fits.chi2_reduced), dof=picked([f.dof for f in fits.fits]),
        n_data=picked([f.n_data for f in fits.fits]), rms=picked(fits.rms),
        rms_of={q: picked([f.rms_of[q] for f in fits.fits]) for q in f0.rms_of},
        status=picked(fits.status),
        errors=ErrorModel(
            ("scaled" if stated else "equal") if scaled else "stated",
            factor if scaled else 1.0, 0.0, stated),
        findings=tuple(findings), others=others, notes=notes, measurement=m, curve=fits.curve,
        curve_names=fits.curve_names, evaluator=_OfPoints(fits),
    )  # fmt: skip


def wrapped(measurement: Measurement, sample: str | None = None, thickness_um=None, **options):
    """The fit of a measurement in the form of the one result."""
    if sample is not None:
        if thickness_um is not None:
            options |= {"structure": "slab", "thickness_um": thickness_um}
        return of_model(fit_model(measurement, sample, **options))
    if thickness_um is not None or np.isin(measurement.quantity, ("psi", "delta")).any():
        structure = "interface" if thickness_um is None else "slab"
        return of_points(fit_points(measurement, structure, thickness_um=thickness_um, **options))
    return _of_index(fit_index(measurement, **options), measurement)
