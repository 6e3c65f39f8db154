"""The folder of --report: one page that needs nothing else, and the files beside it."""

import base64
import html
import html.parser
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from fitting import fit, fit_many
from fitting.command import cli
from fitting.data.measurement import concatenate
from fitting.measured_file import read_csv
from fitting.output import files, page
from fitting.output.page import fit_page
from fitting.results.diagnostics import Finding, Warning
from tests.output.page_reader import Page
from tests.truth.simulated import GOLD, simulated

pytest.importorskip("matplotlib")


@pytest.fixture(autouse=True)
def jax_as_it_is(monkeypatch):
    """float64 is on already (conftest), and no test touches the compile cache of who runs it."""
    monkeypatch.setattr("fitting.process.start_up.set_up_jax", lambda: None)


def test_the_gold_scan(tmp_path, capsys):
    folder = tmp_path / "gold report"
    assert cli.main([str(GOLD), "--report", str(folder), "--quiet"]) == 0
    assert capsys.readouterr().out == ""
    files = {p.name for p in folder.iterdir()}
    assert files == {"report.html", "fit.json", "data.csv", "fit.png"}
    text = (folder / "report.html").read_text(encoding="utf-8")
    seen = Page(text)
    assert seen.open == []
    # What was read, found, and not to be trusted.
    for part in ("18 angles", "16 R_s and 15 R_p", "0.344 +- 0.022", "1.820 +- 0.087",
                 "75.4", "Warning: reduced chi2 is 75.41", f"fresnel-fit {GOLD}"):  # fmt: skip
        assert part in seen.text, part
    # The one thing that it shows from a file is the picture, which stands in the page itself.
    assert len(seen.loaded) == 1
    head, data = seen.loaded[0].split(",")
    assert head == "data:image/png;base64"
    assert base64.b64decode(data) == (folder / "fit.png").read_bytes()
    assert "url(" not in text
    assert "<script" not in text
    # eta and k; the data; and two heads
    assert seen.tags.count("tr") == 2 + 31 + 2
    assert json.loads((folder / "fit.json").read_text())["eta"] == pytest.approx(0.344, abs=1e-3)
    assert (folder / "data.csv").read_text().count("\n") == 31 + 5


def test_a_spectrum_has_its_index_in_a_table():
    waves = np.linspace(0.4, 0.7, 50)
    parts = [simulated(0.5, 2.0 + w, 1e-3, wavelength_um=w, seed=i) for i, w in enumerate(waves)]
    measurement = concatenate(*parts[:3])
    result = fit(measurement)
    seen = Page(fit_page(result, b"png"))
    assert "Index over wavelength" in seen.text
    assert "3 wavelengths: 3 converged" in seen.text
    for i in range(3):
        assert f"{waves[i]:.6g}" in seen.text
        assert f"{result.parameters['eta'].interval[i, 0]:.4f}"[:5] in seen.text
    assert "details" not in seen.tags
    assert "<details>" in page.html_table("Data", [["a"]] + [["1"]] * (page.OPEN_ROWS + 1))


def test_what_the_file_holds_is_text_and_no_html():
    evil = '<img onerror="alert(1)">'  # a name has no slash
    found = fit(read_csv(GOLD))
    m = found.measurement
    assert m is not None
    told = {"sample": evil, "delta_bic": 1.0, "scale": 1.0, "sigma": 0.1}
    found = replace(
        found,
        measurement=replace(m, source=evil, understood=evil),
        parameters={evil: found.parameters["eta"], "k": found.parameters["k"]},
        findings=(Finding("gain_instead", np.True_, told),),
        notes=(Warning("gain_instead", {}, told),),
        curve=np.zeros(len(m), int),
        curve_names=(evil,),
    )
    text = fit_page(found, b"", evil)
    assert "img" not in Page(text).tags
    # file, how it was read, warning and note, parameter, command line
    for tag in ("title", "h1", "dd", "p class=warning", "p class=note", "td", "footer"):
        name = tag.split()[0]
        assert re.search(f"<{tag}[^>]*>[^<]*{re.escape(html.escape(evil))}[^<]*</{name}>", text), (
            tag
        )
    assert "\\udcff" in fit_page(found, b"", "\udcff")


def test_all_of_it_or_nothing(tmp_path, capsys, monkeypatch):
    def fails(*_):
        raise OSError(28, "No space left on device", "report.html")

    monkeypatch.setattr(files, "fit_page", fails)
    new, old = tmp_path / "new", tmp_path / "old"
    old.mkdir()
    (old / "fit.json").write_text("before")
    (old / "mine.txt").write_text("mine")
    for folder in (new, old):
        assert cli.main([str(GOLD), "--report", str(folder), "--overwrite"]) == 2
        assert "No space left" in capsys.readouterr().err
    assert not new.exists()
    assert {p.name: p.read_text() for p in old.iterdir()} == {
        "fit.json": "before",
        "mine.txt": "mine",
    }


def test_a_report_goes_into_a_folder_that_is_there_and_leaves_the_rest(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    assert cli.main([str(GOLD), "--report", str(tmp_path), "--quiet", "--overwrite"]) == 0
    assert (tmp_path / "mine.txt").read_text() == "mine"
    assert (tmp_path / "report.html").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("file", r"--report \S+file: this is a file; name a folder"),
        ("none/deep", r"--report \S+deep: there is no folder \S+none; create it first"),
    ],
)
def test_a_folder_that_cannot_be_is_found_before_the_fit(tmp_path, capsys, monkeypatch, name, said):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(cli, "_fit", lambda *_: pytest.fail("it was fitted first"))
    assert cli.main([str(GOLD), "--report", str(tmp_path / name)]) == 2
    assert re.search(said, capsys.readouterr().err)


def test_without_matplotlib_the_extra_is_named(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert cli.main([str(GOLD), "--report", str(tmp_path / "r")]) == 2
    assert "--report needs matplotlib" in capsys.readouterr().err
    assert not (tmp_path / "r").exists()


def test_the_report_has_all_that_the_single_files_have(tmp_path):
    single = {kind: tmp_path / f"one.{kind}" for kind in ("json", "csv")}
    arguments = [str(GOLD), "--json", str(single["json"]), "--csv", str(single["csv"]), "--quiet"]
    folder = tmp_path / "folder"
    assert cli.main([*arguments, "--report", str(folder)]) == 0
    assert (folder / files.REPORT["json"]).read_bytes() == single["json"].read_bytes()
    assert (folder / files.REPORT["csv"]).read_bytes() == single["csv"].read_bytes()


def test_a_report_from_python(tmp_path):
    found = fit(read_csv(GOLD))
    found.report(tmp_path / "gold")
    names = {p.name for p in (tmp_path / "gold").iterdir()}
    assert names == {"report.html", "fit.json", "data.csv", "fit.png"}
    assert json.loads((tmp_path / "gold" / "fit.json").read_text()) == json.loads(
        json.dumps(found.to_dict())
    )
    with pytest.raises(files.OutputError, match=r"files other than those .*overwrite=True"):
        found.report(tmp_path)
    found.report(tmp_path, overwrite=True)
    assert (tmp_path / "fit.json").read_bytes() == (tmp_path / "gold" / "fit.json").read_bytes()
    angles = np.array([30.0, 50.0, 65.0, 75.0, 82.0])
    one = simulated(0.5, 2.2, 0.0, angles=angles)
    noise = 1e-3 * np.random.default_rng(1).normal(size=(2, 3, 5))
    s, p = (one.value[one.quantity == q] for q in ("R_s", "R_p"))
    many = fit_many(angles, R_s=s + noise[0], R_p=p + noise[1])
    many.report(tmp_path / "many")
    names = {p.name for p in (tmp_path / "many").iterdir()}
    assert names == {"report.html", "fit.json", "index.csv", "fit.png"}
    assert "3 curves: 3 converged" in Page((tmp_path / "many" / "report.html").read_text()).text


def test_the_page_of_a_file_with_control_characters_has_none(tmp_path):
    (tmp_path / "a\x1bb.csv").write_text("angle_deg,R_s\n30,0.8\n50,0.85\n70,0.9\n80,0.95\n")
    found = fit(read_csv(tmp_path / "a\x1bb.csv"))
    text = fit_page(found, b"", "fresnel-fit a\x1bb.csv")
    assert "\x1b" not in text
    assert "a\\x1bb.csv" in text
