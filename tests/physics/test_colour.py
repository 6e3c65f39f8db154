"""Colours against sums in NumPy, published colours, and Airy's formula of a film."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fresnel_jax import bsdf, colour, materials
from fresnel_jax.bsdf import FresnelFilm
from fresnel_jax.dispersion import material

TABLE = np.loadtxt(
    materials._data().joinpath("cie_1931_d65.csv").read_text().splitlines()[5:], delimiter=","
)
NM5 = TABLE[:, 0]
# The columns of the matrix that IEC 61966-2-1 prints, and the CIE Lab of these three colours
PRIMARIES = np.array([[0.4124, 0.2126, 0.0193], [0.3576, 0.7152, 0.1192], [0.1805, 0.0722, 0.9505]])
LABS = [[53.24, 80.09, 67.20], [87.73, -86.18, 83.18], [32.30, 79.19, -107.86]]


def summed(R):
    """X, Y, Z by the sum that CIE 15 prints."""
    weights = TABLE[:, 4:5] * TABLE[:, 1:4]
    return R @ weights / weights[:, 1].sum()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_sum_of_the_cie(dtype):
    R = (0.5 + 0.4 * np.sin(np.outer([20.0, 35.0], NM5))).astype(dtype)
    found = colour.xyz(R, NM5.astype(dtype))
    assert found.dtype == dtype
    np.testing.assert_allclose(found, summed(R), rtol=20 * np.finfo(dtype).eps)
    np.testing.assert_allclose(colour.xyz(R[:, ::-1], NM5[::-1].astype(dtype)), found, rtol=1e-5)
    equal = colour.xyz(np.ones(81, dtype), NM5.astype(dtype), dtype(2.0))
    np.testing.assert_allclose(equal, 1.0, atol=2e-4)  # x, y and z have equal areas


def test_published_colours():
    # D65: X, Y, Z of ASTM E308; the tangent of the spectrum at 520 nm is at x, y = 0.0743, 0.8338
    white = jax.jit(lambda R: colour.xyz(R, NM5))(np.ones(81))
    np.testing.assert_allclose(white, [0.95047, 1.0, 1.08883], atol=5e-5)
    single = np.asarray(colour.colour_matching(0.52))
    np.testing.assert_allclose(single[:2] / single.sum(), [0.0743, 0.8338], atol=5e-5)
    both = jax.jit(lambda x: (colour.lab(x), colour.linear_srgb(x)))
    (*labs, lab_of_white), (*primaries, white_in_srgb) = both(np.vstack([PRIMARIES, white]))
    np.testing.assert_allclose(lab_of_white, [100.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(white_in_srgb, 1.0, rtol=1e-12)
    np.testing.assert_allclose(labs, LABS, atol=0.03)
    np.testing.assert_allclose(primaries, np.eye(3), atol=5e-4)
    values = np.array([-0.5, 0.0, 0.0031308, 0.5, 1.0])
    np.testing.assert_allclose(
        colour.srgb_encode(values), [-0.735357, 0.0, 0.040449936, 0.735357, 1.0], atol=1e-6
    )


def test_gradients_of_colours():
    """Finite at black, and those of the sums elsewhere."""
    slope = jax.jit(jax.jacfwd(lambda R: colour.lab(colour.xyz(R, NM5))))
    assert np.isfinite(slope(np.zeros(81))).all()
    R, step = np.linspace(0.1, 0.6, 81), 1e-5
    lab = jax.jit(colour.lab)
    change = (lab(summed(R + step)) - lab(summed(R - step))) / (2 * step)
    np.testing.assert_allclose(slope(R).sum(-1), change, rtol=1e-3, atol=1e-3)
    assert np.isfinite(
        jax.jit(jax.vmap(jax.grad(colour.srgb_encode)))(np.array([-1.0, 0.0, 1e-9, 2.0]))
    ).all()


@pytest.mark.parametrize(
    ("shape", "wavelength", "words"),
    [
        ((3,), np.linspace(0.4, 0.7, 4), r"has the shape \(4,\) and the spectrum \(3,\)"),
        ((4,), np.array([0.38, 0.5, 0.45, 0.78]), "neither rises nor falls"),
        ((4,), np.linspace(0.4, 0.7, 4), "0.4 to 0.7 with steps up to 0.1; wanted"),
        ((41,), np.linspace(400.0, 800.0, 41), "wanted 0.4 to 0.7 micrometres"),
    ],
)
def test_wavelengths_that_do_not_fit(shape, wavelength, words):
    with pytest.raises(ValueError, match=words):
        colour.xyz(np.ones(shape), wavelength)


@pytest.mark.parametrize("dtype", [np.float64, pytest.param(np.float32, marks=pytest.mark.study)])
def test_a_film_on_a_rough_surface(dtype):
    """Airy's sum for a lossless film at normal incidence, every nanometre, in NumPy."""
    fine = np.arange(0.38, 0.7801, 0.001)
    phase = 4.0 * np.pi * 1.4 * 0.4 / fine
    r_1, r_2 = (1.0 - 1.4) / 2.4, (1.4 - 1.8) / 3.2
    R = np.abs((r_1 + r_2 * np.exp(1j * phase)) / (1.0 + r_1 * r_2 * np.exp(1j * phase))) ** 2
    weights = np.stack([np.interp(fine, NM5, TABLE[:, i]) for i in (1, 2, 3, 4)], -1)
    weights = weights[:, 3:] * weights[:, :3]
    want = colour.lab(R @ weights / weights[:, 1].sum())
    skin = FresnelFilm(dtype(1.4), dtype(0.4), dtype(1.8), exact=False)
    wo = np.array([[[0.6, 0.0, 0.8]], [[0.0, 0.3, np.sqrt(0.91)]]], dtype)
    wi = np.array([[[-0.6, 0.0, 0.8]], [[0.0, 0.0, 1.0]]], dtype)
    m = (wo + wi) / np.linalg.norm(wo + wi, axis=-1, keepdims=True)
    rough, cosine = bsdf.Beckmann(dtype(0.3)), np.append((wo * m).sum(-1), dtype([[1.0]]), axis=0)
    *colours, found = jax.jit(lambda skin, c: skin(c))(skin, cosine)
    to_xyz = np.linalg.inv(np.asarray(colour.linear_srgb(np.eye(3))))
    assert np.linalg.norm(colour.lab(np.asarray(found, float) @ to_xyz) - want) < 0.14
    value, plain = (
        jax.jit(lambda term: bsdf.Reflector(term, rough).evaluate(wo, wi))(term)
        for term in (skin, bsdf.FresnelNone())
    )
    assert value.shape == (2, 3) and value.dtype == dtype
    np.testing.assert_allclose(value, plain * np.array(colours), rtol=1e-5)
    with pytest.raises(ValueError, match=r"shape \(2,\) met a FresnelFilm; wanted \(..., 1\)"):
        skin(jnp.ones(2))


def test_surfaces_with_films_in_a_batch():
    """Points and media of different numbers met in one sum of the mask."""
    stack = bsdf.FresnelStack([1.0, 1.46, 1.3, 3.9], [0.1, 0.1], 0.55)
    w = np.array([[0.6, 0.0, 0.8], [0.0, 0.6, 0.8]])
    for facets in (None, bsdf.TrowbridgeReitz(0.3)):
        surface = bsdf.Reflector(stack, facets)
        for method in (surface.evaluate, surface.density):
            assert jax.eval_shape(method, w, w).shape == (2,)
    several = FresnelFilm(material("SiO2"), np.full((4, 1), 0.3), 3.9)
    assert jax.eval_shape(several, 0.5).shape == (4, 3)
