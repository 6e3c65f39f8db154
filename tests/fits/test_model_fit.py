"""Model fits of simulated data: values, errors, nuisances, settings, bands, refusals."""

import json
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares

from fitting import Measurement, fit, simulate
from fresnel_jax.dispersion import Cauchy
from tests.estimates import bounds, codes, fixed, limits, sigmas, values

pytestmark = pytest.mark.slow

WAVELENGTHS = np.linspace(0.4, 0.9, 14)
ANGLES = np.array([45.0, 65.0, 75.0])
SIGMA = 1e-3


def grid(angles=ANGLES, wavelengths=WAVELENGTHS):
    return tuple(a.ravel() for a in np.meshgrid(angles, wavelengths))


def simulated(model, parameters, sigma=SIGMA, seed=1, quantities=("R_s", "R_p")):
    random = np.random.default_rng(seed)
    angle, wavelength = grid()
    columns = {
        q: simulate(model, parameters, angle, wavelength, q)
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


@pytest.mark.parametrize(
    "model",
    [
        *(pytest.param(m, marks=pytest.mark.study) for m in ("cauchy-urbach:2", "tauc-lorentz")),
        "lorentz",
    ],
)
def test_truths_come_back_without_noise_and_within_errors_with_it(model):
    truth = MODELS[model]
    fixed = {"edge_ev": 3.0} if "edge_ev" in truth else {}
    for sigma in (0.0, SIGMA):
        found = fit(simulated(model, truth, sigma), model, fixed=fixed, errors="stated")
        assert found.status == "converged", found.warnings
        true = np.array([truth[name] for name in found.names])
        if sigma == 0.0:
            scale = np.maximum(np.abs(true), 0.01)
            np.testing.assert_allclose(values(found) / scale, true / scale, atol=1e-9)
        else:
            assert (np.abs(values(found) - true) < 4.5 * sigmas(found)).all()
            assert 0.5 < found.chi2_reduced < 1.6


def by_hand(m):
    """Return the residuals of R_s and R_p as a function of A and B, by the textbook's R."""
    c = np.cos(np.radians(m.angle_deg))

    def residual(x):
        n = x[0] + x[1] / m.wavelength_um**2
        q = np.sqrt(n * n - 1.0 + c * c)
        r_s, r_p = (c - q) / (c + q), (n * n * c - q) / (n * n * c + q)
        return (np.where(m.quantity == "R_s", r_s**2, r_p**2) - m.value) / m.sigma

    return residual


def test_values_and_errors_are_those_of_scipy():
    """The same problem written by hand, the textbook's R, solved and linearised by scipy."""
    m = simulated("cauchy:2", {"A": 1.5, "B": 0.012})
    residual = by_hand(m)
    theirs = least_squares(residual, [1.5, 0.01], xtol=1e-15, ftol=1e-15, gtol=1e-15)
    ours = fit(m, "cauchy:2", errors="stated")
    np.testing.assert_allclose(values(ours), theirs.x, rtol=1e-7)
    covariance = np.linalg.inv(theirs.jac.T @ theirs.jac)
    # scipy's derivatives are differences
    np.testing.assert_allclose(ours.covariance, covariance, rtol=1e-5)
    assert ours.chi2 == pytest.approx(2.0 * theirs.cost, rel=1e-10)
    scaled = fit(m, "cauchy:2")
    factor = np.sqrt(scaled.chi2_reduced)
    np.testing.assert_allclose(sigmas(scaled), sigmas(ours) * factor, rtol=1e-10)
    assert ours.bic == pytest.approx(ours.chi2 + 2 * np.log(len(m)), rel=1e-12)
    # with a prior: one more row
    with_row = least_squares(
        lambda x: np.append(residual(x), (x[1] - 0.02) / 5e-4), [1.5, 0.01],
        xtol=1e-15, ftol=1e-15, gtol=1e-15,
    )  # fmt: skip
    prior = fit(m, "cauchy:2", priors={"B": (0.02, 5e-4)}, errors="stated")
    np.testing.assert_allclose(values(prior), with_row.x, rtol=1e-7)
    inverse = np.linalg.inv(with_row.jac.T @ with_row.jac)
    np.testing.assert_allclose(prior.covariance, inverse, rtol=1e-5)
    assert prior.dof == ours.dof + 1
    # without stated errors the prior is weighed by the noise that the residuals show
    bare = Measurement.from_columns(*grid(), R_s=m.value[:42], R_p=m.value[42:])
    prior = fit(m, "cauchy:2", priors={"B": (0.0125, 3e-4)}, errors="stated")
    found = fit(bare, "cauchy:2", priors={"B": (0.0125, 3e-4)})
    assert found.noise == pytest.approx(SIGMA, rel=0.3)
    assert found.parameters["B"].value == pytest.approx(
        prior.parameters["B"].value, abs=prior.parameters["B"].sigma
    )
    np.testing.assert_allclose(sigmas(found), sigmas(prior), rtol=0.3)


def test_psi_and_delta_with_and_without_errors():
    truth = {"eta": 0.4, "k": 3.0}
    angle = np.array([60.0, 65.0, 70.0, 75.0, 80.0])
    random = np.random.default_rng(4)
    psi, delta = (simulate("constant", truth, angle, 0.6, q) for q in ("psi", "delta"))
    psi = psi + 0.05 * random.standard_normal(5)
    delta = delta + 0.2 * random.standard_normal(5)
    m = Measurement.from_columns(
        angle, 0.6, sigma={"psi": 0.05, "delta": 0.2}, psi=psi, delta=delta
    )
    found = fit(m, "constant", errors="stated")

    def residual(x):
        n = np.sqrt((x[0] + 1j * x[1]) ** 2 - np.sin(np.radians(angle)) ** 2)
        c, N2 = np.cos(np.radians(angle)), (x[0] + 1j * x[1]) ** 2
        rho = (N2 * c - n) / (N2 * c + n) * (c + n) / (c - n)
        off = np.degrees(np.arctan(abs(rho))) - psi, -np.degrees(np.angle(rho)) - delta
        return np.concatenate([off[0] / 0.05, (off[1] + 180.0) % 360.0 / 0.2 - 900.0])

    theirs = least_squares(residual, [0.5, 3.1], xtol=1e-15, ftol=1e-15, gtol=1e-15)
    # psi and Delta and their image on the sphere differ by the curvature, a share of sigma (radian)
    np.testing.assert_allclose(values(found), theirs.x, atol=0.01 * sigmas(found).min())
    covariance = np.linalg.inv(theirs.jac.T @ theirs.jac)
    np.testing.assert_allclose(found.covariance, covariance, rtol=0.02)
    assert found.chi2 == pytest.approx(2.0 * theirs.cost, rel=0.01)
    value, _ = found.predict()
    np.testing.assert_allclose(value[:5], psi, atol=0.3)
    np.testing.assert_allclose(value[5:], delta, atol=1.0)


@pytest.mark.study
def test_several_files_share_the_model_and_have_scales_of_their_own():
    first = simulated(
        "cauchy:2", {"A": 1.5, "B": 0.012, "scale": 0.95}, seed=2, quantities=("R_s",)
    )
    second = simulated(
        "cauchy:2", {"A": 1.5, "B": 0.012, "scale": 1.1}, seed=3, quantities=("R_s",)
    )
    found = fit([first, second], "cauchy:2", free=["scale"], errors="stated")
    names = ("A", "B", "scale[arrays#1 R_s]", "scale[arrays#2 R_s]")
    assert found.names == names
    np.testing.assert_array_less(
        np.abs(values(found) - [1.5, 0.012, 0.95, 1.1]), 4.5 * sigmas(found)
    )
    named = fit([first, second], "cauchy:2", free=["scale[R_s]"], errors="stated")  # of both files
    assert named.names == names and (values(named) == values(found)).all()
    one = fit([first, second], "cauchy:2", free=["scale"], fixed={names[3]: 1.1}, errors="stated")
    assert one.names == names[:3] and fixed(one)[names[3]] == 1.1
    assert one.parameters["A"].sigma < found.parameters["A"].sigma
    assert one.parameters[names[3]].sigma == 0.0
    np.testing.assert_array_equal(found.curve, [0] * 42 + [1] * 42)
    assert len(found.predict().value) == len(first) + len(second)


def test_free_fixed_and_bounded():
    m = simulated("cauchy:2", {"A": 1.5, "B": 0.012})
    held = fit(m, "cauchy:2", fixed={"B": 0.012})
    assert held.names == ("A",) and held.parameters["B"].value == 0.012
    cut = fit(m, "cauchy:2", bounds={"A": (1.5005, 1.6)})
    assert cut.parameters["A"].value == 1.5005 and bounds(cut) == ("low", "")
    assert np.isnan(cut.parameters["A"].sigma) and np.isfinite(cut.parameters["B"].sigma)
    assert any("A ended at the lower end" in w.text for w in cut.warnings)
    offset = simulated("cauchy:2", {"A": 1.5, "B": 0.012, "angle_offset": 0.3})
    found = fit(offset, "cauchy:2", free=["angle-offset"], errors="stated")
    assert found.parameters["angle_offset"].value == pytest.approx(
        0.3, abs=4.0 * found.parameters["angle_offset"].sigma
    )


def test_bands_are_the_spread_of_repeats():
    """One sigma of the curve and of eta against the scatter of 40 simulated measurements."""
    truth = {"A": 1.5, "B": 0.012}
    fits = [
        fit(replace(simulated("cauchy:2", truth, seed=s), sigma=np.full(84, np.nan)), "cauchy:2")
        for s in range(40)
    ]
    value, sigma = (np.array(a) for a in zip(*(f.predict() for f in fits), strict=True))
    # 40 repeats know a standard deviation to 11 %; 84 points move together in two directions
    np.testing.assert_allclose(value.std(0, ddof=1) / sigma.mean(0), 1.0, atol=0.35)
    index = [f.index([0.45, 0.7]) for f in fits]
    spread = np.std([i.eta for i in index], axis=0, ddof=1)
    np.testing.assert_allclose(spread / index[0].sigma_eta, 1.0, atol=0.35)
    assert (index[0].k == 0.0).all() and (index[0].sigma_k == 0.0).all()
    elsewhere = Measurement.from_columns([10.0, 20.0], 0.5, R_s=[0.0, 0.0])
    held_out, _ = fits[0].predict(elsewhere)
    true = simulate("cauchy:2", fits[0].values, [10.0, 20.0], 0.5, "R_s")
    np.testing.assert_allclose(held_out, true, rtol=1e-12)


def test_outliers_do_not_count_with_a_robust_loss():
    m = simulated("cauchy:2", {"A": 1.5, "B": 0.012})
    value = m.value.copy()
    value[::9] += 0.1
    spoilt = Measurement.from_columns(
        m.angle_deg[:42], m.wavelength_um[:42], sigma=SIGMA, R_s=value[:42], R_p=value[42:]
    )
    plain = least_squares(by_hand(spoilt), [1.5, 0.01])
    robust = fit(spoilt, "cauchy:2", loss="huber")
    assert abs(plain.x[0] - 1.5) > 0.01
    assert abs(robust.parameters["A"].value - 1.5) < 4.0 * robust.parameters["A"].sigma < 0.005
    assert robust.noise == pytest.approx(1.0, abs=0.35)
    clean = fit(m, "cauchy:2", loss="huber", errors="stated")
    # as good as least squares to a few per cent where there are no outliers
    squares = fit(m, "cauchy:2", errors="stated")
    assert clean.parameters["A"].sigma == pytest.approx(squares.parameters["A"].sigma, rel=0.15)


def test_what_is_not_determined_is_named():
    angle = np.zeros(3)
    m = Measurement.from_columns(angle, 0.5, sigma=SIGMA, R=[0.300, 0.301, 0.299])
    circle = fit(m, "constant")
    assert circle.status == "undetermined" and np.isnan(sigmas(circle)).all()
    assert "eta and k are not determined separately" in circle.warnings[0].text
    glass = simulated("constant", {"eta": 1.5, "k": 0.0})
    found = fit(glass, "constant", errors="stated")
    limit = limits(found)[found.names.index("k")]
    assert 0.005 < limit < 0.1 and np.isfinite(found.parameters["eta"].sigma)
    assert any("k is compatible with 0" in w.text for w in found.warnings)
    two = fit(simulated("cauchy", CAUCHY), "cauchy", free=["scale", "background"])
    assert any("strongly correlated" in w.text for w in two.warnings)


@pytest.mark.study
def test_nan_never_succeeds(monkeypatch):
    """A model that is NaN everywhere ends as not converged, from whatever start."""
    from fitting.samples import dispersion as models

    nan = models.KINDS["cauchy"]._replace(
        model=lambda n, v: Cauchy(jnp.stack([v["A"] * jnp.nan, v["B"]]))
    )
    monkeypatch.setitem(models.KINDS, "cauchy", nan)
    m = simulated("sellmeier", MODELS["sellmeier"])
    # a number of terms that no other test has compiled
    found = fit(m, "cauchy:4", free=["leak"])
    assert found.status == "not converged" and found.reached == 0
    assert np.isnan(sigmas(found)).all() and codes(found) == ["not_converged"]
    # and where it is NaN in part of its range, the rest of it is found
    truth, known = MODELS["tauc-lorentz"], models.KINDS["tauc-lorentz"]

    def underdamped(n, v):
        width = jnp.where(v["width_ev_1"] < 2.0 * v["resonance_ev_1"], v["width_ev_1"], jnp.nan)
        return known.model(n, {**v, "width_ev_1": width})

    monkeypatch.setitem(models.KINDS, "underdamped", known._replace(model=underdamped))
    found = fit(simulated("tauc-lorentz", truth), "underdamped", bounds={"width_ev_1": (0.5, 50.0)})
    assert found.parameters["width_ev_1"].value == pytest.approx(truth["width_ev_1"], rel=0.1)


def test_plain_data():
    found = fit(simulated("cauchy:2", {"A": 1.5, "B": 0.012}), "cauchy:2")
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert data["names"] == ["A", "B"] and data["status"] == "converged"
    assert [data["parameters"][n]["value"] for n in "AB"] == values(found).tolist()
    assert "measurement" not in data


def test_x64_is_left_as_it_was():
    with jax.enable_x64(False):
        found = fit(simulated("cauchy:2", {"A": 1.5, "B": 0.012}), "cauchy:2")
        assert not jax.config.jax_enable_x64
    assert values(found).dtype == np.float64 and found.status == "converged"


def test_without_a_degree_of_freedom_stated_errors_are_taken_at_their_word():
    m = Measurement.from_columns(60.0, R_s=[0.45], R_p=[0.08], sigma=0.002)
    alone, of_model = fit(m, intervals="quadratic"), fit(m, "constant", intervals="quadratic")
    np.testing.assert_allclose(sigmas(of_model), sigmas(alone), rtol=1e-6)
    ours, theirs = (f.parameters["eta"].interval for f in (of_model, alone))
    np.testing.assert_allclose(ours, theirs, rtol=1e-6)
    for found in (of_model, alone):
        assert "as they are" in " ".join(str(found).split())
