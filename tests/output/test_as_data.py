"""What scripts read of a fit: a dict, JSON, CSV, a DataFrame."""

import csv
import importlib.util
import io
import json
import math

import numpy as np
import pytest

from fitting import fit, fit_many
from fitting.data.measurement import Measurement, concatenate
from fitting.measured_file import read_csv
from fitting.output.export import INDEX_MARK, data_csv, index_csv, json_text
from fitting.samples.material_files import read_material
from fresnel_jax.dispersion import HC_EV_UM
from tests.truth.simulated import GOLD, simulated, textbook


@pytest.fixture(scope="module")
def gold():
    return fit(read_csv(GOLD))


@pytest.fixture(scope="module")
def spectrum():
    """Three wavelengths: a metal, lossless glass, and one angle of normal incidence."""
    metal = simulated(0.5, 2.2, 1e-3, wavelength_um=0.5)
    glass = simulated(1.5, 0.0, 1e-3, wavelength_um=0.6)
    normal = simulated(1.5, 0.0, 1e-3, wavelength_um=0.7, angles=(0.0,))
    return fit(concatenate(metal, glass, normal))


@pytest.fixture(scope="module")
def drude():
    waves = np.linspace(0.4, 0.8, 9)
    energy = HC_EV_UM / waves
    index = np.sqrt(2.0 - 36.0 / (energy * (energy + 0.8j)))
    parts = [simulated(n.real, n.imag, 1e-3, wavelength_um=w, seed=i)
             for i, (w, n) in enumerate(zip(waves, index, strict=True))]  # fmt: skip
    return fit(concatenate(*parts), "drude")


def test_json_has_the_names_and_values_of_the_result(gold):
    fields = json.loads(json_text(gold))
    assert fields["source"] == "gold_532nm.csv"
    assert fields["understood"] == gold.measurement.understood
    assert fields.keys() == gold.to_dict().keys()
    assert fields["eta"] == gold.eta  # to the last bit
    assert fields["parameters"]["eta"]["value"] == gold.eta
    assert fields["parameters"]["eta"]["sigma"] == gold.parameters["eta"].sigma
    assert fields["covariance"] == gold.covariance.tolist()
    assert fields["parameters"]["k"]["upper_limit"] is None  # NaN
    assert fields["status"] == "converged"
    assert fields["sample"] == "free"
    for name in ("chi2", "chi2_reduced", "dof", "n_data", "rms", "loss", "starts"):
        assert fields[name] == getattr(gold, name)
    assert fields["errors"] == {**gold.errors._asdict()}
    assert fields["version"]


@pytest.mark.study
def test_json_has_warnings_as_codes_and_as_sentences(gold, spectrum):
    told = json.loads(json_text(gold))["warnings"]
    assert [w["code"] for w in told] == [w.code for w in gold.warnings]
    assert [w["text"] for w in told] == [w.text for w in gold.warnings]
    assert "chi2_large" in [w["code"] for w in told]
    each = json.loads(json_text(spectrum))["warnings"]
    assert [w["code"] for w in each[2]] == [w.code for w in spectrum.warnings[2]]
    assert each[2][0]["where"] == {"wavelength_um": 0.7}


def test_json_of_a_spectrum_holds_lists_and_no_nan(spectrum):
    def refuse(constant):
        raise AssertionError(f"{constant} is not JSON")

    fields = json.loads(json_text(spectrum), parse_constant=refuse)
    assert fields["wavelength_um"] == [0.5, 0.6, 0.7]
    assert fields["parameters"]["eta"]["sigma"][2] is None
    assert len(fields["warnings"]) == 3
    assert fields["index"]["eta"] == spectrum.eta.tolist()


def rows_of(text):
    return list(csv.DictReader(line for line in io.StringIO(text) if not line.startswith("#")))


def test_csv_of_the_data_reads_back_to_the_last_bit(gold):
    m = gold.measurement
    rows = rows_of(data_csv(gold))
    assert [float(r["wavelength_um"]) for r in rows] == m.wavelength_um.tolist()
    assert "polarizer_deg" not in rows[0]
    assert "curve" not in rows[0]
    assert [float(r["angle_deg"]) for r in rows] == m.angle_deg.tolist()
    assert [r["quantity"] for r in rows] == m.quantity.tolist()
    assert [float(r["sigma"]) for r in rows] == m.sigma.tolist()
    expected = textbook(m.angle_deg, m.quantity, gold.eta, gold.k)
    # The textbook formula loses a few digits itself.
    np.testing.assert_allclose([float(r["fitted"]) for r in rows], expected, rtol=1e-12)
    residual = [float(r["value"]) - float(r["fitted"]) for r in rows]
    assert [float(r["residual"]) for r in rows] == residual
    assert all(float(r["sigma_fitted"]) > 0.0 for r in rows)


def test_csv_of_the_index_is_a_table_of_an_index(spectrum):
    rows = np.genfromtxt(
        io.StringIO(index_csv(spectrum)), delimiter=",", comments="#", usecols=(0, 1, 2)
    )
    rows = rows[np.isfinite(rows).all(axis=1)]
    np.testing.assert_array_equal(rows[:, 1], spectrum.eta)
    np.testing.assert_array_equal(rows[:, 2], spectrum.k)


def test_csv_with_decimal_commas(gold, drude, tmp_path):
    lines = [line for line in data_csv(gold, ",").splitlines() if line[0] != "#"]
    assert lines[0].startswith("angle_deg;wavelength_um;quantity;value;sigma;fitted")
    assert lines[1].startswith("29,6667;0,532;R_s;0,755435;0,000945;")
    assert not any("." in line for line in lines)
    (tmp_path / "index.csv").write_text(index_csv(drude, ","))
    eta, k = read_material(tmp_path / "index.csv").model(drude.wavelength_um)
    np.testing.assert_allclose(eta, drude.eta, rtol=1e-14)
    np.testing.assert_allclose(k, drude.k, rtol=1e-14)


def test_csv_of_a_spectrum(spectrum):
    data = rows_of(data_csv(spectrum))
    assert [float(r["wavelength_um"]) for r in data] == spectrum.measurement.wavelength_um.tolist()
    assert index_csv(spectrum).startswith(f"# {INDEX_MARK}\n")
    index = rows_of(index_csv(spectrum))
    assert list(index[0])[:3] == ["wavelength_um", "eta", "k"]
    assert [float(r["wavelength_um"]) for r in index] == [0.5, 0.6, 0.7]
    assert [float(r["eta"]) for r in index] == spectrum.eta.tolist()
    assert index[2]["sigma_eta"] == ""
    assert index[2]["status"] == "undetermined"


def test_csv_of_a_dispersion_model(drude):
    index = rows_of(index_csv(drude))
    band = drude.index()
    assert list(index[0])[:3] == ["wavelength_um", "eta", "k"]
    for name in band._fields:
        assert [float(r[name]) for r in index] == getattr(band, name).tolist()
    assert json.loads(json_text(drude))["index"]["sigma_k"] == band.sigma_k.tolist()


def test_csv_keeps_the_polarizer():
    m = Measurement.from_columns(
        [40.0, 50.0, 60.0, 70.0], polarizer_deg=30.0, R=[0.9, 0.9, 0.91, 0.93]
    )
    rows = rows_of(data_csv(fit(m)))
    assert "wavelength_um" not in rows[0]
    assert {r["polarizer_deg"] for r in rows} == {"30.0"}
    assert {r["sigma"] for r in rows} == {""}


def test_two_files_are_told_apart_in_the_csv():
    """A name with a comma does not shift the columns."""
    one = simulated(0.5, 2.2, 1e-3)
    one = one.where(one.quantity == "R_s")
    both = [
        Measurement.from_columns(one.angle_deg, R_s=one.value, source=f"a, {i}.csv")
        for i in range(2)
    ]
    found = fit(both, "constant", intervals="quadratic", starts=4)
    rows = rows_of(data_csv(found))
    assert {r["curve"] for r in rows} == set(found.curve_names)
    assert {r["quantity"] for r in rows} == {"R_s"}


def test_a_data_frame_has_a_row_for_each_parameter_or_wavelength(gold, spectrum):
    pytest.importorskip("pandas")
    frame = gold.to_dataframe()
    assert frame.loc["eta", "value"] == gold.eta
    assert frame.loc["k", ["low", "high"]].tolist() == gold.parameters["k"].interval.tolist()
    assert frame.loc["k", "interval_kind"] == "profile"
    frame = spectrum.to_dataframe()
    assert frame.index.name == "wavelength_um"
    assert frame.loc[0.5, "eta"] == spectrum.eta[0]
    assert frame["k_upper_limit"].tolist()[1] == spectrum.parameters["k"].upper_limit[1]
    assert math.isnan(frame.loc[0.7, "sigma_eta"])
    R = np.full((2, 3, 4), 0.5) + 0.1 * np.random.default_rng(0).random((2, 3, 4))
    many = fit_many([30.0, 50.0, 70.0, 80.0], R_s=R)
    frame = many.to_dataframe()
    assert frame.index.names == ["curve_0", "curve_1"]
    assert frame.loc[(1, 2), "eta"] == many.eta[1, 2]


def test_without_pandas_the_extra_is_named(gold, monkeypatch):
    found = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "pandas" else found(name)
    )
    with pytest.raises(ImportError, match="pip install pandas .*extra 'dataframe'"):
        gold.to_dataframe()


def test_a_fit_of_own_residuals_is_shown_as_well(tmp_path):
    import jax.numpy as jnp

    from fitting import fit_residuals

    x = np.linspace(0.0, 2.0, 12)
    y = 3.0 * np.exp(-0.7 * x) + 0.01 * np.random.default_rng(0).normal(size=(4, 12))

    def decay(values, data):
        return (values["height"] * jnp.exp(-values["rate"] * x) - data) / 0.01

    asked = {"height": (0.1, 10.0), "rate": {"start": (0.1, 5.0), "unit": "1/s"}}
    one = fit_residuals(decay, asked, y[0])
    text = str(one)
    assert "1/s" in text and "your own residual function" in text
    assert repr(one).startswith("<Fit: your own residuals, height ")
    fields = json.loads(json_text(one))
    assert fields["sample"] is None
    assert fields["parameters"]["rate"]["value"] == one.parameters["rate"].value
    with pytest.raises(ValueError, match="nothing to draw"):
        one.plot()
    many = fit_residuals(decay, asked, y, batch=True)
    assert "4 curves: 4 converged" in " ".join(str(many).split())
    assert many.plot().axes[0].containers
    many.report(tmp_path / "many")
    assert "4 curves" in (tmp_path / "many" / "report.html").read_text()
    pytest.importorskip("pandas")
    assert many.to_dataframe()["rate"].tolist() == many.parameters["rate"].value.tolist()
