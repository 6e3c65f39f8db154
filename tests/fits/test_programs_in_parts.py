"""Fits in programs that models share: the numbers of the one program, compiled once."""

import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax
import numpy as np
import pytest

from fitting.data.measurement import Measurement
from fitting.problem.lanes import coordinate_bounds
from fitting.problem.observations import observations
from fitting.problem.optics_inputs import core_of, has_parts
from fitting.problem.programs import Bounds, linearised, solve, targets_of, without_data
from fitting.problem.programs_in_parts import in_parts, solved_in_parts
from fitting.problem.slopes import Shown
from fitting.problem.unknowns import index_outside, spectrum_of, unknowns
from fitting.process.compiled import in_turn
from fitting.samples.parameters import Settings, settings_of
from fitting.samples.sample import Sample
from fitting.searching.starts import starts

WAVES = np.linspace(0.4, 1.0, 40)  # more rows than run in one program
LANES = 40  # more than are under way at once


def of(sample, settings, angles=(55.0, 70.0), loss="squares", waves=WAVES, **values):
    angle, wavelength = np.repeat(angles, len(waves)), np.tile(waves, len(angles))
    shape = 1.0 + 0.05 * np.sin(20.0 * wavelength)
    columns: dict[str, Any] = {name: value * shape for name, value in values.items()}
    m, which = Measurement.from_columns(angle, wavelength, **columns), Sample.parse(sample)
    seen = observations([m], "equal")
    settings = settings_of(*settings[:5])._replace(shared=settings.shared)
    u = unknowns(which, spectrum_of([m], which), settings, seen, loss)
    return u, targets_of(u, seen, index_outside(which, seen.points.wavelength_um))


def shared(u):
    """In programs that models share, as `choose` runs them."""
    return u._replace(spec=u.spec._replace(shared=True))


CASES: dict[str, Any] = {
    "oscillators": ("air | lorentz:2 20..300 nm | 1.53", Settings(), {"R": 0.2}),
    "in a wider program": ("air | lorentz:2 20..300 nm | 1.53", Settings(shared=True), {"R": 0.2}),
    "free electrons": ("air | drude 20..300 nm | Si", Settings(shared=True), {"R": 0.2, "T": 0.1}),
    "on a model": ("air | SiO2 2..40 nm | drude-lorentz:1", Settings(), {"R_s": 0.4, "R_p": 0.3}),
    "an edge": ("air | tauc-lorentz:1 20..300 nm | BK7", Settings(), {"R": 0.2}),
    "psi and Delta": (
        "BK7 | cauchy:2 20..300 nm | lorentz:1 9 nm | 3.88+0.016i",
        Settings(free=("angle_offset",)), {"psi": 20.0, "delta": 100.0},
    ),
    "instrument": (
        "air | lorentz:1 20..300 nm | 1.53", Settings(free=("scale", "background", "leak")),
        {"R_s": 0.2, "R_p": 0.1},
    ),
    "ties": (
        "air | lorentz:1 90 nm | lorentz:1 50 nm | 1.53",
        Settings(fixed={"film_1.eps_inf": 2.0}, tie={
            "film_2.resonance_ev_1": "1.1 * film_1.resonance_ev_1",
            "film_2.eps_inf": "film_1.eps_inf", "film_2.thickness_nm": "film_1.thickness_nm",
        }),
        {"R": 0.2},
    ),
    "a bare surface": ("drude-lorentz:2", Settings(), {"R": 0.2}),
    "psi and Delta of a bare surface": (
        "water | lorentz:1", Settings(free=("angle_offset",)), {"psi": 20.0, "delta": 100.0},
    ),
    "a plate": (
        "air | cauchy-urbach:2 1 mm thick | air", Settings(), {"R": 0.1, "T": 0.8, "R_back": 0.1},
    ),
    "a film on a plate": (
        "air | cauchy:2 20..300 nm | BK7 1 mm thick | air", Settings(), {"R": 0.1, "T": 0.8},
    ),
    "psi and Delta of a plate": (
        "air | cauchy:2 1 mm thick | air", Settings(), {"psi": 20.0, "delta": 100.0},
    ),
}  # fmt: skip


def angles_of(case):
    """At normal incidence half of the cases: there s is p."""
    return (0.0,) if case in ("oscillators", "in a wider program", "an edge") else (55.0, 70.0)


# Each has what other cases have, by a program of its own.
_LONG = (
    "in a wider program", "free electrons", "on a model", "a bare surface", "an edge", "ties",
    "a film on a plate", "psi and Delta of a plate",
)  # fmt: skip


@pytest.mark.study
@pytest.mark.parametrize("case", [
    pytest.param(c, marks=[pytest.mark.study] * (c in _LONG)) for c in CASES
])  # fmt: skip
def test_the_derivatives_are_those_of_the_one_program(case):
    sample, settings, values = CASES[case]
    u, targets = of(sample, settings, angles_of(case), **values)
    u = shared(u)
    assert in_parts(u.spec, targets)
    y = starts(u.moving, 3, 3)
    with jax.enable_x64(True):
        for at in y.T:
            one = linearised(without_data(targets), at, spec=u.spec)
            parts = Shown(u.spec, targets)(at)
            for a, b in zip(map(np.asarray, one), parts, strict=True):
                assert np.isfinite(a).all() and np.abs(a).max() > 0.0
                np.testing.assert_allclose(b, a, rtol=1e-9, atol=1e-11 * np.abs(a).max())


@pytest.mark.study
@pytest.mark.parametrize(
    ("case", "loss"),
    [
        ("a plate", "squares"),
        pytest.param("in a wider program", "squares", marks=pytest.mark.study),
        pytest.param("psi and Delta", "huber", marks=pytest.mark.study),
    ],
)
def test_the_solver_takes_the_steps_of_the_one_program(case, loss):
    sample, settings, values = CASES[case]
    u, targets = of(sample, settings, angles_of(case), loss, **values)
    u = shared(u)
    assert in_parts(u.spec, targets)
    low, high = (np.repeat(a[:, None], LANES, 1) for a in coordinate_bounds(u.moving))
    y = np.clip(starts(u.moving, LANES, 3), low, high)
    bounds = Bounds(low, high, np.full(LANES, 30.0), np.full(LANES, 1.0))
    with jax.enable_x64(True):
        for steps in (1, 3):
            one, parts = (
                [np.asarray(x) for x in program(
                    targets, y, np.full(LANES, 1e-3), bounds, np.int64(steps), spec=u.spec
                )]
                for program in (solve, solved_in_parts)
            )  # fmt: skip
            assert [a.shape for a in parts] == [a.shape for a in one]
            # where two unknowns do nearly the same, rounding decides where a step leads
            same = np.isclose(parts[1], one[1], rtol=1e-6)
            assert same.mean() > (0.99 if steps == 1 else 0.7)
    assert parts[1].max() < np.inf


# one block, in calls of half as many columns; 3 blocks, of which ten lanes fill a call; 33 blocks
@pytest.mark.study
@pytest.mark.parametrize(
    "rows", [150, *(pytest.param(n, marks=pytest.mark.study) for n in (40, 2060))]
)
def test_rows_of_one_block_or_several(rows):
    waves = np.linspace(0.4, 1.0, rows)
    u, targets = of("air | cauchy:2 20..300 nm | SiO2", Settings(), (30.0,), waves=waves, R=0.2)
    assert in_parts(u.spec, targets)
    y, low = starts(u.moving, LANES, 3), np.full((len(u.moving), LANES), -np.inf)
    bounds = Bounds(low, -low, np.full(LANES, 30.0), np.full(LANES, 1.0))
    given = targets, y, np.full(LANES, 1e-3), bounds, np.int64(2)
    with jax.enable_x64(True):
        one, parts = (program(*given, spec=u.spec) for program in (solve, solved_in_parts))
        np.testing.assert_allclose(parts[1], one[1], rtol=1e-9)
        np.testing.assert_allclose(parts[0], one[0], rtol=1e-6)
        one = linearised(without_data(targets), y[:, 0], spec=u.spec)
        parts = Shown(u.spec, targets)(y[:, 0])
        for a, b in zip(map(np.asarray, one), parts, strict=True):
            np.testing.assert_allclose(b, a, rtol=1e-9, atol=1e-11 * np.abs(a).max())


@pytest.mark.parametrize("sample", [
    "air | cauchy 90 nm graded | Si", "air | bruggeman(SiO2, air 30 %) 90 nm | Si", "kk-spline:8",
])  # fmt: skip
def test_other_samples_run_in_one_program(sample):
    assert not has_parts(of(sample, Settings(), R=0.2)[0].spec)


@pytest.mark.parametrize(
    ("sample", "angles", "parts"),
    [
        ("cauchy:2", (0.0,), False),
        ("drude-lorentz:2", (0.0,), True),  # eight unknowns
        ("drude-lorentz:2", (55.0, 70.0), False),  # each wavelength comes twice
        ("air | cauchy:2 20..300 nm | Si", (0.0,), True),
        ("air | cauchy:2 20..300 nm | Si", (55.0, 70.0), False),
        ("air | cauchy:2 20..300 nm | Si", tuple(np.linspace(30.0, 72.0, 8)), True),  # 320 rows
        ("air | cauchy:2 3 um thick | air", (0.0,), False),
    ],
)
def test_which_fits_run_in_parts(sample, angles, parts):
    u, targets = of(sample, Settings(), angles, R=0.2)
    assert in_parts(u.spec, targets) == parts
    assert in_parts(shared(u).spec, targets)


def test_models_of_one_film_share_their_optics():
    cores = {
        core_of(of(f"air | {model} 20..300 nm | 1.53", Settings(), R=0.2)[0].spec, True)
        for model in ("constant", "cauchy:3", "drude", "lorentz:4", "tauc-lorentz:1")
    }
    assert len(cores) == 1


def test_of_several_threads_one_compiles():
    events = []

    def program(x, *, spec):
        events.append("begins")
        time.sleep(0.1)
        events.append("ends")
        return x

    taken = in_turn(program)
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda _: taken(np.ones(3), spec="a"), range(4)))
        assert events[:3] == ["begins", "ends", "begins"]
        events.clear()
        list(pool.map(lambda spec: taken(np.ones(3), spec=spec), "bc"))
        assert events[:2] == ["begins", "begins"]  # another program waits for none
