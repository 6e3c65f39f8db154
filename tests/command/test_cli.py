"""The command fresnel-fit, run as people run it, with their mistakes."""

import inspect
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from fitting.command import cli
from fitting.measured_file import read_csv
from fitting.samples.sample import Sample
from fresnel_jax.materials import lookup, names
from tests.command_line import ROOT, nothing_in, own_cache, refused, run  # noqa: F401 (a fixture)
from tests.truth.simulated import GOLD

GLASS = """angle_deg,R_s,R_p
30,5.78,2.53
45,9.20,0.85
60,17.74,0.18
70,30.0,4.2
80,54.6,23.9
"""


def test_the_gold_scan_end_to_end(tmp_path):
    results = {kind: tmp_path / f"gold.{kind}" for kind in ("json", "csv", "png")}
    done = run(GOLD, "--json", results["json"], "--csv", results["csv"], "--plot", results["png"])
    assert (done.returncode, done.stderr) == (0, "")
    assert "eta          0.344 +- 0.022" in done.stdout
    assert "k            1.820 +- 0.087" in done.stdout
    fields = json.loads(results["json"].read_text())
    # The scan's authors report 0.32 and 1.75; an independent fit 0.344 and 1.820, chi2/dof 75.
    assert fields["eta"] == pytest.approx(0.344, abs=0.001)
    assert fields["k"] == pytest.approx(1.820, abs=0.001)
    assert fields["chi2_reduced"] == pytest.approx(75.4, abs=0.1)
    assert (fields["n_data"], fields["dof"], fields["status"]) == (31, 29, "converged")
    assert fields["source"] == "gold_532nm.csv"
    assert "stated errors" in fields["warnings"][0]["text"]
    lines = results["csv"].read_text().splitlines()
    assert sum(not line.startswith("#") for line in lines) == 1 + 31
    assert results["png"].read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    assert results["png"].stat().st_size > 20_000
    assert nothing_in(tmp_path, "gold.json", "gold.csv", "gold.png")


def test_equal_weights_meet_the_independent_fit(capsys):
    """n 0.36 +- 0.03, k 1.86 +- 0.12, rms 0.029 by a least-squares fit made apart."""
    assert cli.main([str(GOLD), "--errors", "equal", "--json", "-"]) == 0
    fields = json.loads(capsys.readouterr().out)
    assert fields["eta"] == pytest.approx(0.362, abs=0.005)
    assert fields["k"] == pytest.approx(1.86, abs=0.01)
    assert fields["rms"] == pytest.approx(0.0293, abs=1e-4)
    assert fields["chi2"] is None


def test_a_cache_folder_that_cannot_be_is_passed_over(tmp_path):
    (tmp_path / "file").write_text("")
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path / "file")}
    done = run(GOLD, "--sample", "constant", "--quiet", env=environment)  # compiled soon
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_a_reader_that_stops_early_is_no_error(tmp_path):
    """As `fresnel-fit gold.csv --json gold.json | head -1` with a head that is quick."""
    result = ["--json", str(tmp_path / "gold.json")]
    for arguments in ([str(GOLD), *result], ["--help"], ["--version"], ["--materials"]):
        read, write = os.pipe()
        os.close(read)
        with os.fdopen(write, "w") as closed:
            done = subprocess.run(
                [sys.executable, "-m", "fitting", *arguments],
                stdout=closed, stderr=subprocess.PIPE, cwd=ROOT, text=True, timeout=120,
            )  # fmt: skip
        assert (done.returncode, done.stderr) == (0, "")
    assert json.loads((tmp_path / "gold.json").read_text())["status"] == "converged"


@pytest.mark.parametrize(
    ("arguments", "status"), [(["--help"], 0), (["--version"], 0), (["--starts", "x", "f"], 2)]
)
def test_help_and_mistyped_options_answer_without_jax(arguments, status):
    script = (
        "import sys\n"
        "from fitting.command.cli import main\n"
        "try:\n"
        "    main(sys.argv[1:])\n"
        "except SystemExit as end:\n"
        "    assert not {'jax', 'numpy', 'optimistix', 'matplotlib'} & set(sys.modules)\n"
        "    raise\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, *arguments], capture_output=True, text=True, cwd=ROOT
    )
    assert done.returncode == status
    assert "Traceback" not in done.stderr


def test_help_has_an_example_and_the_exit_status(capsys):
    with pytest.raises(SystemExit):
        cli.main(["--help"])
    text = capsys.readouterr().out
    assert "fresnel-fit gold.csv --plot gold.png --json gold.json" in text
    for status in ("\n  0 ", "\n  1 ", "\n  2 ", "\n  130 "):
        assert status in text
    assert max(map(len, text.splitlines())) <= 80


def test_every_named_material_is_listed_and_is_an_index(capsys):
    with pytest.raises(SystemExit) as end:
        cli.main(["--materials"])
    lines = capsys.readouterr().out.splitlines()
    for name, line in zip(names(), lines[1:], strict=True):
        assert line.startswith(name) and lookup(name).source in line
        assert str(Sample.parse(f"air | cauchy 9 nm | {name}").media[-1]) == name
    assert end.value.code == 0
    assert "fresnel-fit --materials" in refused(capsys, GOLD, "--sample", "air | lead 9 nm | Si")


def test_every_option_of_the_reader_is_a_flag():
    parameters = inspect.signature(read_csv).parameters.values()
    options = {p.name for p in parameters if p.kind is p.KEYWORD_ONLY}
    assert {name.replace("-", "_") for name, *_ in cli._READING} == options


def test_reader_options_arrive(capsys, tmp_path):
    (tmp_path / "glass.txt").write_text(GLASS.replace(",", ";").replace(".", ","))
    arguments = ["--scale", "0.01", "--delimiter", "semicolon", "--decimal", ",", "--lines", "2-5"]
    arguments += ["--columns", "angle=1,R_s=2,R_p=3", "--sigma", "0.001", "--wavelength-um", ".5"]
    assert cli.main([str(tmp_path / "glass.txt"), *arguments, "--json", "-"]) == 0
    fields = json.loads(capsys.readouterr().out)
    assert fields["n_data"] == 8
    assert fields["wavelength_um"] == 0.5
    assert fields["eta"] == pytest.approx(1.5, abs=0.01)
    assert fields["chi2"] is not None


def test_fit_options_arrive(capsys):
    def fields(*arguments):
        assert cli.main([str(GOLD), "--json", "-", *arguments]) == 0
        return json.loads(capsys.readouterr().out)

    scaled, absolute, water = (
        fields(),
        fields("--errors", "stated"),
        fields("--sample", "1.333 | free"),
    )
    # The factor between the two is sqrt(chi2/dof) by definition.
    ratio = scaled["parameters"]["eta"]["sigma"] / absolute["parameters"]["eta"]["sigma"]
    assert ratio == pytest.approx(scaled["chi2_reduced"] ** 0.5, rel=1e-9)
    # R depends on the ratio of the indices alone.
    assert water["eta"] == pytest.approx(1.333 * scaled["eta"], rel=1e-6)
    assert water["k"] == pytest.approx(1.333 * scaled["k"], rel=1e-6)


def test_quiet_prints_nothing(capsys):
    assert cli.main([str(GOLD), "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


def test_data_that_give_no_index_end_in_1(capsys, tmp_path):
    (tmp_path / "one.csv").write_text("angle_deg,R\n0,0.3\n")
    assert cli.main([str(tmp_path / "one.csv")]) == 1
    out, err = capsys.readouterr()
    assert "undetermined" in out
    assert err == ""


def test_a_spectrum_writes_its_index_beside_the_data(tmp_path):
    (tmp_path / "s.csv").write_text("wavelength_nm,R\n400,0.3\n500,0.4\n")
    assert cli.main([str(tmp_path / "s.csv"), "--csv", str(tmp_path / "out.csv"), "--quiet"]) == 1
    assert nothing_in(tmp_path, "s.csv", "out.csv", "out.index.csv")
    assert (tmp_path / "out.index.csv").read_text().count("undetermined") == 2


def test_a_missing_file(capsys, tmp_path):
    assert "No such file" in refused(capsys, tmp_path / "none.csv")


def test_a_folder_in_place_of_a_file(capsys, tmp_path):
    assert "directory" in refused(capsys, tmp_path)


def test_a_file_that_must_not_be_read(capsys, tmp_path, monkeypatch):
    (tmp_path / "secret.csv").write_text(GLASS)

    def forbidden(self, *_):
        raise PermissionError(13, "Permission denied", str(self))

    monkeypatch.setattr(Path, "open", forbidden)  # root may read everything
    assert "Permission denied" in refused(capsys, tmp_path / "secret.csv")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no row"),
        ("angle_deg,R_s\n30,0.5\n40,-3\n", "line 3"),
        (
            "wavelength_um,T,R\n0.5,0.9,0.08\n0.6,0.9,0.08\n",
            "T cannot be fitted with one bare surface",
        ),
    ],
)
def test_content_that_cannot_be_fitted(capsys, tmp_path, text, said):
    (tmp_path / "bad.csv").write_text(text)
    assert said in refused(capsys, tmp_path / "bad.csv", "--json", tmp_path / "out.json")
    assert nothing_in(tmp_path, "bad.csv")


def test_an_incident_index_that_cannot_be(capsys):
    assert "'-1' is not an index" in refused(capsys, GOLD, "--sample", "-1 | free")


@pytest.mark.parametrize(("arguments", "said"), [
    (["--jsn", "x"], "like it: --json. fresnel-fit --help"),
    (["--angle", "70"], "like it: --angle-deg, --angle-unit. fresnel-fit --help"),
    (["--zzz"], "unrecognized arguments: --zzz. fresnel-fit --help"),
    (["-q"], "unrecognized arguments: -q"),
    (["--errors", "none"], "invalid choice: 'none'"),
])  # fmt: skip
def test_unknown_and_contradicting_options(capsys, arguments, said):
    with pytest.raises(SystemExit) as end:
        cli.main([str(GOLD), *arguments])
    assert end.value.code == 2
    assert said in capsys.readouterr().err


def test_interruption_ends_in_130_and_leaves_nothing(capsys, tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "_fit", interrupted)
    assert cli.main([str(GOLD), "--json", str(tmp_path / "gold.json")]) == 130
    assert capsys.readouterr().out == ""
    assert nothing_in(tmp_path)


def test_a_terminal_that_lacks_a_letter(tmp_path, monkeypatch):
    data = tmp_path / "gold_\u00b5m.csv"
    data.write_bytes(GOLD.read_bytes())
    narrow = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", narrow)
    assert cli.main([str(data)]) == 0
    assert b"gold_\\xb5m.csv" in narrow.buffer.getvalue()
