"""The inverse of the normal matrix, the least-squares step, and what the data do not see."""

import jax
import mpmath
import numpy as np
import pytest

from fitting.problem.curve_lanes import triangle
from fitting.uncertainty.covariance import inverse_of


@pytest.mark.parametrize("seed", range(20))
def test_the_inverse_and_the_step_are_those_of_the_normal_equations(seed):
    """Solved with 50 digits; columns differ in size by up to 1e12, and two by down to 1e-4 of it.

    Rounding is then some 1e-16 / 1e-4^2 of the errors, and more of few rows.
    """
    random = np.random.default_rng(seed)
    count = int(random.integers(1, 7))
    rows = random.normal(size=(int(random.integers(count, 40)), count))
    rows[:, -1] = rows[:, 0] + 10.0 ** random.uniform(-4.0, 0.0) * rows[:, -1]
    rows *= 10.0 ** random.uniform(-6.0, 6.0, count)
    b = random.normal(size=len(rows))
    use = np.append(np.ones(count, bool), False)  # one more unknown, which is not used
    covariance, step, _, hidden = inverse_of(np.column_stack([rows, b]), b, use)
    assert not hidden.any()
    with mpmath.workdps(50):
        exact = mpmath.matrix(rows.tolist())
        inverse = (exact.T * exact) ** -1
        wanted = np.array((-inverse * (exact.T * mpmath.matrix(b.tolist()))).tolist(), float)[:, 0]
        inverse = np.array(inverse.tolist(), float)
    size = np.sqrt(np.diagonal(inverse))
    np.testing.assert_allclose(
        covariance[:count, :count] / np.outer(size, size), inverse / np.outer(size, size), atol=1e-6
    )
    np.testing.assert_allclose(step[:count] / size, wanted / size, atol=1e-6)
    assert np.isnan(covariance[-1]).all() and step[-1] == 0.0


def test_of_fewer_rows_than_unknowns_all_other_directions_are_not_seen():
    rows = np.random.default_rng(4).normal(size=(2, 5))
    _, step, directions, hidden = inverse_of(rows, np.array([1.0, -2.0]), np.ones(5, bool))
    unseen = directions[:, hidden]
    assert unseen.shape == (5, 3)
    size = np.linalg.norm(rows, axis=0)
    np.testing.assert_allclose((rows / size) @ unseen, 0.0, atol=1e-14)
    np.testing.assert_allclose(rows @ step, [-1.0, 2.0], rtol=1e-12)


def test_a_batch_is_its_members_one_by_one():
    """Each with unknowns of its own that are not used, and one that is not seen."""
    random = np.random.default_rng(5)
    rows, b = random.normal(size=(6, 9, 4)), random.normal(size=(6, 9))
    use = random.random((6, 4)) < 0.7
    use[:, 0] = True
    rows[2, :, 0] = 0.0
    both = inverse_of(rows, b, use)
    for i in range(6):
        for whole, one in zip(both, inverse_of(rows[i], b[i], use[i]), strict=True):
            np.testing.assert_allclose(whole[i], one, rtol=1e-12, atol=1e-13)
    assert both.hidden[2].sum() == 1


@pytest.mark.parametrize("count", [2, 6])
def test_the_triangle_of_a_batch_serves_as_its_rows(count):
    """Of columns alike to 1e-6, of which the normal equations would keep four digits."""
    random = np.random.default_rng(6)
    columns = random.normal(size=(count + 1, 2, 30, 3))
    columns[1] = columns[0] + 1e-6 * columns[1]
    columns[:, :, :, 2] = 0.0  # a lane without data
    with jax.enable_x64(True):
        each = np.asarray(jax.jit(triangle)([list(column) for column in columns]))
    for lane in range(3):
        rows, use = columns[..., lane].reshape(count + 1, -1).T, np.ones(count, bool)
        whole = inverse_of(rows[:, :-1], rows[:, -1], use)
        short = inverse_of(each[:, :-1, lane], each[:, -1, lane], use)
        np.testing.assert_allclose(short.covariance, whole.covariance, rtol=1e-8)
        np.testing.assert_allclose(short.step, whole.step, rtol=1e-7)
