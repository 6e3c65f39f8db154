"""Stacks with incoherent layers: answers of the package tmm and in 500 digits; derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fresnel_jax.layers import stack

# Cosines' angles in radians; R_s, T_s, R_p, T_p of tmm 0.2.0 (S. J. Byrnes, arXiv:1603.02720), its
# inc_tmm, at .55 um: a film of magnesium fluoride on 1 mm of glass with its bare back face; glass
# with an absorbing film in front and another film behind; a film of silver on glass.
COATED = [1.0, 1.38, 1.52 + 1e-5j, 1.0], [0.1, 1000.0], (True, False)
BOTH = [1.0, 2.1 + 0.01j, 1.52 + 1e-5j, 1.38, 1.0], [0.08, 1000.0, 0.1], (True, False, True)
SILVER = [1.0, 0.055 + 3.32j, 1.52, 1.0], [0.02, 1000.0], (True, False)
TMM = [
    (COATED, [
        (0.0, 0.03889741194046481, 0.7525147856416561, 0.03889741194046481, 0.7525147856416561),
        (0.8, 0.09645744114806958, 0.6673485880002782, 0.0060482612968760065, 0.7644304017904688),
        (1.3, 0.4090314852243926, 0.3402868683061926, 0.14875466328592185, 0.604656823465842),
    ]),
    (BOTH, [
        (0.0, 0.22149862452599153, 0.605334124616304, 0.22149862452599153, 0.605334124616304),
        (0.8, 0.3726218098455313, 0.4660346917435451, 0.10765613036718247, 0.6749577352094089),
        (1.3, 0.7074353506345034, 0.17905407101063464, 0.07475454338891761, 0.6389997680165749),
    ]),
    (SILVER, [
        (0.0, 0.6227056239619326, 0.35192080810457216, 0.6227056239619326, 0.35192080810457216),
        (0.8, 0.7340229148764782, 0.24507256502041516, 0.5338540799330314, 0.4379638247202712),
        (1.3, 0.897545098186428, 0.09123636333613155, 0.5012881546384107, 0.46870263405314555),
    ]),
]  # fmt: skip
# A film that guides a mode, on a thick layer in which light is evanescent and meets an R of up to
# 1e6 at the film; by `benchmarks.accuracy.search_mixed`. T_s was 1e6 eps off at the last angle.
GUIDE = [1.0, 2.0 + 1e-9j, 0.3 + 1e-4j, 1.5], [0.02541, 1.0], (True, False)
EVANESCENT = [
    (1.5, 0.9986317571109097, 3.252583833247495e-17, 0.9999746968652572, 1.2096259425182231e-18),
    (1.56, 0.9911782930653604, 1.968554171967831e-16, 0.99999611535545, 1.7428338666872878e-19),
    (1.57, 0.9594918841448894, 9.025807489219684e-16, 0.9999997134259907, 1.2837734430154246e-20),
]


def compared_with(table, layers, rtol):
    """Check R and T of a stack (index, thicknesses, coherent) against rows of a table above."""
    angles, *wanted = (np.array(z) for z in zip(*table, strict=True))
    got = stack(
        np.cos(angles), layers[0], thickness_um=layers[1], wavelength_um=0.55, coherent=layers[2]
    )
    for value, exact in zip((got.R_s, got.T_s, got.R_p, got.T_p), wanted, strict=True):
        np.testing.assert_allclose(value, exact, rtol=rtol)
    return got


def test_evanescent_light_in_a_thick_layer_beside_a_guided_mode():
    compared_with(EVANESCENT, GUIDE, rtol=1e-12)


@pytest.mark.parametrize(
    ("layers", "table"), [TMM[0], pytest.param(*TMM[1], marks=pytest.mark.study)]
)
def test_films_on_thick_glass_are_those_of_tmm(layers, table):
    got = compared_with(table, layers, rtol=1e-9)
    for R, T, A in ((got.R_s, got.T_s, got.A_s), (got.R_p, got.T_p, got.A_p)):
        np.testing.assert_allclose(R + T + A.sum(0), 1.0, atol=64 * 2.2e-16)


@pytest.mark.study
def test_derivative_by_the_absorption_of_the_first_medium():
    """There R + T + sum(A) is not 1, and the derivative of R not what the others lose."""

    def reflected(k):
        index = jnp.stack([1.8 + 1j * k, 1.2 + 1e-4j, 1.1 + 0.01j])
        out = stack(0.3, index, thickness_um=[100.0], wavelength_um=0.5, coherent=False)
        return jnp.stack([out.R_s, out.R_p])

    both = jax.jit(lambda k: jax.jvp(reflected, (k,), (1.0,)))
    above, below = both(0.1 + 1e-5)[0], both(0.1 - 1e-5)[0]
    np.testing.assert_allclose(both(0.1)[1], (above - below) / 2e-5, rtol=1e-8)


def _plate_in_an_absorbing_medium(c, indices, thickness, wavelength):
    """R_s, R_p of an incoherent plate by Fresnel's amplitudes as textbooks print them."""
    N0, N1, N2 = indices
    K2 = N0**2 * (1.0 - c * c)
    Q = [N0 * c, np.sqrt(N1**2 - K2), np.sqrt(N2**2 - K2)]
    P2 = np.exp(-8.0 * np.pi * thickness / wavelength * Q[1].imag)
    out = []
    for Y0, Y1, Y2 in (Q, [q / N**2 for q, N in zip(Q, indices, strict=True)]):
        r01, r12 = (Y0 - Y1) / (Y0 + Y1), (Y1 - Y2) / (Y1 + Y2)
        # T from both sides is the power that enters the medium of Y1
        T2 = (abs(1.0 - r01**2) * Y1.real / abs(Y1)) ** 2
        out.append(abs(r01) ** 2 + T2 * P2 * abs(r12) ** 2 / (1.0 - abs(r01 * r12) ** 2 * P2))
    return np.array(out)


@pytest.mark.study
def test_a_clear_plate_behind_an_absorbing_medium():
    """Its wave grows with the depth. R was that of the first boundary, the derivative of an R above
    .5 off by a factor of 130, and at a cosine of 0 a part of it was missing."""
    index = np.array([1.5 + 0.01j, 1.6, 1.7 + 0.2j])

    def reflected(c):
        out = stack(c, index, thickness_um=[5.0], wavelength_um=0.6, coherent=False)
        return jnp.stack([out.R_s, out.R_p])

    cosines = jnp.array([0.0, 1e-3, 0.25, 0.4, 0.5, 0.9])
    values, moved = jax.jit(jax.vmap(lambda c: jax.jvp(reflected, (c,), (1.0,))))(cosines)
    assert np.all(np.isnan(values[:2]))  # the sum over the reflections diverges
    for c, R, dR in zip(cosines.tolist()[2:], values[2:], moved[2:], strict=True):
        exact = [_plate_in_an_absorbing_medium(x, index, 5.0, 0.6) for x in (c, c + 1e-5, c - 1e-5)]
        np.testing.assert_allclose(R, exact[0], rtol=1e-12)
        np.testing.assert_allclose(dR, (exact[1] - exact[2]) / 2e-5, rtol=1e-6)
