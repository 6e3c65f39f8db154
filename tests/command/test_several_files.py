"""Files that are given together and cannot be of one sample."""

import numpy as np
import pytest

from fitting import fit_many
from fitting.command.cli import main
from fitting.outcomes.disagreement import disagreement
from tests.truth.simulated import textbook


def write(folder, name, eta, quantity="R_s", seed=0):
    angle = np.linspace(20.0, 80.0, 25)
    rng = np.random.default_rng(seed)
    R = textbook(angle, np.full(25, quantity), eta, 0.6) + 5e-4 * rng.standard_normal(25)
    path = folder / name
    rows = [f"{a:.6f},{r:.8f}" for a, r in zip(angle, R, strict=True)]
    path.write_text("\n".join([f"angle_deg,{quantity}", *rows]) + "\n")
    return str(path)


def test_files_that_exclude_each_other_are_named(tmp_path, capsys):
    first, second = write(tmp_path, "one.csv", 1.5), write(tmp_path, "two.csv", 1.9, seed=1)
    main([first, second])
    out = " ".join(capsys.readouterr().out.split())
    assert "the files contradict each other: " in out
    assert "one.csv alone" in out and "two.csv alone" in out


@pytest.mark.parametrize("sample", ["free", "constant"])
def test_two_polarizations_of_one_sample_are_not_told_apart(tmp_path, capsys, sample):
    first, second = write(tmp_path, "s.csv", 1.5), write(tmp_path, "p.csv", 1.5, "R_p", 1)
    assert main([first, second, "--sample", sample, "--wavelength-um", "0.6"]) == 0
    assert "contradict each other" not in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("sample", ["free", "constant"])
def test_files_of_one_name_are_told_apart_by_their_folders(tmp_path, monkeypatch, capsys, sample):
    monkeypatch.chdir(tmp_path)
    for folder, eta in (("a", 1.5), ("b", 1.6)):
        (tmp_path / folder).mkdir()
        write(tmp_path / folder, "scan.csv", eta)
    main(["a/scan.csv", "b/scan.csv", "--sample", sample, "--wavelength-um", "0.6"])
    out = " ".join(capsys.readouterr().out.split())
    assert "a/scan.csv alone" in out and "b/scan.csv alone" in out


def test_few_data_exclude_each_other_no_more_often_than_many():
    """By four standard errors 16 of these 400 pairs did: two degrees of freedom tell little."""
    angle = np.array([30.0, 50.0, 65.0, 75.0])
    rng = np.random.default_rng(5)
    exact = textbook(angle, np.full(4, "R_p"), 3.0, 2.0)
    one, other = (
        fit_many(angle, R_p=exact + 5e-3 * rng.standard_normal((400, 4))) for _ in range(2)
    )
    excluded = [bool(disagreement([one[i], other[i]])) for i in range(400)]
    assert sum(excluded) <= 1


@pytest.mark.parametrize("model", ["free", "cauchy"])
def test_plates_of_3_and_6_mm_are_not_fitted_under_one_thickness(tmp_path, capsys, model):
    files = [write(tmp_path, name, 1.5) for name in ("glass_3mm.csv", "glass_6mm.csv")]
    assert (
        main([*files, "--sample", f"air | {model} 3 mm thick | air", "--wavelength-um", "0.6"]) == 2
    )
    error = capsys.readouterr().err
    assert "3 mm" in error and "6 mm" in error and "one by one" in error
