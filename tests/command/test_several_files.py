"""Files that are given together: how well the common fit describes each of them."""

from dataclasses import replace

import numpy as np
import pytest

from fitting import fit, read_csv
from fitting.command.cli import main
from tests.truth.simulated import textbook

pytestmark = pytest.mark.slow


def write(folder, name, eta, quantity="R_s", seed=0):
    angle = np.linspace(20.0, 80.0, 25)
    rng = np.random.default_rng(seed)
    R = textbook(angle, np.full(25, quantity), eta, 0.6) + 5e-4 * rng.standard_normal(25)
    path = folder / name
    rows = [f"{a:.6f},{r:.8f}" for a, r in zip(angle, R, strict=True)]
    path.write_text("\n".join([f"angle_deg,{quantity}", *rows]) + "\n")
    return str(path)


@pytest.mark.parametrize("sample", ["free", "constant"])
def test_the_residuals_of_each_file(tmp_path, sample):
    paths = [write(tmp_path, "s.csv", 1.5), write(tmp_path, "p.csv", 1.5, "R_p", 1)]
    files = [read_csv(path, wavelength_um=0.6) for path in paths]
    found = fit(files, sample)
    (note,) = found.notes
    off = files[1].value - found.fitted[len(files[0]) :]
    assert note.code == "residuals_of_files"
    assert note.values["rms"][1] == pytest.approx(np.sqrt(np.mean(off**2)), rel=1e-12)
    assert max(note.values["rms"]) < 7e-4
    stated = [replace(m, sigma=np.full(25, 5e-4)) for m in files]
    (note,) = fit(stated, sample).notes
    assert note.values["rms"] == pytest.approx([1.0, 1.0], abs=0.4)
    assert "in standard errors" in note.text
    assert fit(files[0], sample).notes == ()


def test_files_that_contradict_each_other_are_named(tmp_path):
    """Without errors by the scatter of their differences, with errors by these."""
    etas = {"one.csv": 1.5, "two.csv": 1.5, "other.csv": 1.52}
    paths = [write(tmp_path, n, eta, seed=i) for i, (n, eta) in enumerate(etas.items())]
    files = [read_csv(path, wavelength_um=0.6) for path in paths]
    for given in (files, [replace(m, sigma=np.full(25, 5e-4)) for m in files]):
        found = fit(given, "constant", fixed={"k": 0.0}, starts=8, intervals="quadratic")
        (note,) = found.notes
        pairs = [(one, other) for one, other, _, _ in note.values["contradictory"]]
        assert pairs == [("one.csv", "other.csv"), ("two.csv", "other.csv")]
        assert "one.csv and other.csv contradict each other: where both measured" in note.text
        assert all(count == 25 and times > 2.0 for *_, times, count in note.values["contradictory"])


@pytest.mark.study
def test_a_file_of_another_sample_stands_out(tmp_path):
    names = ("one.csv", "two.csv", "other.csv")
    paths = [
        write(tmp_path, n, 1.9 if n == "other.csv" else 1.5, seed=i) for i, n in enumerate(names)
    ]
    one, two, other = fit([read_csv(path) for path in paths]).notes[0].values["rms"]
    assert other > 1.5 * max(one, two) > 0.01


def test_files_of_one_name_are_told_apart_by_their_folders(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for seed, folder in enumerate("ab"):
        (tmp_path / folder).mkdir()
        write(tmp_path / folder, "scan.csv", 1.5, seed=seed)
    main(["a/scan.csv", "b/scan.csv", "--wavelength-um", "0.6"])
    out = " ".join(capsys.readouterr().out.split())
    assert "of a/scan.csv (25 data) and " in out and "of b/scan.csv (25 data)" in out


@pytest.mark.parametrize("model", ["free", "cauchy"])
def test_plates_of_3_and_6_mm_are_not_fitted_under_one_thickness(tmp_path, capsys, model):
    files = [write(tmp_path, name, 1.5) for name in ("glass_3mm.csv", "glass_6mm.csv")]
    assert (
        main([*files, "--sample", f"air | {model} 3 mm thick | air", "--wavelength-um", "0.6"]) == 2
    )
    error = capsys.readouterr().err
    assert "3 mm" in error and "6 mm" in error and "one by one" in error
