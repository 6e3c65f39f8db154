"""Entries of the accuracy search: rough surfaces, and samples of smooth ones."""

import functools

import gmpy2
import jax.numpy as jnp
import numpy as np

from benchmarks.accuracy.search_boundary import BOUNDARY, INDEX, boundary, either_side, unpolarized
from benchmarks.accuracy.search_directions import directions, two_directions
from benchmarks.accuracy.search_functions import Function, decades
from fresnel_jax import bsdf
from fresnel_jax.microfacet import Beckmann, TrowbridgeReitz
from tests.truth.exact_fresnel import textbook

_ONE = gmpy2.mpfr(1)


def stretched(v, a, b):
    return gmpy2.sqrt(v[2] ** 2 + (a * v[0]) ** 2 + (b * v[1]) ** 2)


def D(*v):
    m, a, b = v[:3], v[-2], v[-1]
    if m[2] <= 0:
        return None
    return [
        (
            1 / (gmpy2.const_pi() * a * b * ((m[0] / a) ** 2 + (m[1] / b) ** 2 + m[2] ** 2) ** 2),
            None,
        )
    ]


def _masking(*v):
    w, a, b = v[:3], v[-2], v[-1]
    z = abs(w[2])
    return [((stretched(w, a, b) - z) / (2 * z), None), (2 * z / (z + stretched(w, a, b)), None)]


def _beckmann(*v):
    """D, whose exponent e multiplies the rounding of the arguments."""
    m, a, b = v[:3], v[-2], v[-1]
    if m[2] <= 0:
        return None
    e = ((m[0] / a) ** 2 + (m[1] / b) ** 2) / m[2] ** 2
    if e > 85:
        return None  # exp(-e) is 0 in float32
    value = gmpy2.exp(-e) / (gmpy2.const_pi() * a * b * m[2] ** 4)
    return [(value, value * (1 + e / 2))]


def _beckmann_masking(*v):
    """Lambda in units of 1 + Lambda, and G1 (Walter et al. 2007, exact form of eq. 26)."""
    w, alpha2 = v[:3], (v[-2] * v[0]) ** 2 + (v[-1] * v[1]) ** 2
    if alpha2 == 0:
        return [(gmpy2.mpfr(0), _ONE), (_ONE, None)]
    a = abs(w[2]) / gmpy2.sqrt(alpha2)
    hidden = (gmpy2.exp(-a * a) / (a * gmpy2.sqrt(gmpy2.const_pi())) - gmpy2.erfc(a)) / 2
    return [(hidden, 1 + hidden), (1 / (1 + hidden), None)]


def G(*v, masking=_masking):
    (x, _), (y, _) = masking(*v[:3], *v[6:])[0], masking(*v[3:6], *v[6:])[0]
    return [(1 / (1 + x + y), None)]


def _mirror_facets(*v, area=D, masking=_masking):
    """f and density of a mirror with F = 1, at the half vector of the inputs.

    Facets are drawn from the visible ones of Trowbridge and Reitz.
    """
    o, i, a, b = v[:3], v[3:6], v[6], v[7]
    if o[2] * i[2] <= 0:
        return None
    h = [x + y for x, y in zip(o, i, strict=True)]
    length = gmpy2.sqrt(sum(x * x for x in h))
    h = [x / length * (1 if o[2] > 0 else -1) for x in h]
    facets = area(*h, a, b)
    if facets is None:
        return None
    facets, visible = facets[0][0], G(*v, masking=masking)[0][0]
    G1 = 2 * abs(o[2]) / (abs(o[2]) + stretched(o, a, b))
    return [
        (facets * visible / (4 * abs(o[2] * i[2])), None),
        (G1 * D(*h, a, b)[0][0] / (4 * abs(o[2])), None),
    ]


def _rough(*columns):
    """Both directions above the surface, so that none of the points is empty."""
    z_o, t_o, z_i, t_i, *alphas = columns
    return directions(np.abs(z_o), t_o, np.abs(z_i), t_i, *alphas)


def _facets(random, size, eps):
    return (
        *two_directions(random, size, eps),
        decades(random, size, -3, 0),
        decades(random, size, -3, 0),
    )


_FACETS = ((-1.0, 1.0), (0.0, 6.3), (-1.0, 1.0), (0.0, 6.3), (1e-3, 1.0), (1e-3, 1.0))


def _vectors(v, facets=TrowbridgeReitz):
    return jnp.stack(v[:3]), jnp.stack(v[3:6]), facets(v[6], v[7])


def _our_beckmann_masking(*v):
    w, _, facets = _vectors(v, Beckmann)
    return facets.Lambda(w), facets.G1(w)


def _our_mirror(*v, facets=TrowbridgeReitz):
    o, i, facets = _vectors(v, facets)
    model = bsdf.Reflector(bsdf.FresnelNone(), facets)
    return model.evaluate(o, i), model.density(o, i)


def _ray(z, *others):
    """A unit vector of cosine z, by its components, and what comes after it."""
    return np.sqrt((1 - z) * (1 + z)), z, *others


def _smooth(_, z, eta):
    """value, weight, cosine of the sampled direction of both lobes of a smooth dielectric."""
    cosine = abs(z)
    n, m = (eta, _ONE) if z > 0 else (_ONE, eta)
    cos2 = 1 - (m / n) ** 2 * (1 - cosine * cosine)
    if cos2 <= 0:
        return None  # total reflection has one lobe; R is 1 there, as `fresnel_dielectric` is
    exact = textbook(cosine, n, gmpy2.mpfr(0), m)
    if exact is None:
        return None
    R_s, R_p, T_s, T_p = exact.powers()
    cos_t, R, T = gmpy2.sqrt(cos2), (R_s + R_p) / 2, (T_s + T_p) / 2
    if R < 1e-30 or T < 1e-5:
        return None  # a lobe that no number below 1 in float32 chooses
    spread = (m / n) ** 2
    return [
        (R / cosine, None), (R, None), (z, None), (T * spread / cos_t, None),
        (T * spread, None), (-cos_t if z > 0 else cos_t, None), (R, None), (T, None),
    ]  # fmt: skip


def _smooth_without_density(*point):
    """Away from the critical angle, where the derivatives magnify the rounding of the direction."""
    found = _smooth(*point)
    return None if found is None or abs(found[5][0]) < 0.3 else found[:-2]


def _our_smooth(x, z, eta):
    return *_our_smooth_without_density(x, z, eta), *(
        bsdf.Dielectric(eta).sample(jnp.stack([x, 0.0 * x, z]), u_lobe, (0.5, 0.5)).density
        for u_lobe in (0.0, 1.0 - 2.0**-20)
    )


def _our_smooth_without_density(x, z, eta):
    model, wo, out = bsdf.Dielectric(eta), jnp.stack([x, 0.0 * x, z]), []
    for lobe in (bsdf.Lobes.REFLECTION, bsdf.Lobes.TRANSMISSION):
        sample = model.sample(wo, 0.5, (0.5, 0.5), lobe)
        out += [sample.value, sample.weight, sample.direction[2]]
    return tuple(out)


def _slab_of_no_phase(x, z, eta):
    cosine = abs(z)
    exact = textbook(cosine, eta, gmpy2.mpfr(0), _ONE)
    if exact is None or exact.Q.imag > 0:  # total reflection
        return None
    R = [(r + r * (1 - r) ** 2 / (1 - r * r)) if r else r for r in exact.powers()[:2]]
    return [(sum(R) / 2, None), (sum((1 - r) for r in R) / 2, None)]


def _mirror(x, z, n, k):
    found = unpolarized(z, n, k, _ONE)
    return None if found is None else [(found[0][0] / z, None), (found[0][0], None)]


def _our_mirror_of_metal(x, z, n, k):
    model = bsdf.Reflector(bsdf.FresnelConductor(n, k))
    sample = model.sample(jnp.stack([x, 0.0 * x, z]), 0.5, (0.5, 0.5))
    return sample.value, sample.weight


def _sided(random, size, eps):
    z, eta = either_side(random, size, eps)
    return np.where(np.abs(z) < 1e-6, 0.5, z), eta


SMOOTH = {
    "Dielectric.sample, smooth": Function(
        _sided, ((-1.0, 1.0), INDEX), _our_smooth, _smooth, 12.0, None, _ray, (0,),
        conditioned=True,
    ),
    # By eta: samples hold their density fixed, and the direction is drawn, not differentiated by.
    "gradient of Dielectric.sample": Function(
        _sided, ((-1.0, 1.0), INDEX), _our_smooth_without_density, _smooth_without_density,
        # Conditioned: a rounded direction is a unit vector to an eps, and its x^2 is not 1 - z^2.
        None, 100.0, _ray, (0, 1), conditioned=True,
    ),
    "ThinDielectric.powers": Function(
        # The gradient's bound grows as (1 / eta)^2, as that of `powers`.
        _sided, ((-1.0, 1.0), (0.1, 1e2)), lambda x, z, eta: bsdf.ThinDielectric(eta).powers(z),
        _slab_of_no_phase, 12.0, 500.0, _ray, (0,),
    ),
    "Reflector.sample, smooth metal": Function(
        lambda *a: boundary(*a)[:3], BOUNDARY[:3], _our_mirror_of_metal, _mirror, 12.0, 100.0,
        _ray, (0,),
    ),
}  # fmt: skip
BSDFS = SMOOTH | {
    "TrowbridgeReitz.D": Function(
        _facets, _FACETS, lambda *v: (_vectors(v)[2].D(_vectors(v)[0]),), D, 12.0, 24.0, _rough,
    ),
    "TrowbridgeReitz.Lambda, G1": Function(
        _facets, _FACETS,
        lambda *v: (_vectors(v)[2].Lambda(_vectors(v)[0]), _vectors(v)[2].G1(_vectors(v)[0])),
        _masking, 12.0, 24.0, _rough,
    ),
    "TrowbridgeReitz.G": Function(
        _facets, _FACETS, lambda *v: (_vectors(v)[2].G(*_vectors(v)[:2]),), G, 12.0, 24.0, _rough,
    ),
    "Reflector.evaluate, density": Function(
        _facets, _FACETS, _our_mirror, _mirror_facets, 24.0, 100.0, _rough, conditioned=True,
    ),
    "Beckmann.D": Function(
        _facets, _FACETS, lambda *v: (_vectors(v, Beckmann)[2].D(_vectors(v)[0]),), _beckmann,
        8.0, 24.0, _rough, conditioned=True,
    ),
    "Beckmann.Lambda, G1": Function(
        _facets, _FACETS, _our_beckmann_masking, _beckmann_masking, 8.0, 24.0, _rough,
    ),
    "Beckmann.G": Function(
        _facets, _FACETS, lambda *v: (_vectors(v, Beckmann)[2].G(*_vectors(v)[:2]),),
        functools.partial(G, masking=_beckmann_masking), 8.0, 24.0, _rough,
    ),
    "Reflector of Beckmann.evaluate, density": Function(
        _facets, _FACETS, functools.partial(_our_mirror, facets=Beckmann),
        functools.partial(_mirror_facets, area=_beckmann, masking=_beckmann_masking), 24.0, 100.0,
        _rough, conditioned=True,
    ),
}  # fmt: skip
