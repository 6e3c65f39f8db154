"""A call of every public function, model and method of fresnel_jax: name -> (function, arrays).

The arrays have equal ranks, and types that `cast` sets: nothing in them asks for promotion.
"""

from typing import Any

import numpy as np

from fresnel_jax import approximate as ap
from fresnel_jax import bsdf, colour, directions, fresnel_terms, interface, layers, performance
from fresnel_jax import dispersion as dp
from fresnel_jax import effective_medium as em
from fresnel_jax import microfacet as mf
from fresnel_jax import polarization as pol

N = 5  # points; no other axis of these arguments has this length
COS, ETA, K = np.linspace(0.1, 1.0, N), np.linspace(1.2, 3.0, N), np.linspace(0.1, 2.0, N)
ONES, WAVE, EV = np.ones(N), np.linspace(0.4, 0.9, N), np.linspace(1.0, 4.0, 3)
INDEX = np.stack([np.full(N, x) for x in (1.0, 1.4, 2.1, 3.8)])
FILMS, ROUGH = np.full((2, N), 0.1), np.full((3, N), 1e-3)
UP = np.tile([0.0, 0.0, 1.0], (N, 1))
OUT, IN = np.tile([0.6, 0.0, 0.8], (N, 1)), np.tile([-0.36, 0.48, 0.8], (N, 1))
U_LOBE, U = np.full(N, 0.3), np.full((N, 2), 0.3)
ALPHA = np.full(N, 0.3)
SPECTRUM, VISIBLE = np.full((N, 18), 0.4), 0.4 + 0.02 * np.arange(18)


def _stack(c, index, thickness, wavelength, **options):
    return layers.stack(c, index, thickness_um=thickness, wavelength_um=wavelength, **options)


def _media(index):
    return [index[0], layers.Uniaxial(index[1], index[2]), index[3]]


def _uniaxial(c, index, thickness, wavelength, **options):
    return _stack(c, _media(index), thickness, wavelength, **options)


def _in_depth(c, index, thickness, wavelength, depth):
    return layers.fields_at_depth(
        c, _media(index), thickness_um=thickness, wavelength_um=wavelength, depth_um=depth
    )


def scattering(make, *parameters):
    """The methods of a model made of arrays, as calls: name -> (function, arguments)."""
    return {
        "evaluate": (lambda o, i, *p: make(*p).evaluate(o, i), OUT, IN, *parameters),
        "density": (lambda o, i, *p: make(*p).density(o, i), OUT, IN, *parameters),
        "sample": (lambda o, v, u, *p: make(*p).sample(o, v, u), OUT, U_LOBE, U, *parameters),
        "flags": (lambda *p: make(*p).flags(), *parameters),
    }


def rough(make):
    return lambda alpha, *p: make(*p, bsdf.TrowbridgeReitz(alpha, 0.2))


def facets(method, *directions):
    def call(alpha, *w):
        return getattr(mf.TrowbridgeReitz(alpha, 0.2), method)(*w)

    return call, ALPHA, *directions


def boundary(function):
    """The programs of one boundary: with k and eta_i, without, with numbers, with complex eta."""
    return {
        "": (function, COS, ETA, K, ONES),
        " of k": (function, COS, ETA, K),
        " without k": (function, COS, ETA),
        " of numbers": (lambda c: function(c, 1.5, 0.1, 1.2), COS),
        " of integers": (lambda c: function(c, 2), COS),
    }


def at(make, *parameters):
    """A dispersion model of arrays at all wavelengths."""
    return lambda w, *p: make(*p)(w), WAVE, *parameters


def calls() -> dict[str, tuple[Any, ...]]:
    stacked = (COS, INDEX, FILMS, WAVE)
    table: dict[str, tuple[Any, ...]] = {
        "interface.powers of complex eta": (interface.powers, COS, ETA + 0.1j),
        "interface.amplitudes of complex eta": (interface.amplitudes, COS, ETA + 0.1j),
        "interface.fresnel_dielectric": (interface.fresnel_dielectric, COS, ETA),
        "interface.fresnel_conductor": (interface.fresnel_conductor, COS, ETA, K),
        "interface.fresnel_complex": (interface.fresnel_complex, COS, ETA + 0.1j),
        "interface.reflectance fast": (
            lambda *x: interface.reflectance(*x, compensated=False), COS, ETA, K, ONES,
        ),
        "interface.powers fast": (
            lambda *x: interface.powers(*x, compensated=False), COS, ETA, K, ONES,
        ),
        "approximate.f82_from_reflectances": (ap.f82_from_reflectances, COS, COS, COS),
        "approximate.gulbrandsen_index": (ap.gulbrandsen_index, 0.5 * COS, 0.5 * COS),
        "approximate.gulbrandsen_parameters": (ap.gulbrandsen_parameters, ETA, K),
        "approximate.normal_reflectance": (ap.normal_reflectance, ETA, K),
        "approximate.real_index": (ap.real_index, 0.5 * COS),
        "layers.slab": (
            lambda *x: layers.slab(*x[:3], thickness_um=x[3], wavelength_um=x[4], eta_i=x[5]),
            COS, ETA, K, FILMS[0], WAVE, ONES,
        ),
        "layers.slab of numbers": (
            lambda c: layers.slab(c, 1.5, 0.1, thickness_um=2.0, wavelength_um=0.5), COS,
        ),
        "layers.stack": (_stack, *stacked),
        "layers.stack complex": (_stack, COS, INDEX + 0.01j, FILMS, WAVE),
        "layers.stack rough": (lambda *x: _stack(*x[:4], roughness_um=x[4]), *stacked, ROUGH),
        "layers.stack rough complex": (
            lambda *x: _stack(*x[:4], roughness_um=x[4]), COS, INDEX + 0.01j, FILMS, WAVE, ROUGH,
        ),
        "layers.stack of four layers": (
            _stack, COS, np.concatenate([INDEX, INDEX[1:3]]), np.full((4, N), 0.1), WAVE,
        ),
        "layers.stack mixed": (lambda *x: _stack(*x, coherent=(True, False)), *stacked),
        "layers.stack mixed complex": (
            lambda *x: _stack(*x, coherent=(False, True)), COS, INDEX + 0.01j, FILMS, WAVE,
        ),
        "layers.stack incoherent": (lambda *x: _stack(*x, coherent=False), *stacked),
        "layers.stack fast": (lambda *x: _stack(*x, exact=False), *stacked),
        "layers.stack fast mixed": (
            lambda *x: _stack(*x, coherent=(False, True), exact=False), *stacked,
        ),
        "layers.stack of numbers": (
            lambda c: _stack(c, [1.0, 1.4 + 0.1j, 1.5], [0.1], 0.5), COS,
        ),
        "layers.stack of no layer": (lambda c: _stack(c, [1.0, 1.5], [], 0.5), COS),
        "layers.stack of many wavelengths": (
            lambda w: _stack(0.5, [1.0, 1.4, 1.5], [0.1], w), WAVE,
        ),
        "layers.stack of uniaxial media": (_uniaxial, COS, INDEX + 0.01j, FILMS[:1], WAVE),
        "layers.stack fast of uniaxial media": (
            lambda *x: _uniaxial(*x, exact=False), COS, INDEX + 0.01j, FILMS[:1], WAVE,
        ),
        "layers.fields_at_depth": (_in_depth, COS, INDEX, FILMS[:1], WAVE, ALPHA),
        "layers.graded_layer": (
            lambda n, d: layers.graded_layer(lambda z: n[None] * (1.0 + 0.1 * z), d, layers=2),
            ETA, FILMS[0],
        ),
        "performance.computed_once": (performance.computed_once, COS),
        "performance.fenced": (performance.fenced, COS),
        "performance.in_blocks": (
            lambda c: performance.in_blocks(lambda x: interface.reflectance(x, 1.5), c, points=2),
            COS,
        ),
        "performance.in_blocks total": (
            lambda c: performance.in_blocks(
                lambda x: interface.reflectance(x, 1.5), c, points=2, total=True
            ),
            COS,
        ),
        "directions.reflect": (directions.reflect, OUT, UP),
        "directions.refract": (directions.refract, OUT, UP, ETA),
        "directions.refract by a number": (lambda w, n: directions.refract(w, n, 1.5), OUT, UP),
        "directions.faceforward": (directions.faceforward, UP, OUT),
        "directions.entering": (directions.entering, OUT, UP),
        "directions.local_frame": (directions.local_frame, OUT),
        "directions.to_local": (lambda v, n: directions.to_local(v, directions.local_frame(n)),
                                OUT, UP),
        "directions.to_world": (lambda v, n: directions.to_world(v, directions.local_frame(n)),
                                OUT, UP),
        "directions.brewster_angle_deg": (directions.brewster_angle_deg, ETA),
        "directions.critical_angle_deg": (directions.critical_angle_deg, 1.0 / ETA),
        "directions.snells_window": (directions.snells_window, ETA),
        "dispersion.BrendelBormann": at(
            lambda s, e, g: dp.BrendelBormann(80.0, 0.1, s, e, g, g), EV, EV, 0.2 * EV
        ),
        "dispersion.Cauchy": at(dp.Cauchy, np.array([1.5, 0.01, 1e-4])),
        "dispersion.CauchyUrbach": at(
            lambda a, k: dp.CauchyUrbach(a, k, 0.1, 4.0), np.array([1.5, 0.01, 1e-4]), np.array(0.1)
        ),
        "dispersion.CodyLorentz": at(
            lambda a, e, g: dp.CodyLorentz(a, e, g, 0.8, 1.2, 0.9, 0.05), 10.0 * EV, EV, 0.5 * EV
        ),
        "dispersion.Constant": at(dp.Constant, np.array(1.5), np.array(0.1)),
        "dispersion.DrudeLorentz": at(dp.DrudeLorentz, EV, EV, 0.2 * EV),
        "dispersion.Gaussian": at(dp.Gaussian, 0.3 * EV, EV, 0.2 * EV),
        "dispersion.Sum": at(
            lambda a, e, s: dp.Sum(
                (dp.Gaussian(a, e, 0.2 * e), dp.DrudeLorentz(s, 9.0 * e, 0.0 * e)), 1.5
            ),
            0.3 * EV, EV, EV,
        ),
        "dispersion.KramersKronigSpline": at(
            lambda a, p, e: dp.KramersKronigSpline(a, np.arange(1.0, 8.0), 1.5, p, e),
            np.array([0.1, 0.5, 0.3]), np.array([1.0, 2.0]), np.array([8.0, 9.0]),
        ),
        "dispersion.PublishedFormula": at(lambda: dp.PublishedFormula(5, (1.5, 0.004, -2.0))),
        "dispersion.Sellmeier": at(dp.Sellmeier, 0.3 * EV, 0.01 * EV),
        "dispersion.Sellmeier with powers": at(
            lambda s, p, c: dp.Sellmeier(s, p, 1.0, c, (-2.0, 2.0)), EV, 0.01 * EV, 0.01 * EV[:2]
        ),
        "dispersion.Tabulated": at(
            lambda n, k: dp.Tabulated((0.3, 0.5, 1.0), n, k), np.array([1.4, 1.5, 1.6]), 0.1 * EV
        ),
        "dispersion.TaucLorentz": at(
            lambda a, e, g: dp.TaucLorentz(a, e, g, 0.8, 1.5), 10.0 * EV, EV, 0.5 * EV
        ),
        "dispersion.material_from_tables": at(
            lambda: dp.material_from_tables(((0.3, 1.0), (1.5, 1.4)), None, "glass")
        ),
        "dispersion.material_from_yaml": at(lambda: dp.material_from_yaml(
            "DATA: [{type: formula 5, wavelength_range: 0.3 1, coefficients: 1.5}]", "glass")),
        "dispersion.material": at(lambda: dp.material("gold")),
        "dispersion.drude": at(dp.drude, np.array(9.0), np.array(0.1)),
        "dispersion.lorentz_drude": at(
            lambda p, s, g, e: dp.lorentz_drude(p, s, g, e), np.array(9.0), 0.2 * EV, 0.2 * EV, EV
        ),
        "dispersion.Material": at(lambda n: dp.Material(dp.Constant(n), (0.3, 2.0)), np.array(1.5)),
        "microfacet.half_vector": (mf.half_vector, OUT, IN, ETA),
        "microfacet.half_vector_jacobian": (mf.half_vector_jacobian, OUT, IN, ETA),
        "microfacet.TrowbridgeReitz.D": facets("D", OUT),
        "microfacet.TrowbridgeReitz.D_visible": facets("D_visible", OUT, UP),
        "microfacet.TrowbridgeReitz.G": facets("G", OUT, IN),
        "microfacet.TrowbridgeReitz.G1": facets("G1", OUT),
        "microfacet.TrowbridgeReitz.Lambda": facets("Lambda", OUT),
        "microfacet.TrowbridgeReitz.sample_visible": facets("sample_visible", OUT, U),
        "microfacet.Beckmann.Lambda": (lambda a, w: mf.Beckmann(a, 0.2).Lambda(w), ALPHA, OUT),
        "microfacet.TrowbridgeReitz.bounded": facets("bounded"),
        "microfacet.TrowbridgeReitz.effectively_smooth": facets("effectively_smooth"),
        "bsdf.ThinDielectric.powers": (lambda c, n: bsdf.ThinDielectric(n).powers(c), COS, ETA),
        "bsdf.adjoint": (lambda o, i, n: bsdf.adjoint(bsdf.Dielectric(n), o, i), OUT, IN, ETA),
        "fresnel_terms.FresnelDielectric": (
            lambda c, n: fresnel_terms.FresnelDielectric(n)(c), COS, ETA,
        ),
        "fresnel_terms.FresnelConductor": (
            lambda c, n, k: fresnel_terms.FresnelConductor(n, k)(c), COS, ETA, K,
        ),
        "fresnel_terms.FresnelNone": (fresnel_terms.FresnelNone(), COS),
        "fresnel_terms.FresnelStack": (
            lambda c, *p: fresnel_terms.FresnelStack(*p)(c), COS, INDEX, FILMS, WAVE,
        ),
        "colour.colour_matching": (colour.colour_matching, WAVE),
        "colour.xyz": (lambda R, w: colour.xyz(R, w), SPECTRUM, VISIBLE),
        "colour.lab": (colour.lab, OUT),
        "colour.linear_srgb": (colour.linear_srgb, OUT),
        "colour.srgb_encode": (colour.srgb_encode, COS),
        "fresnel_terms.FresnelFilm": (
            lambda c, d: fresnel_terms.FresnelFilm(1.4, d, 2.0, exact=False)(c),
            COS[:1], WAVE[:1],
        ),
        "polarization.absorption_depth": (pol.absorption_depth, WAVE, K),
        "polarization.penetration_depth": (
            lambda w, *x: pol.penetration_depth(*x, wavelength_um=w), WAVE, COS, ETA, K, ONES,
        ),
        "polarization.mueller_refraction": (pol.mueller_refraction, COS, ETA, ONES),
    }  # fmt: skip
    for function in (
        interface.powers, interface.reflectance, interface.amplitudes, ap.f82, ap.large_index,
        ap.lazanyi_szirmay_kalos, ap.polynomial, ap.schlick, pol.ellipsometric_ratio,
        pol.mueller_reflection, pol.phases, pol.psi_delta,
    ):  # fmt: skip
        module = function.__module__.rpartition(".")[2]
        for variant, call in boundary(function).items():
            table[f"{module}.{function.__name__}{variant}"] = call
    for name in em.__all__:
        for count in (2, 3):
            index, fraction = INDEX[:count], np.full((count - 1, N), 0.3)
            call = getattr(em, name), index, 0.1 * index, fraction, *[ALPHA] * (name == "bruggeman")
            table[f"effective_medium.{name} of {count}"] = call
    metal = (ETA, K)
    for name, make, parameters in (
        ("Dielectric", bsdf.Dielectric, (ETA,)),
        ("Dielectric rough", rough(bsdf.Dielectric), (ALPHA, ETA)),
        ("ThinDielectric", bsdf.ThinDielectric, (ETA,)),
        ("conductor", bsdf.conductor, metal),
        ("conductor rough", rough(bsdf.conductor), (ALPHA, *metal)),
        ("conductor by Beckmann", lambda a, *p: bsdf.conductor(*p, bsdf.Beckmann(a)),
            (ALPHA, *metal)),
        ("conductor of numbers", lambda: bsdf.conductor(0.2, 3.0, bsdf.TrowbridgeReitz(0.2)), ()),
        ("Reflector", lambda s: bsdf.Reflector(bsdf.FresnelNone(), None, s), (ALPHA,)),
        ("fresnel_specular", lambda n: bsdf.fresnel_specular(0.9, 0.8, n, 1.5), (ETA,)),
        ("specular_reflection", lambda n: bsdf.specular_reflection(
            0.9, bsdf.FresnelDielectric(n)), (ETA,)),
        ("specular_transmission", lambda n: bsdf.specular_transmission(0.9, n, 1.5), (ETA,)),
    ):  # fmt: skip
        for method, call in scattering(make, *parameters).items():
            table[f"bsdf.{name}.{method}"] = call
    return table


CALLS = calls()


def cast(x, dtype):
    """x in this precision."""
    return x.astype(np.result_type(dtype, np.complex64) if np.iscomplexobj(x) else dtype)
