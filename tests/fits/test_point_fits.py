"""eta and k wavelength by wavelength, of a slab and of an interface, alone and side by side."""

import json
from typing import Any

import numpy as np
import pytest

from fitting import Measurement, fit, simulate
from tests.estimates import codes, sigmas, values

pytestmark = pytest.mark.slow

WAVELENGTHS = np.linspace(0.4, 0.8, 18)  # more than one group of lanes
ETA = 1.52 + 0.004 / WAVELENGTHS**2
PLATE = "air | free 2 mm thick | air"
K = np.geomspace(1e-7, 3e-5, len(WAVELENGTHS))


def plate(angles=(0.0,), quantities=("T", "R"), sigma=0.0, seed=1, thickness=2000.0):
    random = np.random.default_rng(seed)
    angle, wavelength = (a.ravel() for a in np.meshgrid(angles, WAVELENGTHS))
    columns: dict[str, Any] = {q: [] for q in quantities}
    sample = f"air | constant {thickness} um thick | air"
    for a, w in zip(angle, wavelength, strict=True):
        i = int(np.argmin(np.abs(WAVELENGTHS - w)))
        values = {"eta": ETA[i], "k": K[i]}
        for q in quantities:
            true = simulate(sample, values, a, w, q)[0]
            columns[q].append(true + sigma * random.standard_normal())
    return Measurement.from_columns(angle, wavelength, sigma=sigma or None, **columns)


def test_exact_data_at_normal_incidence():
    found = fit(plate(), PLATE)
    assert set(found.status) == {"converged"}
    np.testing.assert_allclose(found.eta, ETA, rtol=1e-9)
    np.testing.assert_allclose(found.k, K, rtol=1e-7)
    # two values for two unknowns: nothing tells the noise
    assert np.isnan(found.parameters["eta"].sigma).all()
    # below 1 there is a second index at each wavelength
    for one, eta in zip(found, ETA, strict=True):
        other = one.alternatives[0].parameters["eta"].value
        assert other == pytest.approx(1.0 / eta, rel=1e-6)


def test_oblique_s_and_p_with_errors():
    m = plate((0.0, 50.0, 70.0), ("T_s", "T_p", "R_s", "R_p"), sigma=1e-3)
    found = fit(m, PLATE, errors="stated")
    z = np.stack(
        [
            (found.eta - ETA) / found.parameters["eta"].sigma,
            (found.k - K) / found.parameters["k"].sigma,
        ]
    )
    assert np.abs(z).max() < 4.5 and 0.7 < z.std() < 1.3
    assert not any(one.alternatives for one in found)  # the angles tell the two indices apart
    value, sigma = found.predict()
    assert np.std((m.value - value) / m.sigma) == pytest.approx(1.0, abs=0.15)
    assert (sigma < m.sigma).all()


@pytest.mark.study
def test_side_by_side_as_alone():
    m = plate((0.0, 60.0), ("T", "R"), sigma=1e-3)
    together = fit(m, PLATE, errors="stated")
    for i in (0, 17):
        one = m.where(m.wavelength_um == WAVELENGTHS[i])
        alone = fit(one, "air | constant 2 mm thick | air", errors="stated", intervals="quadratic")
        np.testing.assert_allclose(values(together[i]), values(alone), rtol=1e-8)
        np.testing.assert_allclose(sigmas(together[i]), sigmas(alone), rtol=1e-6)
        assert codes(together[i]) == codes(alone)
        # All starts from the other wavelengths lead to the same minimum.
        assert together[i].reached - alone.reached == together[i].starts - alone.starts == 16


def test_ellipsometry_of_an_interface_and_wavelengths_with_gaps():
    angle, wavelength = (a.ravel() for a in np.meshgrid([65.0, 75.0], [0.5, 0.6, 0.7]))
    eta, k = 0.3 + wavelength, 2.0 + wavelength
    seen = {q: [simulate("constant", {"eta": n, "k": kk}, a, 0.5, q)[0]
                for a, n, kk in zip(angle, eta, k, strict=True)]
            for q in ("psi", "delta", "R")}  # fmt: skip
    reflectance = np.where(wavelength < 0.55, seen["R"], np.nan)  # at one wavelength only
    m = Measurement.from_columns(
        angle, wavelength, psi=seen["psi"], delta=seen["delta"], R=reflectance
    )
    found = fit(m)
    np.testing.assert_allclose(found.eta, [0.8, 0.9, 1.0], rtol=1e-8)
    np.testing.assert_allclose(found.k, [2.5, 2.6, 2.7], rtol=1e-8)
    assert found.n_data.tolist() == [6, 4, 4]


def test_plain_data_and_refusals():
    m = plate()
    data = json.loads(json.dumps(fit(m, PLATE).to_dict(), allow_nan=False))
    assert len(data["eta"]) == len(WAVELENGTHS)
    assert data["parameters"]["eta"]["sigma"][0] is None
    assert data["parameters"]["thickness_um"]["value"] == 2000.0
    with pytest.raises(ValueError, match="as a plate with its thickness"):
        fit(m)
    with pytest.raises(ValueError, match='errors "stated" need a standard error for every datum'):
        fit(m, PLATE, errors="stated")
    with pytest.raises(ValueError, match="wavelength"):
        fit(Measurement.from_columns([0.0, 1.0], [0.5, np.nan], R=[0.1, 0.1]), PLATE)


@pytest.mark.parametrize("priors", [{}, {"k": (0.5, 0.05)}])
def test_a_robust_loss_means_the_same_at_every_wavelength(priors):
    """An outlier at each of two wavelengths, without stated errors: the noise is found for each."""
    angle = np.tile(np.linspace(20.0, 75.0, 30), 2)
    wave = np.repeat([0.5, 0.6], 30)
    rng = np.random.default_rng(1)
    clean = simulate("constant", {"eta": 1.6, "k": 0.5}, angle, wave, "R_s")
    R = clean + 1e-3 * rng.standard_normal(60)
    R[[10, 40]] += 0.2
    m = Measurement.from_columns(angle, wave, R_s=R)
    robust, plain = fit(m, loss="huber", priors=priors), fit(m)
    assert robust.shape == plain.shape == (2,)
    assert np.abs(robust.eta - 1.6).max() < 0.02 < np.abs(plain.eta - 1.6).max()
    one = fit(m.where(wave == 0.5), loss="huber", priors=priors)
    np.testing.assert_allclose(robust.eta[0], one.eta, rtol=1e-9)
    for name, e in one.parameters.items():
        np.testing.assert_allclose(robust[0].parameters[name].sigma, e.sigma, rtol=1e-6)
        np.testing.assert_allclose(robust[0].parameters[name].interval, e.interval, rtol=1e-4)
    assert (robust.status[0], robust.dof[0]) == (one.status, one.dof)


def test_starts_and_a_given_start_lead_to_the_minimum_of_the_mesh():
    angle, wave = (a.ravel() for a in np.meshgrid(np.linspace(20.0, 75.0, 30), [0.5, 0.6]))
    truth = {"eta": 1.6, "k": 0.5}
    R = simulate("constant", truth, angle, wave, "R_s")
    m = Measurement.from_columns(angle, wave, R_s=R + 1e-3 * np.sin(7.0 * angle * wave))
    mesh = fit(m)
    for options in ({"starts": 8}, {"start": truth}):
        found = fit(m, **options)
        np.testing.assert_allclose(found.eta, mesh.eta, rtol=1e-6)
    with pytest.raises(ValueError, match="start names n"):
        fit(m, start={"n": 1.6})
