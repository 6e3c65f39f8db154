"""Rough gold in a path tracer: float32, wavelengths to RGB, gradients to roughness and index.

Each path carries one wavelength. At the surface `fresnel_jax.bsdf.conductor` gives it a direction
and a weight; it brings home weight * light(direction), and the picture is the mean over the paths
with the colour of their wavelengths. All of it is one function of the roughness alpha and of the
index eta + ik, and `jax.jvp` differentiates it: the direction moves with alpha, the weight with eta
and k.

`main` renders a ball of gold and fits it again: from a ball that is too rough, of a metal with too
large an eta and too small a k, Gauss-Newton steps find alpha, and by how much eta and k differ from
gold's at all wavelengths. The target has other random numbers than the pictures that are fitted to
it, as a photograph would.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from _glass_ball import studio
from _picture import VISIBLE_UM, arguments, figure, spectral_rgb

from fresnel_jax.bsdf import TrowbridgeReitz, conductor
from fresnel_jax.colour import srgb_encode
from fresnel_jax.directions import local_frame, to_local, to_world
from fresnel_jax.dispersion import material

PATHS, STEPS = 64, 8
TRUE = (np.log(0.15), 0.0, 0.0)  # log alpha; what is added to gold's eta and k
START = (np.log(0.4), 0.3, -0.8)


def light(direction):
    """Radiance of white light around the ball, the mean colour of a studio, shape (...)."""
    return jnp.mean(studio(direction), axis=-1)


def ball(size: int):
    """(normals of a unit ball seen along +y from afar, (size, size, 3); where the ball is)."""
    axis = 1.05 * (2.0 * (jnp.arange(size) + 0.5) / size - 1.0)
    x, z = jnp.meshgrid(axis, -axis)
    r2 = x * x + z * z
    inside = r2 < 0.999
    y = -jnp.sqrt(jnp.where(inside, 1.0 - r2, 1.0))
    normal = jnp.stack([x, y, z], axis=-1)
    return jnp.where(inside[..., None], normal, jnp.array([0.0, -1.0, 0.0])), inside


@partial(jax.jit, static_argnames="size")
def render(p, key, size: int):
    """Linear sRGB of the ball, (size, size, 3), for p = (log alpha, added to eta, added to k).

    float32 where jax_enable_x64 is off: a sum of some thousand weights needs no more.
    """
    normal, inside = ball(size)
    frame = local_frame(normal)
    toward_eye = jnp.broadcast_to(jnp.array([0.0, -1.0, 0.0]), normal.shape)
    wo = to_local(toward_eye, frame)
    low, high = VISIBLE_UM

    def path(i, key):
        shift, u_lobe, u1, u2 = jax.random.uniform(key, (4, size, size))
        # One wavelength in each of as many equal parts of the visible range
        wavelength = low + (high - low) * (i + shift) / PATHS
        eta, k = material("gold")(wavelength)
        gold = conductor(eta + p[1], k + p[2], TrowbridgeReitz(jnp.exp(p[0])))
        found = gold.sample(wo, u_lobe, jnp.stack([u1, u2], axis=-1))
        radiance = found.weight * light(to_world(found.direction, frame))
        return radiance[..., None] * spectral_rgb(wavelength)

    def add(total, numbered):
        return total + path(*numbered), None

    keys = jax.random.split(key, PATHS)
    total, _ = jax.lax.scan(add, jnp.zeros_like(normal), (jnp.arange(PATHS), keys))
    return jnp.where(inside[..., None], total / PATHS, 0.0)


@partial(jax.jit, static_argnames="size")
def with_jacobian(p, key, size: int):
    """(picture as (pixels,), its derivatives with respect to p as (pixels, 3))."""

    def flat(p):
        return render(p, key, size).ravel()

    return flat(p), jax.jacfwd(flat)(p)


def recover(target, keys, p):
    """(p, its standard errors) of Gauss-Newton steps, from two pictures with independent noise.

    The sum of squares of one noisy picture's residuals is least where the picture is least noisy,
    not where it is right: with 64 paths that took 5 % off alpha, 15 of its errors. So residuals
    come from one picture and their weights, the derivatives, from another:

        step = -(J_1^T J_2)^-1 J_1^T (picture_2 - target).
    """
    size = target.shape[0]
    for _ in range(STEPS):
        _, J_1 = with_jacobian(p, keys[0], size)
        picture_2, J_2 = with_jacobian(p, keys[1], size)
        residual = picture_2 - target.ravel()
        p = p - jnp.linalg.solve(J_1.T @ J_2, J_1.T @ residual)
    # The errors contain the noise of J_1, which is not small: sum over J_1 r J_1^T r.
    inverse = jnp.linalg.inv(J_1.T @ J_2)
    covariance = inverse @ (J_1.T * residual**2) @ J_1 @ inverse.T
    return p, jnp.sqrt(jnp.diagonal(covariance))


def draw(path, start, found, target, derivatives) -> None:
    """The ball at the start, as found and as it is; the three derivatives of the true one."""
    with figure(path, 13.0, 7.6) as fig:
        axes = fig.subplots(2, 3)
        for axis, image, title in zip(
            axes[0], (start, found, target), ("start", "found", "target"), strict=True
        ):
            axis.imshow(np.clip(srgb_encode(image), 0.0, 1.0), interpolation="nearest")
            axis.set_title(title)
        for axis, image, name in zip(
            axes[1],
            np.moveaxis(derivatives, -1, 0),
            (r"$\log\alpha$", r"$\eta$", "$k$"),
            strict=True,
        ):
            shown = image.mean(axis=-1)
            limit = np.quantile(np.abs(shown), 0.99)
            drawn = axis.imshow(shown, cmap="RdBu_r", vmin=-limit, vmax=limit)
            axis.set_title(f"derivative with respect to {name}")
            fig.colorbar(drawn, ax=axis, shrink=0.85)
        for axis in axes.flat:
            axis.axis("off")


def main(argv=None) -> dict[str, float]:
    """Draws the picture, prints and returns the numbers."""
    picture, size = arguments(__doc__, "rough_gold.png", 160, "pixels across the ball", argv)
    true, start = jnp.array(TRUE), jnp.array(START)
    seen, *own = jax.random.split(jax.random.key(4), 3)
    target = render(true, seen, size)
    found, sigma = recover(target, own, start)
    _, derivatives = with_jacobian(true, own[0], size)
    shown = np.asarray(derivatives).reshape(size, size, 3, 3)
    draw(picture, render(start, own[0], size), render(found, own[0], size), target, shown)
    print(f"{target.dtype}, {size**2 * PATHS / 1e6:.1f} million paths a picture")
    for name, true_value, value, error in zip(
        ("log alpha", "eta - gold's", "k - gold's"), TRUE, found, sigma, strict=True
    ):
        print(f"{name:13} true {true_value:6.3f}, found {value:7.3f} +- {error:.3f}")
    return {
        "log_alpha": float(found[0]), "eta": float(found[1]), "k": float(found[2]),
        "sigma": tuple(map(float, sigma)),
    }  # fmt: skip


if __name__ == "__main__":
    main()
