"""Stacks with incoherent layers: the package tmm's answers; derivatives in total reflection."""

import gmpy2
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from benchmarks.accuracy import search_functions
from benchmarks.accuracy.search import FUNCTIONS
from benchmarks.accuracy.search_mixed import incoherent
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


@pytest.mark.parametrize(
    ("layers", "table"), [TMM[0], pytest.param(*TMM[1], marks=pytest.mark.study)]
)
def test_films_on_thick_glass_are_those_of_tmm(layers, table):
    angles, *wanted = (np.array(z) for z in zip(*table, strict=True))
    got = stack(
        np.cos(angles), layers[0], thickness_um=layers[1], wavelength_um=0.55, coherent=layers[2]
    )
    for value, exact in zip((got.R_s, got.T_s, got.R_p, got.T_p), wanted, strict=True):
        np.testing.assert_allclose(value, exact, rtol=1e-9)
    for R, T, A in ((got.R_s, got.T_s, got.A_s), (got.R_p, got.T_p, got.A_p)):
        np.testing.assert_allclose(R + T + A.sum(0), 1.0, atol=64 * 2.2e-16)


# Found by the accuracy search; R_s, R_p, the absorptions by the cosine. In total reflection by a
# thick layer dR_p was 1,130 eps of R off, as what is left of the derivative of r; behind a rough
# film in front of a medium of small index it was 163, and that of the absorption 548.
FOUND = {
    "stack of a thick layer": (
        0.9877349978502398, 1.788817596321981, 0.27438533973883916, 3.5059354584830683e-09,
        0.21091259793981826, 1.371152125674556e-06, 6197.648859719227, 0.5847139851924896,
    ),
    "stack with rough boundaries": (
        1.0, 1.1644903396881325, 3.2932872889394655, 2.2072821894056243, 0.1221850154852436,
        1.5060399331009968e-07, 0.4284012527199969, 0.5675251494233149, 0.0014295004205669391,
        3.7679181896804296e-05,
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[pytest.mark.study] if "rough" in n else []) for n in FOUND],
)
def test_derivatives_by_the_cosine(name):
    entry = FUNCTIONS[name]
    point = [jnp.asarray(x) for x in FOUND[name]]
    last = [0.0 * x for x in point[1:]]

    def results(*arguments):
        return jnp.stack([jnp.real(z) for z in entry.function(*arguments)])

    found = jax.jit(lambda *p: jax.jvp(results, p, (jnp.ones(()), *last))[1])(*point)
    with gmpy2.context(search_functions.CONTEXT):
        exact = [gmpy2.mpfr(x) for x in FOUND[name]]
        step = gmpy2.mpfr(2) ** -250
        above, below = (entry.truth(exact[0] + s * step, *exact[1:]) for s in (1, -1))
        slopes = [
            float(gmpy2.mpc((a - b) / (2 * step)).real)
            for (a, _), (b, _) in zip(above, below, strict=True)
        ]
    np.testing.assert_allclose(found, slopes, rtol=64 * 2.2e-16, atol=64 * 2.2e-16)


def test_absorption_of_evanescent_light_in_front_of_a_guided_mode():
    """A_s of a thick layer beyond its critical angle, by the index of the film behind it: formed
    from losses that cancel, the derivative was 2e5 eps off."""
    point = (
        0.27195480088483825, 1.2462188818836761, 0.10148027517271158, 0.0008591158391507217,
        3.7214942789298, 0.003191807001861581, 0.2347193409738693, 1.7894501767870487e-05,
        0.3277930660925428, 0.4455723070664177, 0.7478484791328308,
    )  # fmt: skip
    (ours, truth), by, result = incoherent((False, True)), 4, 4  # the film's index; A_s in front

    def absorbed(x):
        return ours(*map(jnp.asarray, (*point[:by], x, *point[by + 1 :])))[result]

    found = jax.jit(lambda x: jax.jvp(absorbed, (x,), (1.0,))[1])(point[by])
    with gmpy2.context(search_functions.CONTEXT):
        exact, step = [gmpy2.mpfr(x) for x in point], gmpy2.mpfr(2) ** -250
        above, below = (
            truth(*exact[:by], exact[by] + s * step, *exact[by + 1 :])[result][0] for s in (1, -1)
        )
        slope = float((above - below) / (2 * step))
    np.testing.assert_allclose(found, slope, rtol=64 * 2.2e-16)


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


def test_thick_layers_at_grazing_incidence_beside_a_guided_mode():
    """T and all absorptions there were 2,600 eps off, by the common factor 1 / (1 - R' P^2 R):
    what a film between the layers loses was formed as the difference of 1 - R and T."""
    point = (
        8.213136451012596e-06, 1.9468130738366614, 2.943165779858516, 6.990683974602658e-06,
        1.9032293435036944, 2.0374365195553568e-08, 2.160849682318816, 7.09815289872745e-09,
        0.25710041455222715, 4.2170479596996066e-05, 0.673174308299202, 0.08037817137685536,
        1.5975997333230112, 1.8410652621127068,
    )  # fmt: skip
    ours, truth = incoherent((False, True, False))
    with gmpy2.context(search_functions.CONTEXT):
        wanted = [float(v) for v, _ in truth(*map(gmpy2.mpfr, point))]
    np.testing.assert_allclose(ours(*map(jnp.asarray, point)), wanted, rtol=16 * 2.2e-16)
