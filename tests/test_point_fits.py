"""eta and k wavelength by wavelength, of a slab and of an interface, alone and side by side."""

import json
from typing import Any

import numpy as np
import pytest

from fitting import Measurement, fit_model, fit_points, predict

WAVELENGTHS = np.linspace(0.4, 0.8, 18)  # more than one group of lanes
ETA = 1.52 + 0.004 / WAVELENGTHS**2
K = np.geomspace(1e-7, 3e-5, len(WAVELENGTHS))


def plate(angles=(0.0,), quantities=("T", "R"), sigma=0.0, seed=1, thickness=2000.0):
    random = np.random.default_rng(seed)
    angle, wavelength = (a.ravel() for a in np.meshgrid(angles, WAVELENGTHS))
    columns: dict[str, Any] = {q: [] for q in quantities}
    for a, w in zip(angle, wavelength, strict=True):
        i = int(np.argmin(np.abs(WAVELENGTHS - w)))
        values = {"eta": ETA[i], "k": K[i], "thickness_um": thickness}
        for q in quantities:
            true = predict("constant", values, a, w, q, structure="slab")[0]
            columns[q].append(true + sigma * random.standard_normal())
    return Measurement.from_columns(angle, wavelength, sigma=sigma or None, **columns)


def test_exact_data_at_normal_incidence():
    found = fit_points(plate(), thickness_um=2000.0)
    assert set(found.status) == {"converged"}
    np.testing.assert_allclose(found.eta, ETA, rtol=1e-9)
    np.testing.assert_allclose(found.k, K, rtol=1e-7)
    # two values for two unknowns: nothing tells the noise
    assert np.isnan(found.sigma_eta).all()
    # below 1 there is a second index at each wavelength
    for fit, eta in zip(found.fits, ETA, strict=True):
        assert fit.others[0]["values"]["eta"] == pytest.approx(1.0 / eta, rel=1e-6)


def test_oblique_s_and_p_with_errors():
    m = plate((0.0, 50.0, 70.0), ("T_s", "T_p", "R_s", "R_p"), sigma=1e-3)
    found = fit_points(m, thickness_um=2000.0, absolute_sigma=True)
    z = np.stack([(found.eta - ETA) / found.sigma_eta, (found.k - K) / found.sigma_k])
    assert np.abs(z).max() < 4.5 and 0.7 < z.std() < 1.3
    assert not any(fit.others for fit in found.fits)  # the angles tell the two indices apart
    value, sigma = found.fitted()
    assert np.std((m.value - value) / m.sigma) == pytest.approx(1.0, abs=0.15)
    assert (sigma < m.sigma).all()


def test_side_by_side_as_alone():
    m = plate((0.0, 60.0), ("T", "R"), sigma=1e-3)
    together = fit_points(m, thickness_um=2000.0, absolute_sigma=True)
    for i in (0, 17):
        one = m.where(m.wavelength_um == WAVELENGTHS[i])
        alone = fit_model(one, "constant", "slab", thickness_um=2000.0, absolute_sigma=True)
        np.testing.assert_allclose(together.fits[i].values, alone.values, rtol=1e-8)
        np.testing.assert_allclose(together.fits[i].sigmas, alone.sigmas, rtol=1e-6)
        assert together.fits[i].warnings == alone.warnings
        assert together.fits[i].reached == alone.reached


def test_ellipsometry_of_an_interface_and_wavelengths_with_gaps():
    angle, wavelength = (a.ravel() for a in np.meshgrid([65.0, 75.0], [0.5, 0.6, 0.7]))
    eta, k = 0.3 + wavelength, 2.0 + wavelength
    seen = {q: [predict("constant", {"eta": n, "k": kk}, a, 0.5, q)[0]
                for a, n, kk in zip(angle, eta, k, strict=True)]
            for q in ("psi", "delta", "R")}  # fmt: skip
    reflectance = np.where(wavelength < 0.55, seen["R"], np.nan)  # at one wavelength only
    m = Measurement.from_columns(
        angle, wavelength, psi=seen["psi"], delta=seen["delta"], R=reflectance
    )
    found = fit_points(m, "interface")
    np.testing.assert_allclose(found.eta, [0.8, 0.9, 1.0], rtol=1e-8)
    np.testing.assert_allclose(found.k, [2.5, 2.6, 2.7], rtol=1e-8)
    assert [fit.n_data for fit in found.fits] == [6, 4, 4]


def test_plain_data_and_refusals():
    m = plate()
    data = json.loads(json.dumps(fit_points(m, thickness_um=2000.0).to_dict(), allow_nan=False))
    assert len(data["eta"]) == len(WAVELENGTHS) and data["sigma_eta"][0] is None
    assert data["fixed"] == {"thickness_um": 2000.0}
    with pytest.raises(ValueError, match="needs its thickness"):
        fit_points(m)
    with pytest.raises(ValueError, match="absolute_sigma"):
        fit_points(m, thickness_um=2000.0, absolute_sigma=True)
    with pytest.raises(ValueError, match="wavelength"):
        fit_points(Measurement.from_columns([0.0, 1.0], [0.5, np.nan], R=[0.1, 0.1]), "interface")
