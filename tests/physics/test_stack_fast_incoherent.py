"""Samples with a thick layer, against a sum over round trips by mpmath."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from mpmath import mpc

from fitting import Measurement, fit, simulate
from fresnel_jax.layers import stack

WAVES = np.array([0.45, 0.6, 0.8])


def packet(index, thickness_um, kx, k0, p):
    """Return r and t from the front, r and t from the back, of films between two media.

    By characteristic matrices of the tangential fields (F. Abeles, 1950); amplitudes of E for s and
    of H for p. kx: over k0. index: of the first medium, the films and the last.
    """
    q = [mpmath.sqrt(n * n - kx * kx) for n in index]
    y = [z / n**2 if p else z for z, n in zip(q, index, strict=True)]

    def r_t(first, last, order):
        m = mpmath.eye(2)
        for j in order:
            d = k0 * q[j] * thickness_um[j - 1]
            c, s = mpmath.cos(d), mpmath.sin(d)
            m = m * mpmath.matrix([[c, -1j * s / y[j]], [-1j * y[j] * s, c]])
        b, g = m[0, 0] + m[0, 1] * y[last], m[1, 0] + m[1, 1] * y[last]
        return (y[first] * b - g) / (y[first] * b + g), 2 * y[first] / (y[first] * b + g)

    films = range(1, len(index) - 1)
    front, back = r_t(0, len(index) - 1, films), r_t(len(index) - 1, 0, list(films)[::-1])
    return [*front, *back], q[-1]


def exact(angle_deg, wavelength_um, front, plate, back, trips=400):
    """Return what films, a plate and films do to light in air, by name; trips: round trips.

    front, back: [(index, thickness), ..]; plate: (index, thickness). psi, delta in degrees; share:
    of the light that is polarized.
    """
    with mpmath.workdps(30):
        k0, kx = 2 * mpmath.pi / wavelength_um, mpmath.sin(mpmath.radians(angle_deg))
        trip, out = {}, {}
        for p in (False, True):
            first = packet(
                [mpc(1), *(n for n, _ in front), plate[0]], [d for _, d in front], kx, k0, p
            )
            second = packet(
                [plate[0], *(n for n, _ in back), mpc(1)], [d for _, d in back], kx, k0, p
            )
            (r, t, r_inside, t_out), q = first
            passage = mpmath.exp(1j * k0 * q * plate[1])
            r_back = second[0][0] * passage**2
            trip[p] = [r, *(t * t_out * r_back * (r_back * r_inside) ** j for j in range(trips))]
            out[f"R_{'sp'[p]}"] = sum(abs(a) ** 2 for a in trip[p])
            # Into air again: the squares of the fields are to each other as the powers.
            first_out = t * passage * second[0][1]
            out[f"T_{'sp'[p]}"] = sum(
                abs(first_out * (r_back * r_inside) ** j) ** 2 for j in range(trips)
            )
        s0, s1 = out["R_s"] + out["R_p"], out["R_s"] - out["R_p"]
        both = sum(a * mpmath.conj(b) for a, b in zip(trip[True], trip[False], strict=True))
        psi = mpmath.atan2(2 * abs(both), s1) / 2
        out["share"] = mpmath.sqrt(s1**2 + 4 * abs(both) ** 2) / s0
        out |= {"psi": mpmath.degrees(psi), "delta": -mpmath.degrees(mpmath.arg(both))}
        return {name: float(x) for name, x in out.items()}


SAMPLES = {
    "air | 1.5 1 mm thick | air": ([], (mpc(1.5), 1e3), []),
    "air | 1.5+1e-5i 1 mm thick | air": ([], (mpc(1.5, 1e-5), 1e3), []),
    "air | 2.1+0.01i 110 nm held | 1.5 1 mm thick | air": (
        [(mpc(2.1, 0.01), 0.11)], (mpc(1.5), 1e3), [],
    ),
    "air | 1.9 90 nm held | 2.3 55 nm held | 1.5+1e-5i 0.5 mm thick | 0.2+3i 15 nm held | air": (
        [(mpc(1.9), 0.09), (mpc(2.3), 0.055)], (mpc(1.5, 1e-5), 5e2), [(mpc(0.2, 3), 0.015)],
    ),
}  # fmt: skip


@pytest.mark.study
@pytest.mark.parametrize("text", SAMPLES)
def test_what_is_seen_is_the_sum_over_round_trips(text):
    angles = np.array([20.0, 50.0, 70.0])
    angle, wave = (x.ravel() for x in np.meshgrid(angles, WAVES))
    names = ["psi", "delta", "R_s", "R_p", "T_s", "T_p"]
    seen = simulate(text, {}, np.tile(angle, 6), np.tile(wave, 6), np.repeat(names, len(angle)))
    seen = dict(zip(names, seen.reshape(6, -1), strict=True))
    alone = simulate(text, {}, angle, wave, "T_p")  # without psi and Delta: a plate by `slab`
    np.testing.assert_allclose(alone, seen["T_p"], rtol=0, atol=1e-10)
    shares = []
    for i in range(len(angle)):
        true = exact(float(angle[i]), float(wave[i]), *SAMPLES[text])
        shares.append(true["share"])
        for name in names:
            away = seen[name][i] - true[name]
            away = (away + 180.0) % 360.0 - 180.0 if name == "delta" else away
            assert away == pytest.approx(0.0, abs=1e-10), name
    assert min(shares) < 0.995  # it is depolarized, or this would be no test


def test_two_thick_layers_and_one_that_lets_nothing_through():
    """Two plates of one index are one plate; an opaque plate is a bare surface."""
    one = "air | 2.1 110 nm held | 1.5+1e-5i 1 mm thick | air"
    two = "air | 2.1 110 nm held | 1.5+1e-5i 0.4 mm thick | 1.5+1e-5i 0.6 mm thick | air"
    opaque = "air | 2.1 110 nm held | 1.5+0.1i 1 mm thick | air"
    bare = "air | 2.1 110 nm held | 1.5+0.1i"
    for quantity in ("psi", "delta"):
        for a, b in ((one, two), (opaque, bare)):
            np.testing.assert_allclose(
                simulate(a, {}, 60.0, WAVES, quantity),
                simulate(b, {}, 60.0, WAVES, quantity),
                rtol=1e-10,
            )


@pytest.mark.study
def test_powers_beside_psi_and_delta_and_a_slit():
    """Powers are what they are alone; through a slit the intensities add up."""
    text = "air | 2.1 900 nm held | 1.5 1 mm thick | air"
    names = ["R_s", "R_p", "psi", "delta"]
    together = simulate(text, {}, 60.0, np.full(4, 0.6), names)
    alone = [simulate(text, {}, 60.0, 0.6, q)[0] for q in names]
    np.testing.assert_allclose(together, alone, rtol=1e-10)
    at = 0.6 + 3e-3 / 2.3548 * np.linspace(-5.0, 5.0, 401)
    weight = np.exp(-0.5 * np.linspace(-5.0, 5.0, 401) ** 2)
    index = [np.full(401, n, complex) for n in (2.1, 1.5, 1.0)]
    with jax.enable_x64(True):
        c, thickness = 0.5 * np.ones(401), [0.9, 1e3]
        found = stack(
            c,
            [1.0, *index],
            thickness_um=thickness,
            wavelength_um=at,
            coherent=[True, False],
            exact=False,
        )
    R_s, R_p, cross = (weight @ np.asarray(x) for x in (found.R_s, found.R_p, found.cross))
    psi = 0.5 * np.degrees(np.arctan2(2.0 * abs(cross), R_s - R_p))
    seen = simulate(text, {"bandwidth": 3.0}, 60.0, [0.6], ["psi"])
    assert seen[0] == pytest.approx(psi, abs=1e-4)


def random_sample(films, random, count):
    """Return n_0, cosines, wavelengths, indices and thicknesses of samples with thick layers.

    films: how many of them are in front of the first thick layer, between two, and behind the last.
    Some of the light is beyond the critical angle of a film or of a plate.
    """
    index, thickness = [], []
    for i, layers in enumerate(films):
        for _ in range(layers):
            k = 10.0 ** random.uniform(-4.0, 0.7, count) * (random.random(count) < 0.5)
            index.append(random.uniform(0.3, 4.0, count) + 1j * k)
            thickness.append(random.uniform(0.0, 1.0, count))
        last = i == len(films) - 1
        index.append(random.uniform(1.2, 2.2, count) + 1j * 10.0 ** random.uniform(-8, -4, count))
        if not last:
            thickness.append(10.0 ** random.uniform(2.0, 3.5, count))
    n_0, wavelength = random.uniform(1.0, 1.6, count), random.uniform(0.3, 1.5, count)
    return random.uniform(0.05, 1.0, count), n_0, index, thickness, wavelength


def followed(left, shares):
    """Return the sums of r_a r_b* and t_a t_b* over all ways of the light, passage by passage.

    left: of intensity after each thick layer. shares: of every packet r_a r_b*, t_a t_b* and both
    from behind, where a and b are s or p.
    """
    r, t, r_back, t_back = (np.array([x[i] for x in shares]) for i in range(4))
    count = len(left)
    down, up = np.zeros(count, complex), np.zeros(count, complex)
    out, through = r[0], 0.0
    down[0] = t[0]
    while max(abs(down).max(), abs(up).max()) > 1e-15:
        at_bottom, at_top = down * left, up * left
        through += at_bottom[-1] * t[count]
        out += at_top[0] * t_back[0]
        down, up = at_top * r_back[:count], at_bottom * r[1:]
        down[1:] += at_bottom[:-1] * t[1:count]
        up[:-1] += at_top[1:] * t_back[1:count]
    return out, through


@pytest.mark.parametrize(
    "films",
    [
        *[(0, 3, 1), (8, 1)],
        *(
            pytest.param(n, marks=pytest.mark.study)
            for n in ((0, 0), (2, 0), (2, 1, 0, 1), (1, 0, 2), (1, 9, 0, 0))
        ),
    ],
)
def test_random_samples_are_the_sums_over_all_ways(films):
    count, random = 10, np.random.default_rng([*films, 17])
    c, n_0, index, thickness, wavelength = random_sample(films, random, count)
    coherent = [True] * films[0] + [x for n in films[1:] for x in (False, *[True] * n)]
    with jax.enable_x64(True):
        got = stack(
            c,
            [n_0, *index],
            thickness_um=thickness,
            wavelength_um=wavelength,
            coherent=coherent,
            exact=False,
        )
    found = [np.asarray(x) for x in (*got[:4], got.cross)]
    thick = [j + 1 for j, interferes in enumerate(coherent) if not interferes]
    ends = list(zip([0, *thick], [*thick, len(index)], strict=True))
    for i in range(count):
        with mpmath.workdps(120):
            k0 = 2 * mpmath.pi / wavelength[i]
            kx = mpmath.mpf(n_0[i]) * mpmath.sqrt(1 - mpmath.mpf(c[i]) ** 2)
            media = [mpc(n_0[i]), *(mpc(n[i]) for n in index)]
            d = [mpmath.mpf(x[i]) for x in thickness]
            faces = [
                [packet(media[a : b + 1], d[a : b - 1], kx, k0, p)[0] for a, b in ends]
                for p in (False, True)
            ]
            q = [mpmath.sqrt(media[j] ** 2 - kx**2) for j in thick]
            left = [
                float(mpmath.exp(-2 * k0 * z.imag * d[j - 1]))
                for z, j in zip(q, thick, strict=True)
            ]
            sums = {}
            for one, two in ((0, 0), (1, 1), (1, 0)):
                pairs = zip(faces[one], faces[two], strict=True)
                shares = [
                    [complex(x * mpmath.conj(y)) for x, y in zip(*both, strict=True)]
                    for both in pairs
                ]
                sums[one, two] = followed(np.array(left), shares)
            front, behind = mpmath.sqrt(media[0] ** 2 - kx**2), mpmath.sqrt(media[-1] ** 2 - kx**2)
            s = float((behind / front).real)
            p = float((behind / media[-1] ** 2 / (front / media[0] ** 2)).real)
        true = [
            sums[0, 0][0], sums[1, 1][0], s * sums[0, 0][1], p * sums[1, 1][1], sums[1, 0][0],
        ]  # fmt: skip
        np.testing.assert_allclose([x[i] for x in found], true, rtol=0, atol=1e-10)


def sums(x):
    """Return sums of a film on a plate with a film behind: eta, k, nm, and k of the plate."""
    eta, k, nm, k_plate = x
    plate = 1.5 + 1j * k_plate
    index = [1.0, eta + 1j * k, plate, 0.2 + 3j, 1.0]
    found = stack(
        0.5,
        index,
        thickness_um=[1e-3 * nm, 300.0, 0.015],
        wavelength_um=0.6,
        coherent=[True, False, True],
        exact=False,
    )
    complex_parts = found.cross.real, found.cross.imag
    return jnp.stack([found.R_s, found.R_p, found.T_s, found.T_p, *complex_parts])


@pytest.mark.study
def test_derivatives_programs_and_precisions_agree():
    x = np.array([2.1, 0.02, 110.0, 1e-5])
    with jax.enable_x64(True):
        whole = np.asarray(sums(jnp.asarray(x)))
        np.testing.assert_allclose(jax.jit(sums)(jnp.asarray(x)), whole, rtol=1e-13)
        slopes = np.asarray(jax.jit(jax.jacfwd(sums))(jnp.asarray(x)))
        for i, step in enumerate((1e-5, 1e-5, 1e-3, 1e-8)):
            d = step * np.eye(4)[i]
            around = [np.asarray(sums(jnp.asarray(x + sign * d))) for sign in (1, -1)]
            # Central differences: the third derivative times step^2, and 1e-16 / step.
            np.testing.assert_allclose(
                (around[0] - around[1]) / (2 * step), slopes[:, i], rtol=1e-6
            )
        many = x * np.linspace(0.9, 1.1, 5)[:, None]
        each = np.stack([np.asarray(sums(jnp.asarray(row))) for row in many])
        together = jax.jit(jax.vmap(sums))(jnp.asarray(many))
        np.testing.assert_allclose(together, each, rtol=1e-13)
    single = jax.jit(sums)(jnp.asarray(x, jnp.float32))
    assert single.dtype == jnp.float32
    np.testing.assert_allclose(single, whole, rtol=2e-5)  # phases of 5 radians: 40 eps


@pytest.mark.study
def test_along_the_normal_s_is_both():
    """A fit at normal incidence forms what s shows alone."""
    random = np.random.default_rng(4)
    with jax.enable_x64(True):
        ones, waves = np.ones(20), random.uniform(0.4, 0.9, 20)
        # half of them transparent, so that some of the light comes through half a millimetre
        k = random.uniform(0.0, 0.2, (4, 20)) * (np.arange(20) % 2)
        index = [1.0, *(random.uniform(1.0, 3.0, (4, 20)) + 1j * k)]
        both = stack(
            ones,
            index,
            thickness_um=[0.3, 500.0, 0.1],
            wavelength_um=waves,
            coherent=[True, False, True],
            exact=False,
        )
    for s, p in ((both.R_s, both.R_p), (both.T_s, both.T_p), (both.R_s, np.abs(both.cross))):
        np.testing.assert_allclose(s, p, rtol=1e-11, atol=1e-15)
    m = Measurement.from_columns(0.0, waves, R=both.R_s, sigma=1e-3)
    assert fit(m, "air | 1.8 80..200 nm | BK7 1 mm thick | air").status == "converged"
