"""The width of a spectrometer's slit: what it does to fringes, and that a fit finds it."""

import numpy as np
import pytest

from fitting import Measurement, fit, simulate

FILM = "air | cauchy:2 8000 nm | Si"
TRUTH = {"A": 1.46, "B": 0.0035, "thickness_nm": 8000.0}
NM = np.linspace(600.0, 640.0, 64)


def test_curves_are_means_over_the_slit():
    """By brute force: intensities, and psi and Delta as the mixture of light that they are of.

    A slit of 6 nm takes the fringes of this film, 15 nm wide, down to a third of their contrast.
    """
    x = np.linspace(-6.0, 6.0, 601)
    weight = np.exp(-0.5 * x * x)
    weight /= weight.sum()
    nm = NM[::16]
    grid = (nm[:, None] + x * 6.0 / np.sqrt(8.0 * np.log(2.0))) / 1e3

    def seen(quantity, wide=0.0):
        if wide:
            return simulate(FILM, TRUTH | {"bandwidth": wide}, 60.0, nm / 1e3, quantity)
        return simulate(FILM, TRUTH, 60.0, grid.ravel(), quantity).reshape(grid.shape)

    R_s, R_p = seen("R_s"), seen("R_p")
    np.testing.assert_allclose(seen("R_s", 6.0), R_s @ weight, atol=1e-4)
    np.testing.assert_allclose(seen("R_p", 6.0), R_p @ weight, atol=1e-4)
    psi, delta = np.radians(seen("psi")), np.radians(seen("delta"))
    each = np.cos(2 * psi), np.sin(2 * psi) * np.cos(delta), np.sin(2 * psi) * np.sin(delta)
    N, C, S = (((R_s + R_p) * part) @ weight for part in each)
    expected = 0.5 * np.degrees(np.arctan2(np.hypot(C, S), N))
    np.testing.assert_allclose(seen("psi", 6.0), expected, atol=0.01)
    away = seen("delta", 6.0) - np.degrees(np.arctan2(S, C))
    np.testing.assert_allclose((away + 180.0) % 360.0 - 180.0, 0.0, atol=0.01)


@pytest.mark.study
def test_a_fit_finds_the_slit():
    R = simulate(FILM, TRUTH | {"bandwidth": 4.0}, 0.0, NM / 1e3, "R")
    R = R + 1e-3 * np.random.default_rng(1).standard_normal(len(R))
    m = Measurement.from_columns(0.0, NM / 1e3, R=R, sigma=1e-3)
    sample, held = "air | cauchy:2 7000..9000 nm | Si", {"B": 0.0035}
    found = fit(m, sample, free="bandwidth", fixed=held, errors="stated", intervals="quadratic")
    for name, value in (("bandwidth", 4.0), ("thickness_nm", 8000.0), ("A", 1.46)):
        e = found.parameters[name]
        assert abs(e.value - value) < 4.0 * e.sigma, name
    assert found.parameters["bandwidth"].sigma < 0.2
    known = fit(m, sample, fixed=held | {"bandwidth": 4.0}, errors="stated", intervals="quadratic")
    narrow = fit(m, sample, fixed=held, errors="stated", intervals="quadratic")
    assert known.chi2_reduced < 1.5 < 20.0 < narrow.chi2_reduced
