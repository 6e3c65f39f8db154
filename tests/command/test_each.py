"""``--each``: every file by itself, a row of results each; patterns that the shell left alone."""

import csv
import json

import pytest

from fitting import fit
from fitting.command import cli
from fitting.command.cli import expanded
from fitting.output.export import EACH_MARK, OfFile, rows_csv, rows_json, rows_text
from fitting.process.progress import listening
from tests.truth.simulated import simulated

GLASS = "angle_deg,R_s,R_p\n30,.0578,.0253\n45,.0920,.0085\n60,.1774,.0018\n70,.300,.042\n"


@pytest.fixture(scope="module")
def each():
    """Two scans, a spectrum and a file that was refused."""
    metal, glass = simulated(0.5, 2.2, 1e-3), simulated(1.5, 0.0, 1e-3, seed=1)
    parts = [simulated(1.5 + i / 10, 1.0, 1e-3, wavelength_um=0.5 + i / 10) for i in range(3)]
    return [
        OfFile("metal.csv", fit(metal)),
        OfFile("bad.csv", None, "bad.csv, line 3: 'x, y' came where a number was wanted."),
        OfFile("glass.csv", fit(glass)),
        OfFile("spectrum.csv", fit(parts)),
    ]


def table(text, mark=","):
    first, *rest = text.splitlines()
    assert first == f"# {EACH_MARK}"
    return list(csv.DictReader(rest, delimiter=mark))


def test_the_table_has_a_row_a_file(each):
    head, metal, bad, glass, spectrum = rows_text(each).splitlines()
    assert head.split() == ["file", "eta", "k", "chi2/dof", "status"]
    assert metal.split()[:1] == ["metal.csv"] and " converged" in metal
    assert bad.split() == ["bad.csv", "-", "-", "-", "refused"]
    assert f"{each[2].fit.eta:.3f}" in glass
    assert "1.5" in spectrum and "3 converged" in spectrum


@pytest.mark.parametrize(("decimal", "mark"), [(".", ","), (",", ";")])
def test_csv_holds_what_was_found_to_the_last_bit(each, decimal, mark):
    rows = table(rows_csv(each, decimal), mark)
    assert [r["file"] for r in rows] == ["metal.csv", "bad.csv", "glass.csv"] + ["spectrum.csv"] * 3

    def number(text):
        return float(text.replace(",", "."))

    metal, found = rows[0], each[0].fit.parameters["eta"]
    assert (number(metal["eta"]), number(metal["sigma_eta"])) == (found.value, found.sigma)
    assert [number(metal["eta_low"]), number(metal["eta_high"])] == list(found.interval)
    assert metal["eta_interval_kind"] == found.interval_kind
    assert number(metal["correlation"]) == each[0].fit.correlation[0, 1]
    assert (rows[1]["status"], rows[1]["eta"]) == ("refused", "")
    assert rows[1]["message"].startswith("bad.csv")
    assert [number(r["wavelength_um"]) for r in rows[3:]] == [0.5, 0.6, 0.7]
    assert [number(r["k"]) for r in rows[3:]] == each[3].fit.k.tolist()
    assert number(rows[2]["k_upper_limit"]) == each[2].fit.parameters["k"].upper_limit


NAMES = [
    '"quote.csv',
    "a,b;c.csv",
    "=1+1.csv",
    "+1.csv",
    "-1.csv",
    "@a.csv",
    "\uff1d1.csv",
    "d.csv",
]


@pytest.mark.parametrize(("decimal", "mark"), [(".", ","), (",", ";")])
def test_names_stay_in_their_cells_and_are_no_formulas(decimal, mark):
    rows = table(
        rows_csv([OfFile(n, None, f"{n}: no, 1; 2 'x' \"y\"") for n in NAMES], decimal), mark
    )
    assert [row["status"] for row in rows] == ["refused"] * len(NAMES)
    for row, name in zip(rows, NAMES, strict=True):
        quoted = "'" * (name[0] in "=+-@\uff1d") + name
        assert row["file"] == quoted and row["message"] == f"{quoted}: no, 1; 2 'x' \"y\""


def test_an_error_of_another_file_is_named_after_the_measurement(tmp_path, capsys):
    (tmp_path / "nul").write_text(GLASS)
    (tmp_path / "null").write_text("")
    assert cli.main(["--each", str(tmp_path / "nul"), "--divide-by", str(tmp_path / "null")]) == 2
    assert f"fresnel-fit: {tmp_path / 'nul'}: null: no row" in capsys.readouterr().err


def test_a_model_of_a_whole_spectrum_is_one_row_without_a_wavelength():
    parts = [simulated(1.5, 0.0, 1e-3, wavelength_um=0.5 + i / 10) for i in range(3)]
    found = fit(parts, "constant", starts=4, intervals="quadratic")
    (row,) = table(rows_csv([OfFile("model.csv", found)]))
    assert float(row["eta"]) == found.eta
    assert not {"wavelength_um", "curve"} & set(row)


def test_json_holds_all_of_every_fit(each):
    metal, bad, *_ = json.loads(rows_json(each))["files"]
    assert metal["file"] == "metal.csv"
    assert metal["eta"] == each[0].fit.eta
    assert bad == {"file": "bad.csv", "status": "refused", "message": each[1].error}


def test_a_bad_file_is_reported_and_the_others_are_fitted(tmp_path, capsys):
    for name, text in {"a.csv": GLASS, "b.csv": "angle,R_s\n30,x\n", "c.csv": GLASS}.items():
        (tmp_path / name).write_text(text)
    results = tmp_path / "results.csv"
    arguments = ["--each", str(tmp_path / "*.csv"), "--csv", str(results)]
    for _ in range(2):  # the second time the pattern takes in the table of results
        assert cli.main(arguments) == 2
        out, err = capsys.readouterr()
        assert str(tmp_path / "b.csv") in err
        good, bad, also_good = out.splitlines()[1:]
        assert " converged" in good and bad.endswith("refused") and " converged" in also_good
        rows = table(results.read_text())
        assert [r["status"] for r in rows] == ["converged", "refused", "converged"]
        assert float(rows[0]["eta"]) == pytest.approx(1.5, abs=0.02)
    assert "results.csv: left out" in err


def test_the_steps_end_at_the_number_of_files(tmp_path, monkeypatch):
    def fails(*_):
        raise ValueError("not fitted")

    steps = []
    monkeypatch.setattr(cli, "_fit", fails)
    for name in "abc":
        (tmp_path / f"{name}.csv").write_text(GLASS)
    with listening(steps.append):
        assert cli.main(["--each", str(tmp_path / "*.csv"), "--quiet"]) == 2
    assert steps[0].total == sum(step.done for step in steps) == 3


def test_of_good_files_the_status_is_0(tmp_path, capsys):
    (tmp_path / "a.csv").write_text(GLASS)
    assert cli.main(["--each", str(tmp_path / "a.csv"), "--json", "-"]) == 0
    (found,) = json.loads(capsys.readouterr().out)["files"]
    assert found["status"] == "converged"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--each", "none*.csv"], "none*.csv: no file matches"),
        (["none*.csv"], "none*.csv: no file matches"),
        (["--each", "a.csv", "--plot", "a.png"], "--plot shows a single fit"),
        (["--each", "a.csv", "--report", "out"], "--report shows a single fit"),
        (["--each", "a.csv", "--sample", "unobtainium"], "unobtainium"),
        (["--each", "a.csv", "--bound", "eta"], "eta=1.4..1.6"),
        (["--each", "a.csv", "--csv", "a.csv"], "is a file that this fit reads"),
        (["--each", "a.csv", "./a.csv"], "the same file"),
    ],
)
def test_what_is_wrong_for_every_file_is_said_before_any_is_fitted(
    tmp_path, monkeypatch, capsys, arguments, said
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.csv").write_text(GLASS)
    monkeypatch.setattr(cli, "_fit", lambda *_: pytest.fail("it was fitted first"))
    assert cli.main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1
    assert said in err
    assert [p.name for p in tmp_path.iterdir()] == ["a.csv"]


def test_patterns_are_expanded_in_order_and_names_left_as_they_are(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("b.csv", "a.csv", "c.txt", "a[1].csv"):
        (tmp_path / name).write_text("")
    (tmp_path / "folder.csv").mkdir()
    assert expanded(["*.csv"]) == ["a.csv", "a[1].csv", "b.csv"]
    assert expanded(["a[1].csv", "?.txt", "-"]) == ["a[1].csv", "c.txt", "-"]
    assert expanded(["gone.csv"]) == ["gone.csv"]  # reading says what is wrong
