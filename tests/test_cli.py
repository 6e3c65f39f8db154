"""The command fresnel-fit, run as people run it, with their mistakes."""

import inspect
import io
import json
import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from simulated import GOLD

from fitting import cli, cli_options, measurement

ROOT = Path(__file__).resolve().parents[1]
GLASS = """angle_deg,R_s,R_p
30,5.78,2.53
45,9.20,0.85
60,17.74,0.18
70,30.0,4.2
80,54.6,23.9
"""


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(autouse=True)
def own_cache(cache, monkeypatch):
    """No test reads or writes the cache of who runs it; no test leaves jax pointed at it."""
    import jax

    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
    names = (
        "jax_compilation_cache_dir",
        "jax_persistent_cache_min_compile_time_secs",
        "jax_persistent_cache_min_entry_size_bytes",
    )
    before = {name: getattr(jax.config, name) for name in names}
    yield
    for name, value in before.items():
        jax.config.update(name, value)


def run(*arguments, **options):
    """Run the command in a process of its own."""
    return subprocess.run(
        [sys.executable, "-W", "error", "-m", "fitting", *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=ROOT,
        timeout=120,
        **options,
    )


def refused(capsys, *arguments):
    """Run in this process, expect status 2, and return the one line that it says."""
    assert cli.main([str(a) for a in arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("fresnel-fit: ")
    assert err.count("\n") == 1
    return err


def nothing_in(folder, *but):
    return {p.name for p in folder.iterdir()} == set(but)


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
    done = run(GOLD, "--quiet", env=environment)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_a_reader_that_stops_early_is_no_error(tmp_path):
    """As `fresnel-fit gold.csv --json gold.json | head -1` with a head that is quick."""
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "w") as closed:
        done = subprocess.run(
            [sys.executable, "-m", "fitting", str(GOLD), "--json", str(tmp_path / "gold.json")],
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
        "from fitting.cli import main\n"
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


def test_every_option_of_the_reader_is_a_flag():
    parameters = inspect.signature(measurement.read_csv).parameters.values()
    options = {p.name for p in parameters if p.kind is p.KEYWORD_ONLY}
    assert {name.replace("-", "_") for name, *_ in cli_options._READING} == options


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
        ("wavelength_um,T,R\n0.5,0.9,0.08\n0.6,0.9,0.08\n", "cannot fit T"),
    ],
)
def test_content_that_cannot_be_fitted(capsys, tmp_path, text, said):
    (tmp_path / "bad.csv").write_text(text)
    assert said in refused(capsys, tmp_path / "bad.csv", "--json", tmp_path / "out.json")
    assert nothing_in(tmp_path, "bad.csv")


def test_an_incident_index_that_cannot_be(capsys):
    assert "'-1' is not an index" in refused(capsys, GOLD, "--sample", "-1 | free")


def test_unknown_and_contradicting_options():
    for arguments in (["--jsn", "x"], ["--errors", "none"]):
        with pytest.raises(SystemExit) as end:
            cli.main([str(GOLD), *arguments])
        assert end.value.code == 2


@pytest.fixture
def no_fit(monkeypatch):
    """The fit must not run: the mistake is to be found before."""

    def fit(*_):
        raise AssertionError("fitted before the mistake was found")

    monkeypatch.setattr(cli, "_fit", fit)


@pytest.mark.parametrize("flag", ["--json", "--csv", "--plot"])
def test_outputs_are_tried_before_the_fit(capsys, tmp_path, no_fit, flag):
    missing = refused(capsys, GOLD, flag, tmp_path / "none" / "out.png")
    assert f"{flag} " in missing
    assert "no folder" in missing
    (tmp_path / "folder.png").mkdir()
    assert "this is a folder" in refused(capsys, GOLD, flag, tmp_path / "folder.png")
    assert nothing_in(tmp_path, "folder.png")


def test_a_folder_that_must_not_be_written_to(capsys, tmp_path, no_fit, monkeypatch):
    def forbidden(path, *_):
        raise PermissionError(13, "Permission denied", path)

    monkeypatch.setattr(os, "open", forbidden)  # root may write everywhere
    assert "Permission denied" in refused(capsys, GOLD, "--json", tmp_path / "out.json")


def test_a_file_that_must_not_be_written_to(capsys, tmp_path, no_fit, monkeypatch):
    (tmp_path / "out.json").write_text("old")
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert "must not be written to" in refused(capsys, GOLD, "--json", tmp_path / "out.json")


def test_a_device_is_not_replaced(capsys, no_fit):
    if not Path("/dev/null").exists():
        pytest.skip("this system has no /dev/null")
    assert "not a regular file" in refused(capsys, GOLD, "--json", "/dev/null")
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)


def test_the_measurement_is_not_overwritten(capsys, tmp_path, no_fit):
    data = tmp_path / "gold.csv"
    data.write_bytes(GOLD.read_bytes())
    assert "measurement itself" in refused(capsys, data, "--csv", data)
    (tmp_path / "link.csv").symlink_to(data)
    assert "measurement itself" in refused(capsys, data, "--csv", tmp_path / "link.csv")
    assert data.read_bytes() == GOLD.read_bytes()


def test_two_results_in_one_file(capsys, tmp_path, no_fit):
    out = tmp_path / "out"
    assert "same file" in refused(capsys, GOLD, "--csv", out, "--json", out)
    assert nothing_in(tmp_path)


def test_a_picture_of_an_unknown_kind(capsys, tmp_path, no_fit):
    assert ".png, .pdf, .svg" in refused(capsys, GOLD, "--plot", tmp_path / "gold.jpg")


def test_missing_matplotlib(capsys, tmp_path, no_fit, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    assert "pip install matplotlib" in refused(capsys, GOLD, "--plot", tmp_path / "gold.png")


@pytest.mark.parametrize("error", [RuntimeError("defect"), OSError(28, "No space left on device")])
def test_results_are_written_whole_or_not_at_all(capsys, tmp_path, monkeypatch, error):
    (tmp_path / "gold.json").write_text("old")

    def fail(figure, path, *_):
        path.write_text("half")
        raise error

    monkeypatch.setattr("fitting.output.files.save", fail)
    arguments = [str(GOLD), "--json", str(tmp_path / "gold.json")]
    arguments += ["--plot", str(tmp_path / "gold.png")]
    if isinstance(error, OSError):
        assert cli.main(arguments) == 2
        assert "--plot: No space left" in capsys.readouterr().err
    else:  # a defect of ours is not dressed up as a mistake of the user
        with pytest.raises(RuntimeError, match="defect"):
            cli.main(arguments)
    assert (tmp_path / "gold.json").read_text() == "old"
    assert nothing_in(tmp_path, "gold.json")


def test_a_result_replaces_an_older_one_and_keeps_its_permissions(tmp_path):
    old = tmp_path / "gold.json"
    old.write_text("old")
    old.chmod(0o640)
    (tmp_path / "link.json").symlink_to(old)
    assert cli.main([str(GOLD), "--quiet", "--json", str(tmp_path / "link.json")]) == 0
    assert json.loads(old.read_text())["status"] == "converged"
    assert stat.S_IMODE(old.stat().st_mode) == 0o640
    assert (tmp_path / "link.json").is_symlink()


def test_a_new_result_has_the_permissions_of_any_new_file(tmp_path):
    assert cli.main([str(GOLD), "--quiet", "--json", str(tmp_path / "gold.json")]) == 0
    (tmp_path / "other").write_text("")
    modes = {stat.S_IMODE(p.stat().st_mode) for p in tmp_path.iterdir()}
    assert len(modes) == 1


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
