"""The thick slab against the textbook's geometric series in 100 digits."""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

from fresnel_jax import powers
from fresnel_jax.layers import slab
from tests.truth import adversarial, oracle

DTYPES = pytest.mark.parametrize("dtype", [np.float64, np.float32])
CASES = [
    pytest.param(dtype, name, id=f"{np.dtype(dtype).name}-{name}")
    for dtype in (np.float64, np.float32)
    for name in adversarial.hard_sets(dtype, 1)
]
R_BOUND, T_BOUND, PER_DEPTH = 24.0, 24.0, 4.0  # eps, eps, eps of ln(1 / A)


def exact(c, n, k, m, thickness, wavelength):
    """R_s, R_p, T_s, T_p and the optical depth, all mpmath numbers."""
    with mp.workdps(oracle.DIGITS):
        R_s, R_p, T_s, T_p = oracle.powers(c, n, k, m)
        Q = oracle._medium(c, n, k, m)[3]
        ratio = mp.mpf(thickness) / mp.mpf(wavelength)
        depth = 4 * mp.pi * ratio * Q.imag
        A = mp.exp(-depth)
        out = [[], []]
        for R, T in ((R_s, T_s), (R_p, T_p)):
            # Neither light nor loss: total reflection at a slab of no thickness.
            total = 0 if T == 0 else T * A * T / (1 - (R * A) ** 2)
            out[0].append(R + R * A * total)
            out[1].append(total)
        return *out[0], *out[1], depth


def sizes(dtype, count, seed=5):
    random = np.random.default_rng(seed)
    thickness, wavelength = 10.0 ** random.uniform(-3, 4, count), 10.0 ** random.uniform(-1, 1)
    thickness[:5] = 0.0
    return thickness.astype(dtype), np.full(count, wavelength, dtype)


@pytest.mark.parametrize("dtype, name", CASES)
def test_powers_against_the_series(dtype, name):
    count = 50
    points = adversarial.hard_sets(dtype, count)[name]
    thickness, wavelength = sizes(dtype, count)
    found = [
        np.asarray(x)
        for x in slab(
            *points[:3], thickness_um=thickness, wavelength_um=wavelength, eta_i=points[3]
        )
    ]
    eps, tiny = float(np.finfo(dtype).eps), float(np.finfo(dtype).tiny)
    assert all(x.dtype == dtype and np.isfinite(x).all() for x in found)
    for i in range(count):
        point = [float(x[i]) for x in points]
        *true, depth = exact(*point, float(thickness[i]), float(wavelength[i]))
        for j, value in enumerate(true):
            error = abs(mp.mpf(float(found[j][i])) - value) / eps
            if j < 2:
                assert error <= R_BOUND * max(value, eps**2)
            else:
                assert error <= (T_BOUND + PER_DEPTH * depth) * max(value, tiny / eps)


def test_the_series_itself_summed_term_by_term():
    """Where the closed sum comes from: what leaves after each passage, one after the other."""
    c, n, k, d, wavelength = 0.7, 1.5, 2e-5, 2000.0, 0.6
    one = powers(c, n, k)
    found = slab(c, n, k, thickness_um=d, wavelength_um=wavelength)
    Q = np.sqrt((n + 1j * k) ** 2 - (1 - c * c))
    A = np.exp(-4 * np.pi * d * Q.imag / wavelength)
    for R_1, R, T in ((one.R_s, found.R_s, found.T_s), (one.R_p, found.R_p, found.T_p)):
        R_1 = float(R_1)
        inside, reflected, through = 1.0 - R_1, R_1, 0.0
        for _ in range(60):
            inside *= A
            through += inside * (1.0 - R_1)
            inside *= R_1 * A
            reflected += inside * (1.0 - R_1)
            inside *= R_1
        assert float(R) == pytest.approx(reflected, rel=1e-13)
        assert float(T) == pytest.approx(through, rel=1e-13)


def test_glass_by_hand():
    """n = 1.5 without absorption at normal incidence: R = .04, both faces 2 R / (1 + R)."""
    found = slab(1.0, 1.5, 0.0, thickness_um=1e3, wavelength_um=0.5)
    assert float(found.R) == pytest.approx(0.08 / 1.04, rel=1e-14)
    assert float(found.T) == pytest.approx(0.96 / 1.04, rel=1e-14)


MANY = 20_000  # of both tests below, which run in the same programs


@DTYPES
def test_nothing_is_lost_without_absorption_and_something_with_it(dtype):
    random = np.random.default_rng(2)
    c, n, m = (random.uniform(low, high, MANY).astype(dtype) for low, high in
               ((0.0, 1.0), (0.3, 4.0), (1.0, 2.0)))  # fmt: skip
    d, wavelength = dtype(50.0), dtype(0.6)
    clear = slab(c, n, 0.0, thickness_um=d, wavelength_um=wavelength, eta_i=m)
    eps = np.finfo(dtype).eps
    for R, T in ((clear.R_s, clear.T_s), (clear.R_p, clear.T_p)):
        np.testing.assert_allclose(np.asarray(R) + np.asarray(T), 1.0, rtol=0, atol=16 * eps)
    k = (10.0 ** random.uniform(-4, 1, MANY)).astype(dtype)
    dim = slab(c, n, k, thickness_um=d, wavelength_um=wavelength, eta_i=m)
    for R, T in ((dim.R_s, dim.T_s), (dim.R_p, dim.T_p)):
        R, T = np.asarray(R), np.asarray(T)
        assert ((R >= 0) & (T >= 0) & (1 + 16 * eps >= R + T)).all()


@DTYPES
def test_no_slab_reflects_more_than_it_gets(dtype):
    """Grazing light: R was an eps above 1 for 2 to 5 % of such points in float32."""
    random = np.random.default_rng(3)
    c = (10.0 ** random.uniform(-9, -0.5, MANY)).astype(dtype)
    n, m = (random.uniform(low, 4.0, MANY).astype(dtype) for low in (0.2, 1.0))
    for k in (0.0, (10.0 ** random.uniform(-12, 1, MANY)).astype(dtype)):
        found = slab(c, n, k, thickness_um=dtype(100.0), wavelength_um=dtype(0.5), eta_i=m)
        for power in found:
            power = np.asarray(power)
            assert ((power >= 0.0) & (power <= 1.0)).all()


@DTYPES
def test_limits(dtype):
    eps, rows = np.finfo(dtype).eps, np.array([  # cosine, n, k, d, eta_i
        (0.8, 1.7, 3.0, 1e6, 1.0), (0.8, 1.7, 0.0, 100.0, 1.7),
        # total reflection, thick and of no thickness
        (0.1, 1.0, 0.0, 0.0, 1.5), (0.1, 1.0, 0.0, 1e3, 1.5),
        (0.0, 1.7, 0.1, 1.0, 1.0), (1e-25, 1.7, 0.0, 1.0, 1.0),
    ], dtype)  # fmt: skip
    c, n, k, d, m = np.resize(rows, (50, 5)).T  # the shape of the hard sets above
    wavelength = np.full(50, 0.5, dtype)
    light = np.array(slab(c, n, k, thickness_um=d, wavelength_um=wavelength, eta_i=m))
    opaque, matched, *total, grazing, faint = light[:, :6].T
    face = powers(c, n, k, m)
    assert opaque.tolist() == [face.R_s[0], face.R_p[0], 0.0, 0.0]
    assert matched.tolist() == [0.0, 0.0, 1.0, 1.0]
    for one in total:
        assert one.tolist() == [1.0, 1.0, 0.0, 0.0]
    np.testing.assert_allclose(grazing, [1, 1, 0, 0], rtol=12 * eps)
    # T1^2 would underflow in float32, as the product of the two faces does
    assert faint[2] == pytest.approx(float(face.T_s[5]) / 2, rel=1e-5)


def _parameters():
    random = np.random.default_rng(11)
    yield 0.8, 1.5, 0.0, 3000.0, 0.6, 1.0  # k = 0: the slope of T in k is not 0
    yield 1.0, 1.5, 0.0, 3000.0, 0.6, 1.0
    yield 0.0003, 1.5, 1e-7, 3000.0, 0.6, 1.0
    yield 0.5, 1.5, 2.0, 3000.0, 0.6, 1.0  # opaque
    yield 0.6, 1.3, 1e-3, 0.0, 0.6, 1.0  # no thickness
    yield 0.2, 1.2, 0.0, 5.0, 0.6, 1.5  # total reflection
    for _ in range(20):
        k = 10.0 ** random.uniform(-7, 0)
        d = 10.0 ** random.uniform(-1, 1) * 0.6 / (4 * np.pi * k)  # a depth from .1 to 10
        yield random.uniform(0.05, 1), random.uniform(0.5, 4), k, d, 0.6, random.uniform(1, 2)


def of_slab(c, n, k, thickness, wavelength, eta_i):
    return slab(c, n, k, thickness_um=thickness, wavelength_um=wavelength, eta_i=eta_i)


@pytest.mark.parametrize("dtype, bound", [(np.float64, 400.0), (np.float32, 400.0)])
def test_gradients_against_differences_in_100_digits(dtype, bound):
    """Bound in eps of each gradient's largest part, times 1 + the optical depth."""
    eps = float(np.finfo(dtype).eps)
    points = np.array(list(_parameters()), dtype)
    jacobian = jax.jit(jax.vmap(jax.jacrev(of_slab, argnums=(0, 1, 2, 3, 4, 5))))
    slopes = np.array(jacobian(*points.T))  # results, arguments, points
    for parameters, slope in zip(points, np.moveaxis(slopes, -1, 0), strict=True):
        exactly = [float(x) for x in parameters]
        # the oracle has eta_i fourth
        *_, depth = exact(*exactly[:3], exactly[5], *exactly[3:5])
        for j, ours in enumerate(slope):
            true = np.array([_difference(exactly, i, j) for i in range(6)])
            # each by its relative change, so that micrometres and k = 1e-7 can be compared
            unit = np.maximum(np.abs(exactly), 1e-9)
            scale = max(np.abs(true * unit).max(), 1e-25)  # the differences are no better
            assert (np.abs(ours - true) * unit <= bound * eps * (1 + float(depth)) * scale).all(), (
                parameters, j, ours, true)  # fmt: skip


def _difference(point, i, j):
    """The derivative of output j with respect to argument i, one-sided at a lower edge."""
    with mp.workdps(oracle.DIGITS):
        step = mp.mpf(10) ** -30

        def at(shift):
            x = [mp.mpf(v) for v in point]
            x[i] += shift
            return exact(*x[:3], x[5], *x[3:5])[j]

        if point[i] == 0.0:
            return float((at(step) - at(0)) / step)
        return float((at(step) - at(-step)) / (2 * step))


def test_broadcasting_jit_vmap_and_complex_index():
    c, wavelength = jnp.linspace(0.1, 1, 4)[:, None], jnp.linspace(0.4, 0.8, 3)
    plain = slab(c, 1.5, 1e-6, thickness_um=3000.0, wavelength_um=wavelength)
    assert all(x.shape == (4, 3) for x in plain)
    jitted = jax.jit(slab)(c, 1.5, 1e-6, thickness_um=3000.0, wavelength_um=wavelength)
    mapped = jax.vmap(
        lambda cc: slab(cc, 1.5, 1e-6, thickness_um=3000.0, wavelength_um=wavelength)
    )(c[:, 0])
    of_complex = slab(c, 1.5 + 1e-6j, 0.0, thickness_um=3000.0, wavelength_um=wavelength)
    for others in (jitted, mapped, of_complex):
        for ours, theirs in zip(plain, others, strict=True):
            # two compilations of one formula; T amplifies the rounding of its exponent
            np.testing.assert_allclose(ours, theirs, rtol=2e-14)
    # lossless and at one angle, the thickness alone has a shape
    assert slab(1.0, 1.5, 0.0, thickness_um=jnp.ones(5), wavelength_um=0.5).T.shape == (5,)


def test_refusals():
    with pytest.raises(ValueError, match="thickness_um and wavelength_um"):
        slab(jnp.ones(3), 1.5, 0.0, thickness_um=jnp.ones(2), wavelength_um=0.5)
    with pytest.raises(ValueError, match="do not broadcast"):
        slab(jnp.ones(3), jnp.ones(2), 0.0, thickness_um=1.0, wavelength_um=0.5)
    with pytest.raises(ValueError, match="wavelength_um is complex"):
        slab(1.0, 1.5, 0.0, thickness_um=1.0, wavelength_um=0.5 + 1j)
    with pytest.raises(ValueError, match="k is complex"):
        slab(1.0, 1.5, 1j, thickness_um=1.0, wavelength_um=0.5)
