"""One curve or many: the same engine, the same answers; and what a call refuses."""

from dataclasses import replace

import numpy as np
import pytest

from fitting import Fit, fit, fit_many
from fitting.data.measurement import Measurement
from tests.estimates import codes, limits, sigmas
from tests.truth.random_measurements import textbook as of_index
from tests.truth.simulated import textbook

ANGLES = np.linspace(20.0, 80.0, 16)
INDICES = [
    (1.5, 0.0), (1.45, 0.0), (1.3, 0.01), (4.0, 0.05), (2.5, 1.0), (0.36, 2.6),
    (0.05, 4.0), (1.1, 7.0), (1.0, 0.5), (3.0, 0.2), (1.8, 0.0), (5.0, 3.0),
]  # fmt: skip


def table(angles=ANGLES, noise=1e-3, seed=0):
    """R_s and R_p of INDICES, (12, 16)."""
    rng = np.random.default_rng(seed)
    return {
        q: np.array([textbook(angles, np.full(len(angles), q), *i) for i in INDICES])
        + noise * rng.standard_normal((len(INDICES), len(angles)))
        for q in ("R_s", "R_p")
    }


def assert_same(one: Fit, many: Fit, index):
    """Values to a thousandth of a standard error, where the search ends; words exactly."""
    beside = many[index]

    def close(ours, theirs, name, atol=1e-12):
        if isinstance(theirs, float | np.ndarray):
            np.testing.assert_allclose(ours, theirs, rtol=1e-3, atol=atol, err_msg=name)
        else:
            assert ours == theirs, name

    for name in ("covariance", "chi2", "chi2_reduced", "dof", "n_data", "rms", "status"):
        close(getattr(beside, name), getattr(one, name), name)
    close(beside.wavelength_um, one.wavelength_um, "wavelength_um")
    assert beside.errors.taken == one.errors.taken
    for name, estimate in one.parameters.items():
        for field in ("value", "sigma", "interval", "interval_kind", "upper_limit", "status"):
            ours = getattr(beside.parameters[name], field)
            # Ends by profile: to a hundredth of a width that is hardly bounded.
            low, high = np.nan_to_num(estimate.interval)
            atol = 1e-3 * np.nan_to_num(estimate.sigma) + 1e-2 * (high - low) + 1e-12
            close(ours, getattr(estimate, field), f"{name}.{field}", atol)
    assert one.alternatives == () or beside.alternatives != ()
    assert codes(one) == codes(beside)


@pytest.mark.parametrize(
    "kwargs",
    [
        {},
        {"sigma": 1e-3, "intervals": "profile"},
        {"sigma": 1e-3, "errors": "stated", "intervals": "auto"},
    ],
)
def test_alone_and_in_a_batch(kwargs):
    data = table()
    many = fit_many(ANGLES, **data, **kwargs)
    assert many.shape == (len(INDICES),)
    for i in range(len(INDICES)):
        assert_same(fit_many(ANGLES, R_s=data["R_s"][i], R_p=data["R_p"][i], **kwargs), many, i)


def test_own_angles_gaps_and_errors_for_each_curve():
    rng = np.random.default_rng(4)
    angles = np.sort(rng.uniform(20.0, 85.0, (len(INDICES), 16)), axis=1)
    sigma = rng.uniform(5e-4, 2e-3, angles.shape)
    data = {
        q: np.array([
            textbook(a, np.full(16, q), *i) + s * rng.standard_normal(16)
            for a, s, i in zip(angles, sigma, INDICES, strict=True)
        ])
        for q in ("R_s", "R_p")
    }  # fmt: skip
    data["R_s"][rng.random(angles.shape) < 0.2] = np.nan
    many = fit_many(angles, **data, sigma=sigma)
    for i in range(len(INDICES)):
        one = fit_many(angles[i], R_s=data["R_s"][i], R_p=data["R_p"][i], sigma=sigma[i])
        assert_same(one, many, i)
        # and a gap is the same as a datum that was never taken
        kept = np.isfinite(data["R_s"][i])
        assert one.n_data == 16 + kept.sum()


@pytest.mark.study
def test_order_and_company_do_not_matter():
    """Chunks, groups of lanes, second passes: a curve is found wherever it stands."""
    data = table()
    repeats = 200  # 2400 curves: several calls
    tiled = {q: np.tile(v, (repeats, 1)) for q, v in data.items()}
    order = np.random.default_rng(1).permutation(len(INDICES) * repeats)
    many = fit_many(ANGLES, **{q: v[order] for q, v in tiled.items()})
    few = fit_many(ANGLES, **data)
    columns = (
        lambda f: f.eta, lambda f: f.k, lambda f: sigmas(f)[0], lambda f: sigmas(f)[1],
        lambda f: f.rms, lambda f: limits(f)[1],
    )  # fmt: skip
    for column in columns:
        sorted_back = column(many)[np.argsort(order)].reshape(repeats, -1)
        # Wherever it stands in a batch a curve gets the same bits, and alone the same to rounding.
        np.testing.assert_array_equal(sorted_back, np.tile(sorted_back[0], (repeats, 1)))
        np.testing.assert_allclose(sorted_back[0], column(few), rtol=1e-9)
    assert (many.status == np.tile(few.status, repeats)[order]).all()


def test_batch_axes_keep_their_shape():
    data = {q: v.reshape(3, 4, 16) for q, v in table().items()}
    found = fit_many(ANGLES, **data)
    assert found.shape == (3, 4)
    assert found.covariance.shape == (3, 4, 2, 2)
    assert found.warnings.shape == (3, 4)
    flat = fit_many(ANGLES, **table())
    np.testing.assert_array_equal(found.eta.ravel(), flat.eta)
    assert found[1, 2].eta == flat[6].eta
    with pytest.raises(ValueError, match="no curve has a datum"):
        fit_many(ANGLES, R_s=np.empty((0, 16)))


def test_a_measurement_is_fitted_wavelength_by_wavelength():
    data, waves = table(), np.linspace(0.4, 0.7, len(INDICES))
    parts = []
    for i in np.random.default_rng(2).permutation(len(INDICES)):  # unsorted
        kept = slice(0, 16 - i)  # and of unequal length
        parts.append((ANGLES[kept], waves[i], data["R_s"][i, kept], data["R_p"][i, kept]))
    lengths = [len(p[0]) for p in parts]
    m = Measurement.from_columns(
        np.concatenate([p[0] for p in parts]),
        np.repeat([p[1] for p in parts], lengths),
        R_s=np.concatenate([p[2] for p in parts]),
        R_p=np.concatenate([p[3] for p in parts]),
        sigma=1e-3,
    )
    found = fit(m)
    np.testing.assert_array_equal(found.wavelength_um, waves)
    for i in range(len(INDICES)):
        kept = slice(0, 16 - i)
        curve = {q: v[i, kept] for q, v in data.items()}
        one = fit_many(ANGLES[kept], **curve, sigma=1e-3, intervals="auto")
        assert_same(replace(one, wavelength_um=waves[i]), found, i)
    single = fit(m.where(m.wavelength_um == waves[3]))
    assert isinstance(single.eta, float)
    assert single.wavelength_um == waves[3]


def test_repeated_angles_are_data_of_their_own():
    data = {q: v[5] for q, v in table(noise=0.0).items()}
    twice = Measurement.from_columns(
        np.concatenate([ANGLES, ANGLES]),
        R_s=np.concatenate([data["R_s"] + 0.01, data["R_s"] - 0.01]),
        R_p=np.concatenate([data["R_p"], np.full(16, np.nan)]),
    )
    found = fit(twice)
    assert found.n_data == 48
    assert found.rms == pytest.approx(0.01 * np.sqrt(32 / 48), rel=1e-3)


def test_errors_missing_from_some_data_are_not_guessed():
    data = table()
    sigma = np.full(16, 1e-3)
    sigma[4] = np.nan
    m = Measurement.from_columns(ANGLES, R_s=data["R_s"][5], R_p=data["R_p"][5], sigma=sigma)
    found = fit(m)
    (note,) = found.notes
    assert note.text == (
        "sigma is missing for 2 of 32 data: all have equal weights, and the errors come from the "
        "scatter. If you know them, for example: try --sigma 0.002 (in Python: sigma=0.002)."
    )
    assert np.isnan(found.chi2)
    assert_equal = fit(m, errors="equal")
    assert (found.eta, assert_equal.notes) == (assert_equal.eta, ())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"R_s": None, "R_p": None}, "no values came"),
        ({"R_s": np.full(16, 92.4)}, "divide by 100"),
        ({"R_s": np.full(16, -0.94)}, "R_s holds -0.94"),
        ({"R_s": "abc"}, "numbers"),
        ({"angles_deg": ANGLES + 30.0}, "0 to 90"),
        ({"angles_deg": ANGLES[:5]}, "shapes"),
        ({"angles_deg": 45.0}, "array"),
        ({"sigma": 0.0}, "above 0"),
        ({"sigma": {"R_s": 1e-3}}, "sigma has no errors of R_p"),
        ({"sigma": {"R": 1e-3}}, "sigma has errors of R, of which there are no data"),
        ({"errors": "stated"}, "need a standard error for every datum"),
        ({"sample": "0 | free"}, "the index '0' is out of range: eta 0.001 to 1000"),
        ({"sample": "1-0.1i | free"}, "k 0 to 1000, N = eta . ik"),
        (
            {"sample": "1+1i | free"},
            r"the first medium, '1\+1i', .*lossless: a real number above 0",
        ),
        ({"sample": "stone | free"}, "'stone' is not an index"),
        ({"sample": "| free"}, "names no medium at one of its places"),
        ({"sample": "air | auto"}, "use choose for"),
        ({"R_s": np.full(16, 0.5 + 0j)}, "R_s must be real numbers .complex"),
        ({"angles_deg": ANGLES + 0j}, "angles_deg must be real numbers .complex"),
        ({"sigma": 1e-3 + 0j}, "sigma of R_s must be real numbers .complex"),
        ({"sigma": 1e-3, "errors": "no"}, "errors is 'no'; one of auto, stated"),
        ({"start": {"eta": 0.0, "k": 1.0}}, "start of eta holds 0 .* was wanted"),
        ({"start": 1.5}, "start is 1.5; .*eta"),
        ({"start": {"eta": 1.5 + 0j, "k": 0.0}}, "start of eta is .*real number.* was wanted"),
    ],
)
def test_a_call_that_makes_no_sense_says_what_was_wanted(change, words):
    data = table()
    call = {"angles_deg": ANGLES, "R_s": data["R_s"][0], "R_p": data["R_p"][0], **change}
    with pytest.raises(ValueError, match=words):
        fit_many(call.pop("angles_deg"), **call)


def test_what_a_bare_surface_does_not_show_is_refused():
    m = Measurement.from_columns(ANGLES, 0.5, T=np.full(16, 0.9))
    with pytest.raises(ValueError, match=r"T cannot be fitted .*bare surface.*mm thick"):
        fit(m)
    with pytest.raises(ValueError, match=r"auto, stated.*equal"):
        fit(Measurement.from_columns(ANGLES, R=np.full(16, 0.5)), errors="unit")


@pytest.mark.parametrize("what", [None, "gold.csv", np.zeros(16)])
def test_what_is_no_measurement_is_refused(what):
    with pytest.raises(ValueError, match=r"where a Measurement was wanted.*read_csv"):
        fit(what)


def straggling():
    """Curves of R_p from inside glass, of which one creeps for a hundred evaluations."""
    angles = np.linspace(50.0, 75.0, 30)
    index = np.array([2.1, 0.9 + 1e-3j, 1.33, 3.5 + 0.2j, 0.2 + 3.0j, 1.2, 4.0, 1.49] * 4)
    exact = of_index(angles, index[:, None], 1.5)["R_p"]
    return angles, exact + 3e-3 * np.random.default_rng(1).standard_normal(exact.shape)


@pytest.mark.study
def test_a_straggler_changes_no_answer_but_its_own_time():
    angles, R_p = straggling()
    sample = "1.5 | free"
    together = fit_many(angles, R_p=R_p, sample=sample)
    assert together.evaluations.max() > 10 * np.median(together.evaluations) or len() > 2
    for i in range(0, len(R_p), 3):
        alone = fit_many(angles, R_p=R_p[i], sample=sample)
        assert alone.status == together.status[i]
        np.testing.assert_allclose(together.eta[i], alone.eta, rtol=1e-6)
        np.testing.assert_allclose(together.k[i], alone.k, rtol=1e-5, atol=1e-9)
        np.testing.assert_allclose(together.cost[i], alone.cost, rtol=1e-9)


@pytest.mark.parametrize("sigma", [None, 1e-3])
def test_each_curve_may_have_angles_of_its_own(sigma):
    angles = np.stack([np.linspace(20.0, 80.0, 16), np.linspace(15.0, 75.0, 16)] * 6)
    rng = np.random.default_rng(0)
    data = {
        q: np.array([textbook(a, np.full(16, q), *i) for a, i in zip(angles, INDICES, strict=True)])
        + 1e-3 * rng.standard_normal((12, 16))
        for q in ("R_s", "R_p")
    }
    many = fit_many(angles, R_s=data["R_s"], R_p=data["R_p"], sigma=sigma)
    for i, own in enumerate(angles):
        one = fit_many(own, R_s=data["R_s"][i], R_p=data["R_p"][i], sigma=sigma)
        assert_same(one, many, i)
