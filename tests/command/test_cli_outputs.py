"""Where the command writes its results, and what it refuses to write to."""

import json
import os
import stat
from pathlib import Path

import pytest

from fitting.command import cli
from fitting.output.export import json_object
from tests.command_line import nothing_in, own_cache, refused  # noqa: F401 (a fixture)
from tests.truth.simulated import GOLD


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
    assert "is write-protected" in refused(capsys, GOLD, "--json", tmp_path / "out.json")


def test_a_device_is_not_replaced(capsys, no_fit):
    if not Path("/dev/null").exists():
        pytest.skip("this system has no /dev/null")
    assert "not a regular file" in refused(capsys, GOLD, "--json", "/dev/null")
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)


def test_the_measurement_is_not_overwritten(capsys, tmp_path, no_fit):
    data = tmp_path / "gold.csv"
    data.write_bytes(GOLD.read_bytes())
    assert "a file that this fit reads" in refused(capsys, data, "--csv", data)
    (tmp_path / "link.csv").symlink_to(data)
    assert "a file that this fit reads" in refused(capsys, data, "--csv", tmp_path / "link.csv")
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
    old = json_object({"written_by": "fresnel-fit", "status": "old"})
    (tmp_path / "gold.json").write_text(old)

    def fail(*_):
        raise error

    # a defect while the picture is drawn; a disk that is full when the second file is written
    if isinstance(error, RuntimeError):
        monkeypatch.setattr("fitting.output.files.picture_bytes", fail)
    else:
        syncs = iter((os.fsync, fail))
        monkeypatch.setattr(os, "fsync", lambda descriptor: next(syncs)(descriptor))
    arguments = [str(GOLD), "--json", str(tmp_path / "gold.json")]
    arguments += ["--plot", str(tmp_path / "gold.png")]
    if isinstance(error, OSError):
        assert cli.main(arguments) == 2
        assert "gold.json: cannot be written (No space left" in capsys.readouterr().err
    else:  # a defect of ours is not dressed up as a mistake of the user
        with pytest.raises(RuntimeError, match="defect"):
            cli.main(arguments)
    assert (tmp_path / "gold.json").read_text() == old
    assert nothing_in(tmp_path, "gold.json")


def test_a_result_replaces_an_older_one_and_keeps_its_permissions(tmp_path):
    old = tmp_path / "gold.json"
    old.write_text(json_object({"written_by": "fresnel-fit", "status": "old"}))
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
