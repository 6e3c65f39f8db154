"""Smooth surfaces: Mitsuba's tables, the thin slab, delta rules, Fresnel terms."""

import csv
import functools
import pathlib

import jax
import numpy as np
import pytest
from jaxtyping import ArrayLike

from fresnel_jax import bsdf, directions
from fresnel_jax.bsdf import Lobes, TransportMode
from fresnel_jax.interface import fresnel_conductor, fresnel_dielectric, powers

pytestmark = pytest.mark.slow

REFERENCE = pathlib.Path(__file__).parents[1] / "truth" / "reference"
MODES = list(TransportMode)
GOLD = (0.43, 2.455)
U = np.array([0.5, 0.5])
UP = np.array([0.0, 0.0, 1.0])


def direction(z, phi: ArrayLike = 0.4):
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


@functools.partial(jax.jit, static_argnums=3)
def sampled(model, wo, u_lobe, mode):
    """Compiled once for all models of a kind."""
    return model.sample(wo, u_lobe, U, mode=mode)


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
    sample = sampled(models[name], wo, table["u1"].astype(float), mode)
    expected = {
        key: table[f"{name}/{mode.name.lower()}/{key}"]
        for key in ("wo", "pdf", "eta", "type", "weight")
    }
    shape = expected["weight"].shape  # a mirror ignores u1
    sample = jax.tree.map(lambda a: np.broadcast_to(a, shape + a.shape[2:]), sample)
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
        np.testing.assert_allclose(got[rows], expected[key][rows], rtol=0, atol=2e-6)
    np.testing.assert_allclose(sample.eta[rows], expected["eta"][rows], rtol=1e-6)
    refracted = (expected["type"] & (64 | 1)) > 0
    np.testing.assert_array_equal(sample.transmission[rows], refracted[rows])
    assert np.all(sample.specular)


def test_thin_slab_sums_each_polarization_apart():
    with open(REFERENCE / "golden_dielectric.csv", newline="") as file:
        columns = ("eta", "cos_i", "thin_unpol", "thin_sp")
        rows = [
            [float(row[key]) for key in columns]
            for row in csv.DictReader(file)
            if row["side"] == "1"
        ]
    # eta = .8 at cosine .6 is critical as a decimal, but not once both are rounded
    rows = [row for row in rows if row[:2] != [0.8, 0.6]]
    eta, cosine, mean_first, apart = np.array(rows).T
    reflected, transmitted = bsdf.ThinDielectric(eta).powers(cosine)
    # R down to 4e-8 at eta = 1.00029, whose n - 1 has 3 digits less than n
    np.testing.assert_allclose(reflected, apart, rtol=2e-12)
    np.testing.assert_allclose(reflected + transmitted, 1.0, rtol=0, atol=1e-15)
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


@pytest.mark.study
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
    np.testing.assert_array_equal(sample.direction, wo * [-1, -1, 1])
    np.testing.assert_array_equal(sample.density, 1.0)
    np.testing.assert_allclose(sample.value, 0.8 / np.abs(COSINES), rtol=1e-15)
    np.testing.assert_allclose(sample.weight, 0.8, rtol=1e-15)
    flux = np.asarray(sample.value) * np.abs(COSINES)
    naive = 0.8 * np.abs(COSINES)
    np.testing.assert_allclose(flux, 0.8, rtol=1e-15)
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
        jax.vmap(lambda term: term(0.7))(many), fresnel_conductor(0.7, many.eta, many.k), rtol=1e-14
    )


def test_reflectance_is_the_same_from_both_ends_of_a_refracted_ray():
    wo = direction(np.array([0.99, 0.6, 0.2, 0.01]))
    wt = directions.refract(wo, UP, 1.5).direction
    np.testing.assert_allclose(
        fresnel_dielectric(wo[:, 2], 1.5), fresnel_dielectric(wt[:, 2], 1.5), rtol=1e-12
    )


def test_models_show_their_values():
    rough = bsdf.conductor(0.2, 3.0, bsdf.TrowbridgeReitz(0.1, 0.25))
    assert "FresnelConductor(eta=0.2, k=3, eta_outside=1)" in repr(rough)
    assert "TrowbridgeReitz(alpha_x=0.1, alpha_y=0.25)" in repr(rough)
    assert "alpha_x=float32[3, 5]" in repr(bsdf.TrowbridgeReitz(np.ones((3, 5), np.float32)))


@pytest.mark.parametrize("wo", [(0.0, 0.6, 1.6), np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.5]])])
def test_a_direction_that_is_no_unit_vector_is_refused(wo):
    model = bsdf.Dielectric(1.5)
    with pytest.raises(ValueError, match="wo has the length .*wanted a unit vector. Divide it by"):
        model.sample(wo, 0.5, U)
    # Nothing is known of a direction that is traced, and rounding is no error.
    jax.eval_shape(lambda w: model.sample(w, 0.5, U), np.asarray(wo))
    model.sample(np.array([0.0, 0.6001, 0.8]), 0.5, U)
