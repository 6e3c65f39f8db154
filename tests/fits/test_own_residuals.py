"""The caller's own residuals: values and errors of scipy, and what one start alone gets wrong."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares

from benchmarks.studies.fit_success import fit_by_itself
from benchmarks.studies.nist_study import ENOUGH, RTOL, fitted
from fitting import fit_residuals, own_residuals
from fitting.problem.lanes import Ends
from tests.estimates import bounds, codes, kinds, sigmas, values
from tests.truth.nist_strd import digits, nist_problems
from tests.truth.random_measurements import draw
from tests.truth.simulated import textbook

pytestmark = pytest.mark.slow

TIMES = np.linspace(0.0, 4.0, 30)
DECAY = {"height": (0.5, 5.0), "rate": {"start": (0.1, 10.0), "coordinate": "log", "unit": "1/s"}}


def decay(v, data):
    t, seen = data
    return (v["height"] * jnp.exp(-v["rate"] * t) - seen) / 0.01


def measured(count=None, seed=1):
    rng = np.random.default_rng(seed)
    shape = (30,) if count is None else (count, 30)
    return 2.0 * np.exp(-1.3 * TIMES) + 0.01 * rng.standard_normal(shape)


def test_values_and_errors_are_those_of_scipy():
    seen = measured()
    found = fit_residuals(decay, DECAY, (TIMES, seen), errors="stated")
    theirs = least_squares(
        lambda x: (x[0] * np.exp(-x[1] * TIMES) - seen) / 0.01, [1.0, 1.0],
        xtol=1e-15, ftol=1e-15, gtol=1e-15,
    )  # fmt: skip
    np.testing.assert_allclose(values(found), theirs.x, rtol=1e-6)
    np.testing.assert_allclose(
        found.covariance, np.linalg.inv(theirs.jac.T @ theirs.jac), rtol=1e-4
    )
    assert found.chi2 == pytest.approx(2.0 * theirs.cost, rel=1e-9)
    assert found.names == ("height", "rate") and found.parameters["rate"].unit == "1/s"
    assert found.status == "converged" and found.reached > 30 and codes(found) == []
    scaled = fit_residuals(decay, DECAY, (TIMES, seen))
    factor = np.sqrt(2.0 * theirs.cost / 28)
    np.testing.assert_allclose(sigmas(scaled), factor * sigmas(found), rtol=1e-6)


def test_settings_act_as_in_every_fit():
    seen = measured()
    both = (TIMES, seen)
    held = fit_residuals(decay, DECAY, both, fixed={"rate": 1.3})
    assert held.names == ("height",) and held.parameters["rate"].status == "fixed"
    cut = fit_residuals(decay, DECAY, both, bounds={"rate": (1.4, 3.0)})
    assert bounds(cut) == ("", "low") and "at_bound" in codes(cut)
    tied = fit_residuals(decay, DECAY, both, tie={"height": "1.5 * rate"})
    assert tied.parameters["height"].value == pytest.approx(1.5 * tied.parameters["rate"].value)
    prior = fit_residuals(decay, DECAY, both, priors={"rate": (2.0, 1e-4)}, errors="stated")
    assert prior.parameters["rate"].value == pytest.approx(2.0, abs=1e-3)
    profile = fit_residuals(decay, DECAY, both, intervals="profile")
    assert kinds(profile) == ("profile", "profile")


def test_a_batch_is_as_one_by_one():
    seen = measured(3)
    times = np.broadcast_to(TIMES, seen.shape)
    many = fit_residuals(decay, DECAY, (times, seen), batch=True)
    assert many.shape == (3,) and len(many) == 3
    for i in range(3):
        one = fit_residuals(decay, DECAY, (TIMES, seen[i]))
        np.testing.assert_allclose(values(many[i]), values(one), rtol=1e-12)
        np.testing.assert_allclose(sigmas(many[i]), sigmas(one), rtol=1e-12)


ANGLES = np.linspace(10.0, 85.0, 16)


def reflectance(v, seen):
    """R_s and R_p of eta + i k as printed in textbooks."""
    c = jnp.cos(jnp.radians(ANGLES))
    index = v["eta"] + 1j * v["k"]
    root = jnp.sqrt(index**2 - 1.0 + c * c)
    r_s, r_p = (c - root) / (c + root), (index**2 * c - root) / (index**2 * c + root)
    return (jnp.concatenate([abs(r_s) ** 2, abs(r_p) ** 2]) - seen) / 1e-3


def test_the_best_minimum_of_every_kind_of_material():
    """What one start in raw coordinates misses in 9 of 100, and clips at k = 0 in 8."""
    rng = np.random.default_rng(3)
    index = [(1.5, 0.0), (4.1, 0.05), (0.2, 3.4), (1.1, 7.0), (2.5, 1.0), (1.33, 0.001)]
    index += list(zip(rng.uniform(0.1, 4.0, 6), rng.uniform(0.0, 6.0, 6), strict=True))
    clean = [
        np.concatenate([textbook(ANGLES, np.full(16, q), n, k) for q in ("R_s", "R_p")])
        for n, k in index
    ]
    seen = np.array(clean) + 1e-3 * rng.standard_normal((len(index), 32))
    parameters = {
        "eta": {"start": (0.1, 5.0), "bounds": (1e-3, 50.0)},
        "k": {"start": (1e-3, 10.0), "bounds": (0.0, 100.0), "coordinate": "square"},
    }
    found = fit_residuals(reflectance, parameters, seen, batch=True, errors="stated")
    assert (found.status == "converged").all()
    truth = [
        np.sum(np.asarray(reflectance({"eta": n, "k": max(k, 1e-9)}, s)) ** 2)
        for (n, k), s in zip(index, seen, strict=True)
    ]
    # The truth is one place of the valley: the best minimum is not above it.
    assert (found.chi2 <= np.array(truth) + 1e-6).all()
    z = (found.parameters["eta"].value - np.array(index)[:, 0]) / found.parameters["eta"].sigma
    assert np.abs(z).max() < 4.5


def test_what_means_nothing_is_refused():
    for arguments, words in (
        ({"parameters": {"a": 1.0}}, "a range .low, high. of starting values"),
        ({"parameters": {"a": {"bounds": (0, 1)}}}, "'start': .low, high. was wanted"),
        ({"parameters": {"a": {"start": (0, 1), "coordinate": "cubic"}}}, "coordinate of a"),
        ({"errors": "floor"}, "errors is 'floor'"),
        ({"loss": "cubes"}, "loss is 'cubes'"),
        ({"fixed": {"c": 1.0}}, "no parameter 'c'"),
        (
            {"data": (TIMES, np.ones((2, 30))), "batch": True},
            "the first axes of the arrays in data",
        ),
        ({"data": (1.0, 2.0), "batch": True}, "the first axes of the arrays in data"),
        ({"data": (TIMES + 1j, measured())}, "the data are complex"),  # i was left out
        ({"parameters": {"a": (5.0, 0.0)}}, "a range .low, high. of starting values"),
        ({"parameters": {"a": {"start": (0.0, np.nan)}}}, "a range .low, high. of starting values"),
        ({"starts": 0}, "starts is 0"),
        ({"rtol": 0.0}, "rtol is 0.0; a number of standard errors"),
        ({"seed": "a"}, "seed is 'a'"),
        ({"tie": {name: name for name in DECAY}}, "is tied itself"),
    ):
        call = {"parameters": DECAY, "data": (TIMES, measured()), **arguments}
        with pytest.raises(ValueError, match=words):
            fit_residuals(decay, call.pop("parameters"), call.pop("data"), **call)


def bent(v, data):
    """Residuals of a bent valley (H. H. Rosenbrock, 1960), and one that is the noise."""
    x, y = v["x"], v["y"]
    return jnp.stack([100.0 * (y - x * x), 1.0 - x, data])


def test_lanes_that_rest_along_a_valley_are_one_minimum(monkeypatch):
    """Their last steps, which are taken along it, lead to one place."""
    along = np.array([0.5, 0.7, 1.4])
    resting = Ends(
        np.stack([along, along**2]), (1.0 - along) ** 2 + 0.25, along > 0, np.ones(3, int)
    )  # fmt: skip
    monkeypatch.setattr(own_residuals, "solved", lambda job, start: (resting, 1.0))
    parameters = {"x": (-2.0, 2.0), "y": (-2.0, 4.0)}
    found = fit_residuals(bent, parameters, np.array(0.5), errors="stated", intervals="quadratic")
    np.testing.assert_allclose(values(found), 1.0, atol=1e-5)
    assert found.alternatives == () and found.reached == 3


NIST = nist_problems()
# From the far starts of BoxBOD and MGH17, as of Eckerle4, long steps lead to where the data do not
# change with a parameter; MGH10 goes down a narrow valley; the last step of MGH09 is a large one.
FIRST = ("MGH10", "BoxBOD", "MGH17", "MGH09")


@pytest.mark.parametrize("name", NIST)
def test_the_models_are_those_of_nist(name):
    """The certified values have the certified sum of squares."""
    p = NIST[name]
    r = np.asarray(p.residuals(p.certified, p.data))
    # Lanczos1 has none but those of 11 digits.
    least = max(p.sum_of_squares, 1e-20)
    assert r @ r == pytest.approx(least, rel=1e-9, abs=1e-20 * (name == "Lanczos1"))


@pytest.mark.parametrize(
    "name", [*FIRST, *(pytest.param(n, marks=pytest.mark.study) for n in NIST if n not in FIRST)]
)
def test_certified_values_are_found_from_one_start(name):
    """Six digits of each, and of the standard errors; from both starts of NIST."""
    p = NIST[name]
    for point in p.starts:
        found = fitted(p, point, rtol=RTOL)
        assert found.status == "converged"
        assert digits(values(found), p.certified) > ENOUGH
        if name == "Lanczos1":  # whose residuals are rounding
            continue
        assert digits(sigmas(found), p.errors) > ENOUGH
        assert found.cost == pytest.approx(p.sum_of_squares, rel=1e-9)
        usual = fitted(p, point)
        assert usual.status == "converged"
        assert (np.abs(values(usual) - p.certified) < 0.1 * p.errors).all()


def test_a_parameter_that_ran_off_is_undetermined():
    """A rate of 69 at once reaches the saturation; least squares find the minimum from there."""
    p = NIST["BoxBOD"]
    found = fitted(p, p.starts[0], loss="huber")
    assert found.status == "undetermined" and "not_seen" in codes(found)
    assert np.isfinite(sigmas(found)[0]) and np.isnan(sigmas(found)[1])


def up_to_one(v, data):
    """Residuals without a value above 1."""
    return jnp.where(v["a"] > 1.0, jnp.nan, v["a"]) - data


def test_where_every_step_fails_is_no_minimum():
    found = fit_residuals(up_to_one, {"a": (0.5, 1.0)}, np.array([2.9, 3.0, 3.1]))
    assert found.status == "not converged" and "not_converged" in codes(found)


@pytest.mark.parametrize(("geometry", "curve"), [(7, 1), (15, 18)])
def test_a_mirror_whose_derivatives_overflow_is_undetermined(geometry, curve):
    """R of nearly 1 fits better and better up to an index of 1e100 (the fit ended in an error)."""
    batch, _ = draw(20261130, geometry, 4)
    assert fit_by_itself(batch, curve, "residuals").status == "undetermined"
