"""Fits of measured files (where they are) and of tabulated materials."""

import json

import numpy as np
import pytest

from fitting import fit, fit_many
from fitting.command import cli
from fitting.measured_file import read_csv
from tests.truth.simulated import GOLD, textbook

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("form", ["wide", "long"])
def test_gold_scan_of_the_shared_files(measured_files, form):
    m = read_csv(measured_files / "au_532nm_sp" / f"au_532nm_sp_{form}.csv")
    equal = fit(m, errors="equal")
    # An independent fit: 0.36 +- .03, 1.86 +- .12, rms .029.
    assert equal.status == "converged"
    assert equal.eta == pytest.approx(0.36, abs=0.01)
    assert equal.k == pytest.approx(1.86, abs=0.01)
    assert equal.parameters["eta"].sigma == pytest.approx(0.03, abs=0.005)
    assert equal.parameters["k"].sigma == pytest.approx(0.12, abs=0.01)
    assert equal.rms == pytest.approx(0.029, abs=0.001)
    # With the stated errors: .344, 1.820, reduced chi2 75.
    weighed = fit(m)
    assert weighed.eta == pytest.approx(0.344, abs=0.001)
    assert weighed.k == pytest.approx(1.820, abs=0.001)
    assert weighed.chi2_reduced == pytest.approx(75.0, abs=1.0)
    assert any("too small" in w.text for w in weighed.warnings)
    plain = fit(m, errors="stated")
    assert weighed.parameters["eta"].sigma == pytest.approx(
        plain.parameters["eta"].sigma * np.sqrt(75.4), rel=0.01
    )


def test_gold_scan_that_ships():
    if not GOLD.exists():
        pytest.skip("examples/data/gold_532nm.csv is not here")
    found = fit(read_csv(GOLD))
    assert found.status == "converged"
    assert 0.2 < found.eta < 0.6
    assert 1.6 < found.k < 2.3
    assert found.rms < 0.035


@pytest.mark.parametrize("metal", ["Al", "Ag"])
def test_reflectance_of_a_mirror_at_normal_incidence_names_no_index(measured_files, metal):
    found = fit(read_csv(measured_files / "metal_mirror" / f"reflection_EKSMA_{metal}.csv"))
    assert len(found.eta) > 50
    assert set(found.status) == {"undetermined"}
    assert np.isnan(found.parameters["eta"].sigma).all()
    assert np.isnan(found.parameters["k"].sigma).all()
    assert all("not determined separately" in w[0].text for w in found.warnings)


@pytest.mark.parametrize("table", ["Si_Aspnes", "Si_Green-2008", "Si_Schinke", "Au_Johnson"])
@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_tabulated_materials_come_back(measured_files, table, noise):
    """R_s and R_p over angle of every row of a table, wavelength by wavelength."""
    rows = np.genfromtxt(measured_files / "nk" / f"{table}.csv", delimiter=",", skip_header=1)
    eta, k = rows[:, 1], np.nan_to_num(rows[:, 2])
    angles, rng = np.linspace(10.0, 85.0, 16), np.random.default_rng(8)
    data = {
        q: np.array([textbook(angles, np.full(16, q), n, kk) for n, kk in zip(eta, k, strict=True)])
        + noise * rng.standard_normal((len(eta), 16))
        for q in ("R_s", "R_p")
    }
    found = fit_many(angles, **data)
    assert (found.status == "converged").all()
    if noise == 0.0:
        np.testing.assert_allclose(found.eta, eta, rtol=1e-12)
        # The rounding of R leaves k^2 uncertain by 1e-15 n^2.
        np.testing.assert_allclose(found.k**2, k**2, rtol=1e-11, atol=2e-14 * np.max(eta) ** 2)
        return
    sigma_k, limit = found.parameters["k"].sigma, found.parameters["k"].upper_limit
    z = (found.eta - eta) / found.parameters["eta"].sigma
    assert np.isfinite(z).all()
    assert np.abs(z).max() < 5.0
    assert 0.7 < z.std() < 1.25  # a little wide where k cannot be seen
    seen = np.isfinite(sigma_k)
    assert np.abs((found.k - k) / sigma_k)[seen].max() < 5.0
    assert (k[~seen] <= 2.0 * limit[~seen]).all()


def test_bare_crystal_by_psi_and_delta_at_one_angle(measured_files, tmp_path, capsys):
    file = measured_files / "lsat_psi_delta_658nm" / "LSAT_test_data.txt"
    out = tmp_path / "lsat.json"
    arguments = [str(file), "--psi-unit", "deg", "--json", str(out)]
    # 2 nm of a film lie on it: a misfit, which the stated errors hide
    assert cli.main([*arguments, "--errors", "equal"]) == 1
    data = json.loads(out.read_text())
    assert data["eta"] == pytest.approx(2.0222, abs=5e-4)
    assert data["k"] == pytest.approx(0.0265, abs=5e-4)
    assert data["rms"] == pytest.approx(0.0027, abs=1e-4)
    assert cli.main(arguments) == 0
    data = json.loads(out.read_text())
    assert 2.015 < data["eta"] < 2.030 and 0.02 < data["k"] < 0.03
    assert "pseudo-index <n>, <k>" in capsys.readouterr().out
    assert len(data["notes"]) == 1
