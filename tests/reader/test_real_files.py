"""Every measured file of the collection: what is read, or what the refusal says and leads to."""

from pathlib import Path

import numpy as np
import pytest

from fitting.data.errors import for_command
from fitting.data.measurement import Measurement, MeasurementError
from fitting.measured_file import read_csv


def column(path: Path, index: int, mark: str | None = ",", skip: int = 1) -> list[float]:
    """Return one column of a plain file by splitting its lines, an oracle without our code."""
    lines = path.read_text("utf-8-sig").splitlines()[skip:]
    return [
        float(line.split(mark)[index]) for line in lines if line.strip() and line.split(mark)[index]
    ]


def refusal(path: Path, *parts: str, **options: object) -> None:
    with pytest.raises(MeasurementError) as caught:
        read_csv(path, **options)
    text = for_command(caught.value)
    assert text.startswith(path.name)
    for part in parts:
        assert part in text, text


def values(m: Measurement, quantity: str) -> list[float]:
    return m.value[m.quantity == quantity].tolist()


def test_gold_wide_and_long_hold_the_same(measured_files: Path) -> None:
    folder = measured_files / "au_532nm_sp"
    wide, long = (read_csv(folder / f"au_532nm_sp_{form}.csv") for form in ("wide", "long"))
    path = folder / "au_532nm_sp_wide.csv"
    assert values(wide, "R_s") == column(path, 1) and values(wide, "R_p") == column(path, 3)
    for name in ("angle_deg", "quantity", "value", "sigma"):
        np.testing.assert_array_equal(getattr(wide, name), getattr(long, name))
    assert len(wide) == 31 and wide.sigma.tolist() == column(path, 2) + column(path, 4)
    assert "16 R_s and 15 R_p" in wide.understood and "5 gaps" in wide.understood
    assert "signal_V" in long.understood


def test_one_point_of_a_scan_in_volts(measured_files: Path) -> None:
    paths = sorted((measured_files / "au_532nm_sp" / "raw_lvm").iterdir())
    assert len(paths) > 30
    for path in paths:
        refusal(path, "only one column", "20 rows", "angle_deg,R_s,sigma_R_s")


def test_lsat_says_rad_and_holds_degrees(measured_files: Path) -> None:
    path = measured_files / "lsat_psi_delta_658nm" / "LSAT_test_data.txt"
    refusal(path, "PSI AVG (rad)", "says rad", "0.850333 to 24.6663", "--psi-unit deg")
    m = read_csv(path, psi_unit="deg")
    assert values(m, "psi") == column(path, 2, None) and values(m, "delta") == column(path, 4, None)
    assert m.sigma.tolist() == column(path, 3, None) + column(path, 5, None)
    assert m.angle_deg.tolist() == column(path, 1, None) * 2 and set(m.wavelength_um) == {0.658}


def test_ep4_psi_and_delta(measured_files: Path) -> None:
    path = measured_files / "ep4_polymer_psi_delta" / "corefine_polyBrush_ellipsometry.dat"
    m = read_csv(path)
    assert values(m, "delta") == column(path, 3, "\t", 3) and values(m, "psi") == column(
        path, 4, "\t", 3
    )
    assert m.angle_deg.tolist() == [40.0, 40, 50, 50, 60, 60, 70, 70] * 2


def test_hafnia_needs_its_angle(measured_files: Path) -> None:
    path = measured_files / "hafnia_film_psi_delta" / "hafnia_on_silica_60deg_psi_delta.csv"
    refusal(path, "--angle-deg 60")
    m = read_csv(path, angle_deg=60)
    assert values(m, "psi") == column(path, 1) and values(m, "delta") == column(path, 2)
    wanted = [1.239841984332 / energy for energy in column(path, 0)]
    assert m.wavelength_um[: len(wanted)] == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize("metal", ["Al", "Ag"])
def test_mirrors_in_percent(measured_files: Path, metal: str) -> None:
    path = measured_files / "metal_mirror" / f"reflection_EKSMA_{metal}.csv"
    m = read_csv(path)
    assert m.value.tolist() == [r / 100.0 for r in column(path, 1)]
    assert m.wavelength_um.tolist() == [w / 1000.0 for w in column(path, 0)]
    assert "percent" in m.understood and "normal incidence assumed" in m.understood


def test_glass_with_and_without_names(measured_files: Path) -> None:
    folder = measured_files / "glass_slab_RT"
    named = read_csv(folder / "clear_glass_3mm_RT.csv")
    assert named.quantity.tolist() == ["T"] * 111 + ["R"] * 111 + ["R_back"] * 111
    refusal(folder / "CLEAR_3.DAT", "line 23", "4 columns have no names", "0.3 to 2.5", "--columns")
    bare = read_csv(
        folder / "CLEAR_3.DAT",
        columns="wavelength=1,T=2,R=3,R_back=4",
        wavelength_unit="um",
    )
    for name in ("wavelength_um", "quantity", "value"):
        np.testing.assert_array_equal(getattr(bare, name), getattr(named, name))


def test_diamond_in_percent_of_a_mirror(measured_files: Path) -> None:
    folder = measured_files / "diamond_film_on_glass"
    for name in ("0_0.csv", "0_1.csv", "0_2.csv", "TFAN_mirror.csv"):
        skip = 0 if "mirror" in name else 9
        refusal(folder / name, f"line {skip + 1}", "have no names", "--columns wavelength=1,R=2")
        options = {"columns": "wavelength=1,R=2", "wavelength_unit": "nm"}
        refusal(
            folder / name, f"line {skip + 1}, column 2", "outside [0, 1]", "--scale 0.01", **options
        )
        m = read_csv(folder / name, scale=0.01, **options)
        assert m.value.tolist() == [r / 100.0 for r in column(folder / name, 1, ",", skip)]
    path = folder / "diamond_286nm_on_glass_R.csv"
    assert read_csv(path).value.tolist() == column(path, 1)


def test_neutrons_by_angle_and_by_q(measured_files: Path) -> None:
    folder = measured_files / "neutron_si_d2o"
    refusal(folder / "si_d2o_lambda5A_aoi.csv", "may state the wavelength", "--wavelength-um")
    angle = read_csv(folder / "si_d2o_lambda5A_aoi.csv", wavelength_um=0.0005)
    path = folder / "Si_D2O_HEPES_20mM.dat"
    refusal(path, "3 columns have no names", "for Q 1/angstrom, with --wavelength-um")
    q = read_csv(
        path, columns="angle=1,R=2,sigma_R=3", angle_unit="1/angstrom", wavelength_um="0.0005"
    )
    assert q.value.tolist() == column(path, 1, ",", 0) and q.sigma.tolist() == column(
        path, 2, ",", 0
    )
    # the other file gives ten decimals
    np.testing.assert_allclose(q.angle_deg, angle.angle_deg, rtol=0, atol=1e-10)


def test_reflectometry_formats(measured_files: Path) -> None:
    ort = measured_files / "formats" / "prist5_10K_m_025.Rqz.ort"
    refusal(ort, "line 23", "wavelength: {min: 3.0", "--wavelength-um")
    refusal(ort, "line 47", "standard error 0", "--missing 0", wavelength_um=5e-4)
    m = read_csv(ort, wavelength_um=5e-4, missing=0)
    assert len(m) == 71 and "8 gaps" in m.understood and "sQz" in m.understood
    refl = measured_files / "formats" / "10ndt001.refl"
    refusal(refl, "line 8", "wavelength 4.760", "--wavelength-um")
    refusal(refl, "Q has no unit", "--angle-unit", wavelength_um=4.76e-4)
    m = read_csv(refl, angle_unit="1/angstrom", wavelength_um=4.76e-4)
    assert m.value.tolist() == column(refl, 1, None, 13) and m.sigma.tolist() == column(
        refl, 2, None, 13
    )
    assert "3 values lie outside [0, 1]" in m.understood


def test_wood_by_wavenumber(measured_files: Path) -> None:
    path = measured_files / "diffuse_wood_ir" / "FSRI_Wood_REFLECTIVITY_R1.csv"
    m = read_csv(path)
    assert m.value.tolist() == column(path, 1)
    assert m.wavelength_um.tolist() == [1e4 / w for w in column(path, 0)]


def test_tables_of_something_else(measured_files: Path) -> None:
    refusal(
        measured_files / "bk7_rotating_analyzer" / "bk7_30deg_633nm_rotating_analyzer.csv",
        "analyzer_deg",
        "raw signal",
        "direct beam",
    )
    refusal(
        measured_files / "formats" / "gold_bom_quoted_header.csv",
        "Wavelength, \u00b5m",
        "optical constant",
    )
    refusal(measured_files / "dispersion_parameters.json", "JSON")


def test_no_file_of_the_collection_is_read_without_a_row_above(measured_files: Path) -> None:
    """Every file outside nk ends as one of the tests of this module says."""
    read_without_options = set()
    for path in sorted(measured_files.rglob("*")):
        if path.is_file() and path.parent.name not in ("nk", "LICENSES"):
            try:
                assert len(read_csv(path)) > 0
                read_without_options.add(path.name)
            except MeasurementError as refused:
                assert path.name in str(refused)
    assert read_without_options == {
        "au_532nm_sp_long.csv",
        "au_532nm_sp_wide.csv",
        "diamond_286nm_on_glass_R.csv",
        "FSRI_Wood_REFLECTIVITY_R1.csv",
        "corefine_polyBrush_ellipsometry.dat",
        "clear_glass_3mm_RT.csv",
        "reflection_EKSMA_Ag.csv",
        "reflection_EKSMA_Al.csv",
        "TestData_bareSI.txt",
        "WVASE_example_2nmSiO2_117nmAu_MultiWavelength.txt",
        "WVASE_example_10nmSiO2_325nmAl2O3_MultiWavelength.txt",
        "WVASE_example_3nmSiO2_30EMA_MultiWavelength.txt",
        "WVASE_example_2nmSiO2_20nmPNIPAM_50EMA_MultiWavelength.txt",
    }
