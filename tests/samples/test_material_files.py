"""Materials from refractiveindex.info files and tables, against published indices; and written."""

from types import SimpleNamespace

import jax
import mpmath as mp
import numpy as np
import pytest

from fitting import simulate
from fitting.output.export import material_of
from fitting.output.files import material_files
from fitting.results.result_parts import IndexBand
from fitting.samples.known_media import known_medium
from fitting.samples.material_files import MaterialFileError, read_material
from fresnel_jax.dispersion import PublishedFormula, material

# (formula, coefficients, wavelength_um, index): files of the database (CC0) and what the site or
# the paper behind prints
PUBLISHED = [
    (1, "0 0.6961663 0.0684043 0.4079426 0.1162414 0.8974794 9.896161", 0.5875618, 1.458464),
    (2, "0 1.03961212 0.00600069867 0.231792344 0.0200179144 1.01046945 103.560653", 0.5875618,
     1.51680),
    (4, "5.913 0.2441 0 0.0803 1 0 0 0 1", 0.5875618, 2.614265),
    (4, "2.956362 0.0219577 0 0.01428322 1 0 0 0 1 -0.01062387 2 -2.04968e-05 4", 3.0, 1.691606),
    (5, "1.875 0.00628 -2 0.00058 -4", 1.0, 1.88186),
    (5, "1.513 -0.003169 2 0.003962 -2", 0.5875618, 1.523382),
    # Bideau-Mehu 1981, argon at standard conditions: (n - 1) 1e6 at .5462 um is 282
    (6, "0 2.50141e-3 91.012 5.00283e-4 87.892 5.22343e-2 214.02", 0.5462, 1.000282),
    # Edwards and Ochoa 1980, silicon; Salzberg and Villa 1957 measured 3.4408 and 3.4179
    (7, "3.41983 0.159906 -0.123109 1.26878E-6 -1.95104E-9", 2.4373, 3.4408),
    (7, "3.41983 0.159906 -0.123109 1.26878E-6 -1.95104E-9", 10.0, 3.4179),
    # Schroeter 1931, silver bromide; Crystran's data sheet has 2.25
    (8, "0.452505 0.09939 0.070537 -0.000150", 0.6, 2.25),
    # Rosker 1985, urea, extraordinary; about 1.60 in the visible
    (9, "2.51527 0.0240 0.0300 0.020 1.52 0.8771", 0.6, 1.60),
]  # fmt: skip


def by_definition(number, c, w):
    """The formulas of refractiveindex.info, coefficient by coefficient, in 30 digits."""
    c = [mp.mpf(x) for x in c] + [mp.mpf(0)] * 30
    w = mp.mpf(w)
    terms = [(c[i], c[i + 1]) for i in range(1, 21, 2)]
    if number == 1:
        return mp.sqrt(1 + c[0] + sum(a * w**2 / (w**2 - b**2) for a, b in terms))
    if number == 2:
        return mp.sqrt(1 + c[0] + sum(a * w**2 / (w**2 - b) for a, b in terms))
    if number == 3:
        return mp.sqrt(c[0] + sum(a * w**b for a, b in terms))
    if number == 4:
        first = c[1] * w ** c[2] / (w**2 - c[3] ** c[4])
        second = c[5] * w ** c[6] / (w**2 - c[7] ** c[8])
        return mp.sqrt(c[0] + first + second + sum(c[i] * w ** c[i + 1] for i in range(9, 25, 2)))
    if number == 5:
        return c[0] + sum(a * w**b for a, b in terms)
    if number == 6:
        return 1 + c[0] + sum(a / (b - w**-2) for a, b in terms)
    if number == 7:
        x = 1 / (w**2 - mp.mpf("0.028"))
        return c[0] + c[1] * x + c[2] * x**2 + c[3] * w**2 + c[4] * w**4 + c[5] * w**6
    if number == 8:
        x = c[0] + c[1] * w**2 / (w**2 - c[2]) + c[3] * w**2
        return mp.sqrt((1 + 2 * x) / (1 - x))
    return mp.sqrt(c[0] + c[1] / (w**2 - c[2]) + c[3] * (w - c[4]) / ((w - c[4]) ** 2 + c[5]))


@pytest.mark.parametrize("number, coefficients, wavelength, index", PUBLISHED)
def test_formulas_give_published_indices(number, coefficients, wavelength, index, tmp_path):
    file = tmp_path / "material.yml"
    file.write_text(
        "REFERENCES: |\n    Somebody, <i>J. Opt.</i> 1 (1980)\nDATA:\n"
        f"  - type: formula {number}\n"
        f"    wavelength_range: {0.9 * wavelength} {1.1 * wavelength}\n"
        f"    coefficients: {coefficients}\n"
    )
    found = read_material(file)(wavelength)
    assert float(found.eta) == pytest.approx(index, abs=6e-3 if number > 6 else 2e-6)
    assert float(found.k) == 0.0


@pytest.mark.parametrize("number", range(1, 10))
def test_formulas_against_their_definition(number):
    random = np.random.default_rng(number)
    for _ in range(5):
        c = {
            1: [0.1, 0.7, 0.07, 0.4, 0.12, 0.5, 20.0],
            2: [0.1, 1.0, 0.006, 0.23, 0.02, 0.5, 200.0],
            3: [2.3, 0.01, -2.0, 0.002, 2.0, 1e-3, -4.0, 1e-4, 1.5],
            4: [2.0, 0.3, 2.0, 0.1, 2.0, 0.02, 0.0, 0.15, 1.5, -0.01, 2.0, 0.001, -2.0],
            5: [1.5, 0.004, -2.0, -0.003, 2.0, 1e-4, -4.0],
            6: [1e-6, 5e-2, 240.0, 2e-3, 57.0],
            7: [3.4, 0.16, -0.12, 1e-6, -2e-9, 1e-12],
            8: [0.45, 0.1, 0.07, -1.5e-4],
            9: [2.5, 0.024, 0.03, 0.02, 1.52, 0.877],
        }[number]
        c = [x * random.uniform(0.9, 1.1) if number not in (3, 4, 5) else x for x in c]
        wavelength = random.uniform(0.5, 1.4)
        found = PublishedFormula(number, tuple(c))(wavelength).eta
        with mp.workdps(30):
            assert float(found) == pytest.approx(
                float(by_definition(number, c, wavelength)), rel=4e-15
            )


def test_tables_and_ranges(tmp_path):
    file = tmp_path / "glass.yml"
    file.write_text(
        "DATA:\n  - type: formula 5\n    wavelength_range: 0.3 2.5\n"
        "    coefficients: 1.5 0.004 -2\n"
        "  - type: tabulated k\n    data: |\n        0.4 1e-8\n        0.8 3e-8\n        1.2 2e-8\n"
    )
    glass = read_material(file)
    assert glass.range_um == (0.4, 1.2)
    assert float(glass(0.8).eta) == pytest.approx(1.5 + 0.004 / 0.64)
    assert float(glass(0.8).k) == pytest.approx(3e-8)
    with pytest.raises(ValueError, match="glass is known from 0.4 to 1.2 um"):
        glass(0.35)
    file.write_text(
        "DATA:\n  - type: tabulated nk\n    data: |\n        .6 .3 2.9\n        .5 .8 1.8\n"
    )
    assert [float(x) for x in read_material(file)(0.5)] == [0.8, 1.8]


def test_csv_with_units_blocks_and_marks(tmp_path):
    file = tmp_path / "gold.csv"
    for header, factor in (
        ("wavelength_um,n,k", 1.0), ('\ufeff"Wavelength, \u00b5m",n,k', 1.0),
        ("Wavelength (nm);n;k", 1e3), ("wl,n,k", 1.0), ("Wavelength\tn\tk", 1e3),
        ("energy_eV,n,k", None),
    ):  # fmt: skip
        mark = next((d for d in "\t;" if d in header), ",")
        rows = [
            (1.2398419843320025 / w if factor is None else w * factor, n, k)
            for w, n, k in ((0.5, 0.85, 1.9), (0.6, 0.25, 2.9), (0.7, 0.15, 3.7))
        ]
        file.write_text("\n".join([header, *(mark.join(f"{x:.12g}" for x in r) for r in rows)]))
        found = read_material(file)
        assert found.range_um == pytest.approx((0.5, 0.7)), header
        assert [float(x) for x in found(0.6)] == pytest.approx([0.25, 2.9]), header
    file.write_text("wl,n\n0.5,1.5\n0.7,1.48\n\nwl,k\n0.4,0.1\n0.6,0.2\n")
    assert read_material(file).range_um == (0.5, 0.6)


def test_written_index_is_read_again(tmp_path):
    wavelength = np.array([0.7, 0.5, 0.6])
    eta, k = np.array([2.05, 2.1, 2.07]), np.array([0.0, 1e-5, np.nan])
    sigma = np.array([0.01, 0.02, 0.03])

    def written(name, *index):
        file = SimpleNamespace(source='"film.csv": fresnel-fit\nsecond line', angle_deg=np.zeros(3))
        found = SimpleNamespace(
            index=lambda *_: IndexBand(*index), measurement=file, sample='air | "b"', parameters={},
            shape=(), status="converged", warnings=(),
        )  # fmt: skip
        paths = [file.path for file in material_files(tmp_path / name)]
        for path, text in zip(paths, material_of(found), strict=True):  # type: ignore[arg-type]
            path.write_text(text)
        return paths

    paths = written("film.yml", wavelength, eta, sigma, k, np.full(3, np.nan))
    assert [p.name for p in paths] == ["film.yml", "film_errors.csv"]
    found = read_material(paths[0])
    assert found.range_um == (0.5, 0.7)
    assert [float(x) for x in found(0.5)] == [2.1, 1e-5]
    _, *lines = paths[1].read_text().splitlines()
    assert lines[0] == "wavelength_um,n,k,sigma_n,sigma_k"
    assert lines[1:] == ["0.5,2.1,1e-05,0.02,", "0.7,2.05,0.0,0.01,"]
    # and by the CSV reader too
    assert [float(x) for x in read_material(paths[1])(0.7)] == [2.05, 0.0]
    with pytest.raises(ValueError, match="no file was written"):
        written("no.yml", *np.array([[0.5], [np.nan], [0.0], [0.0], [0.0]]))
    assert not (tmp_path / "no.yml").exists()


def formula(number, coefficients, limits="0.3 2"):
    return (
        f"DATA:\n  - type: formula {number}\n    wavelength_range: {limits}\n"
        f"    coefficients: {coefficients}\n"
    )


# Each line stands for nine times the one above; the last for 400 million texts.
BOMB = "a0: &a0 [x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 9)
)


@pytest.mark.parametrize("name, text, says", [
    ("a.yml", "DATA:\n  - type: formula 12\n    wavelength_range: 1 2\n", "formula 1 to formula 9"),
    ("a.yml", "DATA:\n  - type: formula 1\n    wavelength_range: 1\n    coefficients: 1\n", "two"),
    ("a.yml", "DATA:\n  - type: tabulated k\n    data: |\n      1 2\n      2 3\n", "and no n"),
    ("a.yml", "DATA:\n  - type: tabulated nk\n    data: |\n      1 2\n", "rows of 3 numbers"),
    ("a.yml", "DATA:\n  - type: tabulated n2\n    data: |\n      1 2\n      2 3\n", "and no n"),
    ("a.yml", formula(5, "1.5") + formula(5, "1.6")[6:], "n twice"),
    ("a.yml", "{", "not valid YAML"), ("a.yml", "hello", "no list DATA"),
    ("a.yml", f"DATA: {'[' * 3000}{']' * 3000}\n", "levels|depth"),
    ("a.yml", "{a: " * 3000, "levels"), ("a.yml", "- " * 3000, "levels"),
    ("a.yml", "DATA: !!int ''\n", "no list DATA"), ("a.yml", "DATA: !!bool foo\n", "no list"),
    ("a.yml", "DATA:\n  - type: !!timestamp foo\n", "DATA holds foo"),
    ("a.yml", BOMB, "alias"), ("a.yml", "DATA:\n" + "  - a: b\n" * 5000, "10000 parts"),
    ("a.yml", "DATA:\n  - type: tabulated nk\n    data: |\n" + "      1 2 3\n" * 500_000, "5 MB"),
    ("a.yml", formula(5, "1.5") + "    coefficients: 1.7\n", "'coefficients' stands twice"),
    ("a.yml", formula(5, "1_5"), "'1_5'; numbers"), ("a.yml", formula(5, "nan"), "not finite"),
    ("a.yml", formula(1, "0 1e308 1e308"), "gives n = inf"),
    ("a.yml", formula(5, "1e308"), "gives n = 1e\\+308"), ("a.yml", formula(5, "-1.5"), "n = -1.5"),
    ("a.yml", formula(4, "2 1 0 -2 0.5 0 0 0 0"), "n = "),
    ("a.yml", formula(4, "2 1 0 0 -1 0 0 0 0"), "gives n = inf"),
    ("a.yml", formula(4, "2 0.3"), "2 coefficients came; 1, 5, 9, 11"),
    ("a.yml", formula(2, "4.6 2.2 0.1 1.8"), "4 coefficients came; 1, 3, 5"),
    ("a.yml", formula(8, "1 1 1 1 1"), "5 coefficients came; 1 to 4"),
    ("a.yml", formula(5, "1.5", "0 1"), "0 to 1; two, above 0"),
    ("a.yml", "DATA:\n  - type: tabulated n\n    data: |\n      1 1e308\n      2 1\n", "above 1e"),
    ("a.csv", "x,n,k\n1,2,3\n", "none may be the wavelength"),
    ("a.csv", "wl,m\n1,2\n", "none may be the n"),
    ("a.csv", "1,2,3\n", "A header such as"), ("a.csv", "wavelength,n\n50,1\n500,2\n", "may be um"),
    ("a.csv", "wavelength_um,n,k\n1,2,-3\n2,2,3\n", "k"),
])  # fmt: skip
def test_refusals(name, text, says, tmp_path):
    file = tmp_path / name
    file.write_text(text)
    with pytest.raises(MaterialFileError, match=says) as error:
        read_material(file)
    assert name in str(error.value)
    with pytest.raises(MaterialFileError, match="cannot be opened"):
        read_material(tmp_path / "not there.yml")


def test_tables_of_others(measured_files):
    for path, wavelength in (("wvase_films/materials/gold.csv", 0.3), ("nk/Au_Johnson.csv", 0.1879),
                             ("formats/gold_bom_quoted_header.csv", 0.3),
                             ("wvase_films/materials/air.csv", 0.23)):  # fmt: skip
        assert read_material(measured_files / path).range_um[0] == pytest.approx(wavelength)


@pytest.mark.parametrize("traced", [False, True])
def test_a_known_medium_does_not_depend_on_where_it_is_first_asked_for(traced):
    ask = jax.jit(lambda w: known_medium("silicon").model.index(w).eta)
    known_medium.cache_clear()
    with jax.enable_x64(traced):
        ask(0.5) if traced else known_medium("silicon")
    R = simulate("Si", {}, 0.0, 0.5)
    known_medium.cache_clear()
    with jax.enable_x64(True):
        n = complex(*material("Si")(np.float64(0.5)))
    np.testing.assert_allclose(R, abs((n - 1) / (n + 1)) ** 2, rtol=1e-14)


def test_light_may_come_from_water_with_its_k(tmp_path):
    water, um = tmp_path / "water.csv", np.array([0.5, 0.6])
    water.write_text("wavelength_um,n,k\n0.4,1.34,1e-8\n0.7,1.34,1e-7\n1.0,1.34,1e-3\n")
    clear = simulate("1.34 | Si", {}, 30.0, um)
    for first in (water, "1.34+1e-7i"):
        np.testing.assert_allclose(simulate(f"{first} | Si", {}, 30.0, um), clear, rtol=1e-6)
    with pytest.raises(ValueError, match="light comes from water, whose k is 0.0.* at 0.9 um"):
        simulate(f"{water} | Si", {}, 30.0, [0.5, 0.9])
    with pytest.raises(ValueError, match="known and lossless"):
        simulate("1.34+1e-4i | Si", {}, 30.0, um)
