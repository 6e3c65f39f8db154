"""Effective media against their defining equations in 60 digits, and their limits."""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

from fresnel_jax.effective_medium import bruggeman, linear, looyenga, maxwell_garnett
from fresnel_jax.layers import stack

pytestmark = pytest.mark.slow

MODELS = [bruggeman, looyenga, maxwell_garnett, linear]
INDEX_BOUND, K_BOUND = 16.0, 32.0  # eps of |N|, and of k itself


def _bruggeman_root(eps, f, factor=None):
    """The root in the cone of the constituents, among all of the polynomial's."""
    factor = mp.mpf(1) / 3 if factor is None else mp.mpf(factor)

    def both(other):
        return [float(1 - factor), complex(factor * other)]

    total = np.zeros(1)
    for j, share in enumerate(f):
        product = np.ones(1)
        for i, other in enumerate(eps):
            product = np.polymul(product, [-1, complex(other)] if i == j else both(other))
        total = np.polyadd(total, float(share) * product)
    phases = [float(mp.arg(e)) for e in eps]
    inside = [r for r in np.roots(total) if min(phases) - 1e-6 <= np.angle(r) <= max(phases) + 1e-6]
    assert len(inside) == 1, (inside, phases)

    def equation(x):
        return sum(
            s * (e - x) / (factor * e + (1 - factor) * x) for s, e in zip(f, eps, strict=True)
        )

    return mp.findroot(equation, mp.mpc(inside[0]))


def oracle(model, eta, k, fraction):
    with mp.workdps(60):
        eps = [mp.mpc(float(n), float(kk)) ** 2 for n, kk in zip(eta, k, strict=True)]
        rest = [mp.mpf(float(x)) for x in fraction]
        f = [1 - sum(rest), *rest]
        if model is looyenga:
            mixture = sum(x * e ** (mp.mpf(1) / 3) for x, e in zip(f, eps, strict=True)) ** 3
        elif model is maxwell_garnett:
            s = sum(x * (e - eps[0]) / (e + 2 * eps[0]) for x, e in zip(f, eps, strict=True))
            mixture = eps[0] * (1 + 2 * s) / (1 - s)
        elif model is linear:
            mixture = sum(x * e for x, e in zip(f, eps, strict=True))
        else:
            mixture = _bruggeman_root(eps, f)
        return mp.sqrt(mixture)


def media(dtype, count, several, seed):
    """Random constituents: dielectrics, weak absorbers, semiconductors, metals; any fractions."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        kinds = random.integers(0, 4, several)

        def drawn(low, high):
            return random.uniform(low, high, several)

        eta = np.choose(kinds, [drawn(1, 4), drawn(1, 3), drawn(2, 5), drawn(0.05, 3)])
        k = np.choose(kinds, [drawn(0, 0), 10 ** drawn(-9, -2), drawn(0.01, 3), drawn(1, 10)])
        share = random.dirichlet(np.ones(several) * random.choice([0.2, 1.0]))[1:]
        yield eta.astype(dtype), k.astype(dtype), share.astype(dtype)


@pytest.mark.study
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("several", [2, 3, pytest.param(4, marks=pytest.mark.study)])
@pytest.mark.parametrize("model", MODELS)
def test_random_mixtures_against_the_defining_equation(model, several, dtype):
    eps = float(np.finfo(dtype).eps)
    for eta, k, fraction in media(dtype, 30, several, several):
        found = model(eta, k, fraction)
        assert found.eta.dtype == found.k.dtype == dtype
        true = oracle(model, eta, k, fraction)
        with mp.workdps(60):
            off = abs(mp.mpc(float(found.eta), float(found.k)) - true) / abs(true)
            assert off <= INDEX_BOUND * eps, (eta, k, fraction)
            off_k = abs(float(found.k) - true.imag)
            assert off_k <= K_BOUND * eps * true.imag + 1e-40, (eta, k, fraction)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("model", MODELS)
def test_pure_and_matched_media_come_out_as_they_are(model, dtype):
    eps = float(np.finfo(dtype).eps)
    rows = np.array([  # eta and k of both, and the share of the second
        (1.5, 3.9, 1e-9, 0.02, 0.0), (1.5, 3.9, 1e-9, 0.02, 1.0),
        (2.2, 2.2, 1e-7, 1e-7, 0.0), (2.2, 2.2, 1e-7, 1e-7, 0.3), (2.2, 2.2, 1e-7, 1e-7, 1.0),
        (1.5, 3.9, 0.0, 0.02, 1e-7), (1.5, 3.9, 0.0, 0.02, 1e-9), (1.5, 3.9, 0.0, 0.0, 0.4),
    ], dtype)  # fmt: skip
    found = model(rows[:, :2].T, rows[:, 2:4].T, rows[:, 4:].T)
    np.testing.assert_allclose(found.eta[:5], [1.5, 3.9, 2.2, 2.2, 2.2], rtol=8 * eps)
    np.testing.assert_allclose(found.k[:5], [1e-9, 0.02, 1e-7, 1e-7, 1e-7], rtol=16 * eps)
    # a trace of an absorber: its k comes in proportion, not as the rounding of the host's index
    assert float(found.k[5] / found.k[6]) == pytest.approx(100.0, rel=1e-4)
    # nothing absorbs: k is 0, not its rounding
    assert float(found.k[7]) == 0.0


@jax.jit
def _with_slope(eta, k, fraction, factor):
    """Bruggeman's index and its derivative by the depolarization factor."""
    return jax.jvp(lambda L: bruggeman(eta, k, fraction, L), (factor,), (jnp.ones_like(factor),))


@pytest.mark.parametrize("several", [2, pytest.param(3, marks=pytest.mark.study)])
@pytest.mark.parametrize("dtype", [np.float64, pytest.param(np.float32, marks=pytest.mark.study)])
def test_grains_of_any_depolarization(several, dtype):
    cases = list(media(dtype, 8, several, 30 + several))
    factor = np.array([1e-3, 0.1, 0.25, 0.4, 0.5, 0.7, 0.0, 1.0], dtype)
    eta, k, fraction = (np.stack(x, -1) for x in zip(*cases, strict=True))
    found, slope = (x.complex for x in _with_slope(eta, k, fraction, factor))
    eps = float(np.finfo(dtype).eps)
    assert found.dtype == np.result_type(dtype, np.complex64) and np.isfinite(slope).all()
    permittivity = (eta.astype(float) + 1j * k) ** 2
    shares = np.stack([1.0 - fraction.astype(float).sum(0), *fraction])
    for i, L in enumerate(factor[:-2]):
        with mp.workdps(60):
            e = [mp.mpc(float(n), float(x)) ** 2 for n, x in zip(*cases[i][:2], strict=True)]
            f = [mp.mpf(float(x)) for x in cases[i][2]]
            f = [1 - sum(f), *f]
            true = mp.sqrt(_bruggeman_root(e, f, float(L)))
            assert abs(mp.mpmathify(complex(found[i])) - true) <= INDEX_BOUND * eps * abs(true)
            # of F(eps, L) = 0: d eps / d L = -F_L / F_eps
            u = [1 / (L * x + (1 - L) * true**2) for x in e]
            along = sum(a * ((x - true**2) * v) ** 2 for a, x, v in zip(f, e, u, strict=True))
            across = sum(a * x * v * v for a, x, v in zip(f, e, u, strict=True))
            want = -along / across / (2 * true)
            assert abs(mp.mpmathify(complex(slope[i])) - want) <= 300 * eps * abs(want)
    # Wiener's bounds: grains that are sheets along the field and across it
    bounds = (shares * permittivity).sum(0)[-2], 1.0 / (shares / permittivity).sum(0)[-1]
    np.testing.assert_allclose(found[-2:], np.sqrt(bounds), rtol=20 * eps)
    with pytest.raises(ValueError, match="depolarization is 1.5; wanted a number from 0 to 1"):
        bruggeman(eta, k, fraction, 1.5)


def test_published_numbers():
    # Half void and half glass (n 1.5): eps 1 and 2.25 give by hand 1.5625, 1.5473, 1.5278
    found = [float(m([1.0, 1.5], [0.0, 0.0], [0.5]).eta) ** 2 for m in MODELS]
    by_hand = [
        (0.5 * 3.25 + np.sqrt((0.5 * 3.25) ** 2 + 8 * 2.25)) / 4,
        (0.5 + 0.5 * 2.25 ** (1 / 3)) ** 3,
        (1 + 2 * 0.5 * 1.25 / 4.25) / (1 - 0.5 * 1.25 / 4.25),
        1.625,
    ]
    np.testing.assert_allclose(found, by_hand, rtol=1e-14)
    # Maxwell Garnett's plasmon: silver spheres in vacuum absorb where Re eps is near -2 (Froehlich)
    wavelength_k = np.linspace(1.0, 2.0, 101)
    absorbed = maxwell_garnett(
        np.array([np.ones(101), np.full(101, 0.2)]), np.array([np.zeros(101), wavelength_k]), [0.01]
    ).k
    assert (wavelength_k[np.argmax(absorbed)] ** 2 - 0.04) == pytest.approx(2.0, abs=0.06)


@pytest.mark.study
@pytest.mark.parametrize("several", [2, pytest.param(3, marks=pytest.mark.study)])
@pytest.mark.parametrize("model", MODELS)
def test_derivatives_against_differences_of_the_oracle(model, several):
    cases = list(media(np.float64, 5, several, 10 + several))
    cases.append((np.linspace(1.3, 2.2, several), np.zeros(several), np.zeros(several - 1)))

    def split(x):
        return x[:several], x[several : 2 * several], x[2 * several :]

    def ours(x):
        return jnp.stack(model(*split(x)))

    forward, reverse = jax.jit(jax.jacfwd(ours)), jax.jit(jax.jacrev(ours))
    second = jax.jit(jax.jacfwd(jax.jacfwd(ours)))
    for eta, k, fraction in cases:
        flat = np.concatenate([eta, k, fraction])
        slopes = forward(flat)
        np.testing.assert_allclose(reverse(flat), slopes, rtol=1e-10, atol=1e-10)
        assert np.isfinite(second(flat)).all()
        for i in range(len(flat)):
            step = 1e-6
            up, down = flat.copy(), flat.copy()
            up[i] += step
            down[i] = max(down[i] - step, 0.0) if i >= several else down[i] - step
            high, low = (oracle(model, *split(x)) for x in (up, down))
            true = (high - low) / (up[i] - down[i])
            tolerance = 1e-4 * (1 + abs(complex(true)))
            assert abs(complex(*map(float, slopes[:, i])) - complex(true)) < tolerance


@pytest.mark.parametrize("model", MODELS)
def test_shapes_and_transformations(model):
    wavelengths, batch = 5, 3
    eta = [1.0, np.linspace(1.4, 1.6, wavelengths)]
    found = model(eta, [0.0, 0.0], np.full((1, batch, 1), 0.3))
    assert found.eta.shape == (batch, wavelengths)
    eta = np.stack([np.ones(wavelengths), eta[1]])
    mixed = jax.jit(lambda n: model(n, np.zeros(2), [0.3]).eta)
    one = [mixed(eta[:, i]) for i in range(wavelengths)]
    lanes = jax.vmap(mixed, in_axes=1)(eta)
    np.testing.assert_allclose(found.eta[0], one, rtol=1e-15)
    np.testing.assert_allclose(lanes, one, rtol=1e-15)


@pytest.mark.parametrize("call, says", [
    (lambda m: m(1.5, 0.0, [0.5]), "two or more"),
    (lambda m: m([1.5], [0.0], []), "two or more"),
    (lambda m: m([1.0, 1.5], [0.0, 0.0], 0.5), "but the first"),
    (lambda m: m([1.0, 1.5], [0.0, 0.0], [0.5, 0.5]), "but the first"),
    (lambda m: m(np.ones((2, 3)), np.zeros((2, 4)), [0.5]), "broadcast"),
    (lambda m: m([1.0, 1.5], [0.0, 0.0], [-0.1]), "fraction is -0.1; wanted >= 0"),
    (lambda m: m([1.0, 1.5], [0.0, 0.0], np.array([[0.5, 1.1]])), "fraction is 1.1"),
    (lambda m: m([1.0, 1.5, 2.0], [0.0, 0.0, 0.0], [0.6, 0.6]), "adds up to 1.2; wanted 1 or less"),
])  # fmt: skip
@pytest.mark.parametrize("model", MODELS)
def test_refusals(model, call, says):
    with pytest.raises(ValueError, match=says):
        call(model)


@pytest.mark.study
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("several", [3, pytest.param(4, marks=pytest.mark.study), 5])
def test_metals_among_dielectrics_near_the_fraction_at_which_they_touch(several, dtype):
    """Newton's steps and the map alone had not converged in 40 steps for 5 to 18 % of these."""
    random = np.random.default_rng(several)
    shape = (several, 2000)
    eta, k = 10.0 ** random.uniform(-1, 2, shape), 10.0 ** random.uniform(-9, 2, shape)
    eta[0], k[0], eta[1], k[1] = 1.0, 0.0, 1.45, 0.0
    k[2] = 10.0 ** random.uniform(1, 2, 2000)
    share = random.dirichlet(np.ones(several), 2000).T[1:]
    eta, k, share = (a.astype(dtype) for a in (eta, k, share))
    found = jax.jit(jax.vmap(bruggeman, (1, 1, 1)))(eta, k, share)
    # The equation in float64, and its slope: how far the root is from here.
    eps = (eta + 1j * k).astype(complex) ** 2
    root = (np.asarray(found.eta, float) + 1j * np.asarray(found.k, float)) ** 2
    f = np.concatenate([1.0 - share.sum(0, keepdims=True), share]).astype(float)
    away = (f * (eps - root) / (eps + 2 * root)).sum(0)
    slope = (3 * f * eps * root / (eps + 2 * root) ** 2).sum(0)
    assert np.max(np.abs(away / slope)) < 2000 * np.finfo(dtype).eps
    # It is the one in the cone of the constituents: the mixture absorbs no more than all of them.
    phase = np.angle(eps)
    assert (np.angle(root) >= phase.min(0) - 1e-6).all()
    assert (np.angle(root) <= phase.max(0) + 1e-6).all()


def test_a_mixture_with_gold_in_the_infrared():
    """Air and n = 2 with gold at 6.2 um: roots of the cubic, by numpy."""
    eta, k, share = np.array([1.0, 2.0, 5.097]), np.array([0.0, 0.0, 38.117]), np.array([0.4, 0.25])
    true = oracle(bruggeman, eta, k, share)
    found = bruggeman(eta, k, share)
    assert complex(found.eta, found.k) == pytest.approx(complex(true), rel=1e-14)
    slopes = jax.jit(jax.jacrev(lambda f: bruggeman(eta, k, f).eta))(share)
    for j in range(2):
        step = 1e-6 * np.eye(2)[j]
        ends = [oracle(bruggeman, eta, k, share + s * step).real for s in (1, -1)]
        assert float(slopes[j]) == pytest.approx(float((ends[0] - ends[1]) / 2e-6), rel=1e-6)


def test_a_film_of_flat_grains_that_an_ellipsometer_program_computed():
    """145 nm of a polymer with 70 % of water, depolarization factor 0.2, on 6 nm SiO2 and silicon.

    psi and Delta at 60 degrees are WVASE's, with the indices that its silicon, silica and water
    have: refellips 0.0.6 (BSD-3-Clause), tests/test_refellips.py, test 11, whose tolerances hold.
    Delta is folded to 0 to 180 degrees there.
    """
    # um, psi, Delta, n and k of silicon, n of silica, n of water
    um, psi, delta, n, k, silica, water = np.array([
        [0.41, 31.368, 163.32, 5.307701, 0.298060, 1.483102, 1.3386],
        [0.49, 30.777, 175.99, 4.357884, 0.078279, 1.477374, 1.3354],
        [0.57, 29.394, 170.98, 4.024567, 0.031522, 1.473933, 1.3330],
        [0.65, 27.415, 161.93, 3.851525, 0.016460, 1.471703, 1.3310],
        [0.73, 25.476, 156.41, 3.751417, 0.009969, 1.470174, 1.3300],
    ]).T  # fmt: skip
    both = np.stack([1.66 + 0.006 / um**2, water])

    def angles(factor):
        film = bruggeman(both, np.zeros((2, 5)), np.full((1, 5), 0.7), factor)
        media = [water, film, silica, n + 1j * k]
        light = stack(0.5, media, thickness_um=[0.145, 0.006], wavelength_um=um, exact=False)
        rho = np.asarray(light.r_p / light.r_s)
        return np.degrees(np.arctan(np.abs(rho))), np.degrees(np.abs(np.angle(rho)))

    found = angles(0.2)
    np.testing.assert_allclose(found[0], psi, rtol=2e-4)
    np.testing.assert_allclose(found[1], delta, rtol=7e-5)
    assert np.abs(angles(1.0 / 3.0)[1] - delta).max() > 0.1  # spheres are another film
