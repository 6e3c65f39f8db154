"""The table of docs/accuracy.md: `make accuracy`, or `python -m benchmarks.accuracy.interface`.

Largest errors, in units of eps, over the hard sets of the tests, against the textbook forms in 100
digits at the exact inputs: of R_s, R_p, T_s, T_p relative to each (an R below eps^2 counts as
eps^2), and of their gradients relative to the gradient's norm. Beside them what the printed form of
pbrt-v4 (FrComplex) makes of the same points in the same precision.
"""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np

from fresnel_jax import powers
from tests.truth import adversarial, oracle

POINTS = 500


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


def main():
    jax.config.update("jax_enable_x64", True)
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
