"""Coatings by design: gradients find the thicknesses, and say how exact they must be.

Three searches, each from many random starts at once (`jax.vmap` of optimistix): four layers on
glass that reflect next to nothing; twenty layers that return a short pulse as short as it came; two
films on silicon of a wanted blue. The errors that a coating may have follow from the Hessian of its
mean reflectance. The page docs/tutorials/design.md does the same step by step, with optax too.
"""

import jax
import jax.numpy as jnp
import numpy as np
import optimistix
from _picture import BLUE, GREY, ORANGE, arguments, figure

from fresnel_jax.colour import lab, linear_srgb, srgb_encode, xyz
from fresnel_jax.dispersion import material
from fresnel_jax.layers import stack

jax.config.update("jax_enable_x64", True)

VISIBLE = np.linspace(0.38, 0.78, 81)
BAND = (VISIBLE > 0.419) & (VISIBLE < 0.681)
GLASS = [material(n)(VISIBLE) for n in ("vacuum", "MgF2", "HfO2", "MgF2", "HfO2", "BK7")]
WAFER = [material(n)(VISIBLE) for n in ("vacuum", "fused silica", "Si3N4", "silicon")]
TARGET = np.array([40.0, 10.0, -45.0])  # L*, a*, b* of a blue
MIRROR, PULSE_UM, C_UM_FS = [1.0] + [2.2, 1.45] * 10 + [1.5], (0.75, 0.85), 0.299792458
OMEGA = 2.0 * np.pi * C_UM_FS / np.linspace(*PULSE_UM, 21)  # rad / fs
QUARTER_UM = 0.8 / 4.0 / np.array(MIRROR[1:-1])


def reflected(thickness_um, media):
    """R over the visible wavelengths, at normal incidence."""
    return stack(1.0, media, thickness_um=thickness_um, wavelength_um=VISIBLE, exact=False).R


def mean_R(thickness_um):
    """The mean R of coated glass from 0.42 to 0.68 um."""
    return reflected(thickness_um, GLASS)[BAND].mean()


def difference(thickness_um):
    """The colour of two films on silicon less the wanted one, in L*, a*, b*."""
    return lab(xyz(reflected(thickness_um, WAFER), VISIBLE)) - TARGET


def _amplitude(omega, thickness_um):
    um = 2.0 * jnp.pi * C_UM_FS / omega
    return stack(1.0, MIRROR, thickness_um=thickness_um, wavelength_um=um, exact=False).r_s


@jax.jit
def pulse(thickness_um):
    """R and the group delay dispersion d^2 phase / d omega^2 in fs^2 of the mirror, (21,) each."""
    each = jax.vmap(jax.grad(jax.grad(lambda w: jnp.angle(_amplitude(w, thickness_um)))))
    amplitude = jax.vmap(_amplitude, (0, None))(OMEGA, thickness_um)
    return jnp.abs(amplitude) ** 2, each(OMEGA)


def search(residuals, thickness_um, starts, rtol: float = 1e-8):
    """Thicknesses from every start, the lowest sum of squares first, and those sums."""
    solver = optimistix.LevenbergMarquardt(rtol=rtol, atol=rtol)

    def one(start):
        def f(x, _):
            return residuals(thickness_um(x))

        x = optimistix.least_squares(f, solver, start, max_steps=200, throw=False).value
        return thickness_um(x), jnp.sum(f(x, None) ** 2)

    found, squares = jax.jit(jax.vmap(one))(starts)
    order = jnp.argsort(squares)
    return found[order], squares[order]


def draw(path, coatings, sigma, mirror, films, size: int) -> None:
    """R of the coatings, GDD of the mirror, colours of the films."""
    nm = 1e3 * VISIBLE
    with figure(path, 13.0, 4.6) as fig:
        coated, delay, colour = fig.subplots(1, 3)
        for d in coatings[1:]:
            coated.plot(nm, 100 * reflected(d, GLASS), color=GREY, linewidth=0.5, alpha=0.35)
        off = sigma * jax.random.normal(jax.random.key(1), (200, 4))
        drawn = 100 * jax.vmap(lambda e: reflected(coatings[0] + e, GLASS))(off)
        coated.fill_between(nm, drawn.min(0), drawn.max(0), color=BLUE, alpha=0.3, linewidth=0)
        coated.plot(nm, 100 * reflected(coatings[0], GLASS), color=BLUE, label="best of 64")
        coated.plot(nm, 100 * reflected(0.0 * coatings[0], GLASS), color=ORANGE, label="bare glass")
        coated.set(title="four layers on glass", xlabel="wavelength (nm)", ylabel="R (%)")
        coated.set(ylim=(0, 6), xlim=(400, 700))
        coated.legend(loc="upper right")
        for d, color, name in ((QUARTER_UM, ORANGE, "quarter waves"), (mirror, BLUE, "designed")):
            delay.plot(2e3 * np.pi * C_UM_FS / OMEGA, pulse(d)[1], color=color, label=name)
        delay.set(title="twenty layers, a short pulse", xlabel="wavelength (nm)")
        delay.set(ylabel=r"group delay dispersion (fs$^2$)")
        delay.legend()
        oxide, nitride = np.meshgrid(*(np.linspace(0.0, 0.3, size),) * 2)
        R = jax.jit(jax.vmap(lambda d: reflected(d, WAFER)))(
            np.stack([oxide, nitride], -1).reshape(-1, 2)
        )
        rgb = srgb_encode(linear_srgb(xyz(R, VISIBLE))).reshape(size, size, 3)
        colour.imshow(np.clip(rgb, 0, 1), origin="lower", extent=(0, 300, 0, 300), aspect="auto")
        colour.plot(*(1e3 * films), "o", color="white", markerfacecolor="none", markersize=11)
        colour.grid(False)
        colour.set(
            title="oxide over nitride on silicon", xlabel="oxide (nm)", ylabel="nitride (nm)"
        )


def main(argv=None) -> dict[str, float]:
    """Draws the picture, prints and returns the numbers."""
    picture, size = arguments(__doc__, "design.png", 120, "thicknesses along an axis", argv)
    key = jax.random.key(0)

    def up_to(most):
        return lambda x: most * jax.nn.sigmoid(x)

    starts = jax.random.normal(key, (64, 4))
    coatings, _ = search(lambda d: reflected(d, GLASS)[BAND], up_to(0.2), starts)
    sigma = 0.01 * coatings[0]
    hessian = jax.jit(jax.hessian(mean_R))(coatings[0])
    rise = 0.5 * jnp.sum(jnp.diagonal(hessian) * sigma**2)

    def misfit(d):  # 1 fs^2 counts as 1 % of R
        R, dispersion = pulse(d)
        return jnp.concatenate([dispersion, (1.0 - R) / 0.01])

    starts = 0.3 * jax.random.normal(key, (24, 20))
    mirrors, _ = search(misfit, lambda x: QUARTER_UM * jnp.exp(x), starts, rtol=1e-6)
    films, squares = search(difference, up_to(0.3), jax.random.normal(key, (64, 2)))
    draw(picture, coatings, sigma, mirrors[0], films[0], size)
    R, dispersion = pulse(mirrors[0])
    results = {
        "bare": float(mean_R(0.0 * sigma)), "coated": float(mean_R(coatings[0])),
        "rise": float(rise), "thickness_um": tuple(map(float, coatings[0])),
        "dispersion_fs2": float(jnp.abs(dispersion).max()), "mirror_R": float(R.min()),
        "delta_e": float(squares[0] ** 0.5),
    }  # fmt: skip
    print(
        "mean R {bare:.4f} bare, {coated:.4f} coated, {rise:.1e} more by 1 % errors".format(
            **results
        )
    )
    print(
        "mirror: GDD within {dispersion_fs2:.1f} fs^2, R at least {mirror_R:.3f}".format(**results)
    )
    print("blue: Delta E {delta_e:.1f}".format(**results))
    return results


if __name__ == "__main__":
    main()
