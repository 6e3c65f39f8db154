"""Ratios to a reference: the reader multiplies by its reflectance, or divides by its scan."""

import json

import jax
import numpy as np
import pytest

from fitting import MeasurementError, read_csv, simulate
from fitting.command import cli
from fresnel_jax.dispersion import material
from tests.command_line import own_cache  # noqa: F401 (a fixture)
from tests.truth import stack_oracle

WAVES = np.array([0.45, 0.5, 0.6, 0.7, 0.8])
SI = "air | SiO2 2 nm held | Si"


def exact(angle_deg, wavelength_um, layers):
    """Return R_s and R_p of [(index, thickness in um), ..., (substrate, 0)] in air, by mpmath."""
    index, thickness = [1.0, *(n for n, _ in layers)], [d for _, d in layers[:-1]]
    found = stack_oracle.stack(np.cos(np.radians(angle_deg)), index, thickness, wavelength_um)
    return [float(R) for R in found[:2]]


def index_of(name, wavelength_um):
    with jax.enable_x64(True):
        eta, k = material(name)(np.float64(wavelength_um))
    return complex(float(eta), float(k))


def wafer(angle_deg, oxide=0.0):
    """Return R_s and R_p (W,) of silicon, with an oxide."""
    out = []
    for w in WAVES:
        layers = [(index_of("SiO2", w), oxide)] if oxide else []
        out.append(exact(angle_deg, w, [*layers, (index_of("Si", w), 0.0)]))
    return np.array(out).T


def written(path, columns):
    """Write a table with these columns and return its path."""
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(f"{x!r}" for x in map(float, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_ratios_times_the_reflectance_of_a_known_wafer(tmp_path):
    ratio = np.array([1.3, 0.9, 1.05, 0.4, 1.2])
    file = written(
        tmp_path / "film.csv",
        {"wavelength_um": WAVES, "R_s": ratio, "sigma_R_s": 0.01 * ratio, "R_p": 0.5 * ratio},
    )
    found = read_csv(file, angle_deg=55, ratio_to=SI)
    s, p = wafer(55.0, 2e-3)
    np.testing.assert_allclose(found.value, [*(ratio * s), *(0.5 * ratio * p)], rtol=1e-12)
    np.testing.assert_allclose(found.sigma[:5], 0.01 * ratio * s, rtol=1e-12)
    assert np.isnan(found.sigma[5:]).all()
    assert f"ratios to {SI}, multiplied by its reflectance" in found.understood
    arrays = ratio * simulate(SI, {}, 55.0, WAVES, "R_s")
    np.testing.assert_array_equal(arrays, found.value[:5])


def test_unpolarized_light_and_a_polarizer(tmp_path):
    s, p = wafer(60.0)
    columns = {"wavelength_um": WAVES, "R": 0.9 + 0 * WAVES}
    file = written(tmp_path / "film.csv", columns)
    found = read_csv(file, angle_deg=60, ratio_to="Si")
    np.testing.assert_allclose(found.value, 0.45 * (s + p), rtol=1e-12)
    file = written(tmp_path / "film.csv", columns | {"polarizer (deg)": 30.0 + 0 * WAVES})
    found = read_csv(file, angle_deg=60, polarization="angle-from-p", ratio_to="Si")
    np.testing.assert_allclose(found.value, 0.9 * (0.25 * s + 0.75 * p), rtol=1e-12)


def test_the_standard_error_of_a_ratio_is_that_of_a_simulation(tmp_path):
    one = np.ones(len(WAVES))
    columns = {"wavelength_nm": 1e3 * WAVES}
    film = written(tmp_path / "film.csv", columns | {"R": 900 * one, "sigma_R": 9 * one})
    bare = written(tmp_path / "bare.csv", columns | {"R": 1200 * one, "sigma_R": 24 * one})
    found = read_csv(film, divide_by=bare)
    rng = np.random.default_rng(3)
    drawn = rng.normal(900, 9, 400_000) / rng.normal(1200, 24, 400_000)
    np.testing.assert_allclose(found.value, 0.75)
    np.testing.assert_allclose(found.sigma, drawn.std(), rtol=5e-3)  # 4 / sqrt(2 N), and curvature
    assert found.understood.endswith("divided by bare.csv, with its standard errors")


def test_a_reference_is_interpolated_in_wavelength_or_angle(tmp_path):
    sample = written(
        tmp_path / "film.csv", {"wavelength_nm": [500, 550, 600], "R": [0.2, 0.3, 0.4]}
    )
    bare = written(
        tmp_path / "bare.csv", {"wavelength_nm": [600, 500, 500, 700], "R": [0.8, 0.3, 0.5, 1.0]}
    )
    found = read_csv(sample, divide_by=bare)
    np.testing.assert_allclose(found.value, [0.5, 0.5, 0.5], rtol=1e-15)
    assert "divided by bare.csv, interpolated" in found.understood
    sample = written(tmp_path / "angles.csv", {"angle_deg": [30, 45, 60], "R_s": [0.2, 0.3, 0.4]})
    bare = written(tmp_path / "beam.csv", {"angle_deg": [0, 60], "R_s": [0.5, 1.0]})
    found = read_csv(sample, divide_by=bare)
    np.testing.assert_allclose(found.value, [0.2 / 0.75, 0.3 / 0.875, 0.4], rtol=1e-15)


def test_the_errors_of_the_command_line_are_those_of_the_ratio(tmp_path):
    film = written(tmp_path / "film.csv", {"wavelength_nm": 1e3 * WAVES, "R": 900 + 0 * WAVES})
    bare = written(tmp_path / "bare.csv", {"wavelength_nm": 1e3 * WAVES, "R": 1200 + 0 * WAVES})
    found = read_csv(film, divide_by=bare, ratio_to="Si", sigma=0.01)
    np.testing.assert_allclose(found.sigma / found.value, 0.01 / 0.75, rtol=1e-12)


SCAN = "wavelength_nm,R\n500,0.9\n600,1.1\n700,1.0\n"
PSI = "wavelength_nm,psi,delta\n500,20,170\n600,21,171\n700,22,172\n"
REFUSED = {
    "nothing held": (SCAN, {"ratio_to": "air | SiO2 2 nm | Si"}, "SiO2 2 nm held"),
    "a model": (SCAN, {"ratio_to": "cauchy"}, "'cauchy' would have to be fitted"),
    "no material": (SCAN, {"ratio_to": "unobtainium"}, "no material named 'unobtainium'"),
    "beyond its table": (SCAN.replace("500", "50"), {"ratio_to": "Si"}, "is known from"),
    "no reflection": (SCAN, {"ratio_to": "1.0"}, "reflects nothing"),
    "T": (SCAN.replace("R", "T"), {"ratio_to": "Si"}, "T came with ratio_to"),
    "psi": (PSI, {"ratio_to": "Si", "angle_deg": 60}, "for reflectances alone"),
    "psi divided": (PSI, {"divide_by": PSI, "angle_deg": 60}, "for powers alone"),
    "p to s": (
        SCAN.replace("R", "Rp/Rs"), {"ratio_to": "Si", "columns": "wavelength=1,R=2"},
        "ratio of two polarizations",
    ),
    "a shorter range": (SCAN, {"divide_by": SCAN[:-8]}, "has no counterpart in reference.csv"),
    "another angle": (
        "angle_deg,wavelength_nm,R\n30,500,0.9\n30,600,0.8\n",
        {"divide_by": "angle_deg,wavelength_nm,R\n31,500,0.9\n31,600,0.8\n"},
        "R at 30 degrees and 0.5 um has no counterpart",
    ),
    "another light": (
        SCAN.replace("R", "R_s"), {"divide_by": SCAN, "angle_deg": 45}, "R_s came, which",
    ),
    "percent of a fraction": (
        SCAN,
        {"divide_by": SCAN.replace(",0.", ",80.").replace(",1.", ",81.")},
        "percent or counts",
    ),
    "nothing to divide by": (
        SCAN,
        {"divide_by": SCAN.replace("1.1", "0"), "missing": "none"},
        "is 0; a number above 0",
    ),
    "beyond 1": (SCAN, {"ratio_to": "gold", "scale": 3}, "Without the reference it is 2.7"),
    "no option": (SCAN, {}, 'its material: ratio_to="Si"'),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_ratio_is_refused(case, tmp_path):
    text, options, wanted = REFUSED[case]
    (tmp_path / "film.csv").write_text(text)
    if "divide_by" in options:
        (tmp_path / "reference.csv").write_text(options["divide_by"])
        options = options | {"divide_by": tmp_path / "reference.csv"}
    with pytest.raises(MeasurementError, match="(?i)" + wanted.replace("(", "\\(")):
        read_csv(tmp_path / "film.csv", **options)


def test_two_scans_of_counts_on_the_command_line(tmp_path, capsys):
    """Gold measured against a wafer, in counts of a lamp that is no straight line."""
    angles = np.arange(20.0, 80.0, 10.0)
    lamp = 4000.0 * (1.0 + 0.3 * np.sin(angles))
    gold, si = (
        np.array([exact(a, 0.6, [(index_of(name, 0.6), 0.0)]) for a in angles])
        for name in ("gold", "Si")
    )
    for name, R in (("gold.csv", gold), ("wafer.csv", si)):
        written(
            tmp_path / name,
            {"angle_deg": angles, "R_s": lamp * R[:, 0], "R_p": lamp * R[:, 1]},
        )
    code = cli.main(
        [str(tmp_path / "gold.csv"), "--divide-by", str(tmp_path / "wafer.csv"), "--ratio-to", "Si"]
        + ["--wavelength-um", "0.6", "--sigma", "0.001", "--json", "-"]
    )
    fields = json.loads(capsys.readouterr().out)
    assert code == 0
    index = index_of("gold", 0.6)
    assert fields["eta"] == pytest.approx(index.real, rel=1e-4)
    assert fields["k"] == pytest.approx(index.imag, rel=1e-4)
    assert "divided by wafer.csv; ratios to Si" in json.dumps(fields)


def test_no_result_replaces_the_reference(tmp_path, capsys):
    for name in ("film.csv", "wafer.csv"):
        (tmp_path / name).write_text(SCAN)
    film, wafer = str(tmp_path / "film.csv"), str(tmp_path / "wafer.csv")
    for more in ([], ["--each"]):
        assert cli.main([film, "--divide-by", wafer, "--csv", wafer, *more]) == 2
        assert "wafer.csv" in capsys.readouterr().err
    assert (tmp_path / "wafer.csv").read_text() == SCAN
