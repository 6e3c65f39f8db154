"""What is drawn has the stated density (chi-squared), and its gradients are unbiased."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.scipy.special import gammaincc

from fresnel_jax import bsdf
from fresnel_jax.bsdf import Dielectric, Lobes, TrowbridgeReitz
from tests.truth.textbook import reflectances

SAMPLES = 1_000_000
BINS_Z, BINS_PHI, NODES = 40, 60, 48  # equal parts of z and phi; the horizon is an edge
GOLD = (0.43, 2.455)


def direction(z, phi):
    z, phi = np.broadcast_arrays(np.asarray(z, float), phi)
    r = np.sqrt((1.0 - z) * (1.0 + z))
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1)


def glass(eta, *alphas):
    return Dielectric(jnp.asarray(eta), TrowbridgeReitz(*(jnp.asarray(a) for a in alphas)))


def metal(*alphas):
    return bsdf.conductor(*GOLD, TrowbridgeReitz(*alphas))


ALL, ONE, OTHER = Lobes.ALL, Lobes.REFLECTION, Lobes.TRANSMISSION
CASES = {  # model, cosine of wo, lobes
    "outside": (glass(1.5, 0.3), 0.7, ALL),
    "grazing": (glass(1.5, 0.4), 0.05, ALL),
    "inside": (glass(1.5, 0.3), -0.9, ALL),
    "total reflection": (glass(1.5, 0.2), -0.3, ALL),
    "inside, grazing": (glass(1.5, 0.5), -0.05, ALL),
    "reflection alone": (glass(1.5, 0.3), 0.3, ONE),
    "transmission alone": (glass(1.5, 0.3), 0.3, OTHER),
    "transmission alone, from inside": (glass(1.5, 0.3), -0.7, OTHER),
    "eta below 1": (glass(1 / 1.5, 0.3), 0.8, ALL),
    "eta below 1, total reflection": (glass(0.5, 0.2), 0.6, ALL),
    "alpha .05": (glass(1.5, 0.05), 0.6, ALL),
    "alpha .05, inside": (glass(1.5, 0.05), -0.8, ALL),
    "anisotropic": (glass(1.5, 0.6, 0.1), 0.5, ALL),
    "alpha 1": (glass(2.42, 1.0), 0.4, ALL),
    "gold": (metal(0.3, 0.1), 0.5, ALL),
    "gold, below and grazing": (metal(0.3), -0.05, ALL),
}


@functools.partial(jax.jit, static_argnums=2)
def histogram(model, wo, lobes, key):
    u = jax.random.uniform(key, (SAMPLES, 3))
    sample = model.sample(wo, u[:, 0], u[:, 1:], lobes)
    wi = sample.direction
    row = jnp.clip(jnp.floor((wi[:, 2] + 1.0) * (BINS_Z / 2)), 0, BINS_Z - 1)
    turn = jnp.arctan2(wi[:, 1], wi[:, 0]) / (2 * jnp.pi) + 0.5
    column = jnp.clip(jnp.floor(turn * BINS_PHI), 0, BINS_PHI - 1)
    cell = jnp.where(sample.valid, row * BINS_PHI + column, BINS_Z * BINS_PHI)
    return jnp.bincount(cell.astype(int), length=BINS_Z * BINS_PHI + 1)


@functools.partial(jax.jit, static_argnums=2)
def probabilities(model, wo, lobes):
    """The density integrated over every cell by midpoints.

    Gauss nodes are of no use: the density jumps to 0 where the facet's normal becomes horizontal.
    """
    nodes = (np.arange(NODES) + 0.5) / NODES
    turn = (np.arange(BINS_PHI)[:, None] + nodes).reshape(-1) / BINS_PHI

    def row(z):
        z = z + nodes * (2.0 / BINS_Z)
        r = jnp.sqrt((1.0 - z) * (1.0 + z))[:, None]
        phi = 2 * np.pi * (turn - 0.5)
        wi = jnp.stack(jnp.broadcast_arrays(r * jnp.cos(phi), r * jnp.sin(phi), z[:, None]), -1)
        p = model.density(wo, wi, lobes).reshape(NODES, BINS_PHI, NODES)
        return jnp.mean(p, axis=(0, 2)) * (4 * np.pi / (BINS_Z * BINS_PHI))

    return jax.lax.map(row, -1.0 + np.arange(BINS_Z) * (2.0 / BINS_Z)).reshape(-1)


# Of each kind one: outside, total reflection, one lobe, an index below 1, two roughnesses, a metal.
FEW = (
    "outside", "total reflection", "reflection alone", "transmission alone", "eta below 1",
    "anisotropic", "gold", "gold, below and grazing",
)  # fmt: skip


@pytest.mark.study
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.study] * (n not in FEW)) for n in CASES]
)
def test_samples_follow_the_density(name):
    """Pearson's test per case, at 1 % for all cases together (Sidak's correction)."""
    model, cosine, lobes = CASES[name]
    wo = direction(cosine, 0.7)
    counts = np.asarray(histogram(model, wo, lobes, jax.random.key(20)), float)
    p = np.asarray(probabilities(model, wo, lobes))
    # what is not drawn is a cell of its own: rays that end on the wrong side, or total reflection
    # where transmission alone is wanted
    assert p.sum() < 1 + 1e-4
    expected = np.append(p, max(0.0, 1.0 - p.sum())) * SAMPLES
    # cells with few counts are added up, the failures with them
    few = expected < 10
    expected = np.append(expected[~few], expected[few].sum())
    counts = np.append(counts[~few], counts[few].sum())
    if expected[-1] < 10:
        expected[-2] += expected[-1]
        counts[-2] += counts[-1]
        expected, counts = expected[:-1], counts[:-1]
    assert expected.size > 30
    statistic = np.sum((counts - expected) ** 2 / expected)
    p_value = float(gammaincc((expected.size - 1) / 2, statistic / 2))
    assert p_value > 1 - 0.99 ** (1 / len(CASES)), (p_value, statistic, expected.size)


# Gradients ----------------------------------------------------------------------------------------


def light(w):
    """A smooth environment, not constant on either side."""
    return jnp.exp(0.7 * w[..., 0] - 0.4 * w[..., 1] + 0.5 * w[..., 2])


def build_glass(parameters):
    return Dielectric(parameters[0], TrowbridgeReitz(parameters[1], parameters[2]))


def build_metal(parameters):
    return bsdf.conductor(parameters[0], 2.4, TrowbridgeReitz(parameters[1], parameters[2]))


def textbook_radiance(metal_like, parameters, wo, grid):
    """L_o = integral of F D G |w_o . m| / |cos_o| L over normals m, written as in the textbooks.

    Over normals the domain does not move with the parameters, so that differences of it are smooth;
    over w_i the integrand jumps where m becomes horizontal, and the jump moves.
    """
    eta, a_x, a_y = parameters
    m, solid_angle = grid
    cos_o = wo[2]

    def smith(w):
        tan2 = ((a_x * w[..., 0]) ** 2 + (a_y * w[..., 1]) ** 2) / w[..., 2] ** 2
        return (-1 + np.sqrt(1 + tan2)) / 2

    d = 1 / (
        np.pi * a_x * a_y * ((m[..., 0] / a_x) ** 2 + (m[..., 1] / a_y) ** 2 + m[..., 2] ** 2) ** 2
    )
    o_m = m @ wo
    facing = o_m * cos_o > 0
    mirrored = 2 * o_m[..., None] * m - wo
    index = eta + 2.4j if metal_like else (eta if cos_o > 0 else 1 / eta)
    c = np.abs(o_m) + 0j
    c_t = np.sqrt(1 - (1 - c * c) / index**2)
    R = reflectances(c.real, index)["R"]
    bent = -wo / index + (np.abs(o_m) / index - c_t.real)[..., None] * m * np.sign(cos_o)
    total = 0.0
    lobes = [(mirrored, R, 1.0)] if metal_like else [(mirrored, R, 1.0), (bent, 1 - R, -1.0)]
    for wi, F, side in lobes:
        wi = np.real(wi)
        visible = facing & (wi[..., 2] * cos_o * side > 0)
        g = 1 / (1 + smith(wo) + smith(np.where(visible[..., None], wi, wo)))
        scale = 1.0 if side > 0 else 1 / index**2
        integrand = F * d * g * np.abs(o_m / cos_o) * np.asarray(light(wi)) * scale
        total += np.sum(np.where(visible, integrand, 0.0) * solid_angle)
    return total


def normals_grid(a_x, a_y):
    """Nodes over the hemisphere of normals, evenly spread for this roughness."""
    t = (np.arange(1500) + 0.5) * (np.pi / 2 / 1500)
    phi = (np.arange(600) + 0.5) * (2 * np.pi / 600)
    r, phi = np.meshgrid(np.tan(t), phi, indexing="ij")
    p, q = a_x * r * np.cos(phi), a_y * r * np.sin(phi)
    z = 1 / np.sqrt(1 + p * p + q * q)
    cell = (np.pi / 2 / 1500) * (2 * np.pi / 600)
    return np.stack([-p * z, -q * z, z], -1), z**3 * a_x * a_y * r * (1 + r * r) * cell


@functools.partial(jax.jit, static_argnums=(0, 4))
def gradient_samples(build, parameters, wo, u, lobes):
    def estimate(parameters, u):
        sample = build(parameters).sample(wo, u[0], u[1:], lobes)
        cosine = jnp.abs(sample.direction[2])
        arrives = light(sample.direction)
        density = jnp.where(sample.valid, sample.density, 1.0)
        return sample.weight * arrives, sample.value * cosine / density * arrives

    return jax.vmap(jax.jacfwd(estimate), (None, 0))(parameters, u)


@pytest.mark.study
@pytest.mark.parametrize(
    ("build", "parameters", "cosine", "lobes", "bar"),
    [
        (build_glass, [1.5, 0.4, 0.2], 0.6, [ALL], 2e-3),
        (build_metal, [0.43, 0.4, 0.2], 0.3, [ALL], 2e-3),
        # Facets on both sides of the critical angle: the mean exists, the variance does not (as
        # the text of `bsdf` says), so that the bar is long. Both lobes for each facet shorten it.
        (build_glass, [1.5, 0.3, 0.3], -0.8, [ONE, OTHER], 0.05),
        (build_glass, [0.7, 0.5, 0.3], 0.4, [ONE, OTHER], 0.05),
    ],
)
def test_gradients_of_an_estimate_are_unbiased(build, parameters, cosine, lobes, bar):
    """Mean gradient of weight L against differences of a quadrature.

    Random numbers are a lattice with a random shift, 16 shifts: their spread is the error bar.
    """
    parameters, wo = np.array(parameters), direction(cosine, 0.7)
    grid, h = normals_grid(*parameters[1:]), 3e-3
    expected = [
        (textbook_radiance(build is build_metal, parameters + h * e, wo, grid)
         - textbook_radiance(build is build_metal, parameters - h * e, wo, grid)) / (2 * h)
        for e in np.eye(3)
    ]  # fmt: skip
    rng, count = np.random.default_rng(4), 16384
    lattice = np.arange(count)[:, None] * np.array([1, 7**5, 5**7]) / count  # rank 1, mod 1
    means, quotients = [], []
    for _ in range(16):
        u = (lattice + rng.uniform(size=3)) % 1.0
        both = [gradient_samples(build, parameters, wo, u, lobe) for lobe in lobes]
        means.append(sum(np.mean(weighted, axis=0) for weighted, _ in both))
        quotients.append(sum(np.mean(quotient, axis=0) for _, quotient in both))
    error = np.std(means, axis=0, ddof=1) / 4
    assert np.all(error < bar), (error, expected)
    # 1e-4: second differences with h = 3e-3, and the quadrature's kinks
    deviation = np.abs(np.mean(means, axis=0) - expected) / (error + 1e-4)
    assert np.all(deviation < 4.0), (deviation, error, expected)
    # value cos / density has the same gradient, draw by draw
    np.testing.assert_allclose(np.mean(quotients, axis=0), np.mean(means, axis=0), rtol=1e-9)


@pytest.mark.study
def test_differentiating_the_lobe_probability_would_lose_the_fresnel_term():
    """With everything attached weight is 1 and its gradient 0: the trap that `sample` avoids."""
    wo, eta = direction(0.3, 0.0), 1.5
    u, facet = (np.arange(1000) + 0.5) / 1000, np.array([0.5, 0.5])

    def reflected(eta, u_lobe):
        sample = Dielectric(eta).sample(wo, u_lobe, facet, mode=bsdf.TransportMode.IMPORTANCE)
        return jnp.where(sample.transmission, 0.0, sample.weight)

    gradient = jnp.mean(jax.jit(jax.vmap(jax.grad(reflected), (None, 0)))(eta, u))
    R = [float(bsdf.FresnelDielectric(eta + h)(0.3)) for h in (-1e-6, 1e-6)]
    # 1000 strata in u_lobe: R is counted to 1e-3
    np.testing.assert_allclose(gradient, (R[1] - R[0]) / 2e-6, rtol=0.01)
