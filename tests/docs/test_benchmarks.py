"""The benchmark measures what it says: the forms named, their errors, the front, the worker."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks import contestants, scenes
from benchmarks.accuracy import scene_errors
from fresnel_jax import reflectance
from tests.truth import printed

pytestmark = pytest.mark.docs  # of `make test-docs`
pytest.importorskip("matplotlib")
ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_scenes_are_the_same_at_every_call_and_exact_in_their_dtype(dtype):
    for scene in scenes.CLASSES:
        first, second = scenes.points(scene, dtype), scenes.points(scene, dtype)
        for x, y in zip(first, second, strict=True):
            assert x.dtype == dtype and np.array_equal(x, y)
        c, eta, k = first
        assert np.all((c >= 0) & (c <= 1) & (eta > 0) & (k >= 0))
        assert np.any(k > 0) != (scene in scenes.LOSSLESS)


def test_printed_forms_are_fresnel_s_at_ordinary_points():
    """Against 50 digits; 20 eps of 1: each loses digits elsewhere, which is what is charted."""
    eps = np.finfo(float).eps
    c, eta, k = scenes.points("metal", "float64")
    for form in (printed.pbrt4_complex, printed.pbrt3_conductor):
        R = [float(x) for x in form(c, eta, k)]
        assert scene_errors.errors("metal", "float64", R)["largest_absolute"] < 20 * eps
    R = contestants.numpy_real_form(c, eta, k)
    assert scene_errors.errors("metal", "float64", list(R))["largest_absolute"] < 20 * eps
    c, eta, _ = scenes.points("dielectric", "float64")
    for form in (printed.pbrt4_dielectric, printed.plain_lossless):
        R = [float(x) for x in form(c, eta)]
        assert scene_errors.errors("dielectric", "float64", R)["largest_absolute"] < 20 * eps


def test_plain_sums_keep_the_stated_bound_next_to_the_critical_angle():
    """docs/speed_tiers.md: 8 eps / |Q|, and 6 sqrt(eps) at most; and they do lose digits there."""
    for dtype in (np.float32, np.float64):
        eps = float(np.finfo(dtype).eps)
        c, eta, _ = scenes.points("near-critical", dtype)
        q = np.sqrt(abs((eta.astype(float) - 1) * (eta.astype(float) + 1) + c.astype(float) ** 2))
        true = np.array(
            [float(x) for x in scene_errors.truth("near-critical", np.dtype(dtype).name)]
        )
        bound = np.minimum(8 * eps / np.maximum(q, 1e-300), 6 * np.sqrt(eps))
        for R in (printed.plain_lossless(c, eta), reflectance(c, eta, compensated=False)):
            error = abs(np.asarray(R, float) - true)
            assert np.all(error < bound)
            assert np.max(error) > 1000 * eps
        exact = np.asarray(reflectance(c, eta), float)
        assert np.max(abs(exact - true)) < 12 * eps


def test_errors_count_what_is_wrong():
    true = [float(x) for x in scene_errors.truth("dielectric", "float64")]
    assert scene_errors.errors("dielectric", "float64", true)["largest_relative_eps"] <= 0.5
    true[3] *= 1.5
    true[5] = float("nan")
    found = scene_errors.errors("dielectric", "float64", true)
    assert found["largest_relative"] == pytest.approx(0.5)
    assert found["not_finite"] == 1 and found["wrong_share"] == pytest.approx(2 / len(true))


def test_the_front_holds_what_nothing_beats_in_both():
    from benchmarks.speed.chart import front

    speeds = {(1e-15, 10.0), (1e-15, 20.0), (1e-10, 15.0), (1e-7, 50.0), (1e-3, 50.0)}
    points = [("", "", "", error, speed) for error, speed in speeds]
    assert [p[3:] for p in front(points)] == [(1e-15, 20.0), (1e-7, 50.0)]


def test_a_worker_answers():
    commands = [
        {"do": "evaluate", "scene": "dielectric"},
        {"do": "time", "what": "value", "lossless": True, "size": 100, "seconds": 0.0},
        {"do": "time", "what": "no such thing", "lossless": True, "size": 1, "seconds": 0.0},
    ]
    worker = subprocess.run(
        [sys.executable, "-m", "benchmarks.speed.worker", "NumPy, real form", "float64"],
        input="".join(json.dumps(x) + "\n" for x in commands),
        capture_output=True,
        text=True,
        cwd=ROOT,
    )
    ready, evaluated, timed, failed = (json.loads(x) for x in worker.stdout.splitlines())
    assert ready["ready"] and timed["s"] > 0 and "failed" in failed
    errors = scene_errors.errors("dielectric", "float64", evaluated["R"])
    assert errors["largest_absolute"] < 20 * np.finfo(float).eps


@pytest.mark.study
def test_the_stages_of_the_command_are_timed(cache):
    from benchmarks.speed import startup

    stages = startup.stages({**os.environ, "PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(cache)})
    assert {"import jax", "fit, first call", "table"} <= stages.keys()
    assert min(stages.values()) > 0.0


def test_the_tables_of_a_gpu_alone_are_those_of_its_runs():
    from benchmarks.speed.report import markdown

    results = json.loads((ROOT / "docs/benchmarks/benchmarks.json").read_text(encoding="utf-8"))
    on_cpu = markdown(results)
    for run in results["runs"]:
        run["platform"] = "gpu"
    assert markdown(results) == on_cpu.replace("Speed on the cpu", "Speed on the gpu")


def test_the_overview_names_every_mark_at_its_place(tmp_path, monkeypatch):
    from matplotlib.figure import Figure

    from benchmarks.speed import overview

    drawn = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, file: drawn.append(figure))
    results = json.loads((ROOT / "docs/benchmarks/benchmarks.json").read_text(encoding="utf-8"))
    overview.draw_overview(results, tmp_path / "never.png", "cpu")
    (figure,) = drawn
    figure.canvas.draw()
    for axes in figure.axes:
        labels = [t for t in axes.texts if not t.get_text().startswith(" eps")]
        assert [t.get_text() for t in labels] == [row[2] for row in overview.SHOWN]
        boxes = [t.get_window_extent() for t in labels]
        assert not any(
            a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[i + 1 :]
        )  # fmt: skip


@pytest.mark.study
def test_bounds_hold_on_this_device_and_its_speed_is_told(capsys):
    """`make gpu` at a tenth of its size, on the CPU; a seed, so that a failure can be repeated."""
    from benchmarks.speed import device

    assert device.main(["--scale", "0.1", "--seed", "0"]) == 0
    printed = capsys.readouterr().out
    assert "EXCEEDED" not in printed
    for name in ("| gradient of R | float32", "| powers, gradient | float64", "curves/s", "film"):
        assert name in printed


def test_a_bound_that_is_exceeded_on_this_device_is_told(capsys, monkeypatch):
    """One quantity of `make gpu`: it holds its bound, and ends with status 1 where it does not."""
    from benchmarks.speed import device

    quantity = device.QUANTITIES["gradient of R"]
    for name in ("speed", "fits"):
        monkeypatch.setattr(device, name, lambda *_: None)
    monkeypatch.setattr(device, "ENTRIES", ())
    monkeypatch.setattr(device, "QUANTITIES", {"gradient of R": quantity})
    assert device.main(["--scale", "0.02", "--seed", "0"]) == 0
    assert "| gradient of R | float32" in capsys.readouterr().out
    strict = quantity._replace(bound=1e-3)
    monkeypatch.setattr(device, "QUANTITIES", {"gradient of R": strict})
    assert device.main(["--scale", "0.02", "--seed", "0"]) == 1
    assert "EXCEEDED" in capsys.readouterr().out
