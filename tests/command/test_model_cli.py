"""The command with --sample: options, files, exit status, refusals."""

import json

import numpy as np
import pytest

from fitting import simulate
from fitting.command import cli
from tests.truth.reading import columns_of

PLATE = "air | free 2 mm thick | air"
ANGLES = np.array([30.0, 50.0, 60.0, 70.0, 80.0])
WAVELENGTHS = np.linspace(0.4, 0.8, 9)


@pytest.fixture
def spectrum(tmp_path):
    """R_s and R_p of a dispersive glass, two polarizations in files of their own."""
    angle, wavelength = (a.ravel() for a in np.meshgrid(ANGLES, WAVELENGTHS))
    random = np.random.default_rng(1)
    files = []
    for q, scale in (("R_s", 1.0), ("R_p", 0.97)):
        values = simulate("cauchy:2", {"A": 1.5, "B": 0.01, "scale": scale}, angle, wavelength, q)
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
    values = {"eta": 1.52, "k": 2e-6}
    T, R = (simulate(PLATE.replace("free", "constant"), values, 0.0, wavelength, q) for q in "TR")
    file = tmp_path / "plate.csv"
    rows = zip(wavelength, T, R, strict=True)
    file.write_text("wavelength_um,T,R\n" + "".join(f"{w},{t:.8f},{r:.8f}\n" for w, t, r in rows))
    return str(file)


def test_two_files_one_model(spectrum, tmp_path, capsys):
    out, csv = tmp_path / "fit.json", tmp_path / "fit.csv"
    status = cli.main([
        *spectrum, "--sample", "cauchy:2", "--free", "scale", "--fix", "scale[R_s.csv R_s]=1",
        "--bound", "A=1.2..1.9", "--prior", "B=0.01+-0.01", "--errors", "stated",
        "--json", str(out), "--csv", str(csv),
    ])  # fmt: skip
    shown = capsys.readouterr().out
    assert status == 0, shown
    assert "cauchy:2 (one bare surface" in shown and "scale[R_p.csv R_p]" in shown
    assert max(map(len, shown.splitlines())) <= 80
    data = json.loads(out.read_text())
    assert data["names"] == ["A", "B", "scale[R_p.csv R_p]"]
    parameters = data["parameters"]
    fixed = parameters["scale[R_s.csv R_s]"]
    assert (fixed["value"], fixed["status"]) == (1.0, "fixed")
    for name, true in zip(data["names"], (1.5, 0.01, 0.97), strict=True):
        assert abs(parameters[name]["value"] - true) < 4.5 * parameters[name]["sigma"]
    assert len(data["index"]["eta"]) == len(WAVELENGTHS)
    table = columns_of(csv)  # fmt: skip
    assert len(table) == 2 * len(ANGLES) * len(WAVELENGTHS)
    np.testing.assert_allclose(
        table["residual"], table["value"] - table["fitted"], atol=1e-15, rtol=0
    )
    index = columns_of(csv.with_name("fit.index.csv"))  # fmt: skip
    np.testing.assert_allclose(index["eta"], data["index"]["eta"])


def test_a_plate_wavelength_by_wavelength(plate, tmp_path, capsys):
    out = tmp_path / "plate.json"
    assert cli.main([plate, "--sample", PLATE, "--json", str(out)]) == 0
    shown = capsys.readouterr().out
    assert "free 2 mm thick" in shown and "3 wavelengths: 3 converged" in shown
    data = json.loads(out.read_text())
    np.testing.assert_allclose(data["eta"], 1.52, atol=1e-5)
    np.testing.assert_allclose(data["k"], 2e-6, rtol=1e-4)
    assert cli.main([plate, "--sample", "air|free 2000um thick|air", "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["k"] == data["k"]


@pytest.mark.study
def test_pictures(plate, spectrum, tmp_path):
    pytest.importorskip("matplotlib")
    for arguments in (
        [plate, "--sample", PLATE, "--reference", "BK7"],
        [*spectrum, "--sample", "cauchy:2", "--reference", "gold"],
    ):
        picture = tmp_path / "fit.png"
        assert cli.main([*arguments, "--quiet", "--plot", str(picture)]) == 0
        assert picture.read_bytes().startswith(b"\x89PNG")
        picture.unlink()


@pytest.mark.parametrize(("options", "words"), [
    (["--sample", ""], "names no medium at one of its places"),  # once the default, free
    (["--free", "scale"], "scale has one value for all wavelengths"),
    (["--sample", "coshy"], "'coshy' is not an index"),
    (["--sample", "cauchy", "--fix", "A=1..2"], "NAME=VALUE was wanted, for example k=0; --bound"),
    (["--sample", "cauchy", "--prior", "A=2"], "scale=1+-0.02; --fix takes this"),
    (["--sample", "cauchy", "--bound", "A"], "NAME=LOW..HIGH"),
    (["--sample", "cauchy", "--fix", "Q=1"], "has no parameter 'Q'"),
    (["--sample", "cauchy", "--reference", "unobtainium"], "unobtainium"),
    (["--sample", "cauchy", "--errors", "none"], None),
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
    for text in ("thin", "-1 mm", "0 mm", "inf mm", "3 inches"):
        assert cli.main([plate, "--sample", f"air | free {text} thick | air"]) == 2
        error = capsys.readouterr().err
        assert "thickness" in error or "is not an index" in error
    assert cli.main([*spectrum, "--sample", "cauchy", "--json", spectrum[1]]) == 2
    assert "a file that this fit reads" in capsys.readouterr().err
    assert cli.main([plate, "--sample", "cauchy"]) == 2  # T of a plate is that of two faces
    assert "cannot be fitted with one bare surface" in capsys.readouterr().err
