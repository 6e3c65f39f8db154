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


@pytest.mark.study
@every_material
def test_every_record_has_slopes_and_is_the_same_in_float32(name):
    record, model = materials.lookup(name), material(name)
    low, high = record.range_um or (0.1, 100.0)
    wavelengths = np.geomspace(low, high, 301)
    wavelengths[[0, -1]] = low, high
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


@pytest.mark.study
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
