"""Fits in processes: a fork of a process in which jax has run is refused, and does not hang."""

import os
import subprocess
import sys
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from fitting import Measurement, fit, fit_many, fit_residuals, simulate

ROOT = Path(__file__).resolve().parents[2]
GLASS = {"angle_deg": [30.0, 45.0, 60.0, 70.0], "R_s": [0.0578, 0.0920, 0.1774, 0.3001]}
WAVES = np.linspace(0.45, 0.8, 12)
FILM = "air | cauchy:2 400..440 nm | Si"

_FORK = """
import multiprocessing, sys
import jax.numpy as jnp
import numpy as np
from fitting import Measurement, fit, fit_many, fit_residuals, simulate

m = Measurement.from_columns(**{glass})
calls = dict(
    fit=lambda: fit(m).status, model=lambda: fit(m, "constant", starts=4).status,
    fit_many=lambda: fit_many(m.angle_deg, R_s=[m.value])[0].status,
    simulate=lambda: simulate("1.5", {{}}, [0.0])[0],
    own=lambda: fit_residuals(lambda v, d: v["a"] - d, {{"a": (0.0, 1.0)}}, np.ones(3)).status,
)

def in_child(call, send):
    try:
        send.send(str(calls[call]()))
    except RuntimeError as error:
        send.send(str(error))

{before}
context = multiprocessing.get_context("fork")
for call in {calls}:
    receive, send = context.Pipe(duplex=False)
    child = context.Process(target=in_child, args=(call, send))
    child.start()
    send.close()
    print(receive.recv() if receive.poll({wait}) else "hangs", flush=True)
    child.kill()
    child.join()
"""


def forked(before, calls, wait):
    """Return what each call gives in a child of a process that has done ``before``."""
    code = _FORK.format(glass=GLASS, before=before, calls=calls, wait=wait)
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code],
        capture_output=True, text=True, cwd=ROOT, timeout=400,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


NO_FORK = pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")


@NO_FORK
# A fit that compiles in a second; and jax was used, though by no fit.
@pytest.mark.parametrize("before", ['calls["own"]()', "jnp.ones(3)"])
def test_a_fork_is_refused_at_once_where_jax_has_run(before):
    lines = forked(before, "calls", 10)
    assert len(lines) == 5 and all("forked" in s and "spawn" in s for s in lines), lines


@NO_FORK
@pytest.mark.parametrize("call", [pytest.param("fit", marks=pytest.mark.study), "own"])
def test_a_fork_works_where_jax_has_not_run(call):
    assert forked("", [call], 100) == ["converged"]


@pytest.fixture
def debugging(set_jax):
    """All switches by which callers debug functions of their own."""
    set_jax(jax_debug_nans=True, jax_debug_infs=True, jax_transfer_guard="disallow")


def root_of(values, data):
    return jnp.sqrt(values["a"]) * data["x"] - data["y"]


@pytest.mark.study
def test_switches_for_debugging_reach_into_no_fit(debugging):
    m = Measurement.from_columns(**GLASS)
    assert fit(m).status == "converged"
    assert fit_many(m.angle_deg, R_s=[m.value] * 2).status.tolist() == ["converged"] * 2
    measured = simulate("air | cauchy:2 420 nm | Si", {"A": 1.6, "B": 0.008}, 0.0, WAVES, "R")
    film = Measurement.from_columns(0.0, WAVES, R=measured, sigma=1e-3)
    found = fit(film, FILM, starts=4)
    assert found.status == "converged"
    np.testing.assert_allclose(found.predict().value, measured, atol=1e-4)
    assert found.index().eta[0] > 1.6
    x = np.linspace(0.1, 1.0, 9)
    data = {"x": x, "y": 1.3 * x}
    assert fit_residuals(root_of, {"a": (0.1, 3.0)}, data).status == "converged"


def test_a_residual_function_of_the_callers_own_is_debugged(debugging):
    with pytest.raises(FloatingPointError, match="nan"):
        fit_residuals(root_of, {"a": (-3.0, -1.0)}, {"x": np.ones(3), "y": np.ones(3)})
