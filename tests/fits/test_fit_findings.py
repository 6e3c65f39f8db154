"""What the fit says that the data do not say: statuses, limits, second solutions, sentences."""

import json

import numpy as np
import pytest

from fitting import Measurement, fit, fit_many
from tests.estimates import at_zero, codes, correlation, limits, second, sigmas, texts
from tests.truth.simulated import textbook
from tests.truth.textbook import reflectances

pytestmark = pytest.mark.slow

ANGLES = np.linspace(5.0, 85.0, 16)


def curves(eta, k, angles=ANGLES, quantities=("R_s", "R_p"), noise=0.0, count=None, seed=0):
    angles = np.asarray(angles)
    rng = np.random.default_rng(seed)
    shape = angles.shape if count is None else (count, *angles.shape)
    return {
        q: textbook(angles, np.full(len(angles), q), eta, k) + noise * rng.standard_normal(shape)
        for q in quantities
    }


def test_glass_gets_an_upper_limit_on_k_and_no_error_bar():
    found = fit_many(ANGLES, **curves(1.5, 0.0, noise=1e-3, count=400), sigma=1e-3)
    zero = at_zero(found)
    assert set(found.status) == {"converged"}
    assert 0.35 < zero.mean() < 0.65  # u = k^2 scatters about 0
    assert (found.k[zero] == 0.0).all()
    limited = np.isfinite(found.parameters["k"].upper_limit)
    assert np.isnan(found.parameters["k"].sigma[limited]).all()
    assert np.isnan(found.covariance[limited, 1, 1]).all()
    # A true k = 0 lies above three sigma in .1 % of all cases, and only then gets a standard error.
    assert limited.mean() > 0.98
    assert np.isfinite(found.parameters["eta"].sigma).all()
    # k may be what the limit allows, which the error of eta covers: wider than for a known k = 0.
    assert 0.6 < ((found.eta - 1.5) / found.parameters["eta"].sigma).std() < 1.0
    assert "k < " in found.warnings[int(np.flatnonzero(limited)[0])][0].text


@pytest.mark.parametrize("k", [0.0, 0.03, 0.06])
def test_the_upper_limit_on_k_holds(k):
    found = fit_many(ANGLES, **curves(1.5, k, noise=1e-3, count=2000), sigma=1e-3, errors="stated")
    with np.errstate(invalid="ignore"):
        below = (k > found.parameters["k"].upper_limit).mean() + (
            np.abs(found.k - k) > 2 * found.parameters["k"].sigma
        ).mean()
    # 5 % of all curves, or less where k = 0 is the physical bound, + 3 binomial errors; of the k
    # in between that are seen with a standard error 5 % miss too.
    assert below < 0.08


@pytest.mark.study
@pytest.mark.parametrize(("eta", "k"), [(1.5, 0.0), (0.5, 2.2), (4.0, 0.1)])
def test_normal_incidence_fixes_only_a_circle(eta, k):
    reflectance = curves(eta, k, [0.0], ("R",))["R"]
    found = fit_many([0.0], R=reflectance, sigma=1e-3)
    assert found.status == "undetermined"
    for nothing in (sigmas(found), correlation(found), limits(found)):
        assert np.isnan(nothing).all()
    assert found.k == 0.0
    r = np.sqrt(reflectance[0])
    assert found.eta == pytest.approx((1 + r) / (1 - r), rel=1e-9)  # the member with k = 0
    (said,) = texts(found)
    a = (1.0 + reflectance[0]) / (1.0 - reflectance[0])
    assert f"(eta - {a:.4g})^2 + k^2 = {a * a - 1.0:.4g}" in said
    assert (eta - a) ** 2 + k * k == pytest.approx(a * a - 1.0, rel=1e-9)  # and the truth is on it


def test_forty_five_degrees_say_one_thing_twice():
    found = fit_many([45.0], **curves(0.5, 2.2, [45.0]), sigma=1e-3)
    assert found.status == "undetermined"
    assert "45 degrees" in found.warnings[0].text
    # 46 degrees say two, though not well.
    assert fit_many([60.0], **curves(0.5, 2.2, [60.0])).status == "converged"


def test_s_alone_on_a_metal_names_the_circle():
    found = fit_many(
        ANGLES, **curves(1.2, 7.0, quantities=("R_s",), noise=5e-3, count=200), sigma=5e-3
    )
    blind = found.status == "undetermined"
    assert blind.mean() > 0.8
    assert np.isnan(found.parameters["eta"].sigma[blind]).all()
    index = int(np.flatnonzero(blind)[0])
    assert "only the circle" in found.warnings[index][0].text
    a = (1 + found.eta**2 + found.k**2) / (2 * found.eta)
    # Noise makes perfect mirrors of a few, which have no value at all.
    valued = blind & np.isfinite(found.eta)
    assert valued.sum() > 0.9 * blind.sum()
    assert np.median(a[valued]) == pytest.approx((1 + 1.2**2 + 49) / 2.4, rel=0.1)


def test_a_perfect_mirror_has_no_index():
    for level in (1.0, 1.02):
        found = fit_many(ANGLES, R_s=np.full(16, level), R_p=np.full(16, level))
        assert found.status == "undetermined"
        assert np.isnan(found.eta)
        assert "perfect mirror" in found.warnings[0].text


def test_nothing_reflected_is_the_medium_itself():
    found = fit_many(ANGLES, R_s=np.zeros(16), R_p=np.zeros(16), sample="1.33 | free")
    assert found.eta == pytest.approx(1.33, abs=1e-6)
    assert found.status != "not converged"


def test_two_solutions_that_fit_alike_are_both_reported():
    # R_p at 60 and 75 degrees: two data, and for 74 of these 200 dielectrics more than one answer,
    # exact or closer than the .1 % assumed of data without stated errors (112 starts a curve).
    angles, eta = np.array([60.0, 75.0]), np.linspace(1.3, 3.5, 200)
    data = np.array([curves(n, 0.0, angles, ("R_p",))["R_p"] for n in eta])
    found = fit_many(angles, R_p=data)
    alternative_eta, alternative_k, rise = second(found)
    twins = np.flatnonzero(np.isfinite(alternative_eta))
    assert len(twins) >= 71
    # Of what rounding alone tells apart that above eta_i which absorbs least is shown: the
    # dielectric, also where another exact solution lies beside it (.07 in k).
    exact = rise < 1e-20
    assert exact.sum() > 10
    determined = found.status != "undetermined"
    np.testing.assert_allclose(found.eta[determined], eta[determined], rtol=1e-5)
    assert (found.k[determined] < 1e-6).all()
    for i in twins:
        for other in (
            (found.eta[i], found.k[i]),
            (alternative_eta[i], alternative_k[i]),
        ):
            again = curves(*other, angles, ("R_p",))["R_p"]
            np.testing.assert_allclose(again, data[i], atol=3e-3)  # within delta chi2 < 6 of 1e-3
        assert abs(found.eta[i] - alternative_eta[i]) > 1e-3
        other = found.alternatives[i][0]
        assert other.parameters["eta"].value == alternative_eta[i]
        assert "other_minima" in {w.code for w in found.warnings[i]}
    for i in (17, 30):  # and by `fit`
        one = fit(Measurement.from_columns(angles, 0.6, R_p=data[i]))
        assert one.eta == pytest.approx(eta[i], rel=1e-5) and one.k < 1e-6
        assert len(one.alternatives) == len(found.alternatives[i])


@pytest.mark.study
def test_many_angles_have_one_solution():
    for quantities in (("R_s", "R_p"), ("R_p",), ("R",)):
        found = fit_many(ANGLES, **curves(2.0, 0.5, quantities=quantities, noise=1e-3, count=50))
        assert np.isnan(second(found)[0]).all()
        assert all(not a for a in found.alternatives)


def test_stated_errors_that_are_too_small_or_too_large_are_said_so():
    data = curves(0.5, 2.2, noise=5e-3, seed=1)
    small = fit_many(ANGLES, **data, sigma=5e-4)
    assert small.chi2_reduced > 40
    assert "too small" in small.warnings[0].text
    assert "scaled up" in small.warnings[0].text
    stated = fit_many(ANGLES, **data, sigma=5e-4, errors="stated")
    assert "absolute" in stated.warnings[0].text
    assert "too large" in fit_many(ANGLES, **data, sigma=5e-2).warnings[0].text
    assert fit_many(ANGLES, **data, sigma=5e-3).warnings == ()


def test_strong_correlation_and_a_vague_index_are_named():
    flat = fit_many(
        np.linspace(10.0, 45.0, 8), **curves(2.5, 1.0, np.linspace(10.0, 45.0, 8), ("R",), 1e-4),
        sigma=1e-4, errors="stated",
    )  # fmt: skip
    assert flat.status == "converged"
    assert abs(correlation(flat)) > 0.995
    assert any("correlated" in w.text for w in flat.warnings)
    low = np.linspace(5.0, 28.0, 8)
    near = fit_many(low, **curves(2.5, 1.0, low, ("R_p",), 1e-5), sigma=1e-5)
    assert any("below 30 degrees" in w.text for w in near.warnings)


def test_a_curve_no_interface_makes_is_said_not_to_fit():
    found = fit_many(ANGLES, R_s=np.full(16, 0.5), R_p=np.full(16, 0.5))
    (said,) = (w for w in found.warnings if w.code == "does_not_describe")
    assert "For the cause fit this curve alone" in said.text
    assert found.status == "misfit"


def test_no_data_and_gaps():
    data = curves(0.5, 2.2, count=3)
    data["R_s"][1], data["R_p"][1] = np.nan, np.nan
    data["R_s"][2, ::2] = np.nan
    found = fit_many(ANGLES, **data)
    assert found.status.tolist() == ["converged", "no data", "converged"]
    assert found.n_data.tolist() == [32, 0, 24]
    assert np.isnan(
        [found.eta[1], found.k[1], found.rms[1], found.parameters["eta"].sigma[1]]
    ).all()
    assert found.eta[[0, 2]] == pytest.approx([0.5, 0.5], rel=1e-11)
    assert found.warnings[1] == ()


def test_the_plain_form_is_json_and_says_none_for_what_is_not_known():
    for result in (
        fit_many(ANGLES, **curves(1.5, 0.0, noise=1e-3)),
        fit_many([0.0], R=[[0.04], [np.nan]]),
    ):
        plain = json.loads(json.dumps(result.to_dict(), allow_nan=False))
        assert plain["status"] == np.asarray(result.status).tolist()
    assert plain["parameters"]["eta"]["sigma"] == [None, None]
    assert plain["eta"][1] is None
    assert len(plain["warnings"][0]) == 1


def test_results_are_immutable_and_picked_apart():
    found = fit_many(ANGLES, **curves(0.5, 2.2, noise=1e-3, count=3))
    with pytest.raises(AttributeError):
        found.eta = 1.0  # pyright: ignore[reportAttributeAccessIssue]
    one = found[1]
    assert isinstance(one.eta, float)
    assert isinstance(one.status, str)
    assert isinstance(one.n_data, int)
    assert one.covariance.shape == (2, 2)
    assert one.eta == found.eta[1]
    with pytest.raises(IndexError, match="no batch; it takes no index"):
        one[0]


@pytest.mark.parametrize(
    "k", [0.0, 0.05, 0.2, *(pytest.param(k, marks=pytest.mark.study) for k in (0.02, 0.1))]
)
def test_an_unseen_k_does_not_spoil_the_error_of_eta(k):
    """Silicon: half of the fits end at k = 0, and eta is off by what k would explain."""
    found = fit_many(ANGLES, **curves(5.6, k, noise=2e-3, count=2000), sigma=2e-3)
    z = np.abs((found.eta - 5.6) / found.parameters["eta"].sigma)
    assert at_zero(found).mean() > 0.2
    # At least nominal coverage (3 binomial errors below 95.4 %), and nothing far out.
    assert (z < 2.0).mean() > 0.94
    assert z.max() < 5.0


def test_no_limit_on_k_where_the_valley_bends():
    """R_s alone on metals: a k of 5 would get limits of 3 from the quadratic model."""
    rng = np.random.default_rng(12)
    eta, k = rng.uniform(0.2, 3.0, 600), rng.uniform(2.0, 9.0, 600)
    data = [
        curves(*index, quantities=("R_s",), noise=1e-3, seed=i)["R_s"]
        for i, index in enumerate(zip(eta, k, strict=True))
    ]
    found = fit_many(ANGLES, R_s=np.array(data), sigma=1e-3)
    with np.errstate(invalid="ignore"):
        assert (k > found.parameters["k"].upper_limit).sum() <= 3


@pytest.mark.parametrize("eta_i", [1.0, 1.5])
@pytest.mark.parametrize("R_s", [0.0, -1e-3])
def test_no_reflection_is_the_index_of_the_medium_outside(eta_i, R_s):
    """R = 0 (or less, by noise): one point, not a circle, with intervals as found on a grid."""
    angles, sigma = np.linspace(10.0, 80.0, 8), 1e-3
    data = {"R_s": np.full(8, R_s), "R_p": np.zeros(8)}
    found = fit_many(
        angles, **data, sigma=sigma, sample=f"{eta_i!r} | free", errors="stated", intervals="auto"
    )
    assert (found.eta, found.k, found.status) == (eta_i, 0.0, "converged")
    assert at_zero(found)
    assert np.isnan(sigmas(found)).all()
    assert codes(found)[0] == "no_reflection" and "circle" not in codes(found)
    relative = 1.0 + np.linspace(-0.006, 0.006, 401)[:, None]
    k = np.linspace(0.0, 0.006, 301)[None]
    index, angle = relative + 1j * k, angles[:, None, None]
    of = reflectances(np.cos(np.radians(angle)), index)
    misses = [of[q] - v[:, None, None] for q, v in data.items()]
    chi2 = np.square(misses).sum((0, 1)) / sigma**2
    inside = chi2 <= chi2.min() + 3.841
    for ends, values in (
        (found.parameters["eta"].interval, relative[:, 0][inside.any(1)]),
        (found.parameters["k"].interval, k[0][inside.any(0)]),
    ):
        np.testing.assert_allclose(ends / eta_i, values[[0, -1]], atol=4e-5)  # the grid's spacing


def test_no_reflection_and_no_error_leave_a_point():
    found = fit_many(ANGLES, R_s=np.zeros((2, 16)), R_p=np.zeros(16))
    assert found.eta.tolist() == [1.0, 1.0] and found.k.tolist() == [0.0, 0.0]
    assert at_zero(found).all()
    # not so where some light comes back: eta or 1 / eta, on a circle
    (circle,) = fit_many([0.0], R=[1e-6], sigma=1e-6).warnings[:1]
    assert circle.code == "circle"
