"""The benchmark of rough surfaces: what it feeds, what its worker answers, the table it writes."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.speed import bsdf

pytestmark = pytest.mark.docs  # of `make test-docs`
ROOT = Path(__file__).resolve().parents[2]


def test_inputs_are_directions_and_random_numbers():
    wo, wi, u_lobe, u = bsdf.inputs("float32", 1000)
    for w in (wo, wi):
        assert w.shape == (3, 1000) and w.dtype == np.float32
        np.testing.assert_allclose(np.linalg.norm(w, axis=0), 1.0, atol=2e-7)
        assert abs(np.mean(w[2] > 0) - 0.5) < 0.1  # both sides
    assert u_lobe.shape == (1000,) and u.shape == (2, 1000)
    assert np.all((u >= 0) & (u < 1))


def test_a_worker_answers():
    job = {"asked": ["dielectric", "sample", 100], "seconds": 0.001}
    worker = subprocess.run(
        [sys.executable, "-m", "benchmarks.speed.bsdf", "--worker", bsdf.REFERENCE, "float32"],
        input=json.dumps(job) + "\n",
        capture_output=True,
        text=True,
        cwd=ROOT,
    )
    ready, timed = (json.loads(x) for x in worker.stdout.splitlines())
    assert ready["ready"] and 0.0 < timed["s"] < 60.0


def test_table():
    ours, blocks = {"s": 0.02, "to_reference": 1.0}, {"s": 0.01, "to_reference": 0.5}
    sizes = {"10000": {bsdf.REFERENCE: ours}, "1000000": {bsdf.REFERENCE: ours, "x": blocks}}
    results = {
        "machine": {"date": "", "processor": "", "cores": 2, "load_before": 0.0, "system": ""},
        "rounds": 4,
        "left_out": {"Mitsuba LLVM": "mitsuba is not installed"},
        "times": {"float32": {"dielectric": {"sample": sizes}}},
    }
    text = bsdf.markdown(results)
    assert "| rough dielectric, sample, 1e4 | 0.5 |  |  |" in text
    assert "| rough dielectric, sample, 1e6 | 50 | 100 | 0.50 |" in text
    assert "Left out: Mitsuba LLVM: mitsuba is not installed." in text
