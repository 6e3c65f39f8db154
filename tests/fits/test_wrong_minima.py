"""Limited ranges of angles, over which a fit may end in another minimum; strong mirrors."""

import numpy as np
import pytest

from fitting import fit_many
from tests.truth.random_measurements import draw, draw_batch, draw_geometry, textbook

pytestmark = pytest.mark.slow

STUDY = pytest.mark.study


def of(angles, eta, k, noise, quantity="R_p", eta_i=1.0, seed=0):
    rng = np.random.default_rng(seed)
    index = (np.asarray(eta) + 1j * np.asarray(k))[:, None]
    value = textbook(angles, index, eta_i)[quantity]
    return {quantity: value + noise * rng.standard_normal(value.shape)}


def bounds_of(found):
    """The least reflectance at normal incidence of the mirrors that fit, of each curve."""
    (told,) = [f for f in found.findings if f.code == "perfect_mirror"]
    return told.values["least_reflectance"]


def excess(angles, data, eta, k, noise, eta_i=1.0):
    """Chi2 above that of the same fit started at the truth, where the fit says converged."""
    found = fit_many(angles, **data, sample=f"{eta_i!r} | free")
    best = fit_many(angles, **data, sample=f"{eta_i!r} | free", start={"eta": eta, "k": k})
    above = (found.rms**2 - best.rms**2) * found.n_data / noise**2
    return np.where(found.status == "converged", above, 0.0), found


@pytest.mark.study
@pytest.mark.parametrize(
    ("low", "high", "low_n", "high_n"),
    [
        *(pytest.param(low, high, 1.3, 3.5, marks=STUDY) for low, high in ((50, 75), (45, 87))),
        (55.0, 70.0, 1.3, 2.0),
    ],
)
def test_R_p_alone_of_dielectrics_over_a_limited_range(low, high, low_n, high_n):
    """16, 7 and 76 % ended in another minimum (n 1.790 as 1.121 with chi2 1,800 above the best)."""
    angles = np.linspace(low, high, 40)
    eta = np.random.default_rng(1).uniform(low_n, high_n, 400)
    data = of(angles, eta, 0.0 * eta, 1e-3)
    above, found = excess(angles, data, eta, 0.0 * eta, 1e-3)
    assert (above > 0.01).sum() == 0
    assert "not converged" not in found.status


@pytest.mark.parametrize("kind", ["weak absorber", "semiconductor", "metal"])
def test_R_p_alone_of_absorbers_above_60_degrees(kind):
    rng = np.random.default_rng(2)
    angles = np.linspace(62.0, 85.0, 40)
    low, high, least, most = {
        "weak absorber": (1.3, 3.5, 0.01, 0.3),
        "semiconductor": (2.0, 5.0, 0.01, 3.0),
        "metal": (0.05, 4.0, 1.0, 10.0),
    }[kind]
    eta, k = rng.uniform(low, high, 400), rng.uniform(least, most, 400)
    above, found = excess(angles, of(angles, eta, k, 1e-3), eta, k, 1e-3)
    assert (above > 0.01).sum() == 0
    assert "not converged" not in found.status


def test_two_lossless_minima_near_each_other_are_told_apart():
    """1.326 and 1.443, of 16 angles: they lay between two nodes of the line of lossless indices."""
    angles = np.linspace(73.3, 82.6, 16)
    eta = np.linspace(1.31, 1.34, 40)
    above, _ = excess(angles, of(angles, eta, 0.0 * eta, 2e-4), eta, 0.0 * eta, 2e-4)
    assert (above > 0.01).sum() == 0


@pytest.mark.study
def test_light_near_normal_incidence_alone():
    """Unpolarized, n and k near .35: a second minimum at k = 0, up to 1,700 of chi2 above."""
    rng = np.random.default_rng(3)
    angles = np.sort(rng.uniform(0.4, 16.0, 40))
    eta, k = rng.uniform(0.3, 0.6, 400), 10.0 ** rng.uniform(-4.0, -0.4, 400)
    data = of(angles, eta, k, 3e-4, "R")
    above, found = excess(angles, data, eta, k, 3e-4)
    assert (found.status == "converged").sum() > 200
    assert (above > 0.01).sum() == 0


def test_an_exact_curve_from_50_to_75_degrees():
    angles = np.linspace(50.0, 75.0, 40)
    found = fit_many(angles, **of(angles, np.full(20, 1.7), np.zeros(20), 0.0))  # was 1.145
    assert found.eta == pytest.approx(1.7, abs=1e-9)


@pytest.mark.study
def test_fits_in_total_reflection_do_not_creep():
    """With light from the denser side some of these needed 10,000 steps and were cut at 400."""
    rng = np.random.default_rng(5)
    angles = np.linspace(62.0, 68.0, 40)
    eta, k = rng.uniform(0.3, 0.9, 200), 10.0 ** rng.uniform(-4.0, -1.0, 200)
    for quantity in ("R", "R_s"):
        found = fit_many(angles, **of(angles, eta, k, 5e-4, quantity))
        assert "not converged" not in found.status


def test_where_noise_decides_between_solutions_one_of_them_holds_the_truth():
    """R_p of dielectrics over 8 degrees: up to three indices fit alike, and of the lowest alone the
    intervals held the truth in 57 % of such fits."""
    rng = np.random.default_rng(8)
    angles = np.linspace(64.0, 72.0, 40)
    eta, noise = rng.uniform(1.3, 3.4, 600), 10.0 ** rng.uniform(-3.3, -1.8, 600)
    data = of(angles, eta, 0.0 * eta, noise[:, None])
    found = fit_many(angles, **data, intervals="auto")
    several, hold = np.zeros(600, bool), within(found.parameters["eta"], eta)
    assert len(found.others) > 1
    for other in found.others:
        several |= np.isfinite(other.delta_chi2)
        hold |= within(other.parameters["eta"], eta)
    clear = found.status == "converged"
    assert several.sum() > 100
    assert hold[several & clear].mean() > 0.9
    assert hold[~several & clear].mean() > 0.9


def within(estimate, truth):
    low, high = estimate.interval.T
    return (low <= truth) & (truth <= high)


@pytest.mark.parametrize(("geometry", "curve"), [(143, 948), (383, 879), (451, 938), (471, 983)])
def test_the_slowest_of_a_million_curves_come_to_rest(geometry, curve):
    """R_s in total reflection, of the success study with seed 6468033: cut off at 584 steps."""
    batch, _ = draw(6468033, geometry)
    angles, data = batch.take(np.array([curve])).padded()
    found = fit_many(angles, **data, sample=f"{batch.geometry.eta_i!r} | free")
    assert found.status[0] == "converged"


def test_a_lane_does_not_creep_where_n_has_no_effect():
    """At n^2 = 1 + k^2, of R near the normal. The end of the circle was shown, 38 of chi2 above."""
    batch, _ = draw(991, 34)
    batch = batch.take(np.array([534]))
    angles, data = batch.padded()
    found = fit_many(angles, **data, errors="equal")
    truth = {"eta": batch.eta, "k": batch.k}
    best = fit_many(angles, **data, errors="equal", start=truth)
    assert found.cost == pytest.approx(best.cost, rel=1e-6)
    assert [found.eta[0], found.k[0]] == pytest.approx([2.409, 2.381], abs=2e-3)


@pytest.mark.study
def test_curves_of_a_batch_start_as_they_would_alone():
    """Gaps leave some with few angles, which take a mesh of their own; so do empty curves."""
    angles = np.linspace(20.0, 80.0, 30)
    data = of(angles, [1.5, 2.0, 1.7], [0.0, 0.5, 0.1], 1e-3)["R_p"]
    data[1, 8:] = np.nan
    data[2] = np.nan
    found = fit_many(angles, R_p=data)
    assert found.status[2] == "no data"
    for i in range(2):
        keep = np.isfinite(data[i])
        one = fit_many(angles[keep], R_p=data[i, keep])
        assert found.eta[i] == pytest.approx(one.eta, rel=1e-6)


def of_a_strong_reflector(low, noise, stated):
    """The angles and 300 curves of R_s of .06 + 3.6 i, and their fit."""
    angles = np.linspace(low, 85.0, 40)
    data = of(angles, np.full(300, 0.06), np.full(300, 3.6), noise, "R_s")
    return angles, data, fit_many(angles, **data, sigma=noise if stated else None)


def reflectance_of(eta, k):
    return ((eta - 1.0) ** 2 + k**2) / ((eta + 1.0) ** 2 + k**2)


@pytest.mark.parametrize("low", [1.0, 50.0])
@pytest.mark.parametrize("stated", [False, True])
def test_a_metal_by_R_s_alone_names_its_circle(low, stated):
    """.06 + 3.6 i, noise .01: a fifth to a half converged on total reflection, .76 +- .004."""
    angles, data, found = of_a_strong_reflector(low, 0.01, stated)
    assert (found.status == "undetermined").all()
    shown = np.isfinite(found.eta)
    (circle,) = (f for f in found.findings if f.code == "circle")
    assert (circle.at == shown).all()
    away = reflectance_of(found.eta[shown], found.k[shown]) - reflectance_of(0.06, 3.6)
    assert np.abs(np.median(away)) < 0.002
    assert np.abs(away).max() < 0.04  # 1 - R(0) of the best fit is at most twice that of the bound
    one = fit_many(angles, R_s=data["R_s"][0], sigma=0.01, intervals="profile")
    least, most = one.parameters["eta"].interval
    assert least <= one.eta <= most
    assert most > 3.0 * least


@pytest.mark.parametrize("low", [1.0, 50.0])
@pytest.mark.parametrize("stated", [False, True])
def test_where_a_perfect_mirror_fits_there_is_only_a_bound(low, stated):
    *_, found = of_a_strong_reflector(low, 0.05, stated)
    assert (found.status == "undetermined").all()
    mirrors = np.isnan(found.eta)
    assert mirrors.mean() > 0.9
    least = bounds_of(found)[mirrors]
    # 95 % are due where 1 / |N|^2 is nothing; here it is .08
    true = reflectance_of(0.06, 3.6)
    assert (least <= true).mean() > 0.9
    assert true - least.mean() < 0.05  # five times that of noise .01
    assert "at least 0.9" in found[int(np.flatnonzero(mirrors)[0])].warnings[0].text


@pytest.mark.study
@pytest.mark.parametrize("seed", [11, 12])
def test_strong_mirrors_at_random_do_not_converge_on_something_else(seed):
    """R_s of eta .02 to 1, k 1.5 to 10, noise .001 to .05, angles of all kinds."""
    rng, count, wrong, least, true = np.random.default_rng(seed), 0, 0, [], []
    for _ in range(6):
        angles = draw_geometry(rng, "s").angles
        eta, k = 10.0 ** rng.uniform(-1.7, 0.0, 200), rng.uniform(1.5, 10.0, 200)
        noise = 10.0 ** rng.uniform(-3.0, -1.3, (200, 1))
        data = of(angles, eta, k, noise, "R_s", seed=rng.integers(1000))
        gaps = np.full((200, 60 - len(angles)), np.nan)  # one compiled program for all
        wide = np.pad(angles, (0, 60 - len(angles)), mode="edge")
        found = fit_many(wide, R_s=np.hstack([data["R_s"], gaps]), intervals="auto")
        clear = found.status == "converged"
        count += 200
        wrong += (clear & ~within(found.parameters["eta"], eta)).sum()
        assert "not converged" not in found.status
        told = np.isfinite(bounds_of(found))
        least += bounds_of(found)[told].tolist()
        true += reflectance_of(eta, k)[told].tolist()
    assert wrong < 0.01 * count
    assert len(least) > 100
    assert (np.array(least) <= np.array(true)).mean() > 0.9


def test_a_mirror_with_clear_losses_keeps_its_index():
    angles = np.linspace(1.0, 89.0, 40)  # the program of those in total reflection
    found = fit_many(angles, **of(angles, np.full(50, 0.36), np.full(50, 2.6), 1e-3, "R_s"))
    assert (found.status == "converged").all()


@pytest.mark.study
def test_what_is_undetermined_lies_within_its_own_range():
    """eta 200 was shown beside a range of .06 to .78."""
    rng = np.random.default_rng(4)
    angles, noise = np.linspace(5.0, 40.0, 40), 9e-3
    eta, k = rng.uniform(0.05, 4.0, 60), rng.uniform(0.5, 6.0, 60)
    for quantity in ("R_s", "R"):
        data = of(angles, eta, k, noise, quantity)
        found = fit_many(angles, **data, sigma=noise, intervals="auto")
        some = (found.status == "undetermined") & np.isfinite(found.parameters["eta"].interval).all(
            -1
        )
        assert some.sum() > 10
        for one in found.parameters.values():
            value, ends = one.value, one.interval
            assert (ends[some, 0] <= value[some]).all() and (value[some] <= ends[some, 1]).all()
        # The best fit is what is shown.
        start = fit_many(angles, **data, start={"eta": eta, "k": k})
        assert (found.rms[some] <= start.rms[some] * (1.0 + 1e-6)).all()


def test_a_last_step_that_a_bound_cuts_is_looked_at():
    """At k = 0 the half of a step that was left led off the circle, to where R = 0 fits as well.

    "no reflection", converged, with a chi2 711 above the best; found by `fit_success`.
    """
    batch, _ = draw(20261202, 82)
    one = batch.take(np.array([227]))
    angles, data = one.padded()
    found = fit_many(angles, **data, sample=f"{one.geometry.eta_i!r} | free", errors="equal")
    assert found.status == "undetermined" and found.rms < 1.5 * one.noise


@pytest.mark.study
@pytest.mark.parametrize("number", range(4))
def test_measurements_drawn_at_random(number):
    """The study of `benchmarks.studies.fit_success`, small."""
    rng = np.random.default_rng([5, number])
    batch = draw_batch(draw_geometry(rng), 40, rng)
    angles, data = batch.padded()
    eta_i = batch.geometry.eta_i
    noise = np.maximum(batch.noise, 1e-12)
    above, found = excess(angles, data, batch.eta, batch.k, noise, eta_i)
    assert (above > 0.01).sum() == 0
    assert "not converged" not in found.status
