"""Smooth surfaces: Mitsuba's tables, the thin slab, delta rules, lobe choice, radiance scaling."""

import csv
import pathlib

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fresnel_jax import bsdf, directions
from fresnel_jax.bsdf import Lobes, TransportMode
from fresnel_jax.interface import fresnel_conductor, fresnel_dielectric, powers

REFERENCE = pathlib.Path(__file__).parent / "reference"
MODES = list(TransportMode)
GOLD = (0.43, 2.455)
U = np.array([0.5, 0.5])
UP = np.array([0.0, 0.0, 1.0])


def direction(z, phi=0.4):
    z, phi = np.broadcast_arrays(np.asarray(z, float), phi)
    r = np.sqrt((1.0 - z) * (1.0 + z))
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1)


COSINES = np.array([1.0, 0.9, 0.5, 0.1, -0.1, -0.5, -0.9, -1.0])

MODELS = {
    "dielectric": lambda: bsdf.Dielectric(1.5),
    "inverse": lambda: bsdf.Dielectric(1 / 1.5),
    "matched": lambda: bsdf.Dielectric(1.0),
    "thin": lambda: bsdf.ThinDielectric(1.5),
    "gold": lambda: bsdf.conductor(*GOLD),
    "no Fresnel": lambda: bsdf.specular_reflection(0.8, bsdf.FresnelNone()),
    "mirror of glass": lambda: bsdf.specular_reflection(1.0, bsdf.FresnelDielectric(1.5)),
    "transmission": lambda: bsdf.specular_transmission(0.7, 1.0, 1.5),
    "fresnel specular": lambda: bsdf.fresnel_specular(0.9, 0.8, 1.2, 1.5),
    "vanishing roughness": lambda: bsdf.Dielectric(1.5, bsdf.TrowbridgeReitz(5e-4)),
}


def both_lobes(model, wo, mode=TransportMode.RADIANCE, lobes=Lobes.ALL):
    """The samples of u_lobe = 0 and u_lobe -> 1: with probability weights, the expectation."""
    last = np.nextafter(1.0, 0.0)
    return [model.sample(wo, u, U, lobes, mode) for u in (0.0, last)]


# Tables -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", ["dielectric_1.5", "dielectric_1over1.5", "dielectric_1.0",
                                  "conductor_Au"])  # fmt: skip
def test_samples_agree_with_the_table(name, mode):
    table = np.load(REFERENCE / "bsdf_smooth.npz")
    models = {
        "dielectric_1.5": bsdf.Dielectric(1.5),
        "dielectric_1over1.5": bsdf.Dielectric(1 / 1.5),
        "dielectric_1.0": bsdf.Dielectric(1.0),
        "conductor_Au": bsdf.conductor(*GOLD),
    }
    wo = table["wi"].astype(float)[:, None]  # Mitsuba's names are the other way round
    wo /= np.linalg.norm(wo, axis=-1, keepdims=True)
    sample = models[name].sample(wo, table["u1"].astype(float), U, mode=mode)
    expected = {
        key: table[f"{name}/{mode.name.lower()}/{key}"]
        for key in ("wo", "pdf", "eta", "type", "weight")
    }
    shape = expected["weight"].shape  # a mirror ignores u1
    sample = bsdf.BSDFSample(*(np.broadcast_to(a, shape + a.shape[2:]) for a in sample))
    rows = np.full(shape, True)
    if name == "conductor_Au":  # Mitsuba's conductor has one side
        rows = np.broadcast_to(wo[..., 2] > 0, shape)
        assert np.all(sample.valid[~rows])
    np.testing.assert_array_equal(sample.valid[rows], expected["weight"][rows] > 0)
    rows = rows & (expected["weight"] > 0)
    if name == "dielectric_1.0":  # u1 <= R: at u1 = 0 Mitsuba reflects although R = 0
        rows = rows & (table["u1"] > 0)
    # float32 entries; the probability of refraction is 1 - R there
    for got, key in ((sample.direction, "wo"), (sample.density, "pdf"), (sample.weight, "weight")):
        np.testing.assert_allclose(got[rows], expected[key][rows], atol=2e-6)
    np.testing.assert_allclose(sample.eta[rows], expected["eta"][rows], rtol=1e-6)
    refracted = (expected["type"] & (64 | 1)) > 0
    np.testing.assert_array_equal(sample.transmission[rows], refracted[rows])
    assert np.all(sample.specular)


def test_thin_slab_sums_each_polarisation_apart():
    with open(REFERENCE / "thin_slab.csv", newline="") as file:
        rows = [[float(x) for x in row.values()] for row in csv.DictReader(file)]
    # eta = .8 at cosine .6 is critical as a decimal, but not once both are rounded
    rows = [row for row in rows if row[:2] != [0.8, 0.6]]
    eta, cosine, mean_first, apart = np.array(rows).T
    reflected, transmitted = bsdf.ThinDielectric(eta).powers(cosine)
    # R down to 4e-8 at eta = 1.00029, whose n - 1 has 3 digits less than n
    np.testing.assert_allclose(reflected, apart, rtol=2e-12)
    np.testing.assert_allclose(reflected + transmitted, 1.0, atol=4e-16)
    sample = bsdf.ThinDielectric(eta).sample(direction(cosine), 0.0, U)
    inside = cosine > 1e-100
    np.testing.assert_allclose(np.asarray(sample.density)[inside], apart[inside], rtol=2e-12)
    # what summing the mean would have given, as the class's text states
    for index, error in ((1.5, 0.022), (2.42, 0.078)):
        grid = np.linspace(0.01, 1.0, 2000)
        R = powers(grid, index).R
        worst = np.max(np.abs(2 * R / (1 + R) - bsdf.ThinDielectric(index).powers(grid)[0]))
        assert error - 0.001 < worst < error + 0.001
    assert np.max(np.abs(mean_first - apart)[eta == 1.5]) > 0.01


def test_thin_slab_is_the_sum_of_all_bounces():
    cosine = np.array([1.0, 0.6, 0.2])
    face = powers(cosine, 1.5)
    total = []
    for R, T in ((face.R_s, face.T_s), (face.R_p, face.T_p)):
        R, T = np.asarray(R), np.asarray(T)
        total.append((R + sum(T * R * (R * R) ** j * T for j in range(400)),
                      sum(T * (R * R) ** j * T for j in range(400))))  # fmt: skip
    reflected, transmitted = bsdf.ThinDielectric(1.5).powers(cosine)
    np.testing.assert_allclose(reflected, np.mean([a for a, _ in total], axis=0), rtol=1e-14)
    np.testing.assert_allclose(transmitted, np.mean([b for _, b in total], axis=0), rtol=1e-14)


def test_thin_slab_has_finite_derivatives_in_total_reflection():
    # eta < 1 and beyond the critical angle: R = 1, where the printed series is 0 / 0
    def slab(eta, cosine):
        return bsdf.ThinDielectric(eta).powers(cosine)[0]

    assert float(slab(0.7, 0.3)) == 1.0
    for gradient in jax.grad(slab, (0, 1))(0.7, 0.3):
        assert float(gradient) == 0.0


# Delta distributions ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MODELS)
def test_quadrature_never_meets_a_delta(name):
    """f = 0 and pdf = 0 for every pair, the mirror pair and the refracted pair included."""
    model = MODELS[name]()
    wo = direction(COSINES)
    for sample in both_lobes(model, wo):
        for mode in MODES:
            assert not np.any(model.evaluate(wo, sample.direction, mode))
        assert not np.any(model.density(wo, sample.direction))
    assert not np.any(bsdf.adjoint(model, wo, direction(COSINES)[:, None]))


def test_mirror_coefficient_has_the_cosine_that_the_naive_brdf_forgets():
    """Rule 8.4: delta(wi - wr) F / cos_i scatters F of the flux; without / cos_i only F cos_i."""
    wo = direction(COSINES)
    mirror = bsdf.specular_reflection(0.8, bsdf.FresnelNone())
    sample = mirror.sample(wo, 0.3, U)
    np.testing.assert_allclose(sample.direction, wo * [-1, -1, 1])
    np.testing.assert_array_equal(sample.density, 1.0)
    np.testing.assert_allclose(sample.value, 0.8 / np.abs(COSINES), rtol=1e-15)
    np.testing.assert_allclose(sample.weight, 0.8, rtol=1e-15)
    flux = np.asarray(sample.value) * np.abs(COSINES)
    naive = 0.8 * np.abs(COSINES)
    np.testing.assert_allclose(flux, 0.8)
    assert np.all((naive < flux) == (np.abs(COSINES) < 1.0))


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("mode", MODES)
def test_weight_is_value_times_cosine_over_density(name, mode):
    for sample in both_lobes(MODELS[name](), direction(COSINES), mode):
        cosine = np.abs(sample.direction[..., 2])
        np.testing.assert_allclose(
            np.asarray(sample.weight) * sample.density, sample.value * cosine, rtol=1e-14
        )


# Fresnel terms ------------------------------------------------------------------------------------


def test_fresnel_terms_are_interchangeable():
    wo = direction(COSINES)
    glass, gold = fresnel_dielectric(COSINES, 1.5), fresnel_conductor(COSINES, *GOLD)
    terms = [
        (bsdf.FresnelDielectric(1.5), glass),
        (bsdf.FresnelDielectric(1.5 * 1.2, 1.2), glass),
        (bsdf.FresnelConductor(*GOLD), gold),
        (bsdf.FresnelConductor(2 * GOLD[0], 2 * GOLD[1], 2.0), gold),
        (bsdf.FresnelNone(), np.ones_like(COSINES)),
    ]
    for term, expected in terms:
        np.testing.assert_allclose(term(COSINES), expected, rtol=1e-13)
        np.testing.assert_allclose(jax.vmap(term)(COSINES), expected, rtol=1e-13)
        weight = bsdf.specular_reflection(0.5, term).sample(wo, 0.0, U).weight
        np.testing.assert_allclose(weight, 0.5 * np.asarray(expected), rtol=1e-13)
    many = bsdf.FresnelConductor(np.array([0.43, 2.87]), np.array([2.455, 3.36]), np.ones(2))
    np.testing.assert_allclose(
        jax.vmap(lambda term: term(0.7))(many), fresnel_conductor(0.7, many.eta, many.k)
    )


def test_reflectance_is_the_same_from_both_ends_of_a_refracted_ray():
    wo = direction(np.array([0.99, 0.6, 0.2, 0.01]))
    wt = directions.refract(wo, UP, 1.5).direction
    np.testing.assert_allclose(
        fresnel_dielectric(wo[:, 2], 1.5), fresnel_dielectric(wt[:, 2], 1.5), rtol=1e-12
    )


# Dielectrics --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["dielectric", "inverse", "thin", "vanishing roughness"])
def test_lobe_is_chosen_in_proportion_to_power(name):
    model, wo = MODELS[name](), direction(0.3)
    u = (np.arange(100_000) + 0.5) / 100_000
    sample = model.sample(wo, u, U)
    R = float(model.powers(0.3)[0] if name == "thin" else fresnel_dielectric(0.3, model.eta))
    assert abs(np.mean(~np.asarray(sample.transmission)) - R) <= 1e-5
    np.testing.assert_allclose(sample.density, np.where(sample.transmission, 1 - R, R), rtol=1e-12)
    # the factor cancels: every path carries the same weight
    scale = np.where(sample.transmission, np.asarray(sample.eta) ** -2.0, 1.0)
    np.testing.assert_allclose(sample.weight, scale, rtol=1e-14)


def test_variance_of_an_equal_split_against_the_fresnel_split():
    """Figure 9.15: (1 - 2R)^2 against 0, here without radiance scaling."""
    model, wo = bsdf.Dielectric(1.5), direction(0.3)
    R = float(fresnel_dielectric(0.3, 1.5))
    equal = [
        2.0 * float(model.sample(wo, 0.5, U, lobes, TransportMode.IMPORTANCE).weight)
        for lobes in (Lobes.REFLECTION, Lobes.TRANSMISSION)
    ]
    np.testing.assert_allclose(np.mean(equal), 1.0, rtol=1e-14)
    np.testing.assert_allclose(np.var(equal), (1 - 2 * R) ** 2, rtol=1e-13)
    u = np.linspace(0.0, 0.999, 500)
    fresnel = model.sample(wo, u, U, mode=TransportMode.IMPORTANCE).weight
    assert np.var(fresnel) < 1e-30


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("lobes", [Lobes.NONE, Lobes.REFLECTION, Lobes.TRANSMISSION, Lobes.ALL])
@pytest.mark.parametrize("name", MODELS)
def test_lobes_that_are_off_are_never_sampled(name, lobes, mode):
    model, wo = MODELS[name](), direction(COSINES)
    samples = both_lobes(model, wo, mode, lobes)
    for sample in samples:
        for flag, kind in ((Lobes.REFLECTION, False), (Lobes.TRANSMISSION, True)):
            if flag not in lobes:
                assert not np.any(np.asarray(sample.valid) & (sample.transmission == kind))
        dead = ~np.asarray(sample.valid)
        for field in (sample.value, sample.density, sample.weight):
            assert not np.any(np.asarray(field)[dead])
        assert np.all(np.isfinite(sample.direction))
        if lobes is not Lobes.ALL:  # one lobe: certain, wherever it exists
            np.testing.assert_array_equal(np.asarray(sample.density)[~dead], 1.0)
    if lobes is Lobes.NONE:
        assert not np.any(samples[0].valid)


@pytest.mark.parametrize("name", MODELS)
def test_flags_agree_with_what_is_sampled(name):
    model, wo = MODELS[name](), direction(COSINES)
    flags = model.flags()
    seen = {False: False, True: False}
    for sample in both_lobes(model, wo):
        for kind in seen:
            seen[kind] |= bool(np.any(np.asarray(sample.valid) & (sample.transmission == kind)))
        assert np.all(sample.specular == flags.specular) and np.all(flags.glossy == ~flags.specular)
    assert seen[False] == bool(flags.reflection) and seen[True] == bool(flags.transmission)
    assert bool(flags.specular)


def test_third_edition_transmission_and_fresnel_specular():
    wo = direction(np.array([0.8, -0.95]))
    eta_a, eta_b = 1.2, 1.5
    T = np.array([float(powers(0.8, eta_b, eta_i=eta_a).T), float(powers(0.95, eta_a, eta_i=eta_b).T)])
    ratio = np.array([eta_a / eta_b, eta_b / eta_a])  # eta_i / eta_t of the code, for radiance
    model = bsdf.specular_transmission(0.7, eta_a, eta_b)
    for mode, factor in ((TransportMode.RADIANCE, ratio**2), (TransportMode.IMPORTANCE, 1.0)):
        sample = model.sample(wo, 0.0, U, mode=mode)
        assert np.all(sample.transmission) and np.all(sample.density == 1.0)
        cosine = np.abs(sample.direction[:, 2])
        np.testing.assert_allclose(sample.value, 0.7 * T * factor / cosine, rtol=1e-13)
    both = bsdf.fresnel_specular(0.9, 0.8, eta_a, eta_b)
    first, last = both_lobes(both, wo, TransportMode.IMPORTANCE)
    np.testing.assert_allclose(first.density, 1 - T, rtol=1e-12)  # reflection with probability F
    np.testing.assert_allclose(last.density, T, rtol=1e-13)
    np.testing.assert_allclose(first.weight, 0.9, rtol=1e-15)
    np.testing.assert_allclose(last.weight, 0.8, rtol=1e-15)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_total_reflection_leaves_one_lobe_whatever_u(dtype):
    wo = direction(-0.5).astype(dtype)
    u = np.array([0.0, 0.5, 1 - np.finfo(dtype).epsneg, 1.0], dtype)
    glass = bsdf.Dielectric(1.5)
    sample = glass.sample(wo, u, U.astype(dtype))
    assert np.all(sample.valid) and not np.any(sample.transmission)
    np.testing.assert_array_equal(sample.weight, 1.0)
    assert not np.any(glass.sample(wo, u, U.astype(dtype), Lobes.TRANSMISSION).valid)


def test_weight_keeps_its_digits_next_to_total_reflection():
    # T = 5e-6: the rest of R to 1 in float32 has one digit of it
    critical = np.sqrt(1 - 1 / 1.5**2)
    wo = direction(-critical * (1 + 1e-12)).astype(np.float64)
    sample = bsdf.Dielectric(1.5).sample(wo, 1.0, U)
    assert bool(sample.valid) and bool(sample.transmission) and float(sample.density) < 1e-5
    np.testing.assert_allclose(sample.weight, 1.5**2, rtol=1e-15)


@pytest.mark.parametrize("cosine", [1.0, 0.7, 0.2, -0.2, -0.7, -0.9, -1.0])
def test_equilibrium_radiance_goes_through_unchanged(cosine):
    """With L = n^2 on both sides the surface gives back n_o^2, from either side."""
    eta = 1.5
    wo = direction(cosine)
    total = 0.0
    for sample in both_lobes(bsdf.Dielectric(eta), wo):
        n_i = np.where(np.asarray(sample.direction)[2] < 0, eta, 1.0)
        total += float(sample.density * sample.weight) * n_i**2
    if abs(cosine) < np.sqrt(1 - 1 / eta**2) and cosine < 0:
        total /= 2  # total reflection: both draws are the one lobe
    np.testing.assert_allclose(total, eta**2 if cosine < 0 else 1.0, rtol=1e-14)


def test_importance_is_radiance_times_the_squared_index():
    for name in ("dielectric", "inverse"):
        model, wo = MODELS[name](), direction(COSINES)
        last = np.nextafter(1.0, 0.0)
        radiance, importance = (model.sample(wo, last, U, mode=mode) for mode in MODES)
        etap = np.asarray(radiance.eta)
        np.testing.assert_allclose(importance.value, etap**2 * radiance.value, rtol=1e-14)


def test_expected_gradient_of_a_smooth_interface():
    """Lobe choice detached: the mean over lobes is the derivative of R L(wr) + T L(wt) / etap^2."""
    wo = direction(0.6)

    def light(w):
        return jnp.exp(0.4 * w[0] - 0.3 * w[2])

    def expected(eta):
        t = directions.refract(wo, UP, eta)
        face = powers(0.6, eta)
        return face.R * light(directions.reflect(wo, UP)) + face.T * light(t.direction) / eta**2

    def estimate(eta, u):
        sample = bsdf.Dielectric(eta).sample(wo, u, U)
        return sample.weight * light(sample.direction), sample.density

    h = 1e-5
    difference = (expected(1.5 + h) - expected(1.5 - h)) / (2 * h)
    mean = sum(
        gradient * probability
        for gradient, probability in (jax.grad(estimate, has_aux=True)(1.5, u) for u in (0.0, 0.999))
    )
    np.testing.assert_allclose(mean, difference, rtol=1e-8)

    def by_quotient(eta, u):
        sample = bsdf.Dielectric(eta).sample(wo, u, U)
        cosine = jnp.abs(sample.direction[2])
        return sample.value * cosine / sample.density * light(sample.direction), sample.density

    for u in (0.0, 0.999):
        gradients = [jax.grad(f, has_aux=True)(1.5, u)[0] for f in (estimate, by_quotient)]
        np.testing.assert_allclose(*gradients, rtol=1e-12)
