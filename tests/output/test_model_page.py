"""The page of a fitted model: its parameters, how they go together, and what was compared."""

import json

import numpy as np
import pytest

from fitting.choice import candidates
from fitting.choice import selection as select
from fitting.command import cli
from fitting.output.page import fit_page
from tests.output.page_reader import Page
from tests.truth.simulated import GOLD, simulated


@pytest.fixture(scope="module")
def choice():
    angles = tuple(np.linspace(20.0, 80.0, 20))
    measurement = simulated(1.7, 0.8, 1e-3, angles=angles, wavelength_um=0.6, seed=3)
    return select.choose(measurement, "auto", instrument=False)


def test_the_page_of_a_model(choice):
    reasons = [reason.text for reason in choice.reasons]
    seen = Page(fit_page(choice.fit, b"", "fresnel-fit x.csv --sample auto", choice))
    assert seen.open == []
    for part in ("constant (one bare surface", "fresnel-fit x.csv --sample auto", "Models compared",
                 "constant, k = 0", "correlation", "Index over wavelength", "Parameters",
                 *reasons):  # fmt: skip
        assert part in seen.text, part
    # eta, k; two models; one wavelength; 40 data; and four heads.
    assert seen.tags.count("tr") == 2 + 2 + 1 + 40 + 4
    fit = choice.fit
    assert f"{fit.values['eta']:.3f}"[:5] in seen.text
    assert f"{fit.correlation[0, 1]:+.3f}" in seen.text
    assert "Models compared" in Page(choice._repr_html_()).text


def test_without_a_choice_there_is_no_comparison(choice):
    assert "Models compared" not in Page(fit_page(choice.fit, b"")).text


def test_the_choice_on_the_command_line(choice, tmp_path, capsys, monkeypatch):
    """The comparison is printed, and the report holds it; which models are fitted is not in doubt
    here, so that the command gets what was chosen already."""
    asked = {}

    def chosen(measurements, samples, **options):
        asked.update(options, samples=[str(sample) for sample in samples])
        return choice

    monkeypatch.setattr("fitting.process.start_up.set_up_jax", lambda: None)
    monkeypatch.setattr(select, "choose", chosen)
    folder = tmp_path / "report"
    arguments = ["--sample", "1.2 | auto", "--loss", "huber", "--report", str(folder)]
    assert cli.main([str(GOLD), *arguments]) == 0
    assert (asked["samples"], asked["loss"]) == (["1.2 | auto"], "huber")
    lines = capsys.readouterr().out.splitlines()
    rows = [line for line in lines if line.strip().startswith("> ")]
    assert len(rows) == 1
    assert rows[0].split()[1:3] == ["constant", "2"]
    assert any(line.split()[:4] == ["constant,", "k", "=", "0"] for line in lines)
    assert {p.name for p in folder.iterdir()} >= {"report.html", "fit.json", "data.csv", "fit.png"}
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert "Models compared" in Page(text).text
    assert text.count("data:image/png;base64,") == 1
    plain = json.loads((folder / "fit.json").read_text())
    assert [m["label"] for m in plain["models"] if m["taken"]] == ["constant"]
    assert plain["models"][0]["bic"] == pytest.approx(plain["bic"], abs=candidates.MARGIN)
    assert [r["text"] for r in plain["choice"]] == [r.text for r in choice.reasons]
    assert cli.main([str(GOLD), *arguments, "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")
