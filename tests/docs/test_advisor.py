"""The advice for a scene against brute force with textbook formulas in NumPy.

Brute force gives a lower bound of each largest error; that the error is attained is shown at the
place that the advice names. Neither needs a tolerance for the width of a grid. All named scenes,
and more random ones, are held by `make advisor-study`: advice for one takes ten seconds.
"""

import os
import subprocess
import sys

import numpy as np
import pytest

from examples import advisor
from examples.advisor import BANDS, LIGHT, Model, Scene, advise
from examples.advisor.boundary import Boundary
from tests.docs.advisor_oracle import (
    EPS,
    FORMS,
    SCENES,
    TEXTBOOK_ERROR,
    advice,
    brute,
    errors,
    media_at,
)

pytestmark = pytest.mark.docs  # of `make test-docs`
STUDY = int(os.environ.get("FRESNEL_SCENES", "0"))  # random scenes, and all named ones
# Total reflection, absorption with dispersion, indices next to 1.
NAMES = list(SCENES) if STUDY else ["water from below", "gold", "X-ray mirror"]
in_each_scene = pytest.mark.parametrize("name", NAMES)


@pytest.mark.study
@in_each_scene
def test_no_error_of_brute_force_is_larger(name):
    for label, found in advice(name).findings.items():
        if label == "float32":
            continue
        for light, worst in zip(LIGHT, found[2:], strict=True):
            assert brute(name, found.model, light) <= worst.error + TEXTBOOK_ERROR, label


@in_each_scene
def test_every_error_is_attained_where_the_advice_says(name):
    for label, found in advice(name).findings.items():
        if label == "float32":
            continue
        for light, worst in zip(LIGHT, found[2:], strict=True):
            # Some differences jump: where two bands meet, and, of forms that are 1 in total
            # reflection, at the critical angle. The advice holds for the limit from either side.
            angles = worst.angle_deg * (1.0 + 2.0 * EPS * np.arange(-2, 3))
            if found.model.bands == 3:
                ends = [np.nextafter(worst.wavelength_um, x) for x in (0.0, 1.0)]
            else:
                ends = [worst.wavelength_um]
            at = np.meshgrid(ends, np.clip(angles, *SCENES[name].angle_deg), indexing="ij")
            there = np.max(errors(name, found.model, *at, light))
            assert there == pytest.approx(worst.error, abs=TEXTBOOK_ERROR), label


@in_each_scene
def test_float32_is_bounded_by_the_corners_of_rounded_arguments(name):
    found = advice(name).findings["float32"]
    eps = np.finfo(np.float32).eps
    for light, worst in zip(LIGHT, found[2:], strict=True):
        # what rounding the arguments costs, and 8 eps of the kernel
        expected = brute(name, found.model, light)
        assert expected <= worst.bound <= 3 * expected + 12 * eps


def random_scenes(count):
    """Lossless and absorbing media, entered and left, dispersive, in any range of angles."""
    random = np.random.default_rng(20261122)
    for i in range(count):
        slope, k = random.uniform(-1.0, 1.0), random.choice([0.0, 10.0 ** random.uniform(-4, 1)])
        n = 10.0 ** random.uniform(-0.3, 0.6)

        def medium(wavelength, n=n, slope=slope, k=k):
            x = np.asarray(wavelength) - 0.55
            return n * (1.0 + slope * x), k * np.exp(3.0 * slope * x)

        low, high = sorted(random.uniform(0.0, 90.0, 2))
        ends = (low, 90.0) if i % 3 == 0 else (low, high)
        accuracy = 10.0 ** random.uniform(-6.5, -1)
        eta_i = random.choice([1.0, random.uniform(1.0, 2.0)])
        yield Scene({"medium": medium}, (0.4, 0.7), ends, accuracy, eta_i)


@pytest.mark.study
@pytest.mark.parametrize("scene", list(random_scenes(STUDY or 2)))
def test_bounds_of_random_scenes_by_brute_force(scene, monkeypatch):
    """What is stated, and what is recommended, stays within its bound, in its precision."""
    monkeypatch.setitem(SCENES, "random", scene)
    media_at.cache_clear()
    brute.cache_clear()
    found = advise(scene)
    candidates = [*found.findings.values(), *found.cheapest.values()]
    for finding in candidates:
        for light, worst in zip(LIGHT, finding[2:], strict=True):
            if worst is not None:
                seen = brute("random", finding.model, light, 13, 1501)
                assert seen <= worst.bound + TEXTBOOK_ERROR * (worst.bound > TEXTBOOK_ERROR)
    for light, finding in found.cheapest.items():
        assert brute("random", finding.model, light, 13, 1501) <= scene.accuracy
    media_at.cache_clear()
    brute.cache_clear()


@in_each_scene
def test_the_cheapest_is_enough_and_nothing_cheaper_is(name):
    scene = SCENES[name]
    for light, found in advice(name).cheapest.items():
        assert brute(name, found.model, light) <= scene.accuracy + TEXTBOOK_ERROR
        for form in FORMS:
            for bands in BANDS:
                share = bands / scene.samples if bands else 1.0
                for dtype, cost in advisor.FORMS[form].costs.items():
                    if cost * share < found.cost:
                        model = Model(form, bands, dtype)
                        # the bound that is held against the accuracy has a hundredth more, and
                        # the rounding of float32
                        seen = brute(name, model, light, 7, 300)
                        assert 1.01 * seen + 64 * np.finfo(np.float32).eps > scene.accuracy, model


def test_what_each_scene_needs():
    """What physics says: which simplifications are free, and which are hopeless."""
    free = {name: {x for x, y in advice(name).findings.items() if y.polarized.error < 1e-13}
            for name in NAMES}  # fmt: skip
    assert all(("k = 0" in free[x]) == (x in ("window glass", "water from below")) for x in NAMES)
    assert advice("gold").findings["k = 0"].unpolarized.error > 0.5
    assert advice("gold").findings["one wavelength"].unpolarized.error > 0.3
    assert advice("water from below").findings["one wavelength"].unpolarized.error > 0.3
    # s and p are one at X-ray wavelengths: the index is 1 to 1e-5
    assert advice("X-ray mirror").findings["unpolarized"].polarized.error < 1e-4


def test_several_materials_count_with_the_worst():
    materials = {"metal": (1.0, 5.0), "tinted": 1.5 + 0.01j}
    scene = Scene(materials, (0.5, 0.5), (0.0, 0.0))
    found = advise(scene)
    assert set(found.findings).isdisjoint({"one wavelength", "three bands"})
    worst = found.findings["k = 0"].unpolarized
    assert worst.material == "metal" and worst.error == pytest.approx(25 / 29, abs=1e-12)
    assert "metal" in found.table()
    assert max(map(len, found.table().splitlines())) <= 110
    assert "* : within the accuracy wanted" in found.table()
    assert "fresnel_jax." in found.table()


def test_a_table_is_evaluated_at_its_knots():
    """A spike of 1e-4 um lies between two wavelengths of the grid."""
    table = [0.4, 0.42039, 0.42049, 0.42059, 0.5], [1.5, 1.5, 4.0, 1.5, 1.5], [0.0] * 5
    boundary = Boundary("spike", table, 1.0, (0.4, 0.5), (0.0, 0.0), advisor.FORMS)
    worst = boundary.worst(Model(bands=1), "unpolarized")
    assert worst.wavelength_um == pytest.approx(0.42049, rel=1e-8)
    assert worst.error == pytest.approx(0.36 - 0.04, rel=1e-8)


def test_a_peak_without_width():
    """Where gold has eta = 1 it has no boundary without its k, but reflects all light at 90."""
    assert advice("gold").findings["k = 0"].unpolarized.error > 0.99999


@pytest.mark.parametrize(
    "change, text",
    [
        ({"materials": {}}, "empty"),
        ({"wavelength_um": (0.7, 0.4)}, "wavelength_um"),
        ({"angle_deg": (0.0, 91.0)}, "angle_deg"),
        ({"accuracy": 0.0}, "accuracy"),
        ({"materials": {"x": "unobtainium"}}, "unobtainium"),
        ({"materials": {"x": -1.5}}, "x: an index"),
        ({"eta_i": 1.5 + 0.1j}, "lossless"),
        ({"materials": {"x": (1.0, 2.0, 3.0, 4.0)}}, "4 values"),
    ],
)
def test_refusals(change, text):
    given = {"materials": {"glass": 1.5}, "wavelength_um": (0.4, 0.7)} | change
    with pytest.raises(ValueError, match=text):
        advise(Scene(**given))


def test_command(tmp_path, capsys):
    from examples.advisor.__main__ import main

    picture = tmp_path / "scene.png"
    assert main(["1.5", "--wavelength-um", "0.5", "0.5", "--plot", str(picture)]) == 0
    assert "schlick" in capsys.readouterr().out
    assert picture.read_bytes().startswith(b"\x89PNG")
    table = tmp_path / "glass.csv"
    table.write_text("wavelength_um,eta,k\n0.4,1.5,0\n0.7,1.4,0\n")
    assert main([str(table), "--wavelength-um", "0.4", "0.7", "--angle-deg", "0", "0"]) == 0
    assert main(["unobtainium"]) == 2
    assert "unobtainium" in capsys.readouterr().err


def test_matplotlib_is_not_imported_and_a_missing_one_is_named(monkeypatch, capsys):
    code = "import sys, examples.advisor.__main__\nprint(*sys.modules)"
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert "matplotlib" not in answer.stdout.split()
    from examples.advisor import __main__ as command

    monkeypatch.setattr(command.importlib.util, "find_spec", lambda name: None)
    assert command.main(["1.5", "--plot", "x.png"]) == 2
    assert "pip install matplotlib" in capsys.readouterr().err
