"""The examples run, draw their pictures, and print numbers that the textbook forms confirm.

Of the library nothing is used here: reflectances are those of `textbook`.
"""

import importlib
import os
import re
import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.truth import stack_oracle
from tests.truth.textbook import reflectances

pytestmark = pytest.mark.docs  # of `make test-docs`
EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.fixture
def example(monkeypatch):
    """Imports an example by its name, as running it as a script would."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    return importlib.import_module


def drawn(path: Path) -> np.ndarray:
    """The picture's pixels; an empty picture is a failure."""
    from matplotlib.image import imread

    pixels = imread(path)
    assert min(pixels.shape[:2]) > 400
    assert np.std(pixels[..., :3]) > 0.05
    return pixels


def textbook(cos_i, eta_i, eta_t):
    """(R_s, R_p, cos_t) of a lossless boundary below the critical angle."""
    found = reflectances(cos_i, eta_t, eta_i)
    return found["R_s"], found["R_p"], np.sqrt(1.0 - (eta_i / eta_t) ** 2 * (1.0 - cos_i**2))


def test_gold_and_glass_as_a_command(tmp_path):
    picture = tmp_path / "folder" / "gold.png"
    root = str(EXAMPLES.parent)
    run = subprocess.run(
        [sys.executable, "-W", "error", EXAMPLES / "gold_and_glass.py", picture, "--size", "60"],
        env=os.environ | {"PYTHONPATH": root, "JAX_PLATFORMS": "cpu"},
        cwd=tmp_path, capture_output=True, text=True, check=True,
    )  # fmt: skip
    drawn(picture)
    blue, _, red, _, glass, _ = map(float, re.findall(r"\d\.\d+", run.stdout.splitlines()[0]))
    rgb = [float(x) for x in run.stdout.splitlines()[1].partition(":")[2].split()]
    # Johnson and Christy's table has 1.38 + 1.914i at .4509 um and .14 + 3.697i at .6595 um, with
    # errors of .02 to .03 in each number: 1 % of R.
    for found, eta, k in ((blue, 1.38, 1.914), (red, 0.14, 3.697)):
        assert found == pytest.approx(((eta - 1) ** 2 + k**2) / ((eta + 1) ** 2 + k**2), abs=0.015)
    # N-BK7 at the helium d line: SCHOTT's catalogue gives 1.51680; six digits are printed.
    assert glass == pytest.approx((0.5168 / 2.5168) ** 2, abs=2e-6)
    assert rgb[0] > rgb[1] > rgb[2]


@pytest.mark.study
def test_film_colours(example, tmp_path):
    results = example("film_colours").main([str(tmp_path / "films.png"), "--size", "24"])
    drawn(tmp_path / "films.png")
    assert results["found_nm"] == pytest.approx(results["true_nm"], rel=1e-9)


def test_snells_window(example, tmp_path, capsys):
    results = example("snells_window").main([str(tmp_path / "window.png"), "--size", "48"])
    drawn(tmp_path / "window.png")
    assert results["half_angle_deg"] == pytest.approx(np.degrees(np.arcsin(1 / 1.333)), rel=1e-14)
    share = 1.0 - np.sqrt(1.0 - 1.333**-2)
    assert results["window"] == pytest.approx(share, rel=1e-14)
    # 192 points across: those on the rim are in or out as a whole, which is 1 in 400 of the disc.
    assert results["window_seen"] == pytest.approx(share, abs=2.5e-3)
    printed = capsys.readouterr().out
    assert "48.606626 degrees" in printed
    assert "0.338775" in printed


def test_fermat(example, tmp_path, capsys):
    fermat = example("fermat")
    results = fermat.main([str(tmp_path / "fermat.png"), "--size", "9"])
    drawn(tmp_path / "fermat.png")
    printed = [float(x) for x in re.findall(r"\d+\.\d{12}", capsys.readouterr().out)]
    sine_i, sine_t = np.sin(np.deg2rad(printed))
    assert sine_i == pytest.approx(1.5 * sine_t, rel=1e-12)
    assert results["largest_difference_rad"] <= 1e-12
    # Both ways through the boundary, from next to the normal to grazing.
    for eta_i, eta_t in ((1.0, 1.5), (1.5, 1.0), (1.333, 2.42)):
        separation = np.geomspace(1e-3, 1e3, 60)
        _, angle_i, angle_t = fermat.fermat(separation, 1.0, 0.7, eta_i, eta_t)
        sine_i, sine_t = np.sin(np.deg2rad([angle_i, angle_t]))
        np.testing.assert_allclose(eta_i * sine_i, eta_t * sine_t, rtol=1e-12)


def sf11(wavelength_um):
    """(eta, d eta / d lambda): SCHOTT's Sellmeier coefficients of SF11."""
    B, C = (1.73848403, 0.311168974, 1.17490871), (0.0136068604, 0.0615960463, 121.922711)
    L2 = wavelength_um**2
    eta = np.sqrt(1.0 + sum(b * L2 / (L2 - c) for b, c in zip(B, C, strict=True)))
    slope = -wavelength_um * sum(b * c / (L2 - c) ** 2 for b, c in zip(B, C, strict=True)) / eta
    return eta, slope


def test_prism(example, tmp_path):
    prism = example("prism")
    results = prism.main([str(tmp_path / "prism.png"), "--size", "160"])
    drawn(tmp_path / "prism.png")
    half = np.deg2rad(30.0)
    eta, slope = sf11(0.55)
    # The symmetric passage: sin((A + delta) / 2) = eta sin(A / 2).
    outer = np.arcsin(eta * np.sin(half))
    assert results["deviation_deg"] == pytest.approx(np.degrees(2 * (outer - half)), rel=1e-12)
    spread = np.degrees(2.0 * np.sin(half) / np.cos(outer) * slope)
    assert results["dispersion_deg_per_um"] == pytest.approx(spread, rel=1e-10)
    # One wavelength in each of N parts: the mean is off by at most variation / N.
    many = prism.sampled_wavelengths(4096)
    variation = np.abs(np.diff(prism.spectral_rgb(np.sort(many)), axis=0)).sum(axis=0)
    error = np.abs(np.mean(prism.spectral_rgb(many), axis=0) - 1.0)
    assert np.all(error <= variation / 4096)
    assert np.all(variation / 4096 < 5e-3)  # the bound says something
    # What passes, by the textbook: in at the fixed angle, out at what is left of the apex angle.
    wavelength = np.asarray(prism.sampled_wavelengths(64))
    eta, _ = sf11(wavelength)
    in_s, in_p, cos_inside = textbook(np.cos(outer), 1.0, eta)
    out_s, out_p, _ = textbook(np.cos(2.0 * half - np.arccos(cos_inside)), eta, 1.0)
    passed = 0.5 * ((1 - in_s) * (1 - out_s) + (1 - in_p) * (1 - out_p))
    colors = np.asarray(prism.spectral_rgb(wavelength))
    expected = np.mean(passed[:, None] * colors, axis=0)
    np.testing.assert_allclose(results["passed_rgb"], expected, rtol=1e-12)


@pytest.mark.study
def test_fields_in_depth(example, tmp_path):
    depth = example("fields_in_depth")
    results = depth.main([str(tmp_path / "fields.png"), "--size", "40"])
    drawn(tmp_path / "fields.png")
    assert results["largest"] == pytest.approx((2.3 / 1.46) ** 10, rel=1e-5)  # of 20,001 depths
    # What the silicon absorbs is what goes in less what comes out: of R and T of the stack
    # on top of silver so thick that T is what enters it.
    media = [1.0, *(complex(*map(float, n)) for n in depth.silicon_on_silver(0.45)[0][1:])]
    R, _, T, *_ = stack_oracle.stack(1.0, media, [depth.SILICON_UM], 0.45)
    assert results["absorbed"] == pytest.approx(float(1 - R - T), rel=1e-6)


@pytest.mark.study
def test_design(example, tmp_path):
    design = example("design")
    results = design.main([str(tmp_path / "design.png"), "--size", "24"])
    drawn(tmp_path / "design.png")
    d, places = results["thickness_um"], np.flatnonzero(design.BAND)
    for name, sizes in (("coated", d), ("bare", (0.0,) * 4)):
        R = [
            stack_oracle.stack(
                1.0, [float(np.broadcast_to(n.eta, design.BAND.shape)[i]) for n in design.GLASS],
                list(sizes), float(design.VISIBLE[i]),
            )[0]
            for i in places
        ]  # fmt: skip
        assert results[name] == pytest.approx(float(sum(R) / len(R)), rel=1e-9)
    assert results["coated"] < 0.0025 < 0.04 < results["bare"]
    assert results["dispersion_fs2"] < 1.5 and results["mirror_R"] > 0.99
    assert results["delta_e"] < 2.0


@pytest.mark.study
def test_lobe_choice(example, tmp_path):
    lobes = example("lobe_choice")
    results = lobes.main([str(tmp_path / "lobes.png"), "--size", "40"])
    drawn(tmp_path / "lobes.png")
    assert results["equal_split"] == pytest.approx((1.0 - 2.0 * 0.04) ** 2, rel=1e-12)
    assert results["fresnel_split"] < 1e-28  # the weights differ from 1 by rounding
    # as many cosines as `main` had, for which the program is compiled
    cosine = np.cos(np.deg2rad(np.resize([0.0, 30.0, 60.0, 80.0], 22)))
    R_s, R_p, _ = textbook(cosine, 1.0, 1.5)
    found = lobes.variance(jnp.append(cosine, -0.5), jax.random.key(0), True)
    np.testing.assert_allclose(found[:-1], (1.0 - R_s - R_p) ** 2, rtol=1e-10)
    assert found[-1] == pytest.approx(1.0, rel=1e-12)  # (1 - 2)^2: half of the paths are lost


@pytest.mark.study
def test_two_spheres_recovers_the_index(example, tmp_path):
    spheres = example("two_spheres")
    results = spheres.main([str(tmp_path / "spheres.png"), "--size", "32"])
    drawn(tmp_path / "spheres.png")
    assert abs(results["start"] - results["true"]) > 0.2
    assert results["sigma"] < 1e-3
    assert abs(results["eta"] - results["true"]) < 4.0 * results["sigma"]
    assert results["chi2_reduced"] == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / (20 * 32 * 3)))


def test_two_spheres_light(example):
    spheres, scenery = example("_spheres"), example("_scenery")
    # A sphere turns light by 2 (theta_i - theta_t), and the power is that of two faces.
    height = np.linspace(0.05, 0.95, 7)
    direction = np.broadcast_to([0.0, 1.0, 0.0], (7, 3))
    point = np.stack([height, -np.sqrt(1.0 - height**2), 0.0 * height], axis=-1) + scenery.GLASS
    way = jax.jit(spheres.passage)(scenery.GLASS, point, direction, 1.517)
    turned = 2.0 * (np.arcsin(height) - np.arcsin(height / 1.517))
    np.testing.assert_allclose(np.arccos(way.direction[:, 1]), turned, atol=1e-12)
    R_s, R_p, _ = textbook(np.sqrt(1.0 - height**2), 1.0, 1.517)
    power = 0.5 * ((1.0 - R_s) ** 2 + (1.0 - R_p) ** 2)
    np.testing.assert_allclose(way.power, power, rtol=1e-12)
    # The same light, followed to the floor by plane geometry: each ray stays in the plane of the
    # sun and its point of entry, p; e is across the sun's direction d. A cell is 1/24 wide.
    d, b = -scenery.SUN, (np.arange(300) + 0.5) / 300
    theta_i, theta_t = np.arcsin(b), np.arcsin(b / 1.517)
    R_s, R_p, _ = textbook(np.cos(theta_i), 1.0, 1.517)
    power = 0.5 * ((1.0 - R_s) ** 2 + (1.0 - R_p) ** 2)
    across = np.array([-d[1], d[0], 0.0]) / np.hypot(d[0], d[1])
    floor_light = 0.0
    for phi in 2.0 * np.pi * (np.arange(300) + 0.5) / 300:
        e = np.cos(phi) * across + np.sin(phi) * np.cross(across, d)
        inner = np.outer(np.cos(theta_i - theta_t), d) - np.outer(np.sin(theta_i - theta_t), e)
        exit_point = np.outer(b, e) - np.outer(np.cos(theta_i), d)
        exit_point += 2.0 * np.cos(theta_t)[:, None] * inner + scenery.GLASS
        turn = 2.0 * (theta_i - theta_t)
        out = np.outer(np.cos(turn), d) - np.outer(np.sin(turn), e)
        away = exit_point - scenery.GOLD
        nearest = np.sum(away * out, axis=-1)
        free = (np.sum(away * away, axis=-1) - nearest**2 > 1.0) | (nearest > 0.0)
        falls = out[:, 2] < -0.05
        length = exit_point[:, 2] / np.where(falls, -out[:, 2], 1.0)
        cell = exit_point[:, :2] + length[:, None] * out[:, :2] - scenery.CAUSTIC_CORNER
        on_map = np.all((cell >= 0.0) & (cell < scenery.CAUSTIC_SPAN), axis=-1)
        floor_light += 2.0 * np.pi / 300**2 * np.sum((b * power)[free & falls & on_map])
    area = (scenery.CAUSTIC_SPAN / scenery.CAUSTIC_CELLS) ** 2
    found = float(jnp.sum(jax.jit(spheres.caustic)(1.517))) * area
    # .1 % of the rays, at the rim of the sphere, are left out, and some light at the map's rim is
    # blurred across it.
    assert found == pytest.approx(floor_light, rel=5e-3)


def test_a_missing_matplotlib_is_named(example, monkeypatch, tmp_path):
    picture = example("_picture")
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with (
        pytest.raises(ModuleNotFoundError, match="pip install matplotlib"),
        picture.figure(tmp_path / "never.png", 1.0, 1.0),
    ):
        pass
