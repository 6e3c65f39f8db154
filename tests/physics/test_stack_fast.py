"""The fast tier of films: values and derivatives against characteristic matrices by mpmath."""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

from fresnel_jax.layers import FEW_LAYERS, stack
from tests.truth import stack_oracle

LAYERS = (0, 1, 2, FEW_LAYERS)
MANY = (FEW_LAYERS + 1, 12, 40)  # one loop over layers instead of a formula for each of them


def drawn(layers, count, seed):
    """Return cosines, n_0, n, k, thicknesses and wavelengths of random stacks; half transparent.

    Many layers are up to 1 um thick, few up to 20.
    """
    random = np.random.default_rng(seed)
    shape = (layers + 1, count)
    thickest = 1.3 if layers <= FEW_LAYERS else 0.0
    k = 10.0 ** random.uniform(-6.0, 1.0, shape) * (random.random(shape) < 0.5)
    return (
        random.uniform(0.01, 1.0, count),
        random.uniform(1.0, 1.8, count),
        random.uniform(0.05, 5.0, shape),
        k,
        10.0 ** random.uniform(-3.0, thickest, (layers, count)),
        10.0 ** random.uniform(-0.5, 1.0, count),
    )


def fast(c, n_0, n, k, d, wavelength):
    """Return R_s, R_p, T_s, T_p, and real and imaginary part of r_s and r_p, (8, count)."""
    return jnp.stack(parts_of(c, n_0, n, k, d, wavelength)[:8])


def parts_of(c, n_0, n, k, d, wavelength):
    """Return the same, and real and imaginary part of t_s and t_p."""
    found = stack(
        c,
        [n_0, *jax.lax.complex(n, k)],
        thickness_um=list(d),
        wavelength_um=wavelength,
        exact=False,
    )
    return [*found[:4], *(part for z in found[4:8] for part in (z.real, z.imag))]


@jax.jit
def value_and_slope(at, along):
    """Return `fast` and its derivative along a direction of all its numbers."""
    return jax.jvp(fast, at, along)


def exact(c, n_0, n, k, d, wavelength):
    """Return the same as `parts_of` of one stack by mpmath, in 60 digits."""
    media = [n_0, *(mp.mpc(a, b) for a, b in zip(n, k, strict=True))]
    found = stack_oracle.stack(c, media, list(d), wavelength, 60)
    return [*found[:4], *(part for z in found[4:] for part in (z.real, z.imag))]


STEP = mp.mpf(10) ** -15  # central differences: errors of 1e-30 of the third derivative


def slope(at, along):
    """Return the derivative of `exact` at a stack, along a direction of all its numbers."""

    def moved(step):
        def by(x, dx):
            if np.ndim(x):
                return [by(a, b) for a, b in zip(x, dx, strict=True)]
            return mp.mpf(float(x)) + step * mp.mpf(float(dx))

        return exact(*(by(x, dx) for x, dx in zip(at, along, strict=True)))

    with mp.workdps(60):
        both = list(zip(moved(STEP), moved(-STEP), strict=True))[:8]
        return [float((a - b) / (2 * STEP)) for a, b in both]


def radians(n, k, d, wavelength):
    """Return the phases of the layers together, on which the errors depend."""
    return 1.0 + (2.0 * np.pi * np.abs(n[:-1] + 1j * k[:-1]) * d / wavelength).sum(0)


@pytest.mark.parametrize(
    "layers",
    [pytest.param(n, marks=[pytest.mark.study] * (n in (1, 2, 12))) for n in (*LAYERS, *MANY)],
)
def test_values_are_right_to_the_digits_of_the_phase(layers):
    count = 40
    given = drawn(layers, count, 11)
    with jax.enable_x64(True):
        found = np.array(jax.jit(parts_of)(*given))
    for i in range(count):
        true = np.array(exact(*(z[..., i] for z in given)), float)
        away = (np.abs(found[:, i] - true) / np.maximum(1.0, np.abs(true))).max()
        # Of 40,000 stacks the worst was 1e-13: near a critical angle the cosine itself is lost.
        assert away < 2e-13 * radians(*given[2:])[i]


# The others take as long to compile as these two, or twice as long.
@pytest.mark.parametrize(
    "layers",
    [
        pytest.param(n, marks=[pytest.mark.study] * (n not in (1, MANY[-1])))
        for n in (*LAYERS, *MANY)
    ],
)
def test_derivatives_are_those_of_exact_differences(layers):
    given = drawn(layers, 100 if layers <= FEW_LAYERS else 20, 12)
    random = np.random.default_rng(13)
    moves = [random.standard_normal(z.shape) * z for z in given]
    with jax.enable_x64(True):
        at, along = [[jnp.asarray(z) for z in x] for x in (given, moves)]
        _, quick = value_and_slope(at, along)
    quick = np.asarray(quick)
    one = [[[z[..., i] for z in x] for x in (given, moves)] for i in range(quick.shape[1])]
    true = np.array([slope(*each) for each in one]).T
    assert np.isfinite(quick).all()
    # Each argument is moved by about its own size, and the phase of a film by that many radians.
    size = np.abs(true).max(0) + radians(*given[2:])
    assert (np.abs(quick - true) / size).max() < 1e-11


def test_nothing_overflows_and_no_derivative_is_lost_at_the_ends():
    """Grazing light, no thickness, an index match, a critical angle, a millimetre of metal."""
    c = np.array([0.0, 1.0, 0.5, 0.6, 0.5])
    n = np.array([[1.5, 1.5, 1.0, 0.8, 0.1], [1.5, 1.0, 1.0, 1.0, 1.5]])
    k = np.array([[0.0, 0.0, 0.0, 0.0, 9.0], np.zeros(5)])
    d = np.array([[0.1, 0.0, 0.3, 0.2, 1e3]])
    given = (c, np.ones(5), n, k, d, np.full(5, 0.6))
    with jax.enable_x64(True):
        at = [jnp.asarray(np.repeat(z, 20, -1)) for z in given]  # of the 100 stacks above
        still = [jnp.zeros_like(z) for z in at]
        found = np.asarray(value_and_slope(at, still)[0])[:, ::20]
        # At grazing incidence, where the matrices say 0 / 0, the limit.
        limit = (np.maximum(c, 1e-30), *given[1:])
        each = [exact(*(z[..., i] for z in limit))[:8] for i in range(5)]
        away = np.abs(found - np.array(each, float).T).max(0)
        # One eps of the square of the cosine in the film at its critical angle, .8, is 1e-8 of it.
        assert (away < [1e-12, 1e-12, 1e-12, 1e-8, 1e-12]).all()
        for which in (2, 4):
            ones = [jnp.ones_like(z) if i == which else z for i, z in enumerate(still)]
            assert np.isfinite(value_and_slope(at, ones)[1]).all()


def graded(shift):
    """Return eight quantities of twelve slices between a metal and a film at total reflection."""
    n = jnp.linspace(1.2, 2.4, 14)[:, None] * (1.0 + shift * jnp.linspace(-1.0, 1.0, 14)[:, None])
    k = jnp.zeros((14, 1)).at[0].set(4.0).at[5].set(0.3)
    return fast(jnp.array([0.45]), 1.6, n, k, jnp.full((13, 1), 0.02), jnp.array([0.5]))


def test_a_loop_is_the_same_over_lanes():
    def both(shift):
        return jax.jvp(graded, (shift,), (jnp.ones_like(shift),))

    shifts = np.linspace(-0.1, 0.1, 3)
    with jax.enable_x64(True):
        compiled = jax.jit(both)
        each = [np.stack(x) for x in zip(*(compiled(shift) for shift in shifts), strict=True)]
        over = jax.jit(jax.vmap(both))(jnp.asarray(shifts))
    for one, some in zip(each, over, strict=True):
        np.testing.assert_allclose(some, one, rtol=1e-12, atol=1e-14)


def test_nothing_overflows_in_a_loop():
    """Twenty layers of no thickness and twenty of a micrometre of metal each, both ways."""
    n, k = np.full((41, 2), 1.5), np.zeros((41, 2))
    k[20:40, 0], k[:20, 1] = 9.0, 9.0
    d = np.where(k[:40] > 0.0, 1.0, 0.0)
    given = (np.full(2, 0.5), np.ones(2), n, k, d, np.full(2, 0.6))
    with jax.enable_x64(True):
        at = [jnp.asarray(np.repeat(z, 10, -1)) for z in given]  # of the 20 stacks above
        still = [jnp.zeros_like(z) for z in at]
        found = np.asarray(value_and_slope(at, still)[0])
        for i in (0, 10):
            true = exact(*(np.asarray(z)[..., i] for z in at))[:8]
            assert np.abs(found[:, i] - np.array(true, float)).max() < 1e-12
        for which in range(6):
            ones = [jnp.ones_like(z) if i == which else z for i, z in enumerate(still)]
            assert np.isfinite(value_and_slope(at, ones)[1]).all()


@pytest.mark.study
@pytest.mark.parametrize("layers", (1, FEW_LAYERS + 1))
def test_float32_media_as_an_array_and_the_exact_tier(layers):
    """Lists, arrays and more axes are one result; float32 stays, with as many of its own digits."""
    given = [z.astype(np.float32) for z in drawn(layers, 2000, 14)]
    c, n_0, n, k, d, wavelength = given
    media = np.concatenate([n_0[None] + 0j, n + 1j * k]).astype(np.complex64)
    separate = stack(c, list(media), thickness_um=list(d), wavelength_um=wavelength, exact=False)
    joined = stack(c, media, thickness_um=d, wavelength_um=wavelength, exact=False)
    assert joined.R_s.dtype == jnp.float32 and joined.r_s.dtype == jnp.complex64
    assert joined.A_s is None and joined.A_p is None
    with pytest.raises(AttributeError, match="exact=False"):
        _ = joined.A
    with jax.enable_x64(True):
        places = {"thickness_um": d.astype(float), "wavelength_um": wavelength.astype(float)}
        truth = stack(c.astype(float), media.astype(complex), **places)
        for one, other, true in zip(separate[:8], joined[:8], truth[:8], strict=True):
            size = np.maximum(1.0, np.abs(true)) * radians(n, k, d, wavelength)
            np.testing.assert_allclose(one, other, rtol=1e-5, atol=1e-3)
            off = np.abs(np.asarray(other, complex) - true) / size
            # the worst are next to a critical angle: 1,600 eps of 320,000 stacks
            assert np.quantile(off, 0.99) < 60 * 1.2e-7 and off.max() < 7000 * 1.2e-7
        wide = stack(
            c[:5, None],
            media[:, :5, None],
            thickness_um=d[:, :5, None],
            wavelength_um=wavelength[:7],
            exact=False,
        )
    assert wide.R_p.shape == (5, 7)


def test_what_the_fast_tier_refuses():
    absorbing = [1.0 + 0.1j, 2.0, 1.5]
    with pytest.raises(ValueError, match="first medium"):
        stack(0.5, absorbing, thickness_um=[0.1], wavelength_um=0.5, exact=False)
    with pytest.raises(ValueError, match="rough"):
        stack(
            0.5,
            [1.0, 2.0, 1.5],
            thickness_um=[0.1],
            wavelength_um=0.5,
            roughness_um=[0.001, 0.0],
            exact=False,
        )
    traced = jax.jit(
        lambda n: stack(0.5, [n, 2.0, 1.5], thickness_um=[0.1], wavelength_um=0.5, exact=False).R
    )
    assert np.isnan(traced(1.0 + 0.1j)) and np.isfinite(traced(1.0 + 0.0j))


def loss_of(x, coherent, exact):
    """Return a loss of a film on a clear layer; x: n and k of the film, n of the layer, both d.

    The incoherent layer is clear: of an absorbing one the tiers sum other things.
    """
    media, layers = [1.0, x[0] + 1j * x[1], x[2], 1.5], [x[3], x[4]]
    c, wavelength = jnp.array([0.9, 0.4]), jnp.array([0.5, 0.6])
    out = stack(
        c, media, thickness_um=layers, wavelength_um=wavelength, coherent=coherent, exact=exact
    )
    return jnp.sum(out.R_s * out.R_s - out.R_p + 0.5 * out.T_s + out.T_p**3)


AT = np.array([2.1, 0.03, 1.7, 0.2, 0.3])


def slopes(function, at):
    """Central differences: 1e-10 of the third derivative, and 1e-16 / 1e-5."""
    steps = 1e-5 * np.eye(len(at))
    return np.array([(function(at + step) - function(at - step)) / 2e-5 for step in steps])


@pytest.mark.study
@pytest.mark.parametrize("coherent", [(True, True), (True, False)])
def test_reverse_mode_has_the_slopes_of_the_exact_tier(coherent):
    with jax.enable_x64(True):
        gradient = jax.jit(jax.grad(lambda x: loss_of(x, coherent, False)))(AT)
        true = slopes(jax.jit(lambda x: loss_of(x, coherent, True)), AT)
    assert np.abs(gradient - true).max() < 1e-7 * np.abs(true).max()


def test_second_derivatives():
    def of_film(x):
        film = stack(
            0.6, [1.0, x[0] + 1j * x[1], 1.5], thickness_um=[x[2]], wavelength_um=0.5, exact=False
        )
        return film.R_p + 0.3 * film.T_s

    with jax.enable_x64(True):
        second = jax.jit(jax.hessian(of_film))(AT[[0, 1, 3]])
        true = slopes(jax.jit(jax.grad(of_film)), AT[[0, 1, 3]])
    assert np.abs(second - true).max() < 1e-6 * np.abs(true).max()
