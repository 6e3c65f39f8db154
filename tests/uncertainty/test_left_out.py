"""Random measurements whose intervals left out a true index that fits as well as their ends."""

import numpy as np
import pytest

from fitting import Fit, fit_many
from tests.truth.left_out import left_out
from tests.truth.random_measurements import Batch, draw, textbook

pytestmark = pytest.mark.slow

BENT = [(1, 68), (65, 117), (73, 77), (82, 104), (87, 106)]
BEYOND_CRITICAL = [(8, 400), (9, 403), (45, 485), (46, 459), (70, 478), (88, 449), (93, 418)]
# below the index in front, where sigma_k is a fifth to two fifths of k
INSIDE = [(39, 411), (75, 418)]
# k above eta: sigma_k was .5 to 1.05 of k, and the status "converged"
LIKE_METALS = [(2, 405), (2, 491), (9, 444)]
# between two critical angles: ranges as narrow as .003 of eta, of which the profile found none
NARROW = [(10, 42), (46, 133), (52, 119)]
UNDETERMINED = [(3, 329), (15, 326), (75, 35), (75, 277), (83, 338), (95, 345), (99, 305)]
ALL = BENT + INSIDE + BEYOND_CRITICAL + LIKE_METALS + NARROW + UNDETERMINED
# drawn by `benchmarks.studies.fit_coverage`
STUDY = 664303778, 200
OF_THE_STUDY = [(3, 921), (24, 903), (72, 812), (77, 855), (241, 965)]


def drawn(number: int, curve: int, seed: int = 11, curves: int = 100) -> Batch:
    batch, _ = draw(seed, number, curves)
    return batch.take(np.array([curve]))


def fitted(batch: Batch, intervals: str = "auto") -> Fit:
    angles, data = batch.padded()
    sample = f"{float(batch.geometry.eta_i)!r} | free"
    return fit_many(angles, **data, sample=sample, intervals=intervals)


@pytest.mark.study
@pytest.mark.parametrize(("number", "curve"), ALL)
def test_an_interval_holds_a_true_index_that_fits_as_well(number, curve):
    batch = drawn(number, curve)
    found = fitted(batch)
    assert np.isfinite(found.parameters["eta"].interval).all()
    assert not left_out(batch, found).any()


@pytest.mark.parametrize(
    ("number", "curve"),
    [pytest.param(*one, marks=[pytest.mark.study] * (one[0] in (24, 77))) for one in OF_THE_STUDY],
)
def test_an_interval_does_not_begin_at_the_value_where_its_region_is_lost(number, curve):
    """The profile had followed another piece of the region, beyond a critical angle."""
    batch = drawn(number, curve, *STUDY)
    assert not left_out(batch, fitted(batch)).any()


@pytest.mark.parametrize(("number", "curve"), BENT)
def test_quadratic_errors_that_mislead_are_named(number, curve):
    """Near an index match a standard error is as large as the circle of constant R(0)."""
    batch = drawn(number, curve)
    found = fitted(batch, "quadratic")
    assert left_out(batch, found, 1.0).any()
    assert "quadratic_misleads" in [f.code for f in found.findings]
    assert "mislead" in str(found)


@pytest.mark.parametrize(("number", "curve"), BEYOND_CRITICAL + LIKE_METALS)
def test_far_beyond_the_critical_angle_only_a_product_is_determined(number, curve):
    """The standard error of eta was 3 to 30 % of it, and a tenth of eta fits as well."""
    found = fitted(drawn(number, curve))
    assert found.status == "undetermined"
    assert "combination" in [f.code for f in found.findings]


def test_angles_on_both_sides_of_the_critical_one_determine_both():
    angles = np.linspace(20.0, 80.0, 13)
    rng = np.random.default_rng(2)
    R_s = textbook(angles, np.array(0.7 + 0.01j))["R_s"] + 1e-3 * rng.standard_normal(13)
    found = fit_many(angles, R_s=R_s)
    assert found.status == "converged"
    assert abs(found.parameters["eta"].value - 0.7) < 0.01
