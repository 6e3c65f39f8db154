"""Named materials: printed values, reference tables, and every record's source and range."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fresnel_jax import fresnel_dielectric, materials, reflectance
from fresnel_jax.dispersion import material
from fresnel_jax.polarization import absorption_depth

every_material = pytest.mark.parametrize("name", materials.names())


@pytest.mark.parametrize(
    "name, eta, printed",
    [
        ("ice", 1.31, 0.0180),
        ("water", 1.333, 0.0204),
        ("fused quartz", 1.46, 0.0350),
        ("glass", 1.5, 0.0400),
        ("sapphire", 1.77, 0.0773),
        ("diamond", 2.42, 0.1724),
    ],
)
def test_table_of_indices(name, eta, printed):
    """Reflectance at normal incidence to the four digits that ((n - 1)/(n + 1))^2 has by hand."""
    assert materials.INDICES[name] == eta
    assert abs(float(fresnel_dielectric(1.0, materials.INDICES[name])) - printed) <= 0.5e-4


def test_table_of_indices_is_whole():
    expected = {"vacuum": 1.0, "air": 1.00029, "crown glass": 1.5, "flint glass": 1.6}
    assert {name: materials.INDICES[name] for name in expected} == expected
    assert len(materials.INDICES) == 10
    assert material("ice")(0.5).eta == 1.31 and material("vacuum")(1e-4).eta == 1.0
    with pytest.raises(ValueError, match="ice is known from"):
        material("ice")(10.0)
    with pytest.raises(TypeError):
        materials.INDICES["water"] = 1.0


@jax.jit
def slopes(model, wavelengths):
    """d(eta + k) / d wavelength; one program for all materials of one structure."""
    return jax.vmap(jax.grad(lambda w: sum(model.index(w))))(wavelengths)


@every_material
def test_every_record_names_its_source_and_covers_its_range(name):
    record = materials.lookup(name)
    assert record.name == name and record.source
    assert record.kind in ("dielectric", "conductor", "semiconductor")
    assert record.doi == "" or re.fullmatch(r"10\.\d{4,}/\S+", record.doi)
    model = material(name)
    assert model.range_um == record.range_um and model.name == name
    low, high = record.range_um or (0.1, 100.0)
    wavelengths = np.geomspace(low, high, 301)
    wavelengths[[0, -1]] = low, high
    eta, k = (np.asarray(x) for x in model(wavelengths))
    assert (eta > 0).all() and (k >= 0).all() and np.isfinite(eta + k).all()
    if record.kind == "dielectric":
        assert not k.any()
    if record.kind == "conductor":
        assert (k[(wavelengths > 0.4) & (wavelengths < 0.8)] > 1.0).all()
    assert np.isfinite(slopes(model.model, wavelengths)).all()
    rounded = wavelengths.astype(np.float32)
    single = model(rounded)
    assert single.eta.dtype == np.float32
    double = model(np.clip(rounded.astype(float), low, high))
    # knots rounded to float32: 1e-5 of a step of 1 % of the wavelength, in which k falls to a third
    rounding = 2e-5 if record.form == "table" else 5e-6
    np.testing.assert_allclose(single, double, rtol=rounding, atol=1e-12)


def test_three_classes_by_one_routine():
    """Dielectric, conductor, semiconductor at 550 nm; R of the last two in print to two digits."""
    R = {name: float(reflectance(1.0, *material(name)(0.55))) for name in
         ("BK7", "gold", "silver", "silicon", "germanium")}  # fmt: skip
    assert abs(R["BK7"] - 0.042) < 0.0005
    assert 0.75 < R["gold"] < 0.85 and R["silver"] > 0.97
    assert abs(R["silicon"] - 0.37) < 0.01 and abs(R["germanium"] - 0.52) < 0.02
    assert set(materials.names("semiconductor")) == {
        "silicon", "silicon infrared", "germanium", "germanium infrared", "GaAs", "SiC", "ZnSe",
    }  # fmt: skip
    kinds = [set(materials.names(k)) for k in ("dielectric", "conductor", "semiconductor")]
    assert sum(map(len, kinds)) == len(set.union(*kinds)) == len(materials.names())


def test_metals_are_opaque_at_a_tenth_of_a_micrometre():
    visible = np.linspace(0.38, 0.78, 41)
    for name in materials.names("conductor"):
        depth = absorption_depth(visible, material(name)(visible).k)
        assert float(depth.max()) < 0.05
        assert float(jnp.exp(-0.1 / depth).max()) < 0.1


# Wavelengths of the Fraunhofer lines F, d, C and of sodium D in um
F, D, C, SODIUM = 0.4861327, 0.5875618, 0.6562725, 0.5892938


@pytest.mark.parametrize(
    "name, wavelength, eta",
    [
        # SCHOTT data sheets N-BK7, SF11, N-SF11
        ("BK7", D, 1.51680),
        ("BK7", F, 1.52238),
        ("BK7", C, 1.51432),
        ("SF11", D, 1.78472),
        ("N-SF11", D, 1.78472),
        # Malitson 1965, table I; Malitson 1963, table II, at the line of helium
        ("fused silica", 0.587562, 1.458464),
        ("fused silica", 1.01398, 1.450242),
        ("CaF2", D, 1.43384),
        # Dodge 1984; Malitson and Dodge 1972
        ("MgF2", D, 1.37774),
        ("sapphire", D, 1.76817),
        # Daimon and Masumura 2007, 20 C
        ("water", SODIUM, 1.33335),
        ("diamond", SODIUM, 2.4173),
        ("Si3N4", 1.55, 1.9963),
    ],
)
def test_printed_indices(name, wavelength, eta):
    """To one and a half units of the last digit printed."""
    digits = len(str(eta).split(".")[1])
    assert abs(float(material(name)(wavelength).eta) - eta) <= 1.5 * 10.0**-digits


def test_abbe_number_of_bk7():
    n_f, n_d, n_c = material("BK7")(np.array([F, D, C])).eta
    assert abs((n_d - 1) / (n_f - n_c) - 64.17) < 0.01  # SCHOTT data sheet


def test_lorentz_drude_gold_as_published():
    """Rows of the table that was computed from Rakic 1998 for the refractiveindex.info database."""
    rows = np.array(
        [
            [0.24797, 1.0941, 1.5478],
            [0.40285, 1.4112, 1.7490],
            [0.54779, 0.50606, 2.3486],
            [0.63363, 0.31127, 3.1534],
            [1.01290, 0.25970, 6.0788],
            [6.19920, 5.0974, 38.118],
        ]
    )
    # rows carry five digits of wavelength too, and n falls as the 6th power of it at .55 um
    index = material("gold Rakic LD")(rows[:, 0])
    np.testing.assert_allclose(np.stack(index, 1), rows[:, 1:], rtol=2e-4)


def test_names_are_found_in_any_spelling():
    for spelling in ("gold", "Gold", " au ", "AU"):
        assert materials.lookup(spelling).name == "gold"
    for spelling in ("Fused_Silica", "fused-silica", "SiO2"):
        assert materials.lookup(spelling).name == "fused silica"
    assert materials.lookup("aluminum").name == "aluminium Rakic BB"
    assert materials.lookup("N-BK7").name == "BK7"
    seen: dict[str, str] = {}
    for name in materials.names():
        for spelling in (name, *materials.lookup(name).aliases):
            assert materials.lookup(spelling).name == name
            assert seen.setdefault(spelling, name) == name


@pytest.mark.parametrize(
    "wrong, near", [("sliver", "silver"), ("BK 8", "BK7"), ("saphire", "sapp")]
)
def test_unknown_names_list_near_ones(wrong, near):
    with pytest.raises(ValueError, match=rf"no material named '{wrong}'; similar names:.*{near}"):
        material(wrong)


def test_wrong_questions_are_refused():
    with pytest.raises(ValueError, match=r"no material named 'xqzw'; fresnel_jax.materials.names"):
        materials.lookup("xqzw")
    with pytest.raises(ValueError, match="kind is 'metal'; wanted 'dielectric'"):
        materials.names("metal")


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
