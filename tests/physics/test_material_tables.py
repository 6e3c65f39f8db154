"""Named materials against the tables that they were fitted to, and against other laboratories."""

import numpy as np
import pytest

from fresnel_jax import reflectance
from fresnel_jax.dispersion import material

pytestmark = pytest.mark.slow


def columns(folder, name):
    """Wavelength, n, k of a reference table; rows without k left out."""
    rows = np.genfromtxt(folder / "nk" / f"{name}.csv", delimiter=",", skip_header=1)
    return rows[np.isfinite(rows).all(axis=1)].T


@pytest.mark.parametrize(
    "name, table",
    [
        ("BK7", "N-BK7_Schott"),
        ("SF11", "SF11_Schott"),
        ("N-SF11", "N-SF11_Schott"),
        ("soda-lime glass", "soda-lime-clear_Rubin"),
        ("fused silica", "SiO2_Malitson"),
        ("sapphire", "Al2O3_Malitson-o"),
        ("sapphire e", "Al2O3_Malitson-e"),
        ("diamond", "C_Peter"),
        ("water", "H2O_Daimon-20.0C"),
        ("CaF2", "CaF2_Malitson"),
        ("MgF2", "MgF2_Dodge-o"),
        ("MgO", "MgO_Stephens"),
        ("rutile", "TiO2_Devore-o"),
        ("HfO2", "HfO2_Al-Kuhaili"),
        ("Si3N4", "Si3N4_Luke"),
        ("PMMA", "PMMA_Sultanova"),
        ("SiC", "SiC_Wang-4H-o"),
        ("GaAs", "GaAs_Skauli"),
    ],
)
def test_formulas_agree_with_reference_tables(measured_files, name, table):
    """Tables evaluated elsewhere from the same coefficients; wavelength and n have 6 digits.

    Half a unit of the fifth decimal, and as much of a micrometre times dn/dl up to .6 per um.
    """
    wavelength, n, _ = columns(measured_files, table)
    model = material(name).model  # a table's ends may be rounded outwards
    np.testing.assert_allclose(model(wavelength).eta, n, atol=8e-6)


@pytest.mark.parametrize(
    "name, wavelength_um, n",
    [
        # the catalogues' index at the helium d line
        ("SF10", 0.5875618, 1.72825),
        ("BaF10", 0.5875618, 1.67003),
        ("LaSF9", 0.5875618, 1.85025),
        # tables of the papers named, as data sheets of infrared optics print them
        ("ZnSe", 10.6, 2.4028),
        ("silicon infrared", 4.0, 3.4255),
        ("germanium infrared", 10.6, 4.0038),
    ],
)
def test_printed_indices_of_glasses_and_infrared_optics(name, wavelength_um, n):
    tolerance = 6e-6 if wavelength_um < 1 else 1e-3
    assert float(material(name)(wavelength_um).eta) == pytest.approx(n, abs=tolerance)


def test_silicon_of_both_ranges_agrees_where_they_overlap():
    wavelength = np.linspace(1.36, 1.45, 10)
    visible, infrared = material("silicon")(wavelength), material("silicon infrared")(wavelength)
    np.testing.assert_allclose(visible.eta, infrared.eta, atol=0.005)


def test_brass_is_yellow():
    """Blue is absorbed, and the table ends where the publication's is cut."""
    blue, red = (float(reflectance(1.0, *material("brass")(x))) for x in (0.45, 0.65))
    assert blue < 0.5 < 0.85 < red
    with pytest.raises(ValueError, match="brass"):
        material("brass")(1.1)


RAKIC = dict(
    zip(
        ("Ag", "Au", "Cu", "Al", "Be", "Cr", "Ni", "Pd", "Pt", "Ti", "W"),
        ("silver", "gold", "copper", "aluminium", "beryllium", "chromium", "nickel", "palladium",
         "platinum", "titanium", "tungsten"),
        strict=True,
    )
)  # fmt: skip


@pytest.mark.parametrize("symbol", RAKIC)
def test_brendel_bormann_metals_agree_with_reference_tables(measured_files, symbol):
    """Printed to five digits of wavelength, n and k, and from an older value of h c / e."""
    wavelength, n, k = columns(measured_files, f"{symbol}_Rakic-BB")
    index = material(f"{symbol} Rakic BB").model(wavelength)
    np.testing.assert_allclose(index.eta, n, rtol=3e-4)
    np.testing.assert_allclose(index.k, k, rtol=3e-4)
    # both fits describe one set of measurements
    other = material(f"{RAKIC[symbol]} Rakic LD").model(wavelength)
    visible = (wavelength > 0.4) & (wavelength < 0.8)
    R, R_other = (np.asarray(reflectance(1.0, *x))[visible] for x in (index, other))
    assert np.abs(R - R_other).max() < 0.15


@pytest.mark.parametrize(
    "name, table",
    [
        ("gold", "Au_Johnson"),
        ("silver", "Ag_Johnson"),
        ("copper", "Cu_Johnson"),
        ("silicon", "Si_Green-2008"),
        ("germanium", "Ge_Aspnes"),
        ("iron", "Fe_Johnson"),
    ],
)
def test_tables_are_the_published_ones(measured_files, name, table):
    wavelength, n, k = columns(measured_files, table)
    index = material(name)(wavelength)
    np.testing.assert_array_equal(index.eta, n)
    np.testing.assert_array_equal(index.k, k)


@pytest.mark.parametrize(
    "name, table, tolerance",
    [
        # other laboratories, other films: reflectance at normal incidence over the visible
        ("gold", "Au_Olmon-ev", 0.06),
        ("silver", "Ag_Yang", 0.03),
        ("silicon", "Si_Schinke", 0.01),
        ("germanium", "Ge_Nunley", 0.03),
        ("aluminium", "Al_McPeak", 0.03),
    ],
)
def test_reflectance_agrees_with_other_laboratories(measured_files, name, table, tolerance):
    wavelength, n, k = columns(measured_files, table)
    visible = (wavelength > 0.4) & (wavelength < 0.78)
    R = reflectance(1.0, *material(name)(wavelength[visible]))
    np.testing.assert_allclose(R, reflectance(1.0, n[visible], k[visible]), atol=tolerance)


def test_interpolation_error_that_the_docstring_states(measured_files):
    """Every second row left out and found again: rms of n."""
    from fresnel_jax.dispersion import Tabulated

    for table, stated in (("Ge_Nunley", 0.002), ("Au_Johnson", 0.02), ("Si_Green-2008", 0.045)):
        wavelength, n, k = columns(measured_files, table)
        model = Tabulated(wavelength[::2], n[::2], k[::2])
        left_out = slice(1, -1, 2)
        difference = np.asarray(model(wavelength[left_out]).eta) - n[left_out]
        assert np.sqrt(np.mean(difference**2)) < stated, table
