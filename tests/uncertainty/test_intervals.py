"""95 % intervals of eta and k: against nested minimisation, closed forms, repeated simulation."""

import functools

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import brentq, minimize_scalar

from fitting import fit, fit_many
from fitting.bare_surface.coordinates import coordinates_of
from fitting.bare_surface.curve_data import Data
from fitting.bare_surface.region import profile
from fitting.bare_surface.valley import Lanes, evaluate
from fitting.measured_file import read_csv
from fitting.results.result_parts import Estimate
from fitting.uncertainty.limits import student_quantile
from fitting.uncertainty.widening import wider
from tests.estimates import intervals
from tests.truth.bounded import WIDE, roots
from tests.truth.simulated import GOLD, simulated, textbook

ANGLES = np.linspace(10.0, 85.0, 16)
Q95 = stats.chi2.ppf(0.95, 1)


def curves(eta, k, quantities, angles=ANGLES, noise=0.0, seed=1, count=None):
    rng = np.random.default_rng(seed)
    shape = (len(angles),) if count is None else (count, len(angles))
    return {
        q: textbook(angles, np.full(len(angles), q), eta, k) + noise * rng.standard_normal(shape)
        for q in quantities
    }


def nested(data, angles, sigma, eta, k):
    """The four ends by root finding on a minimisation over the other unknown, textbook formulas;
    and whether they lie beside k = 0, where other rises than 3.84 are due (`bounded`)."""

    def chi2(n, kk):
        residuals = [
            (textbook(angles, np.full(len(angles), q), n, kk) - v) / sigma for q, v in data.items()
        ]
        return float(np.sum(np.square(residuals)))

    def least(of, *ranges):
        inner = {"bounds": None, "method": "bounded", "options": {"xatol": 1e-9}}
        return min(minimize_scalar(of, **{**inner, "bounds": r}).fun for r in ranges)

    best = chi2(eta, k)

    def above_eta(n, goal=best + Q95):
        k_most = max(2.0 * k, 0.1)
        found = least(lambda kk: chi2(n, kk), (0.0, k_most), (0.0, max(10.0 * k, 3.0)))
        return min(found, chi2(n, 0.0)) - goal

    def above_k(kk, goal=best + Q95):
        return least(lambda n: chi2(n, kk), (0.7 * eta, 1.4 * eta), (0.02 * eta, 5.0 * eta)) - goal

    def end(above, value, step, limit, root=WIDE):
        above = functools.partial(above, goal=best + root**2)
        while True:
            further = value + step
            if step < 0.0 and further <= limit:
                return limit if above(limit) < 0.0 else brentq(above, limit, value)
            if above(further) > 0.0:
                return brentq(above, min(value, further), max(value, further), xtol=1e-10)
            value, step = further, 1.7 * step

    def best_eta(kk):
        found = minimize_scalar(lambda n: chi2(n, kk), bounds=(0.7 * eta, 1.4 * eta),
                                method="bounded", options={"xatol": 1e-9})  # fmt: skip
        return found.x, found.fun - best

    top = end(above_k, k, 1e-3, np.inf)
    near = above_k(0.0, best) < (2.0 * WIDE) ** 2
    of_eta = of_k = (WIDE, WIDE)
    if near:
        u = np.union1d(np.linspace(0.0, 1.3 * top**2, 60), [k**2])
        along, rise = np.array([best_eta(np.sqrt(x)) for x in u]).T
        step = 1e-4 * eta
        bend = (chi2(eta + step, k) - 2.0 * best + chi2(eta - step, k)) / step**2
        of_eta, of_k = roots(u, rise, along, np.sqrt(2.0 / bend))
    return [
        [end(above_eta, eta, -1e-3 * eta, 1e-6, of_eta[0]),
         end(above_eta, eta, 1e-3 * eta, np.inf, of_eta[1])],
        [end(above_k, k, -1e-3, 0.0, of_k[0]), end(above_k, k, 1e-3, np.inf, of_k[1])],
    ], near  # fmt: skip


@pytest.mark.parametrize(
    ("eta", "k", "quantities", "noise", "angles"),
    [
        (1.5, 0.0, ("R_s", "R_p"), 1e-3, ANGLES),
        (4.15, 0.05, ("R_s", "R_p"), 1e-3, ANGLES),
        (0.36, 2.6, ("R_s", "R_p"), 2e-3, ANGLES),
        (0.36, 2.6, ("R_s",), 2e-3, ANGLES),  # a bent valley: 0.25 to 0.82 about 0.38
        (1.1, 7.0, ("R_s", "R_p"), 1e-3, ANGLES),
        (1.8, 0.4, ("R_s", "R_p"), 1e-3, np.array([65.0, 70.0, 75.0])),
        (2.5, 1.0, ("R",), 1e-3, np.linspace(10.0, 45.0, 8)),
        (3.0, 0.5, ("R_s",), 2e-3, ANGLES),  # k = 0 is the best, and cuts the region
    ],
)
def test_profile_intervals_are_those_of_nested_minimisation(eta, k, quantities, noise, angles):
    data = curves(eta, k, quantities, angles, noise)
    found = fit_many(angles, **data, sigma=noise, errors="stated", intervals="profile")
    assert found.parameters["eta"].interval_kind == "profile"
    wanted, near = nested(data, angles, noise, found.eta, found.k)
    for ours, theirs in zip(
        (found.parameters["eta"].interval, found.parameters["k"].interval), wanted, strict=True
    ):
        # Parabolas between 8 lines: a thousandth of the width; and beside k = 0 the rise that is
        # due, from a parabola through the profile there, to 2 %.
        part = 1e-2 if near else 1e-3
        np.testing.assert_allclose(ours, theirs, atol=part * (theirs[1] - theirs[0]))


@pytest.mark.parametrize("R", [0.04, 0.3, 0.97])
def test_one_reflectance_at_normal_incidence_leaves_a_whole_circle(R):
    """(eta - a)^2 + k^2 = a^2 - 1, a = (1 + R) / (1 - R), with R known to 1.96 sigma."""
    sigma = 1e-3
    found = fit_many([0.0], R=[R], sigma=sigma, errors="stated", intervals="auto")
    top = R + np.sqrt(Q95) * sigma
    a = (1.0 + top) / (1.0 - top)
    b = np.sqrt(a * a - 1.0)
    assert found.status == "undetermined"
    assert found.parameters["eta"].interval_kind == "profile"
    # a low end that is 2e4 times less than the width is known to a part of that
    np.testing.assert_allclose(
        found.parameters["eta"].interval, [a - b, a + b], rtol=2e-3, atol=2e-5 * b
    )
    np.testing.assert_allclose(found.parameters["k"].interval, [0.0, b], rtol=2e-3, atol=0.0)
    assert found.warnings[0].code == "circle"


def test_program_chooses_the_profile_where_the_quadratic_one_is_wrong():
    glass = simulated(1.5, 0.0, 1e-3)
    assert fit(glass).parameters["eta"].interval_kind == "profile"
    assert fit(glass, intervals="quadratic").parameters["eta"].interval_kind == "quadratic"
    for way in ("auto", "quadratic"):  # one limit of k, not another beside the interval
        found = fit(glass, intervals=way)
        assert found.parameters["k"].upper_limit == found.parameters["k"].interval[1]
    germanium = simulated(5.5, 1.6, 1e-4)
    assert fit(germanium).parameters["eta"].interval_kind == "quadratic"
    asked = fit(germanium, intervals="profile")
    assert asked.parameters["eta"].interval_kind == "profile"
    plain = fit(germanium)
    for ends, wanted in zip(intervals(plain), intervals(asked), strict=True):
        np.testing.assert_allclose(ends, wanted, atol=0.05 * (wanted[1] - wanted[0]))
    assert (
        fit(read_csv(GOLD)).parameters["eta"].interval_kind == "profile"
    )  # sigma_eta is 6 % of eta


def test_a_quadratic_interval_is_the_standard_error_times_students_t():
    data = curves(5.5, 1.6, ("R_s", "R_p"), noise=1e-4)
    scaled = fit_many(ANGLES, **data)
    t = stats.t.ppf(0.975, 30)
    low, high = scaled.parameters["eta"].interval
    assert low == pytest.approx(scaled.eta - t * scaled.parameters["eta"].sigma, rel=1e-12)
    assert high == pytest.approx(scaled.eta + t * scaled.parameters["eta"].sigma, rel=1e-12)
    low, high = scaled.parameters["k"].interval
    assert (high**2 - low**2) / 2.0 == pytest.approx(
        2.0 * scaled.k * t * scaled.parameters["k"].sigma, rel=1e-9
    )
    absolute = fit_many(ANGLES, **data, sigma=1e-4, errors="stated")
    half = 0.5 * np.diff(absolute.parameters["eta"].interval)[0]
    assert half == pytest.approx(np.sqrt(Q95) * absolute.parameters["eta"].sigma, rel=1e-9)


@pytest.mark.parametrize("dof", [1, 2, 3, 4, 7, 30, 57, 118, 999, 1000, 1001, 5000])
def test_students_quantile(dof):
    assert student_quantile(dof) == pytest.approx(stats.t.ppf(0.975, dof), rel=3e-9)


def test_without_degrees_of_freedom_the_normal_law_holds():
    assert student_quantile(0) == pytest.approx(stats.norm.ppf(0.975), rel=1e-12)


@pytest.mark.study
@pytest.mark.parametrize(
    ("eta", "k", "quantities", "low", "high"),
    [
        # 4 binomial errors of 4000 about .95; at k = 0, with a rise of 3.84, .975 of k.
        (2.5, 1.0, ("R_s", "R_p"), (0.936, 0.936), (0.964, 0.964)),
        pytest.param(0.5, 3.0, ("R_s",), (0.936, 0.936), (0.964, 0.964), marks=pytest.mark.study),
        (1.5, 0.0, ("R_s", "R_p"), (0.936, 0.936), (0.964, 0.964)),
    ],
)
def test_profile_intervals_hold_the_truth_as_often_as_they_should(eta, k, quantities, low, high):
    data = curves(eta, k, quantities, noise=1e-3, count=4000)
    found = fit_many(ANGLES, **data, sigma=1e-3, errors="stated", intervals="profile")
    assert (found.parameters["eta"].interval_kind == "profile").all()
    for i, (ends, truth) in enumerate(
        ((found.parameters["eta"].interval, eta), (found.parameters["k"].interval, k))
    ):
        held = ((ends[:, 0] <= truth) & (truth <= ends[:, 1])).mean()
        assert low[i] < held < high[i]


@pytest.mark.study
def test_k_is_exactly_0_at_the_end_of_an_interval_wherever_the_fit_came_from():
    """R_s alone of glasses: a fit in the chart of n < 1 sees the end with n > 1 from afar."""
    rng = np.random.default_rng(3)
    angles, eta = np.linspace(1.0, 89.0, 60), rng.uniform(1.3, 3.5, (3000, 1))
    R_s = textbook(angles, np.full(60, "R_s"), eta, 0.0)
    R_s = R_s + 1e-3 * rng.standard_normal(R_s.shape)
    found = fit_many(angles, R_s=R_s, sigma=1e-3, errors="stated", intervals="profile")
    low, high = found.parameters["eta"].interval.T
    # .95 (4 binomial errors of 3000: .016); .90 and less without the nearer chart.
    assert ((low <= eta[:, 0]) & (eta[:, 0] <= high)).mean() > 0.922
    assert (found.parameters["k"].interval[:, 0] == 0.0).mean() > 0.934


@pytest.mark.study
def test_noise_decides_at_which_end_of_the_valley_a_fit_near_the_normal_lies_and_that_is_said():
    """R at 6 to 10 degrees: eta below 1 fits half of the time, and looked well determined."""
    angles = np.array([6.0, 8.0, 10.0])
    data = curves(3.5, 0.5, ("R",), angles, 1e-3, count=400)
    found = fit_many(angles, **data, sigma=1e-3, intervals="auto")
    undetermined = found.status == "undetermined"
    assert undetermined.mean() > 0.95
    # Whichever end the best fit lies at, its range holds it, and the truth at the other end.
    known = undetermined & np.isfinite(found.parameters["eta"].interval).all(-1)
    assert known.mean() > 0.8  # of the others the valley could not be followed
    low, high = found.parameters["eta"].interval[known].T
    eta = found.eta[known]
    assert ((low <= eta) & (eta <= high)).all()
    assert ((low <= 3.5) & (high >= 3.5)).mean() > 0.9


def test_an_interval_ends_where_total_reflection_begins():
    """R_p = R_s^2 at 45 degrees: the valley runs from k = 0 to n = sin 45, where it breaks off."""
    data = curves(2.0, 0.0, ("R_s", "R_p"), np.array([45.0]))
    found = fit_many([45.0], **data, sigma=1e-3, errors="stated", intervals="auto")
    assert found.status == "undetermined"
    assert found.parameters["eta"].interval_kind == "profile"
    # With k = 0 both reflectances give n of 2 to the error that two of them leave; the other end is
    # an index below 1 that reflects as much.
    assert found.parameters["eta"].interval[0] < 0.8
    assert found.parameters["eta"].interval[1] == pytest.approx(2.0, abs=0.02)
    assert found.parameters["k"].interval[0] == 0.0
    assert 0.6 < found.parameters["k"].interval[1] < 0.8


def test_no_interval_where_there_is_nothing_to_go_by():
    for found in (
        fit_many([0.0], R=[0.3], intervals="auto"),  # no error, no scatter
        fit_many([0.0], R=[1.0], sigma=1e-3, intervals="auto"),  # a perfect mirror
        fit_many([0.0], R=[np.nan], intervals="auto"),
    ):
        assert found.parameters["eta"].interval_kind == "none"
        assert np.isnan(intervals(found)).all()
    with pytest.raises(ValueError, match=r"intervals is 'bayes'; one of auto, quadratic"):
        fit_many([0.0], R=[0.3], intervals="bayes")


def test_exact_data_have_intervals_as_narrow_as_rounding():
    found = fit_many(ANGLES, **curves(0.5, 2.2, ("R_s", "R_p")), intervals="profile")
    np.testing.assert_allclose(found.parameters["eta"].interval, 0.5, rtol=1e-12)
    np.testing.assert_allclose(found.parameters["k"].interval, 2.2, rtol=1e-12)


@pytest.mark.study
@pytest.mark.parametrize(
    "n", [1.3, *(pytest.param(n, marks=pytest.mark.study) for n in (2.0, 3.6))]
)
def test_an_interval_is_the_same_from_wherever_in_the_valley(n):
    """At 45 degrees every index of a curve from n to below 1 fits; which is best is rounding.

    With the minimum at .723 + .2 i the interval of eta had ended at 1.007, where the floor of the
    valley, followed from there, had been taken for the end of the chart.
    """
    channels, angle = ("R_s", "R_p"), np.array([45.0])
    data = Data(
        np.cos(np.radians(angle)), np.array([0.5]), tuple(curves(n, 0.0, channels, angle).values()),
        (np.array([1e3]),) * 2, 1.0, channels,
    )  # fmt: skip
    data = data._replace(values=tuple(v[None] for v in data.values))

    def above(k, eta):
        """By how much an index reflects more of s than n does."""
        return (textbook(angle, np.array(["R_s"]), eta, k) - data.values[0][0])[0]

    ends = []
    for eta in np.linspace(0.72, 0.98 * n, 12):
        if above(0.0, eta) > 0.0:
            continue
        k = brentq(above, 0.0, 5.0, args=(eta,))
        place = Lanes(np.array([0]), *coordinates_of(np.array([eta]), np.array([k])))
        region = profile(data, evaluate(data, place), np.array([3.84]), np.array([np.nan]))
        ends.append([region.eta[0, 1], region.k[0, 1]])
    np.testing.assert_allclose(np.array(ends)[:, 0], n, atol=0.02)
    np.testing.assert_allclose(np.array(ends)[:, 1], np.mean(ends, axis=0)[1], rtol=0.02)


def test_only_the_range_of_a_parameter_ends_its_widened_interval():
    """One that may be negative, as B of Cauchy's formula, had ended at 0 if it had been above."""
    e = Estimate(
        name="B", value=3.0, sigma=1.0, interval=np.array([1.0, 5.0]), interval_kind="quadratic"
    )
    assert wider(e, 2.0, (-np.inf, np.inf)).interval.tolist() == [-1.0, 7.0]
    assert wider(e, 2.0, (0.0, 6.0)).interval.tolist() == [0.0, 6.0]
