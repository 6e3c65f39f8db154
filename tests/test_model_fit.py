"""Model fits of simulated data: values, errors, nuisances, settings, bands, refusals."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares

from fitting import Measurement, fit, fit_model, predict
from fitting.output import report
from fitting.output.model_report import table
from fresnel_jax.dispersion import Cauchy, TaucLorentz

WAVELENGTHS = np.linspace(0.4, 0.9, 14)
ANGLES = np.array([45.0, 65.0, 75.0])
SIGMA = 1e-3


def grid(angles=ANGLES, wavelengths=WAVELENGTHS):
    return tuple(a.ravel() for a in np.meshgrid(angles, wavelengths))


def simulated(model, parameters, sigma=SIGMA, seed=1, quantities=("R_s", "R_p"), **how):
    random = np.random.default_rng(seed)
    angle, wavelength = grid()
    columns = {
        q: predict(model, parameters, angle, wavelength, q, **how)
        + sigma * random.standard_normal(len(angle))
        for q in quantities
    }
    return Measurement.from_columns(angle, wavelength, sigma=sigma or SIGMA, **columns)


CAUCHY = {"A": 1.5, "B": 0.012, "C": 0.0}


MODELS = {
    "cauchy-urbach:2": {"A": 1.7, "B": 0.01, "k_edge": 0.3, "urbach_ev": 0.4, "edge_ev": 3.0},
    "sellmeier": {"strength_1": 1.2, "resonance_um_1": 0.15},
    "lorentz": {"eps_inf": 2.0, "strength_ev2_1": 6.0, "resonance_ev_1": 2.3, "width_ev_1": 0.5},
    "tauc-lorentz": {"eps_inf": 1.5, "amplitude_ev_1": 90.0, "resonance_ev_1": 3.4,
                     "width_ev_1": 1.5, "gap_ev": 1.7},
}  # fmt: skip


@pytest.mark.parametrize("model", ["cauchy-urbach:2", "lorentz", "tauc-lorentz"])
def test_truths_come_back_without_noise_and_within_errors_with_it(model):
    truth = MODELS[model]
    fixed = {"edge_ev": 3.0} if "edge_ev" in truth else {}
    for sigma in (0.0, SIGMA):
        found = fit_model(simulated(model, truth, sigma), model, fixed=fixed, absolute_sigma=True)
        assert found.status == "converged", found.warnings
        true = np.array([truth[name] for name in found.names])
        if sigma == 0.0:
            scale = np.maximum(np.abs(true), 0.01)
            np.testing.assert_allclose(found.values / scale, true / scale, atol=1e-9)
        else:
            assert (np.abs(found.values - true) < 4.5 * found.sigmas).all()
            assert 0.5 < found.chi2_reduced < 1.6


def test_values_and_errors_are_those_of_scipy():
    """The same problem written by hand, the textbook's R, solved and linearised by scipy."""
    m = simulated("cauchy:2", {"A": 1.5, "B": 0.012})
    c = np.cos(np.radians(m.angle_deg))

    def residual(x):
        n = x[0] + x[1] / m.wavelength_um**2
        q = np.sqrt(n * n - 1.0 + c * c)
        r_s, r_p = (c - q) / (c + q), (n * n * c - q) / (n * n * c + q)
        return (np.where(m.quantity == "R_s", r_s**2, r_p**2) - m.value) / m.sigma

    theirs = least_squares(residual, [1.5, 0.01], xtol=1e-15, ftol=1e-15, gtol=1e-15)
    ours = fit_model(m, "cauchy:2", absolute_sigma=True)
    np.testing.assert_allclose(ours.values, theirs.x, rtol=1e-7)
    covariance = np.linalg.inv(theirs.jac.T @ theirs.jac)
    # scipy's derivatives are differences
    np.testing.assert_allclose(ours.covariance, covariance, rtol=1e-5)
    assert ours.chi2 == pytest.approx(2.0 * theirs.cost, rel=1e-10)
    scaled = fit_model(m, "cauchy:2")
    factor = np.sqrt(scaled.chi2_reduced)
    np.testing.assert_allclose(scaled.sigmas, ours.sigmas * factor, rtol=1e-10)
    assert ours.bic == pytest.approx(ours.chi2 + 2 * np.log(len(m)), rel=1e-12)
    # with a prior: one more row
    with_row = least_squares(
        lambda x: np.append(residual(x), (x[1] - 0.02) / 5e-4), [1.5, 0.01],
        xtol=1e-15, ftol=1e-15, gtol=1e-15,
    )  # fmt: skip
    prior = fit_model(m, "cauchy:2", priors={"B": (0.02, 5e-4)}, absolute_sigma=True)
    np.testing.assert_allclose(prior.values, with_row.x, rtol=1e-7)
    inverse = np.linalg.inv(with_row.jac.T @ with_row.jac)
    np.testing.assert_allclose(prior.covariance, inverse, rtol=1e-5)
    assert prior.dof == ours.dof + 1
    # without stated errors the prior is weighed by the noise that the residuals show
    bare = Measurement.from_columns(*grid(), R_s=m.value[:42], R_p=m.value[42:])
    prior = fit_model(m, "cauchy:2", priors={"B": (0.0125, 3e-4)}, absolute_sigma=True)
    found = fit_model(bare, "cauchy:2", priors={"B": (0.0125, 3e-4)})
    assert found.noise == pytest.approx(SIGMA, rel=0.3)
    assert found.value_of("B") == pytest.approx(prior.value_of("B"), abs=prior.sigma_of("B"))
    np.testing.assert_allclose(found.sigmas, prior.sigmas, rtol=0.3)


def test_psi_and_delta_with_and_without_errors():
    truth = {"eta": 0.4, "k": 3.0}
    angle = np.array([60.0, 65.0, 70.0, 75.0, 80.0])
    random = np.random.default_rng(4)
    psi, delta = (predict("constant", truth, angle, 0.6, q) for q in ("psi", "delta"))
    psi = psi + 0.05 * random.standard_normal(5)
    delta = delta + 0.2 * random.standard_normal(5)
    m = Measurement.from_columns(
        angle, 0.6, sigma={"psi": 0.05, "delta": 0.2}, psi=psi, delta=delta
    )
    found = fit_model(m, "constant", absolute_sigma=True)

    def residual(x):
        n = np.sqrt((x[0] + 1j * x[1]) ** 2 - np.sin(np.radians(angle)) ** 2)
        c, N2 = np.cos(np.radians(angle)), (x[0] + 1j * x[1]) ** 2
        rho = (N2 * c - n) / (N2 * c + n) * (c + n) / (c - n)
        off = np.degrees(np.arctan(abs(rho))) - psi, -np.degrees(np.angle(rho)) - delta
        return np.concatenate([off[0] / 0.05, (off[1] + 180.0) % 360.0 / 0.2 - 900.0])

    theirs = least_squares(residual, [0.5, 3.1], xtol=1e-15, ftol=1e-15, gtol=1e-15)
    # psi and Delta and their image on the sphere differ by the curvature, a share of sigma (radian)
    np.testing.assert_allclose(found.values, theirs.x, atol=0.01 * found.sigmas.min())
    covariance = np.linalg.inv(theirs.jac.T @ theirs.jac)
    np.testing.assert_allclose(found.covariance, covariance, rtol=0.02)
    assert found.chi2 == pytest.approx(2.0 * theirs.cost, rel=0.01)
    value, _ = found.fitted()
    np.testing.assert_allclose(value[:5], psi, atol=0.3)
    np.testing.assert_allclose(value[5:], delta, atol=1.0)


def test_several_files_share_the_model_and_have_scales_of_their_own():
    first = simulated(
        "cauchy:2", {"A": 1.5, "B": 0.012, "scale": 0.95}, seed=2, quantities=("R_s",)
    )
    second = simulated(
        "cauchy:2", {"A": 1.5, "B": 0.012, "scale": 1.1}, seed=3, quantities=("R_s",)
    )
    found = fit_model([first, second], "cauchy:2", free=["scale"], absolute_sigma=True)
    names = ("A", "B", "scale[arrays#1 R_s]", "scale[arrays#2 R_s]")
    assert found.names == names
    np.testing.assert_array_less(np.abs(found.values - [1.5, 0.012, 0.95, 1.1]), 4.5 * found.sigmas)
    one = fit_model(
        [first, second], "cauchy:2", free=["scale"], fixed={names[3]: 1.1}, absolute_sigma=True
    )
    assert one.names == names[:3] and one.fixed[names[3]] == 1.1
    assert one.sigma_of("A") < found.sigma_of("A")
    assert one.sigma_of(names[3]) == 0.0
    np.testing.assert_array_equal(found.curve, [0] * 42 + [1] * 42)
    assert len(found.fitted()[0]) == len(first) + len(second)


def test_free_fixed_and_bounded():
    m = simulated("cauchy:2", {"A": 1.5, "B": 0.012})
    held = fit_model(m, "cauchy:2", fixed={"B": 0.012})
    assert held.names == ("A",) and held.parameters["B"] == 0.012
    cut = fit_model(m, "cauchy:2", bounds={"A": (1.51, 1.6)})
    assert cut.value_of("A") == 1.51 and cut.at_bound == ("low", "")
    assert np.isnan(cut.sigma_of("A")) and np.isfinite(cut.sigma_of("B"))
    assert any("A ended at the lower end" in w for w in cut.warnings)
    offset = simulated("cauchy:2", {"A": 1.5, "B": 0.012, "angle_offset": 0.3})
    found = fit_model(offset, "cauchy:2", free=["angle-offset"], absolute_sigma=True)
    assert found.value_of("angle_offset") == pytest.approx(
        0.3, abs=4.0 * found.sigma_of("angle_offset")
    )


def test_bands_are_the_spread_of_repeats():
    """One sigma of the curve and of eta against the scatter of 40 simulated measurements."""
    truth = {"A": 1.5, "B": 0.012}
    fits = [
        fit_model(simulated("cauchy:2", truth, seed=s), "cauchy:2", absolute_sigma=True)
        for s in range(40)
    ]
    value, sigma = (np.array(a) for a in zip(*(f.fitted() for f in fits), strict=True))
    # 40 repeats know a standard deviation to 11 %; 84 points move together in two directions
    np.testing.assert_allclose(value.std(0, ddof=1) / sigma.mean(0), 1.0, atol=0.35)
    index = [f.index([0.45, 0.7]) for f in fits]
    spread = np.std([i.eta for i in index], axis=0, ddof=1)
    np.testing.assert_allclose(spread / index[0].sigma_eta, 1.0, atol=0.35)
    assert (index[0].k == 0.0).all() and (index[0].sigma_k == 0.0).all()
    elsewhere = Measurement.from_columns([10.0, 20.0], 0.5, R_s=[0.0, 0.0])
    held_out, _ = fits[0].fitted(elsewhere)
    true = predict("cauchy:2", fits[0].parameters, [10.0, 20.0], 0.5, "R_s")
    np.testing.assert_allclose(held_out, true, rtol=1e-12)


@pytest.mark.parametrize("loss", ["huber", "student"])
def test_outliers_do_not_count_with_a_robust_loss(loss):
    m = simulated("cauchy:2", {"A": 1.5, "B": 0.012})
    value = m.value.copy()
    value[::9] += 0.1
    spoilt = Measurement.from_columns(
        m.angle_deg[:42], m.wavelength_um[:42], sigma=SIGMA, R_s=value[:42], R_p=value[42:]
    )
    plain = fit_model(spoilt, "cauchy:2")
    robust = fit_model(spoilt, "cauchy:2", loss=loss)
    assert abs(plain.value_of("A") - 1.5) > 0.01
    assert abs(robust.value_of("A") - 1.5) < 4.0 * robust.sigma_of("A") < 0.005
    assert robust.noise == pytest.approx(1.0, abs=0.35)
    clean = fit_model(m, "cauchy:2", loss=loss, absolute_sigma=True)
    # as good as least squares to a few per cent where there are no outliers
    squares = fit_model(m, "cauchy:2", absolute_sigma=True)
    assert clean.sigma_of("A") == pytest.approx(squares.sigma_of("A"), rel=0.15)


def test_what_is_not_determined_is_named():
    angle = np.zeros(3)
    m = Measurement.from_columns(angle, 0.5, sigma=SIGMA, R=[0.300, 0.301, 0.299])
    circle = fit_model(m, "constant")
    assert circle.status == "undetermined" and np.isnan(circle.sigmas).all()
    assert "eta and k are not determined separately" in circle.warnings[0]
    glass = simulated("constant", {"eta": 1.5, "k": 0.0})
    found = fit_model(glass, "constant", absolute_sigma=True)
    limit = found.upper_limits[found.names.index("k")]
    assert 0.005 < limit < 0.1 and np.isfinite(found.sigma_of("eta"))
    assert any("k is compatible with 0" in w for w in found.warnings)
    two = fit_model(simulated("cauchy", CAUCHY), "cauchy", free=["scale", "background"])
    assert any("strongly correlated" in w for w in two.warnings)


def test_nan_never_succeeds(monkeypatch):
    """A model that is NaN everywhere ends as not converged, from whatever start."""
    from fitting import dispersion as models

    nan = models.KINDS["cauchy"]._replace(
        model=lambda n, v: Cauchy(jnp.stack([v["A"] * jnp.nan, v["B"]]))
    )
    monkeypatch.setitem(models.KINDS, "cauchy", nan)
    m = simulated("sellmeier", MODELS["sellmeier"])
    # a number of terms that no other test has compiled
    found = fit_model(m, "cauchy:4", free=["leak"])
    assert found.status == "not converged" and found.reached == 0
    assert np.isnan(found.sigmas).all() and "did not converge" in found.warnings[0]
    # and where it is NaN in part of its range, the rest of it is found
    truth = MODELS["tauc-lorentz"]
    assert np.isnan(TaucLorentz([90.0], [1.0], [2.5], 0.5)(0.5).eta)
    found = fit_model(
        simulated("tauc-lorentz", truth), "tauc-lorentz", bounds={"width_ev_1": (0.5, 50.0)}
    )
    assert found.value_of("width_ev_1") == pytest.approx(truth["width_ev_1"], rel=0.1)


def test_plain_data():
    found = fit_model(simulated("cauchy:2", {"A": 1.5, "B": 0.012}), "cauchy:2")
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert data["names"] == ["A", "B"] and data["status"] == "converged"
    assert data["values"] == found.values.tolist()
    assert "measurement" not in data


def test_x64_is_left_as_it_was():
    with jax.enable_x64(False):
        found = fit_model(simulated("cauchy:2", {"A": 1.5, "B": 0.012}), "cauchy:2")
        assert not jax.config.jax_enable_x64
    assert found.values.dtype == np.float64 and found.status == "converged"


def test_without_a_degree_of_freedom_stated_errors_are_taken_at_their_word():
    m = Measurement.from_columns(60.0, R_s=[0.45], R_p=[0.08], sigma=0.002)
    alone, of_model = fit(m, intervals="quadratic"), fit_model(m, "constant", intervals="quadratic")
    assert of_model.sigma_of("eta") == pytest.approx(alone.sigma_eta, rel=1e-6)
    assert of_model.sigma_of("k") == pytest.approx(alone.sigma_k, rel=1e-6)
    np.testing.assert_allclose(of_model.interval_of("eta"), alone.eta_interval, rtol=1e-6)
    assert "as they are" in table(of_model, 80) and "as they are" in report.table(alone, m)
