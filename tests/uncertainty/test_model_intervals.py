"""95 % intervals of model fits, against profiles by brute force: the textbook's R and scipy."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import brentq, minimize_scalar

from fitting import Measurement, fit
from fitting.choice import selection as select
from fitting.command import cli
from tests.estimates import bounds, intervals, kinds, sigmas, values
from tests.truth.bounded import roots
from tests.truth.profiles import (
    ANGLES,
    NORMAL,
    assert_same,
    by_hand,
    cauchy,
    constant,
    measured,
    residuals,
    textbook,
)

pytestmark = pytest.mark.slow

# The rise that is due follows from the profile, here from a parabola through all of it.
BESIDE_ZERO = 0.02


@pytest.fixture(scope="module")
def glass():
    """k of 0, below what the data can show."""
    return measured(constant, (1.5, 0.0), ANGLES, [0.6], 2e-3, 1)


def rises_beside_zero(of, found, unit):
    """The rises due at the ends of eta and k, (2, 2), by the profile over k^2 (see `bounded`).

    unit: a rise that counts as 1.96^2.
    """
    eta, k = values(found)

    def chi2(n, kk):
        return (of(np.array([n, kk])) ** 2).sum() * NORMAL / unit

    inner = {"bounds": (eta - 0.05, eta + 0.05), "method": "bounded", "options": {"xatol": 1e-9}}
    u = np.union1d(np.linspace(0.0, 0.12**2, 80), [k**2])
    along = [minimize_scalar(lambda n, x=x: chi2(n, np.sqrt(x)), **inner) for x in u]
    rise = np.array([a.fun for a in along]) - chi2(eta, k)
    bend = (chi2(eta + 1e-3, k) - 2.0 * chi2(eta, k) + chi2(eta - 1e-3, k)) / 1e-6
    both = roots(u, rise, np.array([a.x for a in along]), np.sqrt(2.0 / bend))
    return np.array(both) ** 2 * unit / NORMAL


@pytest.mark.study
@pytest.mark.parametrize("seed", [1, 5])
def test_k_near_zero(seed):
    """Seed 1: the best k is 0, on the bound; seed 5: it is above, and compatible with 0."""
    m = measured(constant, (1.5, 0.0), ANGLES, [0.6], 2e-3, seed)
    found = fit(m, "constant", errors="stated")
    assert bounds(found)[1] == ("low" if seed == 1 else "")
    assert kinds(found) == ("profile", "profile")
    of = residuals(m, constant)
    starts = [values(found), values(found) + [0.003, 0.03], values(found) - [0.003, 0.0]]
    low, high, step = [1e-3, 0.0], [10.0, 10.0], [1e-3, 0.02]
    theirs = by_hand(of, starts, low, high, rises_beside_zero(of, found, NORMAL), step)
    assert theirs[1, 0] == 0.0 == intervals(found)[1, 0]
    assert_same(intervals(found), theirs, BESIDE_ZERO)
    # scaled by the scatter: Student's t with its degrees of freedom
    scaled = fit(m, "constant")
    scatter = (of(values(scaled)) ** 2).sum() / 24
    unit = stats.t.ppf(0.975, 24) ** 2 * scatter
    theirs = by_hand(of, starts, low, high, rises_beside_zero(of, scaled, unit), step)
    assert_same(intervals(scaled), theirs, BESIDE_ZERO)
    # the standard error holds k where it is; the interval does not
    quadratic = fit(m, "constant", intervals="quadratic")
    assert kinds(quadratic) == ("quadratic", "quadratic")
    t = stats.t.ppf(0.975, 24)
    np.testing.assert_allclose(
        intervals(quadratic)[0], values(quadratic)[0] + t * sigmas(quadratic)[0] * np.array([-1, 1])
    )
    if seed == 1:
        text = "are valid for k = 0 only; their 95 % intervals include all values of k"
        assert any(text in w.text for w in scaled.warnings)
        assert not any("intervals" in w.text for w in quadratic.warnings)
        text = "the standard errors of the others are valid for k = 0 only"
        assert any(text in w.text for w in quadratic.warnings)
        assert np.ptp(intervals(scaled)[0]) > 1.1 * np.ptp(intervals(quadratic)[0])
        assert any(
            "eta: 1.49" in w.text and "by its standard error" in w.text for w in scaled.warnings
        )


def test_k_a_few_errors_above_zero():
    """k^2 is 2.4 standard errors: the lower end of k lies where the rise is 3.2."""
    m = measured(constant, (1.5, 0.1), ANGLES, [0.6], 2e-3, 3)
    found = fit(m, "constant", errors="stated", intervals="profile")
    of = residuals(m, constant)
    rises = rises_beside_zero(of, found, NORMAL)
    assert rises[1, 0] < 0.9 * NORMAL and rises[1, 1] == pytest.approx(NORMAL)
    starts = [values(found), values(found) + [0.003, 0.03], values(found) - [0.003, 0.02]]
    theirs = by_hand(of, starts, [1e-3, 0.0], [10.0, 10.0], rises, [1e-3, 0.02])
    assert theirs[1, 0] > 0.0
    assert_same(intervals(found), theirs, BESIDE_ZERO)


def test_a_curved_valley():
    """R_p of an absorber seen at three angles with much noise."""
    m = measured(constant, (1.1, 7.0), [45.0, 65.0, 75.0], [0.6], 1e-2, 0)
    found = fit(m, "constant", errors="stated")
    assert kinds(found) == ("profile", "profile")
    starts = [values(found), 0.8 * values(found), 1.3 * values(found)]
    theirs = by_hand(
        residuals(m, constant), starts, [1e-3, 0.0], [100.0, 100.0], NORMAL, 0.3 * values(found)
    )
    assert_same(intervals(found), theirs)
    # As the fit of a free index says, which knows the same of these data.
    assert found.status == fit(m, errors="stated").status == "undetermined"
    assert np.isnan(sigmas(found)).all()


@pytest.fixture(scope="module")
def spectrum():
    return measured(
        cauchy, (1.5, 0.012), [45.0, 65.0, 75.0], np.linspace(0.4, 0.9, 14), 5e-3, 3, ("R_s",)
    )  # fmt: skip


def test_a_spectrum_with_a_prior(spectrum):
    found = fit(
        spectrum, "cauchy:2", priors={"scale": (1.0, 0.02)}, errors="stated",
        intervals="profile",
    )  # fmt: skip
    assert found.names == ("A", "B", "scale") and set(kinds(found)) == {"profile"}
    of = residuals(spectrum, cauchy, scaled=True)
    theirs = by_hand(
        lambda x: np.append(of(x), (x[2] - 1.0) / 0.02), [values(found)],
        [1.0, -np.inf, 1e-3], [100.0, np.inf, 1e3], NORMAL, 0.7 * sigmas(found),
    )  # fmt: skip
    assert_same(intervals(found), theirs)
    # scaled: data and prior are weighed by the noise that was found; t has 40 degrees of freedom
    scaled = fit(
        spectrum, "cauchy:2", priors={"scale": (1.0, 0.02)}, intervals="profile"
    )  # fmt: skip
    assert 1.1 < scaled.noise < 1.5 and scaled.dof == 40
    again = by_hand(
        lambda x: np.append(of(x) / scaled.noise, (x[2] - 1.0) / 0.02), [values(scaled)],
        [1.0, -np.inf, 1e-3], [100.0, np.inf, 1e3], stats.t.ppf(0.975, 40) ** 2,
        0.7 * sigmas(scaled),
    )  # fmt: skip
    assert_same(intervals(scaled), again)
    # linear enough: quadratic ones are taken if nothing is said
    plain = fit(spectrum, "cauchy:2", priors={"scale": (1.0, 0.02)}, errors="stated")
    assert kinds(plain) == ("quadratic",) * 3
    np.testing.assert_allclose(
        intervals(plain),
        values(plain)[:, None] + np.sqrt(NORMAL) * sigmas(plain)[:, None] * [-1, 1],
    )
    half = np.ptp(theirs, axis=1)[:, None] / 2.0
    assert (np.abs(intervals(plain) - theirs) < 0.1 * half).all()


def test_others_are_free_of_the_bound_that_one_lies_on(spectrum):
    """A is kept above its best value; B's standard error is that for A on its bound, its interval
    is not."""
    free = fit(spectrum, "cauchy:2", errors="stated")
    low = free.parameters["A"].value + 0.3 * free.parameters["A"].sigma
    found = fit(spectrum, "cauchy:2", bounds={"A": (low, 1.6)}, errors="stated")
    assert bounds(found) == ("low", "") and kinds(found) == ("profile", "profile")
    theirs = by_hand(
        residuals(spectrum, cauchy), [values(found), values(found) + [1e-3, 0.0]],
        [low, -np.inf], [1.6, np.inf], NORMAL, 0.4 * sigmas(free),
    )  # fmt: skip
    assert_same(intervals(found), theirs)
    assert intervals(found)[0, 0] == low == theirs[0, 0]
    # downwards A gives way, upwards it cannot
    below, above = (
        np.abs(intervals(found)[1] - found.parameters["B"].value) / found.parameters["B"].sigma
    )
    assert below > 2.5 and above == pytest.approx(1.96, rel=0.03)


def test_beside_a_bound_nothing_is_conditional():
    """Also where the standard error of eta, for k = 0, would be right to a tenth."""
    m = measured(constant, (1.5, 0.1), ANGLES, [0.6], 5e-3, 0, ("R_p",))
    found = fit(m, "constant", errors="stated")
    assert bounds(found) == ("", "low") and kinds(found) == ("profile", "profile")
    quadratic = fit(m, "constant", errors="stated", intervals="quadratic")
    off = np.abs(intervals(found)[0] - intervals(quadratic)[0]) / np.ptp(intervals(found)[0])
    assert 0.01 < off.max() < 0.05


def test_a_robust_loss(spectrum):
    """Huber's loss of one unknown: the cost rises by t^2 mean(psi^2) / mean(psi') at the ends."""
    value = spectrum.value.copy()
    value[::9] += 0.05
    spoilt = Measurement.from_columns(
        spectrum.angle_deg, spectrum.wavelength_um, sigma=5e-3, R_s=value
    )
    found = fit(
        spoilt, "cauchy:2", fixed={"B": 0.012}, loss="huber", errors="stated",
        intervals="profile",
    )  # fmt: skip
    of = residuals(spoilt, cauchy)

    def cost(a):
        r = np.abs(of((a, 0.012)))
        return np.where(r > 1.345, 2.0 * 1.345 * r - 1.345**2, r * r).sum()

    best = minimize_scalar(cost, bracket=(1.49, 1.51), options={"xtol": 1e-12})
    r = of((best.x, 0.012))
    psi, bend = np.clip(r, -1.345, 1.345), (np.abs(r) < 1.345).mean()
    variance = max((psi @ psi) / (len(r) - 1) / bend**2, 1.0)
    step = 10.0 * sigmas(found)[0]
    theirs = [
        brentq(lambda a: cost(a) - best.fun - NORMAL * variance * bend, best.x, best.x + s)
        for s in (-step, step)
    ]
    assert_same(intervals(found), np.array([theirs]))


def test_without_noise_or_data_to_spare_there_is_nothing_to_follow():
    """The cost does not rise by anything but rounding: no interval, or the quadratic one."""
    R_s, R_p = (textbook(1.7 + 0.8j, ANGLES, np.array(q)) for q in ("R_s", "R_p"))
    m = Measurement.from_columns(ANGLES, 0.6, R_s=R_s, R_p=R_p)
    found = fit(m, "constant", intervals="profile")
    assert set(kinds(found)) == {"quadratic"} and np.ptp(intervals(found)) < 2.0
    pair = Measurement.from_columns([70.0], 0.6, R_s=[0.5], R_p=[0.1])
    found = fit(pair, "constant", intervals="profile")
    assert kinds(found) == ("none", "none") and np.isnan(intervals(found)).all()
    # errors that are stated need no data to spare
    pair = replace(pair, sigma=np.full(2, 1e-3))
    for errors in ("scaled", "stated"):
        found = fit(pair, "constant", intervals="profile", errors=errors)
        assert kinds(found) == ("profile", "profile")


def test_an_undetermined_index_has_the_range_of_its_circle():
    """R at normal incidence leaves the circle (eta - a)^2 + k^2 = b: its ends in closed form."""
    m = Measurement.from_columns([0.0] * 4, 0.5, sigma=1e-4, R=[0.3, 0.3001, 0.2999, 0.3])
    found = fit(m, "constant", errors="stated", intervals="profile")
    assert found.status == "undetermined"
    root = np.sqrt(0.3)
    # the width of the line, 1e-4 of R, is a thousandth of the circle
    low, high = (1.0 - root) / (1.0 + root), (1.0 + root) / (1.0 - root)
    np.testing.assert_allclose(found.parameters["eta"].interval, [low, high], rtol=2e-3)
    np.testing.assert_allclose(found.parameters["k"].interval, [0.0, 2.0 * root / 0.7], rtol=2e-3)
    assert kinds(fit(m, "constant", errors="stated")) == ("profile", "profile")


def test_plain_data_and_refusal(glass):
    found = fit(glass, "constant", fixed={"k": 0.0})
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert data["parameters"]["eta"]["interval"] == intervals(found)[0].tolist()
    assert data["parameters"]["eta"]["interval_kind"] == "quadratic"
    np.testing.assert_array_equal(found.parameters["k"].interval, (0.0, 0.0))
    assert "A" not in found.parameters
    for call in (fit, select.choose):
        with pytest.raises(ValueError, match="auto, quadratic, profile"):
            call(glass, intervals="exact")


def test_the_model_chosen_has_intervals(glass):
    choice = select.choose(glass, instrument=False)
    assert choice.fit is choice.taken.fit
    assert choice.taken in choice.candidates
    with_k = next(c for c in choice.candidates if not c.key.without_k)
    assert set(kinds(with_k.fit)) == {"quadratic"}
    profiled = select.choose(glass, instrument=False, intervals="profile")
    assert kinds(profiled.fit) == ("profile",)


def test_the_command(tmp_path, capsys):
    file = tmp_path / "glass.csv"
    m = measured(constant, (1.5, 0.0), ANGLES, [0.6], 2e-3, 6)
    rows = zip(ANGLES, m.value[:13], m.value[13:], strict=True)
    file.write_text("angle_deg,R_s,sigma_R_s,R_p,sigma_R_p\n" + "".join(
        f"{a:g},{s:.6f},0.002,{p:.6f},0.002\n" for a, s, p in rows
    ))  # fmt: skip
    shown = {}
    for kind in ("auto", "quadratic", "profile"):
        assert cli.main([str(file), "--sample", "constant", "--intervals", kind]) == 0
        shown[kind] = " ".join(capsys.readouterr().out.split())
    for kind in ("auto", "profile"):
        # no standard error beside a 95 % interval that says otherwise
        assert re.search(r"eta 1\.50\d* 1\.49\d* to 1\.5\d* \(profile likelihood\)", shown[kind])
    assert "profile" not in shown["quadratic"]
    folder = tmp_path / "report"
    assert cli.main([str(file), "--sample", "constant", "--quiet", "--report", str(folder)]) == 0
    data = json.loads((folder / "fit.json").read_text())["parameters"]
    assert {e["interval_kind"] for e in data.values()} == {"profile"}
    assert data["k"]["interval"][0] == 0.0
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "95 % interval" in page and "profile likelihood" in page
