"""Reflection and refraction against vector identities and 50-digit arithmetic."""

import pathlib
from fractions import Fraction

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

from fresnel_jax import directions
from fresnel_jax._numerics.vectors import components, dot_exactly

pytestmark = pytest.mark.slow

REFERENCE = pathlib.Path(__file__).parents[1] / "truth" / "reference"
UP = np.array([0.0, 0.0, 1.0])
DTYPES = [np.float32, np.float64]

reflect, refract = jax.jit(directions.reflect), jax.jit(directions.refract)


def unit_vectors(rng, count, dtype=np.float64):
    v = rng.normal(size=(count, 3))
    return (v / np.linalg.norm(v, axis=-1, keepdims=True)).astype(dtype)


def directions_with_cosine(z, rng, dtype=np.float64):
    z = np.clip(z, -1.0, 1.0)
    phi = rng.uniform(0.0, 2.0 * np.pi, z.shape)
    r = np.sqrt((1.0 - z) * (1.0 + z))
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1).astype(dtype)


def length_error(v):
    return np.abs(np.linalg.norm(np.asarray(v).astype(np.longdouble), axis=-1) - 1.0)


def exact_cos_t(z, eta):
    """cos_t from cos_i and eta, exactly as given; None in total reflection."""
    with mpmath.workdps(60):
        z, eta = mpmath.mpf(float(z)), mpmath.mpf(float(eta))
        eta_i, eta_t = (1, eta) if z >= 0 else (eta, 1)
        squared = 1 - (eta_i / eta_t) ** 2 * (1 - z * z)
        return mpmath.sqrt(squared) if squared > 0 else None


# Reflection ---------------------------------------------------------------------------------------


def test_reflection_in_the_local_frame_turns_x_and_y():
    w = unit_vectors(np.random.default_rng(0), 200)
    np.testing.assert_array_equal(reflect(w, UP), w * [-1.0, -1.0, 1.0])


@pytest.mark.parametrize("dtype", DTYPES)
def test_reflection_is_an_involution_that_keeps_length_and_cosine(dtype):
    rng = np.random.default_rng(1)
    w, n = unit_vectors(rng, 5000, dtype), unit_vectors(rng, 5000, dtype)
    r = reflect(w, n)
    eps = np.finfo(dtype).eps
    assert r.dtype == dtype
    # n is a unit vector to an eps or two only; reflection counts its length twice
    assert length_error(r).max() < 6 * eps
    np.testing.assert_allclose(reflect(r, n), w, rtol=0, atol=12 * eps)
    np.testing.assert_allclose(np.sum(r * n, -1), np.sum(w * n, -1), rtol=0, atol=8 * eps)
    # in one plane with w and n
    assert np.abs(np.sum(np.cross(w, n) * r, -1)).max() < 8 * eps


def test_reflection_agrees_with_the_table():
    table = np.load(REFERENCE / "reflect_refract.npz")
    r = reflect(table["w"].astype(float), table["m"].astype(float))
    # the table was computed from the same float32 vectors after they were normalised
    np.testing.assert_allclose(r, table["ref_reflect"], rtol=0, atol=5e-7)


# Refraction ---------------------------------------------------------------------------------------


def hard_cosines(kind, eta, rng, eps):
    count = eta.size
    sign = rng.choice([-1.0, 1.0], count)
    if kind == "anywhere":
        return rng.uniform(-1.0, 1.0, count)
    if kind == "grazing":
        return sign * 10 ** rng.uniform(-12.0, -1.0, count)
    if kind == "normal":
        return sign * np.cos(10 ** rng.uniform(-12.0, -1.0, count))
    eta = eta.astype(float)
    small, large = np.minimum(eta, 1.0), np.maximum(eta, 1.0)
    critical = np.sqrt((large - small) * (large + small)) / large
    return np.where(eta < 1.0, 1.0, -1.0) * critical * (1.0 + sign * eps * 10 ** rng.uniform(0, 9))


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("kind", ["anywhere", "critical", "grazing", "normal"])
@pytest.mark.parametrize("count", [500, pytest.param(1500, marks=pytest.mark.study)])
def test_refracted_cosine_has_a_small_relative_error(kind, dtype, count):
    rng = np.random.default_rng(2)
    eps = np.finfo(dtype).eps
    eta = np.exp(rng.uniform(-np.log(4.0), np.log(4.0), count)).astype(dtype)
    w = directions_with_cosine(hard_cosines(kind, eta, rng, eps), rng, dtype)
    direction, along, valid = refract(w, UP.astype(dtype), eta)
    assert direction.dtype == along.dtype == dtype
    assert length_error(direction).max() < 4 * eps
    for w_z, eta_j, t_z, ok in zip(w[:, 2], eta, np.asarray(direction)[:, 2], valid, strict=True):
        cos_t = exact_cos_t(w_z, eta_j)
        assert ok == (cos_t is not None)
        if cos_t is not None:
            assert t_z * w_z < 0.0
            # 4.6 eps measured; the part along the surface adds its error through the unit length
            assert abs(abs(float(t_z)) / cos_t - 1) < 8 * eps
    np.testing.assert_allclose(along, np.where(w[:, 2] < 0, 1 / eta, eta), rtol=eps)


@pytest.mark.study
@pytest.mark.parametrize("dtype", DTYPES)
def test_derivative_at_grazing_for_any_normal(dtype):
    rng = np.random.default_rng(13)  # d cos_t / d eta is about 1 / cos_t, and wi . n cancels
    n, z = unit_vectors(rng, 60), 0.003 * rng.uniform(1.0, 2.0, 60)
    tangent = np.cross(n, unit_vectors(rng, 60))
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    w = (z[:, None] * n + np.sqrt(1.0 - z * z)[:, None] * tangent).astype(dtype)
    n, eta = n.astype(dtype), dtype(1.0 + 1e-6)
    slope = jax.jit(jax.jacfwd(lambda eta: directions.refract(w, n, eta).direction))(eta)
    for w_j, n_j, slope_j in zip(w, n, np.asarray(slope, float), strict=True):
        z = float(sum(Fraction(float(a)) * Fraction(float(b)) for a, b in zip(w_j, n_j)))  # noqa: B905
        true = (1.0 - z * z) / (float(eta) ** 3 * float(exact_cos_t(z, eta)))
        # a plainly summed wi . n is off by .5 eps / .003; the rest of the path by some eps / .03
        error = abs(-np.dot(slope_j, n_j.astype(float)) / true - 1.0)
        assert error < 20 * np.finfo(dtype).eps


@pytest.mark.parametrize("dtype", DTYPES)
def test_cosines_that_only_the_lowest_digits_decide(dtype):
    """The pairs, among 2e6, next to the critical angle: the squares cancel to 1e-5 eps and less."""
    rng = np.random.default_rng(12)
    eta = rng.uniform(0.3, 0.95, 2_000_000).astype(dtype)
    wide = np.float64 if dtype == np.float32 else np.longdouble
    z = np.sqrt((1 - eta.astype(wide)) * (1 + eta.astype(wide))).astype(dtype)
    left = np.abs(eta.astype(wide) ** 2 - (1 - z.astype(wide)) * (1 + z.astype(wide)))
    nearest = np.argsort(left)[:300]
    eta, z = eta[nearest], z[nearest]
    w = np.stack([np.sqrt((1 - z) * (1 + z)), 0 * z, z], -1)
    t, _, valid = refract(w, UP.astype(dtype), eta)
    for z_j, eta_j, t_z, ok in zip(z, eta, np.asarray(t)[:, 2], valid, strict=True):
        cos_t = exact_cos_t(z_j, eta_j)
        assert ok == (cos_t is not None)
        if cos_t is not None:
            assert abs(-float(t_z) / cos_t - 1) < 8 * np.finfo(dtype).eps


def test_snells_law_and_one_plane_for_any_normal():
    rng = np.random.default_rng(3)
    w, n = unit_vectors(rng, 20000), unit_vectors(rng, 20000)
    eta = np.exp(rng.uniform(-np.log(4.0), np.log(4.0), 20000))
    t, along, valid = (np.asarray(a) for a in refract(w, n, eta))
    residual = np.cross(n, w) + along[:, None] * np.cross(n, t)
    assert np.abs(residual[valid]).max() < 1e-12
    assert np.all((np.sum(t * n, -1) * np.sum(w * n, -1))[valid] < 0.0)
    # the law in angles
    sin_w, sin_t = (np.sqrt(1 - np.sum(v * n, -1) ** 2) for v in (w, t))
    np.testing.assert_allclose(sin_w[valid], (along * sin_t)[valid], rtol=0, atol=1e-12)


def test_tilt_survives_next_to_normal_incidence():
    # cos = 1 in float64 does not know of a tilt of 1e-9; the refracted ray must
    w = np.array([1e-9, 0.0, 1.0])
    t = refract(w, UP, 1.5).direction
    np.testing.assert_allclose(t, [-1e-9 / 1.5, 0.0, -1.0], rtol=1e-15)


def test_grazing_cosine_survives_the_cancellation_in_the_dot_product():
    n = np.array([0.6, 0.0, 0.8])
    w = np.array([0.8, 0.0, -0.6 + 2.0**-50])  # rounded; n . w is 7e-16 with full precision below
    exact = sum(Fraction(a) * Fraction(b) for a, b in zip(w.tolist(), n.tolist(), strict=True))
    assert 0 < exact < 1e-14
    computed = dot_exactly(components(w, "w"), components(n, "n"))
    assert abs(Fraction(float(computed)) / exact - 1) < 2**-52
    assert abs(float(np.sum(w * n) / float(exact)) - 1) > 0.01  # what the plain sum would give


def test_refraction_agrees_with_the_table():
    table = np.load(REFERENCE / "reflect_refract.npz")
    t, along, valid = refract(table["w"].astype(float), table["m"].astype(float), 1.5)
    np.testing.assert_array_equal(valid, table["valid"])
    np.testing.assert_allclose(along, table["ref_etap"], rtol=1e-15)
    # float32 vectors, normalised before the table was computed; near the critical angle the cosine
    # multiplies that difference by 1 / cos_t
    some = table["valid"]
    np.testing.assert_allclose(np.asarray(t)[some], table["ref_refract"][some], rtol=0, atol=3e-6)


def test_there_and_back_again():
    w = unit_vectors(np.random.default_rng(4), 3000)
    t, along, valid = refract(w, UP, 1.5)
    back, along_back, valid_back = refract(t, UP, 1.5)
    some = np.asarray(valid) & (np.abs(w[:, 2]) > 1e-3)
    assert np.all(np.asarray(valid_back)[some])
    np.testing.assert_allclose(np.asarray(back)[some], w[some], rtol=0, atol=1e-12)
    np.testing.assert_allclose((along * along_back)[some], 1.0, rtol=1e-15)


def test_third_edition_form_is_a_special_case():
    # v3: n on the side of w, eta_i / eta_t, eq. 8.8 written out
    rng = np.random.default_rng(5)
    w, n = unit_vectors(rng, 1000), unit_vectors(rng, 1000)
    n = np.asarray(directions.faceforward(n, w))
    eta_i, eta_t = 1.2, 1.7
    ratio = eta_i / eta_t
    c = np.sum(w * n, -1, keepdims=True)
    cos_t = np.sqrt(1.0 - ratio**2 * (1.0 - c * c))
    expected = ratio * -w + (ratio * c - cos_t) * n
    t, along, valid = refract(w, n, eta_t / eta_i)
    assert np.all(valid)
    np.testing.assert_allclose(t, expected, rtol=0, atol=1e-15)
    np.testing.assert_allclose(along, eta_t / eta_i, rtol=1e-15)


def test_matched_media_are_passed_straight_on():
    w = directions_with_cosine(np.array([1.0, 0.3, 1e-200, 0.0, -1e-200, -0.3, -1.0]),
                               np.random.default_rng(6))  # fmt: skip
    t, along, valid = refract(w, UP, 1.0)
    assert np.all(valid)
    np.testing.assert_array_equal(along, 1.0)
    np.testing.assert_allclose(t, -w, rtol=3e-16)


@pytest.mark.parametrize("dtype", DTYPES)
def test_total_reflection_is_finite_with_its_derivatives(dtype):
    z = np.array([-0.745355, -0.7, -0.3, -1e-9, -0.0])
    w = directions_with_cosine(z, np.random.default_rng(7), dtype)
    t, _, valid = refract(w, UP.astype(dtype), dtype(1.5))
    np.testing.assert_array_equal(valid, [False, False, False, False, True])
    assert length_error(t).max() < 4 * np.finfo(dtype).eps
    np.testing.assert_array_equal(np.asarray(t)[:4, 2], 0.0)

    def direction(w, n, eta):
        return refract(w, n, eta).direction

    jacobian = jax.jit(jax.vmap(jax.jacfwd(direction, (0, 1, 2)), (0, None, None)))
    for gradient in jacobian(w, UP.astype(dtype), dtype(1.5)):
        assert np.all(np.isfinite(gradient))


def test_the_critical_angle_lies_between_the_right_two_numbers():
    # sin = eta = .8 to within the rounding of these decimals, and three numbers either way
    w = np.array([0.8, 0.0, 0.6])
    derivative = jax.jit(jax.jacfwd(lambda e: directions.refract(w, UP, e).direction))
    for steps in range(-3, 4):
        eta = np.float64(0.8) + steps * np.spacing(0.8)
        assert bool(refract(w, UP, eta).valid) == (exact_cos_t(w[2], eta) is not None)
        jacobian = derivative(eta)
        assert np.all(np.isfinite(jacobian))


def test_derivatives_against_differences():
    rng = np.random.default_rng(8)
    w = directions_with_cosine(np.array([0.9, 0.2, -0.8, -0.95]), rng)
    n = np.asarray(unit_vectors(rng, 4) * 0.2 + UP)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    eta = np.array([1.5, 0.99, 1.2, 1.0])

    @jax.jit
    def along_curve(step):
        # unit vectors that turn with the parameter: only such derivatives are defined
        turned = w + step * np.array([0.3, -0.5, 0.2])
        turned = turned / jnp.linalg.norm(turned, axis=-1, keepdims=True)
        tilted = n + step * np.array([0.1, 0.2, -0.3])
        tilted = tilted / jnp.linalg.norm(tilted, axis=-1, keepdims=True)
        return refract(turned, tilted, eta + 0.7 * step).direction

    h = 1e-4
    difference = (
        8 * (along_curve(h) - along_curve(-h)) - (along_curve(2 * h) - along_curve(-2 * h))
    ) / (12 * h)  # error h^4
    slope = jax.jit(jax.jacfwd(along_curve))(0.0)
    np.testing.assert_allclose(slope, difference, rtol=0, atol=1e-10)


def test_derivative_at_normal_incidence():
    # d t / d w is -1 / eta in the plane of the surface, where a normalised tangent would be 0 / 0
    jacobian = jax.jacfwd(lambda w: refract(w, UP, 1.5).direction)(UP)
    np.testing.assert_allclose(jacobian[:2, :2], -np.eye(2) / 1.5, rtol=0, atol=1e-15)


def test_broadcasting_jit_and_vmap_agree():
    rng = np.random.default_rng(9)
    w, eta = unit_vectors(rng, 6), np.array([0.7, 1.0, 1.5])
    table = refract(w[:, None], UP, eta)
    assert table.direction.shape == (6, 3, 3) and table.valid.shape == table.eta.shape == (6, 3)
    one_by_one = jax.jit(
        jax.vmap(jax.vmap(directions.refract, (None, None, 0)), (0, None, None))
    )(w, UP, eta)  # fmt: skip
    for a, b in zip(table, one_by_one, strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-15)


def test_a_wrong_shape_is_named():
    with pytest.raises(ValueError, match=r"wi has shape \(4,\); wanted \(\.\.\., 3\)"):
        refract(np.ones(4), UP, 1.5)
    with pytest.raises(ValueError, match="n has shape"):
        reflect(UP, 1.0)
