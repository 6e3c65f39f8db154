"""The page of a fitted model: its parameters, how they go together, and what was compared."""

import numpy as np
import pytest
from simulated import simulated
from test_report_page import Page

from fitting import select
from fitting.model_page import model_page


@pytest.fixture(scope="module")
def choice():
    angles = tuple(np.linspace(20.0, 80.0, 20))
    measurement = simulated(1.7, 0.8, 1e-3, angles=angles, wavelength_um=0.6, seed=3)
    return select.choose(measurement, nuisances=False)


def test_the_page_of_a_model(choice):
    seen = Page(model_page(choice.fit, b"", "fresnel-fit x.csv --model auto", choice))
    assert seen.open == []
    for part in ("constant, interface", "fresnel-fit x.csv --model auto", "Models compared",
                 "constant, k = 0", "Correlations", "Index over wavelength", "Parameters",
                 *choice.reasons):  # fmt: skip
        assert part in seen.text, part
    # eta, k; eta and k with each other; two models; one wavelength; 40 data; and five heads.
    assert seen.tags.count("tr") == 2 + 2 + 2 + 1 + 40 + 5
    fit = choice.fit
    assert f"{fit.value_of('eta'):.3f}"[:5] in seen.text
    assert f"{fit.correlation[0, 1]:+.3f}" in seen.text


def test_without_a_choice_there_is_no_comparison(choice):
    assert "Models compared" not in Page(model_page(choice.fit, b"", "")).text
