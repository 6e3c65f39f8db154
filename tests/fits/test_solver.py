"""The batch solver against scipy, NumPy's linear algebra and exhaustive minimisation."""

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from scipy.optimize import least_squares, lsq_linear

from fitting.problem.solver import (
    BatchLevenbergMarquardt,
    bounded_step,
    normal_sums,
    solve_lanes,
)

pytestmark = pytest.mark.slow

T = np.linspace(0.0, 3.0, 25)
RNG = np.random.default_rng(11)
LANES = 32  # one shape, one compilation


def decay(y, args):
    """a exp(-b t) + c against data (25, L), three unknowns."""
    return y[0] * jnp.exp(-y[1] * jnp.asarray(T, args.dtype)[:, None]) + y[2] - args


def solve(data, start, *, lower=-1e3, upper=1e3, max_steps=100, fn=decay, solver=None):
    lanes = data.shape[1]
    y = np.broadcast_to(np.asarray(start, float)[:, None], (len(start), lanes))
    box = [np.broadcast_to(np.reshape(b, (-1, 1)), y.shape).astype(float) for b in (lower, upper)]
    options = {
        "lower": jnp.asarray(box[0]),
        "upper": jnp.asarray(box[1]),
        "degrees": jnp.full(lanes, float(len(data) - len(start))),
        "scale": jnp.asarray((data**2).sum(0)),
        "max_steps": jnp.asarray(max_steps),
    }
    return optx.least_squares(
        fn, solver or BatchLevenbergMarquardt(), jnp.asarray(y), jnp.asarray(data), options,
        max_steps=None, throw=False,
    )  # fmt: skip


def noisy_decays(noise=0.01, lanes=LANES):
    a, b, c = RNG.uniform(0.5, 2.0, lanes), RNG.uniform(0.5, 2.0, lanes), RNG.uniform(-1, 1, lanes)
    truth = np.stack([a, b, c])
    return a * np.exp(-b * T[:, None]) + c + noise * RNG.standard_normal((len(T), lanes)), truth


def by_scipy(column, start, **bounds):
    return least_squares(
        lambda y: y[0] * np.exp(-y[1] * T) + y[2] - column, start, xtol=1e-15, ftol=1e-15,
        gtol=1e-15, **bounds,
    )  # fmt: skip


def test_minima_are_those_of_scipy():
    data, _ = noisy_decays()
    found = solve(data, [1.0, 1.0, 0.0])
    assert bool(found.stats["done"].all())
    y = np.asarray(found.value + found.stats["step"])
    for lane in range(LANES):
        scipy = by_scipy(data[:, lane], [1.0, 1.0, 0.0])
        sigma = np.sqrt(
            np.diag(np.linalg.inv(scipy.jac.T @ scipy.jac)) * 2 * scipy.cost / (len(T) - 3)
        )
        # It stops when a step is below a hundredth of a standard error.
        assert np.all(np.abs(y[:, lane] - scipy.x) < 0.01 * sigma)


def test_without_noise_it_ends_at_the_rounding_and_not_at_max_steps():
    data, truth = noisy_decays(noise=0.0)
    found = solve(data, [1.0, 1.0, 0.0])
    assert bool(found.stats["done"].all())
    # From a far start 6 to 10 steps of a quadratic convergence; what is more is lost at the floor.
    assert int(found.stats["evaluations"].max()) < 25
    np.testing.assert_allclose(found.value + found.stats["step"], truth, rtol=1e-12, atol=1e-13)


def test_a_misfit_that_is_no_noise_does_not_end_a_lane():
    """Begun .004 standard errors of it away from the minimum, it goes there all the same."""
    exact, truth = noisy_decays(0.0)
    data = np.tile((exact + 1e-8 * RNG.standard_normal(exact.shape))[:, :1], LANES)
    best = np.asarray(solve(data, truth[:, 0], solver=BatchLevenbergMarquardt(rtol=1e-9)).value)
    found = np.asarray(solve(data, best[:, 0] + 2e-11).value)
    np.testing.assert_allclose(found, best, rtol=0.0, atol=2e-12)


def test_it_ends_where_no_step_is_accepted_any_more():
    """With no allowance for the rounding of the data, only refused steps say that it is over."""
    data, truth = noisy_decays(noise=0.0)
    found = solve(data, [1.0, 1.0, 0.0], solver=BatchLevenbergMarquardt(rtol=1e-9, atol=0.0))
    assert bool(found.stats["done"].all())
    assert int(found.stats["evaluations"].max()) < 60
    np.testing.assert_allclose(found.value, truth, rtol=1e-12, atol=1e-13)


def test_a_lane_does_not_depend_on_the_others():
    data, _ = noisy_decays()
    hard = data.copy()
    hard[:, ::2] = (
        RNG.standard_normal((len(T), LANES // 2)) * 50.0
    )  # nonsense beside it takes longer
    alone, beside = solve(data, [1.0, 1.0, 0.0]), solve(hard, [1.0, 1.0, 0.0])
    assert int(beside.stats["evaluations"].max()) > int(alone.stats["evaluations"].max())
    np.testing.assert_array_equal(alone.value[:, 1::2], beside.value[:, 1::2])
    np.testing.assert_array_equal(
        alone.stats["evaluations"][1::2], beside.stats["evaluations"][1::2]
    )


def test_a_lane_of_nan_neither_spoils_nor_delays_the_others():
    data, _ = noisy_decays()
    spoilt = data.copy()
    spoilt[3, 4] = np.nan
    good, bad = solve(data, [1.0, 1.0, 0.0]), solve(spoilt, [1.0, 1.0, 0.0])
    others = np.arange(LANES) != 4
    np.testing.assert_array_equal(good.value[:, others], bad.value[:, others])
    assert not np.isfinite(bad.stats["cost"][4])
    assert np.isfinite(np.asarray(bad.value)).all()
    assert int(bad.stats["num_steps"]) == int(good.stats["num_steps"])


def test_bounds_hold_and_the_bounded_minimum_is_that_of_scipy():
    data, truth = noisy_decays()
    # The true decay rate lies above its bound in about half of the lanes.
    lower, upper = [0.0, 0.0, -2.0], [5.0, 1.2, 2.0]
    found = solve(data, [1.0, 1.0, 0.0], lower=lower, upper=upper)
    y = np.asarray(found.value + found.stats["step"])
    assert bool(found.stats["done"].all())
    assert np.all(y[1] <= 1.2)
    at_bound = y[1] == 1.2
    assert 5 < at_bound.sum() < LANES - 5
    for lane in np.flatnonzero(at_bound):
        if truth[1, lane] < 1.25:
            continue  # scipy's interior method stops a hair inside
        scipy = by_scipy(data[:, lane], [1.0, 1.0, 0.0], bounds=(lower, upper))
        np.testing.assert_allclose(y[:, lane], scipy.x, atol=1e-3)
        assert np.sum(decay(y[:, [lane]], data[:, [lane]]) ** 2) <= 2 * scipy.cost * (1 + 1e-6)


def test_max_steps_leaves_lanes_that_go_on_from_there():
    data, _ = noisy_decays()
    whole = solve(data, [1.0, 1.0, 0.0])
    cut = solve(data, [1.0, 1.0, 0.0], max_steps=2)
    assert not bool(cut.stats["done"].any())
    assert int(cut.stats["evaluations"].max()) == 2
    assert int(whole.stats["evaluations"].min()) > 2


def test_fewer_data_than_unknowns_end_at_a_zero():
    data = np.array([[1.0, 0.3], [2.0, 0.1]])

    def line(y, args):
        return jnp.stack([y[0] + y[1], y[0] + y[1] + y[2]]) - args

    found = solve(data, [0.3, 0.2, 0.1], fn=line)
    assert bool(found.stats["done"].all())
    assert float(found.stats["cost"].max()) < 1e-25


def test_normal_sums_are_the_products_of_the_jacobian():
    data, truth = noisy_decays(lanes=7)
    sums = jax.jit(lambda y, a: normal_sums(lambda *z: (decay(*z), None), y, a))(truth, data)
    cost, gradient, matrix = sums[0, 0], sums[0, 1:], sums[1:, 1:]
    e = np.exp(-truth[1] * T[:, None])
    jacobian = np.stack([e, -truth[0] * T[:, None] * e, np.ones_like(e)])
    residual = truth[0] * e + truth[2] - data
    # 25 terms of order 1 or less, each with a few roundings.
    close = {"rtol": 1e-13, "atol": 1e-13}
    np.testing.assert_allclose(cost, (residual**2).sum(0), **close)
    np.testing.assert_allclose(gradient, np.einsum("itl,tl->il", jacobian, residual), **close)
    np.testing.assert_allclose(matrix, np.einsum("itl,jtl->ijl", jacobian, jacobian), **close)


@pytest.mark.parametrize("p", [1, 2, 5, 9])
def test_solve_lanes_is_a_linear_solve_over_the_free_unknowns(p):
    half = RNG.standard_normal((p, p + 3, 50)) * 10.0 ** RNG.uniform(-3, 3, (p, 1, 1))
    matrix = np.einsum("iml,jml->ijl", half, half)
    rhs, free = RNG.standard_normal((p, 50)), RNG.random((p, 50)) < 0.7
    found = np.asarray(jax.jit(solve_lanes)(matrix, rhs, free))
    for lane in range(50):
        f = free[:, lane]
        assert np.all(found[~f, lane] == 0.0)
        if f.any():
            want = np.linalg.solve(matrix[np.ix_(f, f, [lane])][..., 0], rhs[f, lane])
            # rows differ by 1e6, but Cholesky does not mind what a column is measured in
            np.testing.assert_allclose(found[f, lane], want, rtol=1e-9)


@pytest.mark.parametrize("p", [2, 3])
def test_bounded_step_gains_over_the_box_wherever_there_is_a_gain(p):
    """Against scipy's bounded linear least squares, from points of which half lie on bounds."""
    lanes, rng = 2000, np.random.default_rng(p)
    half = rng.standard_normal((p, p + 2, lanes))
    matrix = np.einsum("iml,jml->ijl", half, half)
    gradient = 3.0 * rng.standard_normal((p, lanes))
    y, pick = rng.uniform(0.0, 1.0, (2, p, lanes))
    y = np.where(pick < 0.3, 0.0, np.where(pick > 0.8, 1.0, y))
    sums = np.ones((p + 1, p + 1, lanes))
    sums[0, 1:], sums[1:, 1:] = gradient, matrix
    lower, upper = np.zeros_like(y), np.ones_like(y)
    step, fall = map(np.asarray, jax.jit(bounded_step)(y, sums, lower, upper, np.zeros(lanes)))
    # Within an eps; the solver clips what it adds up.
    assert np.all((y + step >= -1e-15) & (y + step <= 1.0 + 1e-15))
    best = np.empty(lanes)
    for lane in range(lanes):
        h, g, s = matrix[:, :, lane], gradient[:, lane], step[:, lane]
        assert fall[lane] == pytest.approx(-(2.0 * g @ s + s @ h @ s), abs=1e-11)
        root = np.linalg.cholesky(h)
        box = (-y[:, lane] - 1e-15, 1.0 - y[:, lane] + 1e-15)
        s = lsq_linear(root.T, -np.linalg.solve(root, g), box, method="bvls").x
        best[lane] = -(2.0 * g @ s + s @ h @ s)
    assert np.all(fall <= best + 1e-9)
    # It need not be the best step, but nothing gained must mean that the lane has arrived.
    assert np.all(fall[best > 1e-6] > 1e-9)
    assert (fall / best)[best > 1e-6].mean() > 0.9


def test_two_unknowns_that_the_data_cannot_tell_apart_give_a_finite_step():
    half = RNG.standard_normal((9, 12, 20))
    half[1] = half[0]
    matrix, rhs = np.einsum("iml,jml->ijl", half, half), RNG.standard_normal((9, 20))
    found = jax.jit(solve_lanes)(matrix, rhs, np.ones_like(rhs, bool))
    assert np.isfinite(np.asarray(found)).all()


def test_no_library_is_called_that_waits_for_threads_of_its_own():
    """Two fits of 24 unknowns side by side, by the batched LAPACK calls of jaxlib, never ended."""
    at = np.ones((9, 9, 20)), np.ones((9, 20)), np.ones((9, 20), bool)
    assert "custom-call" not in jax.jit(solve_lanes).lower(*at).compile().as_text()


@pytest.mark.parametrize("p", [pytest.param(40, marks=pytest.mark.study), 44])
def test_sums_of_many_unknowns(p):
    """XLA ended the process at more than 43 unknowns, as splines of a film may have."""
    rng = np.random.default_rng(p)
    table, data = rng.standard_normal((2, 30, p)), rng.standard_normal((30, 3))
    y = rng.standard_normal((p, 3))

    def residual(y, args):
        return (jnp.asarray(table[0]) @ y - data, jnp.sin(jnp.asarray(table[1]) @ y)), None

    sums = jax.jit(lambda y: normal_sums(residual, y, None))(jnp.asarray(y))
    off = np.concatenate([table[0] @ y - data, np.sin(table[1] @ y)])
    for lane in range(3):
        slopes = np.concatenate([table[0], np.cos(table[1] @ y[:, [lane]]) * table[1]])
        rows = np.concatenate([off[:, [lane]], slopes], 1)
        np.testing.assert_allclose(sums[..., lane], rows.T @ rows, rtol=1e-10, atol=1e-10)


def test_float32_stays_float32():
    data, truth = noisy_decays()
    with jax.enable_x64(False):
        found = solve(
            data.astype(np.float32), [1.0, 1.0, 0.0],
            solver=BatchLevenbergMarquardt(atol=2.0**-23),
        )  # fmt: skip
        assert found.value.dtype == jnp.float32
        assert bool(found.stats["done"].all())
        # noise .01, 25 data: 5 standard errors of the least certain unknown are about .1
        np.testing.assert_allclose(found.value, truth, atol=0.15)
