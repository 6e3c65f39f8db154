"""A fitted index that no material has, or hardly any, is told."""

import numpy as np
import pytest

from fitting import Measurement, fit, simulate

pytestmark = pytest.mark.slow

WAVES = np.linspace(0.4, 0.9, 32)


@pytest.mark.parametrize("dispersion, told", [(-0.002, ["eta"]), (0.01, []), (0.0, [])])
def test_an_index_that_rises_with_the_wavelength_is_told(dispersion, told):
    """62 nm of a clear film had ended as 10.5 nm, of eta 3.0 in the blue and 4.8 in the red."""
    noise = 1e-3 * np.random.default_rng(0).standard_normal(32)
    truth = {"A": 2.0, "B": dispersion}
    shown = simulate("air | cauchy:2 150 nm held | 3.9", truth, 0.0, WAVES, "R")
    m = Measurement.from_columns(0.0, WAVES, R=shown + noise, sigma=1e-3)
    sample, wide = "air | cauchy:2 120..180 nm | 3.9", {"B": (-0.1, 0.1)}
    found = fit(m, sample, bounds=wide, intervals="quadratic", starts=8)
    rising = [f.values["indices"] for f in found.findings if f.code == "rising_index"]
    assert rising == [(name,) for name in told]
    assert ("rises with the wavelength" in str(found).replace("\n              ", "")) == bool(told)
    # By default the range of B ends where the index of a clear material does, and is left only
    # where chi2 asks for it; that is said first. A range of the caller's own is never left.
    usual = fit(m, sample, intervals="quadratic", starts=8)
    low, high = usual.parameters["B"].interval
    assert low <= dispersion <= high
    assert ([w.code for w in usual.warnings[:1]] == ["range_left"]) == (dispersion < 0.0)
    if dispersion < 0.0:
        assert usual.warnings[0].values["gain"] > 6.0
        own = fit(m, sample, intervals="quadratic", starts=8, bounds={"B": (0.0, 0.1)})
        assert own.parameters["B"].value == 0.0 and own.chi2 > usual.chi2 + 6.0
    assert simulate("cauchy:2", truth, 0.0, 0.5, "R") > 0.0  # any value, where it is given


LOW = [
    # a porous film; magnesium fluoride; a porous film on a metal, by two quantities
    ("air | cauchy:2 200..400 nm | 3.9", {"A": 1.15, "B": 0.001, "thickness_nm": 300.0},
     ("R",), 1.156),
    ("air | cauchy:2 50..150 nm | 3.9", {"A": 1.38, "B": 0.001, "thickness_nm": 90.0}, ("R",), 0.0),
    ("air | constant 200..300 nm | 0.2+3.1i", {"eta": 1.2, "k": 0.0, "thickness_nm": 250.0},
     ("R_s", "R_p"), 1.2),
    # a metal: eta is low, but it absorbs
    ("air | constant 20..60 nm | 1.5", {"eta": 0.15, "k": 3.5, "thickness_nm": 40.0},
     ("R_s", "R_p"), 0.0),
]  # fmt: skip


@pytest.mark.parametrize("sample, truth, quantities, told", LOW)
def test_a_low_index_of_what_does_not_absorb_is_told(sample, truth, quantities, told):
    """22 nm of a clear film on silicon had ended as 73 nm of eta 1.05 without a word."""
    random = np.random.default_rng(5)
    shown = {
        q: simulate(sample, truth, 0.0 if q == "R" else 50.0, WAVES, q)
        + 1e-4 * random.standard_normal(len(WAVES))
        for q in quantities
    }
    angle = 0.0 if "R" in quantities else 50.0
    m = Measurement.from_columns(angle, WAVES, **shown, sigma=1e-4)
    free = "k" if "k" in truth else ()
    found = fit(m, sample, free=free, intervals="quadratic", starts=8)
    assert found.parameters["thickness_nm"].value == pytest.approx(truth["thickness_nm"], rel=0.02)
    most = [f.values["most"] for f in found.findings if f.code == "low_index"]
    assert most == ([pytest.approx(told, abs=0.01)] if told else [])


@pytest.mark.study
def test_the_film_of_low_index_is_named():
    sample = "air | cauchy:2 50..150 nm | tauc-lorentz:1"
    truth = {
        "film.A": 1.15, "film.B": 0.001, "film.thickness_nm": 90.0, "substrate.eps_inf": 2.0,
        "substrate.amplitude_ev_1": 100.0, "substrate.resonance_ev_1": 3.8,
        "substrate.width_ev_1": 2.0, "substrate.gap_ev": 1.6,
    }  # fmt: skip
    shown = {q: simulate(sample, truth, 60.0, WAVES, q) for q in ("psi", "delta")}
    m = Measurement.from_columns(60.0, WAVES, **shown, sigma=0.02)
    found = fit(m, sample, intervals="quadratic", starts=8, start=truth)
    assert found.parameters["film.thickness_nm"].value == pytest.approx(90.0, rel=0.02)
    assert [f.values["indices"] for f in found.findings if f.code == "low_index"] == [("film.eta",)]


# A film on a substrate of index m reflects nearly as one of index m / eta does: the first had been
# 159 nm of eta 1.06, where chi2 is lower by 0.9, the second 947 nm of an eta that rose from 0.81.
ON_GLASS = [
    ({"A": 1.38, "B": 0.004, "C": 1e-4, "thickness_nm": 84.2}, 0.002, [1, 842, 0, 20]),
    ({"A": 1.75, "B": 0.01, "C": 2e-4, "thickness_nm": 78.5}, 0.005, [1, 785, 2, 50]),
]


@pytest.mark.parametrize("truth, sigma, seed", ON_GLASS)
def test_of_minima_between_which_noise_decides_that_of_a_solid_is_shown(truth, sigma, seed):
    sample, waves = "air | cauchy 10..1000 nm | 1.52", np.linspace(0.4, 0.8, 41)
    noise = sigma * np.random.default_rng(seed).standard_normal(41)
    R = simulate(sample, truth, 45.0, waves, "R") + noise
    # Errors a tenth larger than the noise: no chi2 is doubtful, and no cause of it is looked for.
    found = fit(Measurement.from_columns(45.0, waves, R=R, sigma=1.1 * sigma), sample)
    low, high = found.parameters["thickness_nm"].interval
    assert low < truth["thickness_nm"] < high
    band = found.index(0.55)
    eta = truth["A"] + truth["B"] / 0.55**2 + truth["C"] / 0.55**4
    assert abs(band.eta[0] - eta) < 2.0 * band.sigma_eta[0] < 0.5
    assert not {"rising_index", "low_index"} & {f.code for f in found.findings}
    if truth["A"] < 1.5:  # the lower minimum is listed, with what it is lower by
        least = min(found.alternatives, key=lambda a: a.delta_chi2)
        assert -6.0 < least.delta_chi2 < 0.0 and least.parameters["A"].value < 1.1
