"""The variance of lobe choice: why a sampler of glass tosses a coin weighted by Fresnel.

At a dielectric boundary a path goes on in one of two directions: reflected, which brings R L_r, or
refracted, which brings T L_t. A path tracer takes one of them, with probability p or 1 - p, and
divides by it. Where both directions bring the same radiance L = 1, the estimate is R / p or
T / (1 - p), its mean is R + T = 1, and its variance is

    equal split,   p = 1/2:   (1 - 2 R)^2        Fresnel split, p = R:   0.

(Physically Based Rendering, 4th ed., sec. 9.5, figure 9.15.) The pictures show a glass ball,
sampled both ways with equally many paths; the plot shows the measured variance on the closed form.
`fresnel_jax.bsdf.Dielectric.sample` splits by Fresnel. (Where the rare direction looks at
something bright, as where the ball mirrors the window, that noise remains.)
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from _glass_ball import ball
from _picture import BLUE, GREY, ORANGE, arguments, figure, tone

from fresnel_jax import fresnel_dielectric
from fresnel_jax.bsdf import Dielectric, Lobes, TransportMode

jax.config.update("jax_enable_x64", True)

GLASS = Dielectric(1.5)
PATHS, SAMPLES = 8, 2000


def sample(wo, u, equal: bool = False):
    """(direction, weight) of one path that leaves along wo, split equally or by Fresnel."""
    mode, any_facet = TransportMode.IMPORTANCE, jnp.zeros((*jnp.shape(u), 2))
    if not equal:
        taken = GLASS.sample(wo, u, any_facet, mode=mode)
        return taken.direction, taken.weight
    # FitOptions for one lobe alone, `sample` gives it the weight R or T.
    mirrored = GLASS.sample(wo, u, any_facet, Lobes.REFLECTION, mode)
    bent = GLASS.sample(wo, u, any_facet, Lobes.TRANSMISSION, mode)
    mirror = u < 0.5
    direction = jnp.where(mirror[..., None], mirrored.direction, bent.direction)
    return direction, 2.0 * jnp.where(mirror, mirrored.weight, bent.weight)


@partial(jax.jit, static_argnames="equal")
def variance(cos_theta, key, equal: bool):
    """Variance of the weight (radiance 1 all around) over seeded paths, by the side and angle."""
    sine = jnp.sqrt(1.0 - cos_theta**2)
    wo = jnp.stack([sine, jnp.zeros_like(sine), cos_theta], axis=-1)
    # One number in each of as many equal parts of [0, 1): the estimate has next to no noise.
    u = (jnp.arange(SAMPLES) + jax.random.uniform(key, (len(cos_theta), SAMPLES))) / SAMPLES
    _, weight = sample(jnp.broadcast_to(wo[:, None], (*u.shape, 3)), u, equal)
    return jnp.var(weight, axis=1)


def draw(path, size: int, angles, measured) -> None:
    """Both balls, and the variance over the angle from either side."""
    with figure(path, 13.0, 4.6) as fig:
        equal, split, plot = fig.subplots(1, 3, width_ratios=(1.0, 1.0, 1.35))
        for axes, sampler, title in (
            (equal, partial(sample, equal=True), "equal split"),
            (split, sample, "Fresnel split"),
        ):
            picture = tone(ball(sampler, jax.random.key(3), size, PATHS))
            axes.imshow(picture, interpolation="nearest")
            axes.set_title(f"{title}, {PATHS} paths a pixel")
            axes.axis("off")
        for sign, color, side in ((1.0, BLUE, "air to glass"), (-1.0, ORANGE, "glass to air")):
            fine = np.linspace(0.0, 90.0, 721)
            R = fresnel_dielectric(sign * np.cos(np.deg2rad(fine)), GLASS.eta)
            plot.plot(fine, (1.0 - 2.0 * R) ** 2, color=color, label=rf"{side}: $(1 - 2R)^2$")
            plot.plot(angles, measured[sign, True], "o", color=color, markersize=5, clip_on=False)
            plot.plot(angles, measured[sign, False], "s", color=color, markersize=4, clip_on=False)
        plot.plot([], [], "o", color=GREY, label="equal split, measured")
        plot.plot([], [], "s", color=GREY, label="Fresnel split, measured: 0")
        plot.set(xlabel="angle of incidence (degrees)", ylabel="variance of the weight")
        plot.set(xlim=(0, 90), ylim=(-0.04, 1.04))
        plot.legend(loc="lower left", bbox_to_anchor=(-0.02, 1.0), ncols=2)


def main(argv=None) -> dict[str, float]:
    """Draws the picture, prints and returns the numbers."""
    picture, size = arguments(__doc__, "lobe_choice.png", 360, "pixels across a ball", argv)
    angles = np.linspace(0.0, 89.0, 23)
    measured, worst = {}, 0.0
    for sign in (1.0, -1.0):
        cosine = sign * jnp.cos(jnp.deg2rad(angles))
        for equal in (True, False):
            measured[sign, equal] = np.asarray(variance(cosine, jax.random.key(1), equal))
        closed = (1.0 - 2.0 * fresnel_dielectric(cosine, GLASS.eta)) ** 2
        worst = max(worst, float(np.max(np.abs(measured[sign, True] - closed))))
    draw(picture, size, angles, measured)
    results = {
        "equal_split": float(measured[1.0, True][0]),
        "off_closed_form": worst,
        "fresnel_split": float(max(measured[1.0, False].max(), measured[-1.0, False].max())),
    }
    print("variance at normal incidence: equal split {equal_split:.6f}".format(**results))
    print(
        "all angles, both sides: equal split within {off_closed_form:.1e} of (1 - 2R)^2, "
        "Fresnel split at most {fresnel_split:.1e}".format(**results)
    )
    return results


if __name__ == "__main__":
    main()
