"""How many calls of the program a batch takes, and that no curve depends on the others of it."""

import numpy as np
import pytest

from fitting import fit_many
from fitting.bare_surface import calls
from fitting.bare_surface.curve_data import Data
from fitting.bare_surface.curves import fitted_curves
from fitting.bare_surface.descent import Solved
from fitting.bare_surface.engine import Steps
from fitting.bare_surface.reflectances import CHANNELS
from fitting.bare_surface.valley import Lanes, _at_lossless_end, evaluate
from tests.truth.fit_batches import ANGLES, mixed
from tests.truth.random_measurements import textbook


@pytest.fixture
def seen(monkeypatch):
    """The number of curves of every call of the program from here on, on two processors."""
    found, real = [], calls.solve

    def solve(*args, **kwargs):
        found.append(int(args[5][0]))
        return real(*args, **kwargs)

    monkeypatch.setattr(calls, "solve", solve)
    monkeypatch.setattr(calls, "PROCESSORS", 2)
    return found


def test_a_mixed_batch_takes_one_call_a_processor(seen):
    """Further starts and the other ends of charts belong to the call of their curve.

    A call has whole groups of eight: 13 of them, and not 14 as with 50 curves in each.
    """
    fit_many(ANGLES, **mixed(100))
    assert sorted(seen) == [44, 56]


def straggling():
    """Curves of R_p from inside glass, of which one creeps for a hundred evaluations."""
    angles = np.linspace(50.0, 75.0, 30)
    index = np.array([2.1, 0.9 + 1e-3j, 1.33, 3.5 + 0.2j, 0.2 + 3.0j, 1.2, 4.0, 1.49] * 4)
    exact = textbook(angles, index[:, None], 1.5)["R_p"]
    return angles, exact + 3e-3 * np.random.default_rng(1).standard_normal(exact.shape)


@pytest.mark.study
def test_a_straggler_changes_no_answer_but_its_own_time(seen):
    angles, R_p = straggling()
    sample = "1.5 | free"
    together = fit_many(angles, R_p=R_p, sample=sample)
    assert together.evaluations.max() > 10 * np.median(together.evaluations) or len(seen) > 2
    for i in range(0, len(R_p), 3):
        alone = fit_many(angles, R_p=R_p[i], sample=sample)
        assert alone.status == together.status[i]
        np.testing.assert_allclose(together.eta[i], alone.eta, rtol=1e-6)
        np.testing.assert_allclose(together.k[i], alone.k, rtol=1e-5, atol=1e-9)
        np.testing.assert_allclose(together.cost[i], alone.cost, rtol=1e-9)


@pytest.mark.study
@pytest.mark.parametrize("eta_i", [1.0, 1.7])
def test_the_lossless_end_is_that_of_the_program(eta_i):
    rng, count = np.random.default_rng(3), 12
    angles = np.sort(rng.uniform(1.0, 88.0, (count, 20)), axis=1)
    values, weights = rng.uniform(0.0, 1.0, (2, 3, count, 20))
    data = Data(
        np.cos(np.radians(angles)), rng.uniform(0.0, 1.0, angles.shape), tuple(values),
        tuple(weights), eta_i, CHANNELS,
    )  # fmt: skip
    x = np.geomspace(1e-4, 5.0, count)
    there = evaluate(data, Lanes(np.arange(count), x, np.full(count, 1e-24), np.ones(count)))
    for own, of_program in zip(
        _at_lossless_end(data, x), (there.cost, there.g_x, there.h_xx), strict=True
    ):
        np.testing.assert_allclose(own, of_program, rtol=1e-9)


@pytest.mark.study
@pytest.mark.parametrize(("angles", "curves"), [(13, 5), (61, 40), (61, 300)])
def test_the_sums_of_a_call_are_those_of_its_residuals(angles, curves):
    """At numbers of angles that are no multiples of four, with gaps and weights of each curve."""
    rng = np.random.default_rng(angles)
    at = np.linspace(5.0, 85.0, angles)
    values, weights = rng.uniform(0.0, 1.0, (2, 2, curves, angles))
    weights = np.where(rng.random(weights.shape) < 0.2, 0.0, weights)
    data = Data(
        np.cos(np.radians(at)), np.full(angles, 0.5), tuple(values), tuple(weights), 1.0,
        ("R_s", "R_p"), few=curves <= 16,
    )  # fmt: skip
    solved = Solved(*calls.run(data, calls.start_rows(curves), Steps(4))[0])
    off = values - fitted_curves(data, solved)
    e = np.pad(off * weights, ((0, 0), (0, 0), (0, -angles % 4)))
    together = (e.reshape(2, curves, -1, 4).sum(-1) ** 2).sum((0, 2))
    np.testing.assert_allclose(solved.cost, (e * e).sum((0, 2)), rtol=1e-9)
    np.testing.assert_allclose(solved.plain, (off**2 * (weights > 0.0)).sum((0, 2)), rtol=1e-9)
    np.testing.assert_allclose(solved.together, together, rtol=1e-9)
