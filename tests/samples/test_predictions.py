"""What a model shows against the library's own functions, and each nuisance by hand."""

from typing import Any

import jax
import numpy as np
import pytest

from fitting import Measurement, Sample, fit, simulate
from fresnel_jax import powers
from fresnel_jax.dispersion import Cauchy, DrudeLorentz, material
from fresnel_jax.effective_medium import bruggeman
from fresnel_jax.layers import Uniaxial, slab, stack
from fresnel_jax.polarization import psi_delta
from tests.truth import stack_oracle

pytestmark = pytest.mark.slow

CAUCHY = {"A": 1.5, "B": 0.012, "C": 0.0}


def grid():
    points = np.meshgrid([45.0, 65.0, 75.0], np.linspace(0.4, 0.9, 14))
    return tuple(a.ravel() for a in points)


def seen_of(sample, values, quantities):
    """These quantities on the grid, a row each, by one program."""
    angle, wavelength = (np.tile(x, len(quantities)) for x in grid())
    names = np.repeat(quantities, angle.size // len(quantities))
    return simulate(sample, values, angle, wavelength, names).reshape(len(quantities), -1)


def test_predict_is_the_library():
    angle, wavelength = grid()
    c = np.cos(np.radians(angle))
    index = Cauchy([1.5, 0.012, 0.0])(wavelength)
    one = powers(c, *index)
    names = ("R_s", "R_p", "T_s", "T_p", "R", "T")
    for q, found in zip(names, seen_of("cauchy", CAUCHY, names), strict=True):
        np.testing.assert_allclose(found, getattr(one, q), rtol=1e-13, atol=1e-16)
    both = slab(c, *index, thickness_um=100.0, wavelength_um=wavelength)
    found = simulate("air | cauchy 100 um thick | air", CAUCHY, angle, wavelength, "T")
    np.testing.assert_allclose(found, both.T, rtol=1e-13)
    metal = {"eps_inf": 2.0, "plasma_ev": 8.0, "width_ev": 0.1, "strength_ev2_1": 3.0,
             "resonance_ev_1": 2.5, "width_ev_1": 0.6}  # fmt: skip
    index = DrudeLorentz([64.0, 3.0], [0.0, 2.5], [0.1, 0.6], 2.0)(wavelength)
    angles = psi_delta(c, *index)
    found = seen_of("drude-lorentz", metal, ("psi", "delta"))
    np.testing.assert_allclose(found, np.degrees(angles), rtol=1e-11)


def test_a_thickness_that_is_one_number_in_the_text_is_that_of_the_sample():
    angle, values = np.linspace(0.0, 80.0, 9), CAUCHY | {"thickness_nm": 110.0}
    ranged = simulate("air | cauchy 50..200 nm | Si", values, angle, 0.6, "R_p")
    assert (simulate("air | cauchy 110 nm | Si", CAUCHY, angle, 0.6, "R_p") == ranged).all()
    assert (simulate("air | cauchy 90 nm | Si", values, angle, 0.6, "R_p") == ranged).all()
    with pytest.raises(ValueError, match="needs a value of thickness_nm"):
        simulate("air | cauchy 50..200 nm | Si", CAUCHY, angle, 0.6, "R_p")


UNIAXIAL = "air | uniaxial(cauchy:1, birefringence 0.1) 150..300 nm | 3.88+0.02i"


def test_a_uniaxial_film_is_that_of_the_library_and_is_fitted():
    angle, wavelength = grid()
    c, media = np.cos(np.radians(angle)), [1.0, Uniaxial(1.6, 1.68), 3.88 + 0.02j]
    values = {"A": 1.6, "birefringence": 0.08, "thickness_nm": 210.0}
    both = "air | uniaxial(1.6, 1.68) 210 nm held | 3.88+0.02i"
    with jax.enable_x64(True):
        true = stack(c, media, thickness_um=[0.21], wavelength_um=wavelength, exact=False)
    R_s, R_p = seen = seen_of(UNIAXIAL, values, ("R_s", "R_p"))
    np.testing.assert_allclose(seen, [true.R_s, true.R_p], rtol=1e-11)
    np.testing.assert_allclose(seen_of(both, {}, ("R_s", "R_p")), seen, rtol=1e-11)
    found = fit(Measurement.from_columns(angle, wavelength, R_s=R_s, R_p=R_p), UNIAXIAL).parameters
    for name, value in values.items():
        assert found[name].value == pytest.approx(value, rel=1e-6)


def test_a_uniaxial_substrate():
    """A film on sapphire cut across its axis: ordinary 1.768, extraordinary 1.760 (589 nm)."""
    angle = np.array([0.0, 50.0, 75.0])
    media, c = [1.0, 1.46, (1.768, 1.760)], np.cos(np.radians(angle))
    true = np.array([stack_oracle.stack(x, media, [0.1], 0.589)[:2] for x in c], float).T
    sample = "air | 1.46 100 nm | uniaxial(1.768, 1.760)"
    for quantity, R in zip(("R_s", "R_p"), true, strict=True):
        found = simulate(sample, {}, angle, 0.589, quantity)
        np.testing.assert_allclose(found, R, rtol=1e-10)
    with pytest.raises(ValueError, match="or the substrate below films"):
        Sample.parse("air | uniaxial(1.768, 1.760)")


@pytest.mark.parametrize(("medium", "message"), [
    ("uniaxial(1.5, 1.6, tilt 30) 9 nm", "tilted axes"),
    ("uniaxial(1.5, 1.6) 1 mm thick", "must be a film"),
    ("uniaxial(cauchy, cauchy) 9 nm", "one of them may be a dispersion model"),
    ("uniaxial(cauchy, birefringence 0.2..0.1) 9 nm", "the smaller birefringence"),
])  # fmt: skip
def test_uniaxial_media_that_are_refused(medium, message):
    with pytest.raises(ValueError, match=message):
        Sample.parse(f"air | {medium} | Si")


def test_nuisances_act_as_they_say():
    angle, wavelength = np.array([30.0, 60.0]), np.full(2, 0.5)
    values = {"eta": 1.5, "k": 0.1}

    def seen(quantity, at=angle, **extra):
        return simulate("constant", values | extra, at, wavelength, quantity)

    np.testing.assert_allclose(
        seen("R_s", scale=0.9, background=0.01), 0.9 * seen("R_s") + 0.01, rtol=1e-14
    )
    np.testing.assert_allclose(seen("R_p", angle_offset=0.5), seen("R_p", angle + 0.5), rtol=1e-13)
    mixed = 0.98 * seen("R_p") + 0.02 * seen("R_s")
    np.testing.assert_allclose(seen("R_p", leak=0.02), mixed, rtol=1e-13)
    np.testing.assert_allclose(seen("R", leak=0.02), seen("R"), rtol=1e-13)
    # a Gaussian beam by brute force
    x = np.linspace(-9.0, 9.0, 4001)
    weight = np.exp(-x * x / 2.0) / np.exp(-x * x / 2.0).sum()
    for i in range(2):
        many = simulate("constant", values, angle[i] + 0.8 * x, 0.5, "R_p")
        assert seen("R_p", divergence=0.8)[i] == pytest.approx(weight @ many, rel=1e-9)


def test_refusals():
    with pytest.raises(ValueError, match="has no parameter 'D'"):
        simulate("cauchy", CAUCHY | {"D": 1.0}, 45.0, 0.5, "R")
    with pytest.raises(ValueError, match="needs a value of B"):
        simulate("cauchy:2", {"A": 1.5}, 45.0, 0.5, "R")
    for quantity in ("Delta", ["psi", "Delta"], "r_s"):  # once a number without meaning
        with pytest.raises(ValueError, match=r"no quantity .*; one of R_s, .*, psi, .*, S was"):
            simulate("Si", {}, 60.0, 0.5, quantity)
    for angle in (100.0, -10.0, np.nan, "60", []):
        with pytest.raises(ValueError, match=r"angles? of "):
            simulate("Si", {}, angle, 0.5)
    for wave in (-0.5, 0.0, np.inf, [0.5, -1.0], "0.5"):
        with pytest.raises(ValueError, match="wavelength_um"):
            simulate("air | 1.5 100 nm held | 3.5", {}, 10.0, wave)
    with pytest.raises(ValueError, match=r"shapes \(2,\), \(\), \(3,\) came"):
        simulate("Si", {}, [10.0, 20.0], [0.5, 0.6, 0.7])
    none: Any = None
    with pytest.raises(ValueError, match="parameters is None"):
        simulate("Si", none, 10.0, 0.5)
    with pytest.raises(ValueError, match="leaves its dispersion model open"):
        simulate("auto", {}, 10.0, 0.5)


def test_points_of_ones_own_do_not_change_the_sample():
    # Once edge_ev was the highest energy of the points, and so k at 0.6 um that of what is beside.
    tail: dict[str, Any] = {"A": 1.5, "k_edge": 0.1, "urbach_ev": 0.3}
    with pytest.raises(ValueError, match="needs a value of edge_ev"):
        simulate("cauchy-urbach:1", tail, 10.0, [0.5, 0.6])
    tail["edge_ev"] = 2.0
    both = simulate("cauchy-urbach:1", tail, 10.0, [0.5, 0.6])
    assert both[1] == simulate("cauchy-urbach:1", tail, 10.0, 0.6)[0]
    # A metal in the infrared: its plasma energy is 200 photons, and once was refused for that.
    metal = {"eps_inf": 1.0, "plasma_ev": 9.0, "width_ev": 0.02}
    energy = 1.2398419843320025 / 30.0
    n = np.sqrt(1.0 - 81.0 / (energy * (energy + 0.02j)))
    R = abs((1.0 - n) / (1.0 + n)) ** 2
    assert simulate("drude", metal, 0.0, 30.0)[0] == pytest.approx(R, rel=1e-12)


def test_light_from_a_material_is_computed_in_float64():
    """The index of the first medium was float32: 6e-8 of it, and 4e-6 of R of a thick plate."""
    wave = np.random.default_rng(5).uniform(0.4, 0.8, 20)
    with jax.enable_x64(True):
        water = material("water")(wave).eta
        exact = powers(np.cos(np.radians(70.0)), 2.1, 0.0, water).R_s
    found = simulate("water | 2.1", {}, 70.0, wave, "R_s")
    np.testing.assert_allclose(found, exact, rtol=1e-13)


def test_r_back_is_that_of_a_plate_between_equal_media():
    """Elsewhere R of the front was given for it: .042 for .009 of a plate on water."""
    for text in ("air | 1.5+1e-5i 1 mm thick | 1.33", "air | 1.5 1 mm thick | 2.0 1 mm thick | air",
                 "air | 1.5 100 nm held | air"):  # fmt: skip
        with pytest.raises(ValueError, match="R_back is .* not computed"):
            simulate(text, {}, 10.0, 0.5, "R_back")
    same = simulate("1.2 | 1.5+1e-5i 1 mm thick | 1.2", {}, 10.0, 0.5, ["R", "R_back"])
    assert same[0] == same[1]


def test_samples_that_mean_nothing():
    for text in ("air | rough", "air | rough 2 mm thick | Si", "air | interface 3 nm graded | Si",
                 "air | rough 2 nm | interface 3 nm | Si",
                 "air | bruggeman(SiO2, water 60 % held, air 70 % held) 9 nm | Si",
                 "air | bruggeman(SiO2, free 30 %) 9 nm | Si",
                 "air | bruggeman(SiO2, rough 30 %) 9 nm | Si",
                 "air | bruggeman(SiO2, water 30 %)) 9 nm | Si"):  # fmt: skip
        with pytest.raises(ValueError, match=r"^the (sample|mixture) '"):
            Sample.parse(text)
    text = "air | bruggeman(1.5, 1.3 30 %, 1.7 30 %) 9 nm held | Si"
    shares = {"fraction_1": 0.6, "fraction_2": 0.7}  # -30 % of the first: no number
    assert np.isnan(simulate(text, shares, 10.0, 0.5)).all()


@pytest.mark.study
def test_a_fit_is_evaluated_only_where_it_says_something():
    sample, wave = "1.333 | rough 9 nm held | cauchy:2 100 nm | Si", np.linspace(0.4, 0.8, 25)
    true: Any = {"film_2.A": 1.6, "film_2.B": 0.005, "film_2.thickness_nm": 100.0}
    psi, delta = (simulate(sample, true, 70.0, wave, q) for q in ("psi", "delta"))
    m = Measurement.from_columns(70.0, wave, psi=psi, delta=delta, sigma=0.01)
    found = fit(m, sample, start=true, starts=1, intervals="quadratic")
    # The wavelength that was not given was 1 um, and tables went on beyond their ends.
    with pytest.raises(ValueError, match="give it"):
        found.predict([30.0, 60.0], "R")
    for ask in (lambda: found.predict(30.0, "R", 20.0), lambda: found.index(20.0, "substrate")):
        with pytest.raises(ValueError, match="silicon is known from"):
            ask()
    with pytest.raises(ValueError, match="angle of incidence of 100"):
        found.predict(100.0, "R", 0.5)
    with pytest.raises(ValueError, match="R_back is .* not computed"):
        found.predict(30.0, "R_back", 0.5)
    # The rough layer is half water: it was taken for half air.
    with jax.enable_x64(True):
        half = bruggeman([1.333, 1.6 + 0.005 / 0.25], [0.0, 0.0], [0.5])
    assert found.index(0.5, "film_1").eta[0] == pytest.approx(float(half.eta), rel=1e-9)
