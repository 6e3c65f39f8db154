"""Batches of films, plates and models: each curve as `fit` has it, wherever it stands."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fitting import Measurement, fit, fit_many, simulate
from fitting.problem.lanes import Ends
from fitting.searching import batch_search

WAVES = np.linspace(0.42, 0.8, 30)
FILM = "air | cauchy:2 60..260 nm | 3.9"
# At normal incidence a film of the index 3.9 / 1.45 on index 3.9 is as good.
LOW = {"A": (1.3, 1.8)}


def films(thickness, A, sigma=0.002, seed=0):
    """R of films on index 3.9 at normal incidence, thickness.shape + (30,), with noise."""
    each = [
        simulate(
            FILM.replace("60..260", "100"), {"thickness_nm": d, "A": a, "B": 0.004}, 0.0, WAVES, "R"
        )
        for d, a in zip(np.ravel(thickness), np.ravel(A), strict=True)
    ]
    exact = np.reshape(each, (*np.shape(thickness), len(WAVES)))
    return exact + sigma * np.random.default_rng(seed).standard_normal(exact.shape)


def assert_same(one, other, close=1e-2):
    """The same fit, to a part of its errors: a hundredth."""
    assert one.status == other.status and one.names == other.names
    assert one.dof == other.dof and one.n_data == other.n_data
    np.testing.assert_allclose(one.cost, other.cost, rtol=1e-6)
    for name in one.names:
        a, b = one.parameters[name], other.parameters[name]
        sigma = a.sigma if np.isfinite(a.sigma) else max(abs(a.value), 1e-3)
        assert abs(a.value - b.value) < close * sigma, name
        np.testing.assert_allclose(a.sigma, b.sigma, rtol=close)
        np.testing.assert_allclose(a.interval, b.interval, atol=2.0 * close * sigma)
        assert a.status == b.status
        np.testing.assert_allclose(a.upper_limit, b.upper_limit, rtol=2.0 * close)


@pytest.fixture(scope="module")
def wafer():
    """A map (3, 4) of films, what is true of it, and its fit."""
    thickness = 100.0 + np.arange(12.0).reshape(3, 4)
    A = np.linspace(1.44, 1.48, 12).reshape(3, 4)
    R = films(thickness, A)
    return R, thickness, fit_many(0.0, WAVES, R=R, sigma=0.002, sample=FILM, bounds=LOW, check=2)


def test_each_film_is_that_of_fit(wafer):
    R, thickness, found = wafer
    assert found.shape == (3, 4) and (found.status == "converged").all()
    e = found.parameters["thickness_nm"]
    assert (np.abs(e.value - thickness) < 5.0 * e.sigma).all()
    for i in ((0, 0), (2, 1)):
        m = Measurement.from_columns(0.0, WAVES, R=R[i], sigma=0.002)
        one = fit(m, FILM, bounds=LOW, errors="scaled", intervals="quadratic")
        assert_same(one, found[i])


def test_one_film_is_a_batch_of_one(wafer):
    R, _, found = wafer
    one = fit_many(0.0, WAVES, R=R[1, 2], sigma=0.002, sample=FILM, bounds=LOW, check=0)
    assert one.shape == ()
    assert_same(one, found[1, 2])
    with pytest.raises(ValueError, match="no curve has a datum"):
        fit_many(0.0, WAVES, R=np.full((2, 30), np.nan), sample=FILM)


def test_values_errors_and_curves_have_the_shape_of_the_batch(wafer):
    R, _, found = wafer
    assert found.covariance.shape == (3, 4, 3, 3)
    assert found.wavelength_um.shape == (3, 4, 30)
    at = found.index([0.5, 0.6], "film")
    assert at.eta.shape == (3, 4, 2)
    curve = found.predict(0.0, "R", 0.5)
    assert curve.value.shape == (3, 4, 1)
    here = np.argmin(np.abs(WAVES - 0.5))
    assert np.abs(curve.value[..., 0] - R[..., here]).max() < 0.05
    one = found[1, 2]
    assert one.predict(0.0, "R", 0.5).value == curve.value[1, 2]
    assert "thickness_nm" in str(one) and str(found)
    assert len(found.to_dataframe()) == 12


@pytest.mark.study
def test_what_is_fixed_or_tied_is_as_in_fit(wafer):
    """Two films of one material, of which the second has 1.1 times the first one's A."""
    R = wafer[0]
    sample = "air | cauchy:2 60..260 nm | cauchy:1 20 nm held | 3.9"
    options = {
        "sample": sample, "fixed": {"film_1.B": 0.004}, "tie": {"film_2.A": "1.1 * film_1.A"},
        "bounds": {"film_1.A": (1.3, 1.8)}, "errors": "scaled", "intervals": "quadratic",
    }  # fmt: skip
    many = fit_many(0.0, WAVES, R=R[0], sigma=0.002, check=1, **options)
    one = fit(Measurement.from_columns(0.0, WAVES, R=R[0, 1], sigma=0.002), **options)
    assert_same(one, many[1])
    for name, status in (("film_1.B", "fixed"), ("film_2.A", "tied")):
        a, b = one.parameters[name], many[1].parameters[name]
        assert a.status == b.status == status
        np.testing.assert_allclose([b.value, b.sigma], [a.value, a.sigma], rtol=1e-2)


def test_all_begin_from_a_fit_that_is_near(wafer):
    R, _, found = wafer
    options = {"R": R, "sigma": 0.002, "sample": FILM, "bounds": LOW}
    again = fit_many(0.0, WAVES, **options, near=found[0, 0], check=0)
    for name in found.names:
        a, b = found.parameters[name], again.parameters[name]
        assert (np.abs(a.value - b.value) < 0.01 * a.sigma).all()


def test_a_wrong_fringe_order_of_near_is_found_out():
    """From films that are two fringes too thin, in which all curves rest by themselves."""
    thickness = 1000.0 + np.arange(6.0)
    R = films(thickness, np.full(6, 1.46))
    options = {
        "R": R,
        "sigma": 0.002,
        "sample": FILM.replace("60..260", "600..1400"),
        "bounds": LOW,
    }
    wrong = {"thickness_nm": 690.0, "A": 1.46, "B": 0.004}
    there = fit_many(0.0, WAVES, **options, start=wrong, check=0)
    assert (np.abs(there.parameters["thickness_nm"].value - thickness) > 50.0).all()
    found = fit_many(0.0, WAVES, **options, start=wrong, check=2)
    np.testing.assert_allclose(found.parameters["thickness_nm"].value, thickness, atol=5.0)
    several = {**wrong, "thickness_nm": np.stack([np.full(6, 690.0), thickness + 5.0])}
    both = fit_many(0.0, WAVES, **options, start=several, check=0)
    np.testing.assert_allclose(both.parameters["thickness_nm"].value, thickness, atol=5.0)
    with pytest.raises(ValueError, match="several of these on an axis in front"):
        fit_many(0.0, WAVES, **options, start={n: np.ones((5, 7)) for n in wrong})
    with pytest.raises(ValueError, match="2 starts of thickness_nm, 3 starts of A"):
        fit_many(0.0, WAVES, **options, start={**several, "A": np.full((3, 6), 1.46)})


@pytest.mark.study
def test_a_thickness_that_grows_over_many_fringes_is_followed_along_the_map():
    thickness = np.linspace(400.0, 1300.0, 40)
    R = films(thickness, np.full(40, 1.46))
    sample = FILM.replace("60..260", "300..1400")
    found = fit_many(0.0, WAVES, R=R, sigma=0.002, sample=sample, bounds=LOW, check=1)
    np.testing.assert_allclose(found.parameters["thickness_nm"].value, thickness, atol=8.0)


def test_what_all_curves_share_is_told_though_chance_hides_it_in_each():
    """A gain of .3 %, by which chi2/dof is 1.14 in the median."""
    angle, random = np.linspace(20.0, 80.0, 16), np.random.default_rng(2)
    each = [
        {"eta": eta, "k": k}
        for eta, k in zip(random.uniform(1.5, 2.5, 64), random.uniform(0.1, 0.5, 64), strict=True)
    ]
    exact = {q: np.array([simulate("constant", v, angle, 0.6, q) for v in each])
             for q in ("R_s", "R_p")}  # fmt: skip
    noise = {q: 1e-3 * random.standard_normal((64, 16)) for q in exact}
    for gain, curves, told in ((1.0, 64, False), (1.003, 64, True), (1.003, 16, False)):
        data = {q: (gain * exact[q] + noise[q])[:curves] for q in exact}
        found = fit_many(angle, **data, sigma=1e-3, sample="constant")
        alike = [f for f in found.findings if f.code == "alike"]
        assert bool(alike) == told and ((found.status == "misfit") == told).all()
        assert np.median(found.chi2_reduced) < 1.3


def test_psi_and_delta_with_gaps_and_errors_of_their_own():
    angle, random = np.linspace(50.0, 77.0, 10), np.random.default_rng(3)
    errors, exact = {"psi": 0.05, "delta": 0.1}, [(2.0, 0.3), (1.5, 0.1), (0.3, 3.0)]
    data = {
        q: np.array([simulate("constant", dict(eta=eta, k=k), angle, 0.6, q) for eta, k in exact])
        + sigma * random.standard_normal((3, 10))
        for q, sigma in errors.items()
    }
    data["delta"][1, 4] = np.nan
    options = {"sample": "constant", "check": 1}
    found = fit_many(angle, 0.6, **data, sigma=errors, **options)
    one = {q: values[1] for q, values in data.items()}
    m = Measurement.from_columns(angle, 0.6, **one, sigma=errors)
    assert_same(fit(m, "constant", errors="scaled", intervals="quadratic"), found[1])
    assert found.n_data.tolist() == [20, 19, 20]
    m = Measurement.from_columns(angle, 0.6, **one)
    assert_same(
        fit(m, "constant", intervals="quadratic"), fit_many(angle, 0.6, **data, **options)[1]
    )


def with_outliers(kind, random):
    """Angles, wavelengths, data of three curves with an outlier in each, and what fits them."""
    angle, wave, errors = np.linspace(50.0, 77.0, 12), 0.6, {"psi": 0.05, "delta": 0.1}
    truths = [{"eta": n, "k": k} for n, k in random.uniform([1.4, 0.1], [3.0, 2.0], (3, 2))]
    options = {"sample": "constant", "priors": {"k": (1.0, 0.5)}}
    if kind == "surface":
        errors, options["sample"] = {"R_s": 1e-3, "R_p": 1e-3}, "free"
    elif kind == "film":
        angle, wave, errors = 0.0, WAVES, {"R": 2e-3}
        truths = [{"thickness_nm": d, "A": 1.46, "B": 0.004}
                  for d in random.uniform(80.0, 160.0, 3)]  # fmt: skip
        options = {"sample": FILM, "bounds": LOW, "priors": {"A": (1.46, 0.01)}}
    sample = str(options["sample"]).replace("60..260", "100")
    data = {q: np.array([simulate(sample, truth, angle, wave, q) for truth in truths])
            for q in errors}  # fmt: skip
    for q, exact in data.items():
        exact += errors[q] * random.standard_normal(exact.shape)
        exact[:, exact.shape[1] // 3] += 40.0 * errors[q]
    return angle, wave, data, {**options, "sigma": errors}


@pytest.mark.parametrize(
    ("kind", "loss"),
    [("surface", "huber"), ("surface", "squares"), ("film", "huber"), ("psi and delta", "huber")],
)
def test_a_robust_loss_and_priors_are_those_of_fit(kind, loss):
    """The noise of each curve is found by itself, and the prior counts as one more datum."""
    angle, wave, data, options = with_outliers(kind, np.random.default_rng(7))
    sigma = options.pop("sigma")
    for stated in (sigma, None):
        many = fit_many(angle, wave, **data, sigma=stated, **options, loss=loss, check=1)
        for i in range(3):
            one = {q: values[i] for q, values in data.items()}
            m = Measurement.from_columns(angle, wave, **one, sigma=stated)
            errors = "scaled" if stated else "equal"
            single = fit(m, **options, loss=loss, errors=errors, intervals="quadratic")
            assert_same(single, many[i], 1e-4)
            np.testing.assert_allclose(single.noise, many[i].noise, rtol=1e-4)
            np.testing.assert_allclose(single.chi2, many[i].chi2, rtol=1e-4)
            assert single.loss == many.loss == loss


def test_outliers_move_a_film_less_by_a_robust_loss():
    angle, wave, data, options = with_outliers("film", np.random.default_rng(7))
    del options["priors"]
    plain = fit_many(angle, wave, **data, **options, check=1)
    robust = fit_many(angle, wave, **data, **options, check=1, loss="huber", starts=32)
    off = [np.abs(f.parameters["A"].value - 1.46) for f in (robust, plain)]
    assert (off[0] < 0.5 * off[1]).all()
    assert (off[0] < 4.0 * robust.parameters["A"].sigma).all()


def test_random_starts_of_surfaces_end_where_those_of_the_mesh_do():
    angle, wave, data, options = with_outliers("surface", np.random.default_rng(7))
    mesh, random = (
        fit_many(angle, wave, **data, sigma=options["sigma"], starts=n) for n in (None, 16)
    )
    np.testing.assert_allclose(random.eta, mesh.eta, rtol=1e-6)


def test_a_prior_that_a_curve_contradicts_is_told_of_it():
    angle, wave, data, options = with_outliers("surface", np.random.default_rng(7))
    free = fit_many(angle, wave, **data, sigma=options["sigma"])
    options["priors"] = {"k": (float(free.k[1]), 0.02)}
    found = fit_many(angle, wave, **data, **options, errors="stated")
    told = [{w.code for w in each} for each in found.warnings]
    assert ["prior_contradicted" in codes for codes in told] == [True, False, True]


@pytest.mark.study
def test_psi_and_delta_of_films():
    angle, wave = (a.ravel() for a in np.meshgrid([60.0, 70.0], WAVES[::3], indexing="ij"))
    random, errors = np.random.default_rng(3), {"psi": 0.05, "delta": 0.1}
    truths = [{"thickness_nm": d, "A": 1.46, "B": 0.004} for d in (80.0, 90.0, 110.0)]
    data = {
        q: np.array([simulate(FILM, truth, angle, wave, q) for truth in truths])
        + sigma * random.standard_normal((3, len(angle)))
        for q, sigma in errors.items()
    }
    data["delta"][1, 4] = np.nan
    found = fit_many(angle, wave, **data, sigma=errors, sample=FILM, check=1)
    one = {q: values[1] for q, values in data.items()}
    m = Measurement.from_columns(angle, wave, **one, sigma=errors)
    assert_same(fit(m, FILM, errors="scaled", intervals="quadratic"), found[1])
    assert found.n_data.tolist() == [40, 39, 40]


@pytest.mark.study
def test_a_plate_whose_k_is_beside_0():
    wave = np.linspace(0.5, 0.9, 16)
    plate = "air | constant 1 mm thick held | air"
    exact = simulate("air | cauchy:1 1 mm thick | air", {"A": 1.5}, 0.0, wave, "T")
    T = exact + 1e-3 * np.random.default_rng(1).standard_normal((4, 16))
    found = fit_many(0.0, wave, T=T, sigma=1e-3, sample=plate, check=1)
    for i in range(4):
        m = Measurement.from_columns(0.0, wave, T=T[i], sigma=1e-3)
        one = fit(m, plate, errors="scaled", intervals="quadratic")
        assert_same(one, found[i])


def test_what_the_data_do_not_see_is_told_of_each_curve():
    """A film that is as its substrate: the thickness has no effect. Beside it one that is seen."""
    sample = "air | cauchy:2 5..60 nm | 1.46"
    R = np.stack([
        simulate(sample, {"A": eta, "B": 0.0, "thickness_nm": 50.0}, 0.0, WAVES, "R")
        for eta in (1.46, 2.2)
    ])  # fmt: skip
    options = {"sample": sample, "sigma": 1e-4, "fixed": {"A": 1.46, "B": 0.0}}
    found = fit_many(0.0, WAVES, R=R[:1].repeat(2, 0), **options, check=0)
    assert (found.status == "undetermined").all()
    assert "thickness_nm is not determined" in found.warnings[1][0].text
    one = fit(
        Measurement.from_columns(0.0, WAVES, R=R[0], sigma=1e-4), sample, fixed=options["fixed"]
    )
    assert one.status == "undetermined" and one.warnings[0].code == "not_seen"
    free = fit_many(0.0, WAVES, R=R[1:], sample=sample, sigma=1e-4, fixed={"B": 0.0}, check=0)
    assert free.status.tolist() == ["converged"]


def test_one_wavelength_of_a_free_index_is_a_batch_too():
    exact = [simulate("free", {"eta": n, "k": 0.2}, [60.0, 70.0], 0.6, q)
             for n in (1.8, 2.0) for q in ("psi", "delta")]  # fmt: skip
    psi, delta = np.array(exact[::2]), np.array(exact[1::2])
    found = fit_many([60.0, 70.0], 0.6, psi=psi, delta=delta, sigma=0.01, check=1)
    np.testing.assert_allclose(found.eta, [1.8, 2.0], atol=1e-6)
    np.testing.assert_allclose(found.k, 0.2, atol=1e-6)


@pytest.mark.parametrize("sample", ["free", FILM])
def test_a_bad_pixel_is_refused_by_itself(sample):
    """Saturated, dead, and one of which nothing is known."""
    if sample == "free":
        angle, wave = np.linspace(20.0, 80.0, 12), None
        good = np.tile(simulate("free", {"eta": 1.5, "k": 0.1}, angle, None, "R_s"), (5, 1))
        name = "R_s"
    else:
        angle, wave, name = 0.0, WAVES, "R"
        good = films(np.full(5, 100.0), np.full(5, 1.46))
    bad = good.copy()
    bad[1, 3], bad[2], bad[3] = 65535.0, 0.0, np.nan
    options = {"sigma": 1e-3, "sample": sample}
    found = fit_many(angle, wave, **{name: bad}, **options)
    assert found.status.tolist() == ["converged", "refused", "refused", "no data", "converged"]
    assert found.warnings[1][0].code == found.warnings[2][0].code == "refused"
    assert "outside of" in found.warnings[1][0].text and "are 0" in found.warnings[2][0].text
    assert np.isnan(found.parameters[found.names[0]].value[1:4]).all()
    alone = fit_many(angle, wave, **{name: good}, **options)
    for name in found.names:
        a, b = alone.parameters[name], found.parameters[name]
        assert (np.abs(a.value - b.value)[[0, 4]] <= 0.01 * a.sigma[[0, 4]]).all()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"sample": "air | auto 100 nm | Si"}, "use choose"),
        ({"sample": "air | free 50..200 nm | Si"}, "one wavelength a call"),
        ({"start": {"A": 1.5}}, "no value of B, thickness_nm"),
        ({"R": np.full((4, 7), 0.3)}, "do not go together"),
        ({"check": -1}, "check is -1"),
        ({"loss": "cubes"}, "loss is 'cubes'"),
        ({"starts": 0}, "starts is 0"),
        ({"priors": {"A": (1.5, 0.0)}}, "above 0"),
        ({"priors": {"eta": (1.5, 0.1)}}, "eta"),
        ({"T": np.full((4, 30), 0.3), "R": None, "sample": "cauchy"}, "bare surface"),
        ({"sigma": {"T": 0.1}}, "no data"),
        ({"R": np.full((4, 30), 30.0)}, "percent"),
    ],
)
def test_what_a_batch_does_not_take(change, said):
    options = {"R": np.full((4, 30), 0.3), "sigma": 0.002, "sample": FILM, **change}
    with pytest.raises(ValueError, match=said):
        fit_many(0.0, WAVES, **options)


def test_a_lane_that_is_under_way_is_shown_only_if_it_is_by_far_the_lowest(monkeypatch):
    """Of two curves with a minimum at a cost of 9, one is still falling at 5, the other at 7."""
    ends = Ends(
        np.array([[1.0, 2.0, 1.0, 2.0]]), np.array([9.0, 5.0, 9.0, 7.0]),
        np.array([True, False, True, False]), np.ones(4, int),
    )  # fmt: skip
    monkeypatch.setattr(batch_search, "run_lanes", lambda *given: ends)
    u = SimpleNamespace(size=1, free=np.ones(1, bool), spec=None)
    job: Any = SimpleNamespace(u=u, priors=0, limits=None, sharper=1.0)
    curves: Any = SimpleNamespace(n_data=np.array([9, 9]), count=2, squares=np.ones(2), width=2)
    search = batch_search.BatchSearch(job, curves)
    search.run(ends.y, np.array([0, 0, 1, 1]))
    assert search.best.cost.tolist() == [5.0, 9.0]
    assert search.best.done.tolist() == [False, True]
