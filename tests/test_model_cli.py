"""The command with --model and --slab: options, files, exit status, refusals."""

import json

import numpy as np
import pytest

from fitting import cli, predict

ANGLES = np.array([30.0, 50.0, 60.0, 70.0, 80.0])
WAVELENGTHS = np.linspace(0.4, 0.8, 9)


@pytest.fixture
def spectrum(tmp_path):
    """R_s and R_p of a dispersive glass, two polarisations in files of their own."""
    angle, wavelength = (a.ravel() for a in np.meshgrid(ANGLES, WAVELENGTHS))
    random = np.random.default_rng(1)
    files = []
    for q, scale in (("R_s", 1.0), ("R_p", 0.97)):
        values = predict("cauchy:2", {"A": 1.5, "B": 0.01, "scale": scale}, angle, wavelength, q)
        values = values + 1e-3 * random.standard_normal(len(angle))
        rows = zip(angle, wavelength, values, strict=True)
        file = tmp_path / f"{q}.csv"
        file.write_text(
            f"angle_deg,wavelength_um,{q},sigma_{q}\n"
            + "".join(f"{a:g},{w:.4f},{max(v, 0.0):.6f},0.001\n" for a, w, v in rows)
        )
        files.append(str(file))
    return files


@pytest.fixture
def plate(tmp_path):
    wavelength = np.array([0.5, 0.6, 0.7])
    values = {"eta": 1.52, "k": 2e-6, "thickness_um": 2000.0}
    T, R = (predict("constant", values, 0.0, wavelength, q, structure="slab") for q in ("T", "R"))
    file = tmp_path / "plate.csv"
    rows = zip(wavelength, T, R, strict=True)
    file.write_text("wavelength_um,T,R\n" + "".join(f"{w},{t:.8f},{r:.8f}\n" for w, t, r in rows))
    return str(file)


def test_two_files_one_model(spectrum, tmp_path, capsys):
    out, csv = tmp_path / "fit.json", tmp_path / "fit.csv"
    status = cli.main([
        *spectrum, "--model", "cauchy:2", "--free", "scale", "--fix", "scale[R_s.csv R_s]=1",
        "--bound", "A=1.2..1.9", "--prior", "B=0.01+-0.01", "--absolute-sigma",
        "--json", str(out), "--csv", str(csv),
    ])  # fmt: skip
    shown = capsys.readouterr().out
    assert status == 0, shown
    assert "cauchy:2, one bare interface" in shown and "scale[R_p.csv R_p]" in shown
    assert max(map(len, shown.splitlines())) <= 80
    data = json.loads(out.read_text())
    assert data["names"] == ["A", "B", "scale[R_p.csv R_p]"]
    assert data["fixed"] == {"scale[R_s.csv R_s]": 1.0}
    for value, sigma, true in zip(data["values"], data["sigmas"], (1.5, 0.01, 0.97), strict=True):
        assert abs(value - true) < 4.5 * sigma
    assert len(data["index"]["eta"]) == len(WAVELENGTHS)
    table = np.genfromtxt(csv, delimiter=",", names=True, skip_header=2, encoding="utf-8",
                          dtype=None)  # fmt: skip
    assert len(table) == 2 * len(ANGLES) * len(WAVELENGTHS)
    np.testing.assert_allclose(
        table["residual"], table["value"] - table["fitted"], atol=1e-15, rtol=0
    )
    index = np.genfromtxt(csv.with_name("fit.index.csv"), delimiter=",", names=True,
                          skip_header=2)  # fmt: skip
    np.testing.assert_allclose(index["eta"], data["index"]["eta"])


def test_a_plate_wavelength_by_wavelength(plate, tmp_path, capsys):
    out = tmp_path / "plate.json"
    assert cli.main([plate, "--slab", "2", "--json", str(out)]) == 0
    shown = capsys.readouterr().out
    assert "a slab of 2000 um, both faces" in shown and "3 wavelengths: 3 converged" in shown
    data = json.loads(out.read_text())
    np.testing.assert_allclose(data["eta"], 1.52, atol=1e-5)
    np.testing.assert_allclose(data["k"], 2e-6, rtol=1e-4)
    assert cli.main([plate, "--slab", "2000um", "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["k"] == data["k"]


def test_pictures(plate, spectrum, tmp_path):
    pytest.importorskip("matplotlib")
    for arguments in (
        [plate, "--slab", "2", "--reference", "BK7"],
        [*spectrum, "--model", "cauchy:2", "--reference", "gold"],
    ):
        picture = tmp_path / "fit.png"
        assert cli.main([*arguments, "--quiet", "--plot", str(picture)]) == 0
        assert picture.read_bytes().startswith(b"\x89PNG")
        picture.unlink()


@pytest.mark.parametrize(("options", "words"), [
    (["--free", "scale"], "--free needs --model"),
    (["--model", "coshy"], "there is no model 'coshy'"),
    (["--model", "cauchy", "--fix", "A=1..2"], "this is what --bound takes"),
    (["--model", "cauchy", "--prior", "A=2"], "this is what --fix takes"),
    (["--model", "cauchy", "--bound", "A"], "NAME=LOW..HIGH"),
    (["--model", "cauchy", "--fix", "Q=1"], "has no parameter 'Q'"),
    (["--model", "cauchy", "--reference", "unobtainium"], "unobtainium"),
    (["--model", "cauchy", "--absolute-sigma", "--equal-weights"], None),
])  # fmt: skip
def test_refusals(spectrum, capsys, options, words):
    if words is None:
        with pytest.raises(SystemExit):
            cli.main([*spectrum, *options])
        return
    assert cli.main([*spectrum, *options]) == 2
    error = capsys.readouterr().err
    assert words in error and "Traceback" not in error and error.count("\n") == 1


def test_thickness_and_results_are_checked(plate, spectrum, capsys):
    for text in ("thin", "-1", "0", "inf", "3 inches"):
        with pytest.raises(SystemExit):
            cli.main([plate, f"--slab={text}"])
        assert "is no thickness" in capsys.readouterr().err
    assert cli.main([*spectrum, "--model", "cauchy", "--json", spectrum[1]]) == 2
    assert "is the measurement itself" in capsys.readouterr().err
    assert cli.main([plate, "--model", "cauchy"]) == 0  # T through one face
