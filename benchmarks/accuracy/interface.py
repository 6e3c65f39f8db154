"""Two tables of docs/accuracy.md: `make accuracy`, or `python -m benchmarks.accuracy.interface`.

The first one: correct decimal digits at random points of everyday optics, median and worst.

The second one: largest errors, in units of eps, over the hard sets of the tests, against the
textbook forms in 100 digits at the exact inputs: of R_s, R_p, T_s, T_p relative to each (an R below
eps^2 counts as eps^2), and of their gradients relative to the gradient's norm. Beside them what the
printed form of pbrt-v4 (FrComplex) makes of the same points in the same precision.
"""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np

from fresnel_jax import powers
from fresnel_jax.layers import stack
from fresnel_jax.polarization import psi_delta
from tests.truth import adversarial, oracle, stack_oracle

POINTS = 500
SEED, DRAWN, STEP = 20261129, 300, mp.mpf(10) ** -30


def printed_form(cos_theta_i, eta, k, eta_i):
    """R_s and R_p as FrComplex computes them, with the relative index."""
    index = jax.lax.complex(eta, k) / eta_i
    sine2 = 1 - cos_theta_i * cos_theta_i
    cos_theta_t = jnp.sqrt(1 - sine2 / (index * index))
    r_p = (index * cos_theta_i - cos_theta_t) / (index * cos_theta_i + cos_theta_t)
    r_s = (cos_theta_i - index * cos_theta_t) / (cos_theta_i + index * cos_theta_t)
    return jnp.abs(r_s) ** 2, jnp.abs(r_p) ** 2


@jax.jit
def derivatives(*arguments):
    directions = np.eye(4)
    return [
        jax.jvp(
            powers,
            arguments,
            tuple(jnp.full_like(x, d) for x, d in zip(arguments, row, strict=True)),
        )[1]
        for row in directions
    ]


def largest_errors(dtype, points):
    """In eps: of our powers, of their gradients, of the printed form."""
    eps = float(np.finfo(dtype).eps)
    ours = np.array(powers(*points), float)
    gradients = np.array(derivatives(*points), float)
    printed = np.array(jax.jit(printed_form)(*points), float)
    worst = np.zeros(3)
    for i, point in enumerate(zip(*points, strict=True)):
        true = oracle.powers(*point)
        scales = [
            max(abs(t), eps**2 if j < 2 else np.finfo(dtype).tiny / eps) for j, t in enumerate(true)
        ]
        errors = [abs(mp.mpf(x) - t) / s for x, t, s in zip(ours[:, i], true, scales, strict=True)]
        worst[0] = max(worst[0], float(max(errors)) / eps)
        errors = [
            abs(mp.mpf(x) - t) / s if np.isfinite(x) else mp.inf
            for x, t, s in zip(printed[:, i], true[:2], scales[:2], strict=True)
        ]
        worst[2] = max(worst[2], float(max(errors)) / eps)
        for j, gradient in enumerate(oracle.reflectance_gradients(*point) or []):
            norm = mp.norm(gradient)
            if mp.mpf(10) ** -50 < norm < float(np.finfo(dtype).max):
                error = mp.norm(
                    [mp.mpf(x) - g for x, g in zip(gradients[:, j, i], gradient, strict=True)]
                )
                worst[1] = max(worst[1], float(error / norm) / eps)
    return worst


def everyday(dtype):
    """Cosine, indices, thicknesses and wavelength of two films on a substrate, in air.

    Angles to 85 degrees, eta 1.3 to 4 (a metal's .1 to 3), k 0 or 1e-4 to 1 (a metal's 1 to 8) in
    films and substrate, films up to half a micrometre, wavelengths .3 to 2 um.
    """
    random = np.random.default_rng(SEED)

    def medium():
        metal = random.random(DRAWN) < 0.3
        eta = np.where(metal, random.uniform(0.1, 3, DRAWN), random.uniform(1.3, 4, DRAWN))
        lossy = np.where(random.random(DRAWN) < 0.5, 10 ** random.uniform(-4, 0, DRAWN), 0.0)
        return eta, np.where(metal, random.uniform(1, 8, DRAWN), lossy)

    eta, k = np.moveaxis([medium() for _ in range(3)], 1, 0)
    cosine = np.cos(np.radians(random.uniform(0, 85, DRAWN)))
    thickness, wavelength = random.uniform(0.0, 0.5, (2, DRAWN)), random.uniform(0.3, 2.0, DRAWN)
    return [x.astype(dtype) for x in (cosine, eta, k, thickness, wavelength)]


@jax.jit
def everyday_results(cosine, eta, k, thickness, wavelength):
    """R, T, psi of the substrate alone; R, T of the films; thickness times dR / dthickness."""
    air = jnp.ones_like(eta[:1])
    index = jax.lax.complex(jnp.concatenate([air, eta]), jnp.concatenate([0 * air, k]))

    def films(thickness):
        whole = stack(cosine, index, thickness_um=thickness, wavelength_um=wavelength)
        return jnp.stack(whole[:4])

    bare = powers(cosine, eta[-1], k[-1])
    psi = psi_delta(cosine, eta[-1], k[-1]).psi[None]
    slopes = [
        jax.jvp(films, (thickness,), (thickness * row[:, None],))[1][:2]
        for row in jnp.eye(2, dtype=thickness.dtype)
    ]
    return jnp.stack(bare[:2]), jnp.stack(bare[2:]), psi, films(thickness), jnp.stack(slopes)


def everyday_truth(cosine, eta, k, thickness, wavelength):
    """The same of one point, by characteristic matrices."""
    substrate = complex(eta[-1], k[-1])
    index = [1.0, *(complex(*pair) for pair in zip(eta, k, strict=True))]
    with mp.workdps(60):
        bare = stack_oracle.stack(cosine, [1.0, substrate], [], wavelength, 60)
        d = [mp.mpf(float(x)) for x in thickness]

        def films(*change):
            moved = [x * (1 + y) for x, y in zip(d, change, strict=True)]
            return stack_oracle.stack(cosine, index, moved, wavelength, 60)

        whole = films(0, 0)
        slopes = []
        for step in ((STEP, 0), (0, STEP)):
            up, down = films(*step), films(*(-x for x in step))
            slopes += [(up[i] - down[i]) / (2 * STEP) for i in (0, 1)]
        psi = mp.atan(abs(bare[5] / bare[4]))
        return bare[:2], bare[2:4], [psi], whole[:4], slopes


def everyday_digits(dtype):
    """Correct digits of each result, (5, points); of slopes in units of the largest one.

    A T or slope below 1e13 times the smallest float may be 0, and counts as that.
    """
    points, least = everyday(dtype), 1e13 * float(np.finfo(dtype).tiny)
    ours = [np.asarray(x, float) for x in everyday_results(*points)]
    digits = np.zeros((len(ours), DRAWN))
    for i in range(DRAWN):
        truth = everyday_truth(*(x[..., i] for x in points))
        for j, (found, true) in enumerate(zip(ours, truth, strict=True)):
            found = found[..., i].reshape(-1)
            size = [max(map(abs, true))] * len(true) if j == 4 else map(abs, true)
            size = [max(x, least) for x in size]
            errors = [abs(mp.mpf(x) - t) / s for x, t, s in zip(found, true, size, strict=True)]
            digits[j, i] = -np.log10(max(float(max(errors)), np.finfo(dtype).eps / 2))
    return digits


def main():
    jax.config.update("jax_enable_x64", True)
    print("| | float64: median | worst | float32: median | worst |")
    print("| --- | --- | --- | --- | --- |")
    digits = [everyday_digits(dtype) for dtype in (np.float64, np.float32)]
    for j, name in enumerate((
        "R of one boundary", "T of one boundary", "psi of one boundary", "R and T of two films",
        "derivative of R by their thicknesses",
    )):  # fmt: skip
        figures = [f"{of(x[j]):.1f}" for x in digits for of in (np.median, np.min)]
        print(f"| {name} | {' | '.join(figures)} |")
    print()
    print(
        "| points | R, T: float64 | float32 | gradient: float64 | float32 "
        "| printed form: float64 | float32 |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name in adversarial.hard_sets(np.float64):
        double, single = (
            largest_errors(dtype, adversarial.hard_sets(dtype, POINTS)[name])
            for dtype in (np.float64, np.float32)
        )
        figures = [f"{x:.1f}" for pair in zip(double[:2], single[:2], strict=True) for x in pair]
        figures += ["NaN" if np.isinf(x) else f"{x:.0e}" for x in (double[2], single[2])]
        print(f"| {name} | {' | '.join(figures)} |")


if __name__ == "__main__":
    main()
