"""The loop form of the damped normal equations against NumPy."""

import jax
import numpy as np
import pytest

from fitting.problem import solver
from fitting.problem.many_unknowns import solve_lanes

P, LANES = 9, 20


def problem(seed=3):
    random = np.random.default_rng(seed)
    tables = random.standard_normal((LANES, 30, P)) * 10.0 ** random.uniform(-3, 3, P)
    matrix = np.einsum("lri,lrj->ijl", tables, tables)
    return matrix, random.standard_normal((P, LANES)), random.random((P, LANES)) < 0.7


def test_solutions_over_the_free_unknowns():
    matrix, rhs, free = problem()
    x = np.asarray(solve_lanes(matrix, rhs, free))
    for lane in range(LANES):
        use = free[:, lane]
        true = np.linalg.solve(matrix[:, :, lane][np.ix_(use, use)], rhs[use, lane])
        # the columns differ by 1e6, but Cholesky does not mind what a column is measured in
        np.testing.assert_allclose(x[use, lane], true, rtol=1e-9)
        assert (x[~use, lane] == 0.0).all()


def test_two_unknowns_that_the_data_cannot_tell_apart_give_a_finite_step():
    matrix, rhs, free = problem()
    matrix[:, 1], matrix[1] = matrix[:, 0], matrix[0]
    assert np.isfinite(np.asarray(solve_lanes(matrix, rhs, free | True))).all()


@pytest.mark.parametrize("count", [1, 4])
def test_same_as_the_unrolled_form(count, monkeypatch):
    matrix, rhs, free = problem()
    few = slice(0, count)
    short = solver.solve_lanes(matrix[few, few], rhs[few], free[few])
    np.testing.assert_allclose(solve_lanes(matrix[few, few], rhs[few], free[few]), short, rtol=1e-9)
    monkeypatch.setattr(solver, "FEW_UNKNOWNS", 0)
    again = solver.solve_lanes(matrix[few, few], rhs[few], free[few])
    np.testing.assert_allclose(again, short, rtol=1e-9)


def test_no_library_is_called_that_waits_for_threads_of_its_own():
    """Two fits of 24 unknowns side by side, by the batched LAPACK calls of jaxlib, never ended."""
    matrix, rhs, free = problem()
    program = jax.jit(solver.solve_lanes).lower(matrix, rhs, free).compile().as_text()
    assert "custom-call" not in program
