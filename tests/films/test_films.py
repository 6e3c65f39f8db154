"""Films: what the text of a sample means, where thicknesses start, what a fit says of them."""

import numpy as np
import pytest

from fitting import Measurement, choose, fit, simulate
from fitting.samples.known_media import Mixture
from fitting.samples.sample import Sample
from fitting.searching.fringes import Grid, harmonic_sums, likely_thicknesses, phase_rate
from fresnel_jax.dispersion import material
from fresnel_jax.effective_medium import bruggeman
from tests.truth import stack_oracle

WAVES = np.linspace(0.4, 0.9, 16)


def parameters_of(text: str) -> set[str]:
    sample = Sample.parse(text)
    assert Sample.parse(str(sample)) == sample
    return {
        f"{prefix}{name}"
        for medium, prefix in zip(sample.media, sample.prefixes, strict=True)
        if isinstance(medium.index, Mixture)
        for name in medium.index.fractions
    }


def test_text_of_mixtures_and_files(tmp_path):
    file = tmp_path / "film.csv"
    file.write_text("wavelength_um,n,k\n0.3,1.6,0\n1.0,1.5,0\n")
    assert parameters_of("water | bruggeman(SiO2, water 30 %) 3 nm | Si") == {"fraction"}
    assert parameters_of("air | linear(1.5, air 5..60 %, water 10 % held) 3 nm | Si") == {
        "fraction_1", "fraction_2",
    }  # fmt: skip
    sample = Sample.parse(f"air | rough 2 nm | {file} 110 nm graded | Si")
    assert sample.layers[0].index.shares[0].held  # type: ignore
    assert sample.layers[1].thickness.graded  # type: ignore
    assert sample.films and not sample.bare


@pytest.mark.parametrize("text, says", [
    ("air | bruggeman(SiO2) 3 nm | Si", "two or more parts in brackets"),
    ("air | bruggeman(SiO2, water) 3 nm | Si", "has no share"),
    ("air | bruggeman(SiO2, water 130 %) 3 nm | Si", "from 0 to 100 % was wanted"),
    ("air | bruggeman(cauchy, lorentz 10 %) 3 nm | Si", "only one part may be a dispersion model"),
    ("air | looyenga(1.5, air 5 %, depolarization 0.5) 3 nm | Si", "only bruggeman takes a depol"),
    ("air | bruggeman(1.5, air 5 %, depolarization 1.5) 3 nm | Si", "from 0 to 1"),
    ("air | nothing.yml 3 nm | Si", "cannot be opened"),
    ("air | 1.5 3 mm thick graded | Si", "'thick' and 'graded' exclude"),
    ("air | 1.5 3 nm fast | Si", "'fast' came after the thickness, where 'thick'"),
])  # fmt: skip
def test_refused_texts(text, says):
    with pytest.raises(ValueError, match=says):
        Sample.parse(text)


def test_grains_that_are_no_spheres():
    """Sheets across the field, depolarization 1: the inverse permittivities add up (Wiener)."""
    mixed = (0.7 / 4.0 + 0.3 / 1.0) ** -0.5
    shown = [
        simulate(f"air | {film} 100 nm held | Si", {}, 0.0, WAVES[:2], "R")
        for film in ("bruggeman(2.0, air 30 % held, depolarization 1)", mixed)
    ]
    np.testing.assert_allclose(*shown, rtol=1e-12)


def stacked(index, thickness_um):
    """Return R at normal incidence by characteristic matrices in mpmath."""
    media = np.broadcast_arrays(*index, WAVES)[:-1]
    each = zip(np.stack(media, axis=1).tolist(), WAVES, strict=True)
    return np.array([float(stack_oracle.stack(1.0, n, thickness_um, w, 30)[0]) for n, w in each])


def test_samples_are_the_stacks_that_they_name():
    si = material("Si")(WAVES)
    n_si = np.asarray(si.eta) + 1j * np.asarray(si.k)
    film = {"film_2.eta": 1.5, "film_2.k": 0.0}
    # half of air, half of the film below
    shown = simulate("air | rough 20 nm held | constant 100 nm held | Si", film, 0.0, WAVES, "R")
    mixed = float(bruggeman([1.0, 1.5], [0.0, 0.0], [0.5]).eta)
    np.testing.assert_allclose(shown, stacked([1.0, mixed, 1.5, n_si], [0.02, 0.1]), rtol=1e-6)
    # from the film to the substrate in eight steps
    shown = simulate(
        "air | 1.5 100 nm held | interface 20 nm held | Si", {}, 0.0, WAVES, "R"
    )  # fmt: skip
    one = np.ones_like(WAVES)
    steps = []
    for share in (np.arange(8) + 0.5) / 8:
        mixture = bruggeman([1.5 * one, si.eta], [0.0 * one, si.k], [share])
        steps.append(np.asarray(mixture.eta) + 1j * np.asarray(mixture.k))
    expected = stacked([1.0, 1.5, *steps, n_si], [0.1, *[0.02 / 8] * 8])
    np.testing.assert_allclose(shown, expected, rtol=1e-9)


def test_film_on_a_plate_with_its_back_face():
    """R and T of a lossless film on a lossless plate add up to 1, and are Airy's on both sides."""
    sample = "air | 1.38 100 nm held | 1.52 1 mm thick | air"
    R, T = (simulate(sample, {}, 0.0, WAVES, q) for q in ("R", "T"))
    np.testing.assert_allclose(R + T, 1.0, rtol=1e-12)
    front = stacked([1.0, 1.38, 1.52], [0.1])
    back = (0.52 / 2.52) ** 2
    # lossless: the front reflects alike from both sides
    np.testing.assert_allclose(T, (1 - front) * (1 - back) / (1 - front * back), rtol=1e-10)


@pytest.mark.parametrize("thickness", [0.3, 2.2, 17.0])
def test_fringes_tell_the_thickness(thickness):
    random = np.random.default_rng(3)
    wave = 1.0 / np.linspace(1.0 / 0.9, 1.0 / 0.45, 900)
    A, B = random.uniform(1.3, 2.5, 30), random.uniform(0.0, 0.02, 30)
    A[4], B[4] = 1.7, 0.01
    rates = phase_rate(A[:, None] + B[:, None] / wave**2, wave, np.zeros(900), 1.0)
    # two curves of other contrasts and phases, on slopes
    values = np.stack([
        0.2 + 0.1 / wave + 0.05 * np.cos(2 * np.pi * thickness * rates[4] + 0.7),
        0.7 - 0.03 * wave * np.sin(2 * np.pi * thickness * rates[4]),
    ]) + 0.003 * random.standard_normal((2, 900))  # fmt: skip
    which, where = likely_thicknesses(rates, 0.005, 20.0, values, np.ones((2, 900)), 12)
    # the optical thickness, whatever the index
    found = (where[:, None] * rates[which]).mean(axis=1)
    assert np.abs(found / (thickness * rates[4].mean()) - 1.0).min() < 0.2 / thickness / 2.0
    assert np.median(np.abs(found - thickness * rates[4].mean())) < 1.0


@pytest.mark.parametrize(
    ("rate", "count"), [(3.0, 4000), (900.0, 700), (0.2, 161), (40.0, 90), (40.0, 1)]
)
def test_sums_over_the_data_at_many_thicknesses(rate, count):
    """By a Fourier transform as one by one, also where the phase turns often between two steps."""
    random = np.random.default_rng(11)
    rates, vectors = rate * random.uniform(0.5, 3.0, 257), random.standard_normal((3, 257))
    grid = Grid(np.geomspace(1e-3, 1e-2, 5), 0.0123, 0.0031, count)
    exact = vectors @ np.exp(2j * np.pi * np.outer(rates, grid.thickness_um))
    off = np.abs(harmonic_sums(vectors, rates, grid) - exact)
    # 1e-11 of the window, and the rounding of phases
    bound = 1e-11 + 1e-15 * rates.max() * grid.thickness_um.max()
    assert (off / np.abs(vectors).sum(1, keepdims=True)).max() < bound


def measured(sample, values, sigma, angle=0.0, waves=None, seed=0, quantities=("R",)):
    waves = np.linspace(0.4, 0.9, 120) if waves is None else waves
    random = np.random.default_rng(seed)
    columns = {
        q: simulate(sample, values, angle, waves, q) + sigma * random.standard_normal(len(waves))
        for q in quantities
    }
    return Measurement.from_columns(angle, waves, sigma=sigma, **columns)


@pytest.mark.study
def test_the_right_order_is_found_in_a_wide_range():
    truth = {"A": 1.46, "B": 0.0035, "thickness_nm": 3210.0}
    m = measured("air | cauchy:2 1 nm | Si", truth, 0.002)
    found = fit(m, "air | cauchy:2 5..20000 nm | Si", intervals="quadratic")
    thickness = found.parameters["thickness_nm"]
    assert abs(thickness.value - 3210.0) < 4.0 * thickness.sigma < 40.0
    # a narrow band leaves the order open, and that is said
    narrow = measured(
        "air | cauchy:2 1 nm | Si", truth, 0.01, waves=np.linspace(0.62, 0.66, 120)
    )  # fmt: skip
    found = fit(
        narrow, "air | cauchy:2 2500..4000 nm | Si", fixed={"B": 0.0035}, intervals="quadratic"
    )  # fmt: skip
    shown = [found.parameters["thickness_nm"].value]
    shown += [a.parameters["thickness_nm"].value for a in found.alternatives]
    assert min(abs(d - 3210.0) for d in shown) < 60.0


@pytest.mark.study
def test_a_film_or_none():
    bare = measured("Si", {}, 0.002, angle=60.0, quantities=("R_s", "R_p"))
    text = "Si or air | SiO2 1..60 nm | Si"
    assert choose(bare, text, intervals="quadratic").taken.label == "Si"
    coated = measured(
        "air | SiO2 1 nm | Si", {"thickness_nm": 12.0}, 0.002, angle=60.0, quantities=("R_s", "R_p")
    )
    choice = choose(coated, text, intervals="quadratic")
    assert choice.taken.label.startswith("air | SiO2")
    thickness = choice.fit.parameters["thickness_nm"]
    assert abs(thickness.value - 12.0) < 4.0 * thickness.sigma


def test_free_film_refusals():
    waves = np.array([0.5, 0.6])
    m = Measurement.from_columns(65.0, waves, psi=[30.0, 31.0], delta=[100.0, 110.0])
    with pytest.raises(ValueError, match="Add a second angle"):
        fit(m, "water | free 5..50 nm | Si")
    with pytest.raises(ValueError, match="needs a range for its thickness"):
        fit(m, "water | free 20 nm | Si")


@pytest.mark.study
def test_free_film_with_a_shared_thickness():
    waves, angle = np.repeat(np.linspace(0.4, 0.8, 5), 2), np.tile([60.0, 72.0], 5)
    film = {
        "eps_inf": 1.2, "amplitude_ev_1": 60.0, "resonance_ev_1": 4.0, "width_ev_1": 2.0,
        "gap_ev": 1.2, "thickness_nm": 30.0,
    }  # fmt: skip
    random = np.random.default_rng(0)
    psi, delta = (
        simulate("water | tauc-lorentz 1 nm | Si", film, angle, waves, q)
        + error * random.standard_normal(10)
        for q, error in (("psi", 0.01), ("delta", 0.02))
    )
    m = Measurement.from_columns(
        angle, waves, psi=psi, delta=delta % 360.0, sigma={"psi": 0.01, "delta": 0.02}
    )
    found = fit(m, "water | free 10..60 nm | Si", errors="stated")
    thickness = found.parameters["thickness_nm"]
    assert thickness.status == "shared"
    assert abs(thickness.value - 30.0) < 4.0 * thickness.sigma < 8.0
    assert found.shape == (5,)
    assert (found.parameters["eta"].sigma > 0.0).all()


@pytest.mark.study
def test_what_absorbs_above_the_measured_range_is_part_of_a_free_form_index():
    """20 splines describe a Tauc-Lorentz surface whose absorption goes on beyond 5.5 eV."""
    waves = np.repeat(1.2398 / np.linspace(1.2, 5.5, 40), 2)
    angle = np.tile([60.0, 70.0], 40)
    truth = {
        "eps_inf": 1.2, "amplitude_ev_1": 90.0, "resonance_ev_1": 4.0, "width_ev_1": 2.2,
        "gap_ev": 1.4,
    }  # fmt: skip
    error, random = {"psi": 0.02, "delta": 0.1}, np.random.default_rng(6)
    seen = {
        q: simulate("tauc-lorentz", truth, angle, waves, q) + error[q] * random.standard_normal(80)
        for q in error
    }
    m = Measurement.from_columns(angle, waves, **seen, sigma=error)
    found = fit(m, "kk-spline:20", intervals="quadratic", starts=16)
    # 137 degrees of freedom and a bias of the spline; 90 and more with knots over the range alone
    assert found.chi2_reduced < 2.5


@pytest.mark.study
def test_free_form_index_of_a_surface():
    """A kk-spline finds a Tauc-Lorentz truth that it knows nothing of, and more knots nearer."""
    waves = np.repeat(1.2398 / np.linspace(1.2, 5.5, 40), 2)
    angle = np.tile([60.0, 70.0], 40)
    truth = {
        "eps_inf": 1.2, "amplitude_ev_1": 90.0, "resonance_ev_1": 4.0, "width_ev_1": 2.2,
        "gap_ev": 1.4,
    }  # fmt: skip
    psi, delta = (simulate("tauc-lorentz", truth, angle, waves, q) for q in ("psi", "delta"))
    m = Measurement.from_columns(angle, waves, psi=psi, delta=delta)
    found = fit(m, "kk-spline:12", intervals="quadratic")
    assert found.status == "converged"
    at = np.linspace(0.3, 0.9, 7)
    expected = simulate("tauc-lorentz", truth, 70.0, at, "psi")
    shown = found.predict(np.full(7, 70.0), "psi", at).value
    np.testing.assert_allclose(shown, expected, atol=0.5)
    # Its knots would be those of the points: another index at 0.5 um, whatever stands beside it.
    for waves in (0.5, [0.5, 0.6]):
        with pytest.raises(ValueError, match="cannot be simulated without a fit"):
            simulate("kk-spline:12", dict.fromkeys(found.names, 1.0), 60.0, waves, "R")


@pytest.mark.study
def test_the_thickness_of_a_free_film_is_at_the_minimum():
    """Exact data give the exact thickness; the search ended .17 nm beside it, and called that .02.

    A place of the search that was the best one but for its last bit hid all that lay beyond.
    """
    angle, wave = (x.ravel() for x in np.meshgrid(np.arange(20.0, 81.0, 10.0), [0.45, 0.55, 0.65]))
    true = {"A": 2.637, "B": 0.02, "thickness_nm": 39.838269257}
    text = "air | cauchy:2 30 nm | Si"
    R = {q: simulate(text, true, angle, wave, q) for q in ("R_s", "R_p")}
    m = Measurement.from_columns(angle, wave, sigma=0.001, **R)
    found = fit(m, "air | free 19.919..63.741 nm | Si", intervals="quadratic")
    assert np.ravel(found.parameters["thickness_nm"].value)[0] == pytest.approx(39.838269257)
    # At one wavelength thickness, eta and k are three unknowns of one fit, and of its covariance.
    one = fit(m.where(m.wavelength_um == 0.55), "air | free 19.919..63.741 nm | Si")
    assert one.parameters["thickness_nm"].value == pytest.approx(39.838269257)
    assert one.dof == 11 and one.covariance.shape == (3, 3)
    assert "thickness_nm" in str(one) and "thickness_nm" in str(found[0])


@pytest.mark.study
def test_errors_of_an_index_that_only_its_product_with_the_thickness_determines():
    """6 nm of eta 1.64 or 136 nm of eta 1.008: chi2 differs by .5; the error of eta was .003."""
    true = {"A": 1.615, "B": 0.0048, "C": 0.00025, "thickness_nm": 6.13}
    waves = np.linspace(0.43, 1.28, 60)
    R = simulate("air | cauchy:3 6 nm | Si", true, 0.0, waves, "R")
    R = R + 1e-3 * np.random.default_rng(3).standard_normal(60)
    m = Measurement.from_columns(0.0, waves, R=R, sigma=1e-3)
    found = fit(m, "air | cauchy:3 5..20000 nm | Si", errors="stated")
    low, high = found.parameters["thickness_nm"].interval
    assert low <= 6.13 <= high
    at = found.index(np.array([0.5, 0.9]))
    eta = 1.615 + 0.0048 / at.wavelength_um**2 + 0.00025 / at.wavelength_um**4
    assert (np.abs(at.eta - eta) < 2.0 * at.sigma_eta).all()
    shown = found.predict(75.0, "psi", 0.5)
    wanted = simulate("air | cauchy:3 6 nm | Si", true, 75.0, 0.5, "psi")
    assert (np.abs(shown.value - wanted) < 2.0 * shown.sigma).all()
    # With the thickness known the index is, too, and its error is that of the covariance.
    known = fit(m, "air | cauchy:3 6.13 nm held | Si", errors="stated", intervals="quadratic")
    profiled = fit(m, "air | cauchy:3 6.13 nm held | Si", errors="stated", intervals="profile")
    for one, other in zip(known.index(0.6), profiled.index(0.6), strict=True):
        np.testing.assert_allclose(one, other, rtol=0.05)
