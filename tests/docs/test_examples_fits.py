"""The examples that fit: your own loss with optimistix, rough gold, and the simulated scan."""

import importlib
from pathlib import Path

import jax
import numpy as np
import pytest

from fitting import fit, read_csv

pytestmark = pytest.mark.docs  # of `make test-docs`
EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.fixture
def example(monkeypatch):
    """Imports an example by its name, as running it as a script would."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    return importlib.import_module


@pytest.mark.study
def test_optimistix_on_gold_and_the_count_of_failures(example, tmp_path):
    own = example("fit_with_optimistix")
    results = own.main([str(tmp_path / "own.png"), "--size", "20"])
    assert (tmp_path / "own.png").stat().st_size > 50_000
    # The other fit shares neither unknowns nor solver with it.
    for name in ("eta", "k", "sigma_eta"):
        assert results[name] == pytest.approx(results[f"fit_{name}"], rel=1e-3)
    missed = {(x.unknowns, x.start): x.missed for x in results["counts"] if x.kind == "R_s and R_p"}
    assert missed[own.OURS, "ten of the mesh"] == 0.0
    assert missed["eta, k", "1.5 + 0 i"] > 0.3
    # Glass: the best k^2 is below 0 for about half of the noises, and k is then exactly 0.
    data = own.simulated("R_s and R_p", 20, np.random.default_rng(2))
    k = np.asarray(own.fit_many_indices(data).k)
    assert np.all(k >= 0.0) and np.any(k[:5] == 0.0)


@pytest.mark.study
def test_rough_gold_is_found_again(example, tmp_path):
    gold = example("rough_gold")
    jax.config.update("jax_enable_x64", False)
    try:
        results = gold.main([str(tmp_path / "gold.png"), "--size", "40"])
    finally:
        jax.config.update("jax_enable_x64", True)
    found = np.array([results["log_alpha"], results["eta"], results["k"]])
    sigma = np.array(results["sigma"])
    assert np.all(sigma < 0.2) and np.all(np.abs(found - gold.TRUE) < 4.0 * sigma)
    assert np.all(np.abs(np.array(gold.START) - gold.TRUE) > 4.0 * sigma)
    assert (tmp_path / "gold.png").stat().st_size > 20_000


@pytest.mark.study
def test_a_rendered_picture_has_the_derivatives_of_its_own_differences(example):
    gold = example("rough_gold")
    p, key, step = np.array(gold.TRUE), jax.random.key(1), 1e-6
    value, jacobian = gold.with_jacobian(p, key, 12)
    assert value.dtype == np.float64  # x64 is on here
    for i in (1, 2):  # eta and k; with the roughness a path may leave the surface
        shifted = [gold.render(p + s * step * np.eye(3)[i], key, 12).ravel() for s in (1.0, -1.0)]
        np.testing.assert_allclose(
            jacobian[:, i], (shifted[0] - shifted[1]) / (2.0 * step), atol=1e-7
        )


def test_the_simulated_scan_is_what_its_script_writes_and_fits(example):
    scan = example("simulated_scan")
    assert scan.FILE.read_text(encoding="utf-8") == scan.text()
    found = fit(read_csv(scan.FILE))
    for name, true in zip(("eta", "k"), scan.truth(), strict=True):
        low, high = found.parameters[name].interval
        assert low < true < high
    assert 0.4 < found.chi2_reduced < 1.8
    assert found.warnings == ()
