"""The coordinates of the fit against their definitions, in 60 digits."""

import jax
import mpmath as mp
import numpy as np
import pytest

from fitting.bare_surface.coordinates import (
    FAR_END,
    W_MIN,
    X_MAX,
    coordinates_of,
    index_derivatives,
    index_of,
    xi_of,
)

RNG = np.random.default_rng(6)
N = np.concatenate([RNG.uniform(0.05, 6.0, 60), 10.0 ** RNG.uniform(-3.0, 3.0, 40)])
K = np.concatenate([RNG.uniform(0.0, 8.0, 60), 10.0 ** RNG.uniform(-6.0, 3.0, 40)])


def exact(x, w, chart):
    """n and k by the definitions: x = log[(1 + |N|^2) / 2n], w = 2 xi - chart log|N|^2."""
    square = mp.exp(chart * (2 * mp.acosh(mp.exp(x)) - w))
    n = (1 + square) / (2 * mp.exp(x))
    return n, mp.sqrt(square - n * n)


def test_index_has_every_digit_in_either_chart():
    x = 10.0 ** RNG.uniform(-10.0, 1.0, 200)
    with mp.workdps(60):
        for xi in x:
            far = 4.0 * float(mp.acosh(mp.exp(mp.mpf(float(xi)))))
            for w in far * np.array([1e-20, 1e-8, 0.01, 0.3, 0.5, 0.9]):
                for chart in (1.0, -1.0):
                    n, k = (float(v) for v in index_of(xi, w, chart))
                    want_n, want_k = exact(mp.mpf(float(xi)), mp.mpf(float(w)), chart)
                    # n and k have some ten roundings; 4 xi - w loses a digit at .9 of the way, and
                    # exp(w) for w up to 40 has an error of 40 eps.
                    assert abs(n / want_n - 1) < 2e-14
                    assert abs(k / want_k - 1) < 2e-14


def test_there_and_back():
    x, w, chart = coordinates_of(N, K)
    n, k = index_of(x, w, chart)
    np.testing.assert_allclose(n, N, rtol=1e-12)
    # w is a difference here: k^2 is good to an eps of |N|^2.
    np.testing.assert_allclose(
        np.asarray(k) ** 2, K**2, rtol=1e-11, atol=1e-13 * np.max(N**2 + K**2)
    )
    assert (w >= W_MIN).all()
    assert (w <= 2.0 * xi_of(x) * (1 + 1e-12)).all()  # from the nearer end
    assert (chart == np.where(N**2 + K**2 < 1.0, -1.0, 1.0)).all()


def test_x_is_the_reflectance_at_normal_incidence():
    x, _, _ = coordinates_of(N, K)
    amplitude = (N + 1j * K - 1.0) / (N + 1j * K + 1.0)
    np.testing.assert_allclose(np.tanh(x / 2.0), np.abs(amplitude) ** 2, rtol=1e-12, atol=1e-15)


def test_ends_are_lossless():
    x = np.array([1e-6, 0.08, 1.0, 5.0])
    n, k = index_of(x, np.full(4, W_MIN), np.ones(4))
    np.testing.assert_allclose(n, np.exp(xi_of(x)), rtol=1e-14)
    assert (np.asarray(k) < 1e-11 * np.asarray(n)).all()
    below, _ = index_of(x, np.full(4, W_MIN), -np.ones(4))
    np.testing.assert_allclose(below, np.exp(-xi_of(x)), rtol=1e-14)
    # Past the far end nothing more happens, and nothing becomes NaN.
    n, k = index_of(x, np.full(4, 163.0), np.ones(4))
    np.testing.assert_allclose(n, np.exp(-xi_of(x)), rtol=1e-12)
    assert (np.asarray(k) < 100 * np.sqrt(FAR_END) * np.exp(xi_of(x))).all()
    assert np.isfinite(index_of(X_MAX, 1.0, 1.0)).all()


@pytest.mark.parametrize("chart", [1.0, -1.0])
def test_derivatives_are_those_of_the_map(chart):
    with mp.workdps(60):
        for x in (1e-4, 0.08, 0.7, 3.0, 8.0):
            far = 4.0 * float(xi_of(np.array(x)))
            for w in far * np.array([1e-6, 0.02, 0.4, 0.8]):
                n, k, *found = index_derivatives(x, w, chart)
                want = []
                for i in (0, 1):
                    for arg in (0, 1):
                        want.append(
                            mp.diff(lambda a, b: exact(a, b, chart)[i], (x, w), (1 - arg, arg))  # noqa: B023
                        )
                for value, truth in zip(found, want, strict=True):
                    # n_x and k_x are differences of terms of order xi_x n, xi_x k, with
                    # xi_x = coth xi (70 at x = 1e-4).
                    scale = max(n, k) / np.tanh(far / 4.0)
                    assert abs(value - truth) < 1e-12 * max(abs(truth), scale)
                tangents = jax.jvp(
                    lambda a, b: index_of(a, b, chart), (x, w), (0.3, 0.7)
                )[1]  # fmt: skip
                n_x, n_w, k_x, k_w = found
                np.testing.assert_allclose(
                    tangents, (0.3 * n_x + 0.7 * n_w, 0.3 * k_x + 0.7 * k_w), rtol=1e-12
                )
