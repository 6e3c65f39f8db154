"""What a file holds and a fit would ignore is refused, unless it says nothing, or --ignore."""

import math
from pathlib import Path

import numpy as np
import pytest

from fitting import Measurement, MeasurementError, fit_many, read_csv
from fitting.samples.material_files import MaterialFileError, read_material
from tests.truth.reading import read, refusal

LIGHT = {
    "state": "s p", "light": "TE TM", "mode": "s p", "channel": "Rs Rp", "config": "TE TM",
    "variable": "Rs Rp", "type": "s p", "label": "perpendicular parallel", "s/p": "s p",
    "Richtung": "senkrecht parallel", "kanal": "0 1", "sample": "A B", "t (min)": "0 30",
}  # fmt: skip


@pytest.mark.parametrize("name", LIGHT)
def test_a_column_that_tells_rows_apart_is_not_pooled(tmp_path: Path, name: str) -> None:
    s, p = LIGHT[name].split()
    table = f"angle,{name},R\n" + "".join(f"{a},{c},.{a}\n" for a in (30, 45, 60) for c in (s, p))
    assert "column " + name in refusal(tmp_path, table) and "--ignore" in refusal(tmp_path, table)
    number = "2" if " " in name else name
    assert f"--ignore {number}; else name all columns" in refusal(tmp_path, table)
    m = read(tmp_path, table, ignore=number.upper())
    assert set(m.quantity) == {"R"} and f"columns not used: {name}" in m.understood
    if s in ("0", "A"):
        return
    codes = f"{s}=s,{p}=p"
    m = read(tmp_path, table, columns="angle=1,polarization=2,R=3", polarization=codes)
    assert m.quantity.tolist() == ["R_s", "R_p"] * 3


@pytest.mark.parametrize("cell", ["s", "TM", "Rs", "perpendicular"])
def test_light_that_is_the_same_in_all_rows_is_no_constant(tmp_path: Path, cell: str) -> None:
    assert "polarization=2" in refusal(tmp_path, f"angle,state,R\n30,{cell},.1\n45,{cell},.2\n")


def test_what_says_nothing_is_left_out(tmp_path: Path) -> None:
    names = "angle,R_s,temperature,sample,no,signal_V,T (K),n_samples"
    rows = [
        f"{a},.{a},20{'.0' * (a > 30)},gold,{i},{a / 7},293,20" for i, a in enumerate((9, 45, 60))
    ]
    m = read(tmp_path, "\n".join([names, *rows]))
    assert "not used: temperature, sample, no, signal_V, T (K), n_samples" in m.understood
    assert "t0" in refusal(tmp_path, "angle,R_s,t0\n9,.1,20\n45,.2,20\n60,.3,21\n")


def test_blanks_in_a_label_do_not_part_a_tabbed_file(tmp_path: Path) -> None:
    table = "angle\tR_s\tProbe\n30\t.1\tgold 1\n45\t.2\tgold 2\n"  # a file that was drawn
    assert "column Probe: this column (gold 1, gold 2)" in refusal(tmp_path, table)


def test_a_running_number_is_not_the_axis(tmp_path: Path) -> None:
    table = "X,psi,delta\n1,20,100\n2,25,95\n3,30,90\n"
    assert "column X" in refusal(tmp_path, table, angle_deg=60)
    assert (
        len(
            read(
                tmp_path,
                table.replace("X", "X,nm")
                .replace(",2", ",402,2", 1)
                .replace("2,25", "2,500,25")
                .replace("3,30", "3,600,30"),
                angle_deg=60,
            )
        )
        == 6
    )


EV, C = 1.2398419843320026, 299.792458
AXES = {
    "energy (meV)": EV * 1e3, "E [meV]": EV * 1e3, "frequency (Hz)": C * 1e12, "f (GHz)": C * 1e3,
    "wavenumber (1/um)": 1.0, "Wellenzahl / \u00b5m^-1": 1.0, "1/um": None,
    "angular frequency (rad/fs)": 2e-3 * math.pi * C, "\u03c9 (rad/s)": 2e12 * math.pi * C,
    "k (1/nm)": None, "k (1/um)": None, "wavelength (nm air)": None, "Raman shift (cm-1)": None,
    "X": None, "angular frequency (THz)": None, "frequency (PHz)": None, "energy (kJ/mol)": None,
}  # fmt: skip


@pytest.mark.parametrize("name", AXES)
def test_an_axis_is_read_in_its_unit_or_refused(tmp_path: Path, name: str) -> None:
    """Psi and Delta of many energies had become repeats at one angle."""
    um, factor = np.array([0.4, 0.5, 0.7]), AXES[name]
    spectrum, table = (f"{name},{names}\n" for names in ("psi,delta", "n"))
    for x, psi in zip((factor or 300.0) / um, (20, 25, 30), strict=True):
        spectrum += f"{x:.16g},{psi},100.5\n"
        table += f"{x:.16g},1.{psi}\n"
    (tmp_path / "film.csv").write_text(table)
    if factor is None:
        refusal(tmp_path, spectrum, angle_deg=60)
        with pytest.raises(MaterialFileError, match=r"film\.csv"):
            read_material(tmp_path / "film.csv")
        return
    m = read(tmp_path, spectrum, angle_deg=60)
    np.testing.assert_allclose(m.wavelength_um, [*um, *um], rtol=1e-12)
    np.testing.assert_allclose(
        read_material(tmp_path / "film.csv").range_um, (0.4, 0.7), rtol=1e-12
    )
    forced = read(tmp_path, "x" + spectrum, columns="wavelength=1,psi=2", angle_deg=60,
                  wavelength_unit="um")  # fmt: skip
    np.testing.assert_allclose(forced.wavelength_um, factor / um)


@pytest.mark.parametrize(
    "names",
    ["R_s (frac),Rp [-]", "R_TE *100,R_p", "PSI,DEL", "u(R_s),R_s", "eRs,R_s", "2sigma R_s,R_s",
     "U(R_s) (k=2),R_s", "95% CI R_s,R_s", "R_s,err (2 sigma)", "R_s,expanded unc", "R,sigma_T"],
)  # fmt: skip
def test_half_of_the_data_is_not_left_out(tmp_path: Path, names: str) -> None:
    assert "--ignore" in refusal(tmp_path, f"angle,{names}\n30,.1,.2\n45,.11,.22\n", psi_unit="deg")
    if names != "PSI,DEL":  # a name that speaks of a value holds none, even if it is constant
        refusal(tmp_path, f"angle,{names}\n30,.1,.2\n45,.1,.2\n")


@pytest.mark.parametrize(
    "said", ["errors are 2 sigma", "coverage factor k=2", "2\u03c3 errors", "95 % confidence",
             "Erweiterte Messunsicherheit", "2 standard deviations"],
)  # fmt: skip
def test_errors_of_another_size_are_not_standard_errors(tmp_path: Path, said: str) -> None:
    table = f"# {said}\nangle,R_s,err\n30,.1,.01\n45,.2,.01\n"
    assert "line 1" in (text := refusal(tmp_path, table)) and "--columns" in text
    given = read(tmp_path, table, columns="angle=1,R_s=2,sigma_R_s=3")
    assert given.sigma.tolist() == [0.01, 0.01]
    read(tmp_path, table.replace("err", "zone").replace(".01", "1"))
    assert len(read(tmp_path, table.replace(said, "errors: 1 sigma, std of 20 repeats"))) == 2


def test_plus_and_minus_is_heard(tmp_path: Path) -> None:
    assert read(tmp_path, "angle,R_s,+/-\n30,.1,.01\n").sigma.tolist() == [0.01]


WAVE = "wavelength_nm"
TABLES = {
    "n,k,n_err,k_err": (1.5, 0.1), "n,k,n_std,k_std": (1.5, 0.1), "N,K": (1.5, 0.1),
    "n (-),k [1]": (1.5, 0.1), "eta,kappa": (1.5, 0.1), "n": (1.5, 0.0), "n,n_err": (1.5, 0.0),
}  # fmt: skip
NO_TABLES = (
    "n_o,n_e", "n (real),n (imag)", "n,n_g", "n^2", "n-1", "(n-1)*1e6", "n,k [1/cm]", "n,k*1e3",
    "n,k (log10)", "n,log k", "n,n", "n,k,k", "k", "n,alpha", "n,k,T", "n_TE,n_TM", "n,delta n",
    "n,k (%)", "n,wavenumber_cm-1", "energy (eV),n", "n [nm],k", "n'", "Re(n),Im(n)", "eps1,eps2",
)  # fmt: skip


def table_of(folder: Path, header: str, *rows: str) -> Path:
    path = folder / "film.csv"
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


@pytest.mark.parametrize("names", [*TABLES, *NO_TABLES])
def test_tables_of_materials_hold_one_n_and_one_k(tmp_path: Path, names: str) -> None:
    """The first word of a name decided, and the last such column won: n was .02 for 1.5."""
    cells = ",1.5,.1,.02,.01"
    count = len(names.split(","))
    rows = [str(w) + ",".join(cells.split(",")[: count + 1]) for w in (500, 600, 700)]
    path = table_of(tmp_path, f"{WAVE},{names}", *rows)
    if names in TABLES:
        assert [float(x) for x in read_material(path)(np.float64(0.6))] == pytest.approx(
            TABLES[names]
        )
        return
    with pytest.raises(MaterialFileError, match=r"film\.csv, line 1|no column is n"):
        read_material(path)


def test_cells_of_materials_are_read_as_those_of_measurements(tmp_path: Path) -> None:
    path = table_of(tmp_path, "lambda (nm);n;k", "500,0;1,512;0", "600,0;1,500;1e-3")
    assert float(read_material(path)(0.6).eta) == pytest.approx(1.5)
    for header, cells in (
        (f"{WAVE},n", "500,1_5 600,1.5"), ("wavelength,n", "4000,1.5 7000,1.4"),
        ("energy,n", "1,1.5 2,1.6"), (f"{WAVE},n,k", "500,1.5,0 600,1.5 700,2,1"),
    ):  # fmt: skip
        with pytest.raises(MaterialFileError):
            read_material(table_of(tmp_path, header, *cells.split()))
    path = table_of(tmp_path, "no,wavelength_nm,n,k", "1,500,1.5,", "2,600,1.6,", "3,700,1.7,")
    assert [float(x) for x in read_material(path)(0.6)] == pytest.approx([1.6, 0.0])


def test_masked_is_missing() -> None:
    R = np.ma.masked_less(np.array([0.1, -9.0, 0.3]), 0.0)
    m = Measurement.from_columns(
        [10, 20, 30], R_s=R, sigma={"R_s": np.ma.array(R * 0 + 1, mask=R.mask)}
    )
    assert m.angle_deg.tolist() == [10.0, 30.0] and m.value.tolist() == [0.1, 0.3]
    counts = np.ma.array([1, 0, 0], mask=[False, True, False])
    assert Measurement.from_columns([1, 2, 3], R=counts).value.tolist() == [1.0, 0.0]
    assert len(read_csv({"angle_deg": [10, 20, 30], "R_s": R})) == 2
    angles = np.array([20.0, 40.0, 60.0, 80.0])
    curve = np.array([0.05, 0.08, 0.18, 0.55])
    gap = np.where(angles == 60.0, np.nan, curve)
    masked = np.ma.array(np.where(angles == 60.0, 0.9, curve), mask=angles == 60.0)
    of_gap, of_mask = (fit_many(angles, R_s=[x], R_p=[x / 2]) for x in (gap, masked))
    assert of_gap.parameters["eta"].value.tolist() == of_mask.parameters["eta"].value.tolist()


class Frame:
    """A data frame as polars has them: columns, and no keys()."""

    def __init__(self, **table: list[object]) -> None:
        self.table = table
        self.columns = [*table]

    def __getitem__(self, name: str) -> np.ndarray:
        return np.array(self.table[name])


def test_frames_without_keys_and_with_columns_that_are_not_read() -> None:
    table = dict(angle_deg=[10, 20, 30], R=[0.1, 0.2, 0.3], row=[0, 1, 2], site=["x", "x", "x"])
    assert len(read_csv(Frame(**table))) == 3
    with pytest.raises(MeasurementError, match='column spot: .* say ignore="spot"'):
        read_csv(Frame(**table, spot=["a", "b", "a"]))
    assert len(read_csv({**table, "spot": ["a", "b", "a"]}, ignore="spot")) == 3


def test_what_r_writes(tmp_path: Path) -> None:
    table = '"angle (deg)" "pol" "R"\n"1" 30 "s" 0.1\n"2" 30 "p" 0.2\n"3" 45 "s" 0.3\n'
    m = read(tmp_path, table)
    assert m.quantity.tolist() == ["R_s", "R_p", "R_s"] and m.angle_deg.tolist() == [30, 30, 45]
    assert "column light" in refusal(tmp_path, table.replace("pol", "light"))


def test_a_row_of_units_with_one_that_is_not_known(tmp_path: Path) -> None:
    table = "#Lambda\tAOI\tDelta\tPsi\tX\n#nm\tdeg\tdeg\tdeg\tarcsec\n658\t40\t171\t36\t2\n"
    assert set(read(tmp_path, table).wavelength_um) == {0.658}
    text = refusal(tmp_path, table.replace("nm\tdeg\tdeg\tdeg\tarcsec", "nm\tgon\tdeg\tdeg\tnm"))
    assert "angles in gon" in text and "--angle-unit" in text


@pytest.mark.parametrize("stem", ["radians", "percent", "mixed"])
def test_the_name_of_a_file_does_not_overrule_the_header(tmp_path: Path, stem: str) -> None:
    for table in (
        "angle_deg,R_s (-)\n30,.1\n45,.2\n", "wavelength_nm,R (%)\n500,20\n600,30\n",
        "angle_deg,psi (deg),delta (deg)\n9,20,100\n",
    ):  # fmt: skip
        assert len(read(tmp_path, table, stem + ".csv")) == 2


@pytest.mark.parametrize("end", ["\t", ""])
def test_names_of_two_words_stay_whole_where_the_last_column_has_no_name(
    tmp_path: Path, end: str
) -> None:
    """Parted at blanks, "R parallel" was R of unpolarized light and a column that is not read."""
    table = f"angle (deg)\tRTE\tR parallel{end}\n30\t.5\t.4\t1\n40\t.6\t.3\t2\n50\t.7\t.2\t3\n"
    if end:
        assert read(tmp_path, table).quantity.tolist() == ["R_s"] * 3 + ["R_p"] * 3
    else:
        assert "4 columns" in refusal(tmp_path, table)
