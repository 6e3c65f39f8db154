"""Where light is in a stack of films: the field in a cavity, and what absorbs in front of a mirror.

A layer half a wave thick between two mirrors of quarter-wave layers, (HL)^N 2H (LH)^N in air, lets
its own wavelength through as if nothing were there. At every quarter-wave layer the field turns
from E to H and back; from the exit, where |E| = 1, each pair raises it by n_H / n_L, so that at the
faces of the middle layer

    |E|^2 = (n_H / n_L)^(2 N)        times that of the light that comes in.

The second picture has 300 nm of silicon on silver. The area under each curve is the absorptance:
what is neither in the silicon nor in the silver comes back.
"""

import jax
import numpy as np
from _picture import BLUE, GREEN, GREY, ORANGE, arguments, figure

from fresnel_jax.dispersion import material
from fresnel_jax.layers import fields_at_depth, stack

jax.config.update("jax_enable_x64", True)

HIGH, LOW, PAIRS, MIDDLE_UM = 2.3, 1.46, 5, 0.55
MIRROR = [HIGH, LOW] * PAIRS
LAYERS = [*MIRROR, HIGH, *reversed(MIRROR)]
THICKNESS_UM = [MIDDLE_UM / 4 / n for n in LAYERS]
THICKNESS_UM[len(MIRROR)] *= 2.0  # the middle one
SILICON_UM, COLORS = 0.3, {0.45: BLUE, 0.55: GREEN, 0.65: ORANGE}


def intensity(wavelength_um, depth_um):
    """|E|^2 at normal incidence over that of the incident light, (wavelengths, depths)."""
    field = fields_at_depth(
        1.0, [1.0, *LAYERS, 1.0], thickness_um=THICKNESS_UM,
        wavelength_um=wavelength_um[:, None], depth_um=depth_um,
    ).E_y  # fmt: skip
    return np.abs(field) ** 2


def silicon_on_silver(wavelength_um):
    """The media of the second picture, and the light they reflect and absorb."""
    media = [1.0, material("silicon")(wavelength_um), material("silver")(wavelength_um)]
    of_light = {"thickness_um": [SILICON_UM], "wavelength_um": wavelength_um}
    return media, of_light, stack(1.0, media, **of_light)


def draw(path, size: int) -> None:
    """The field over depth and wavelength with T beside it; absorbed power over depth."""
    wavelength, total = np.linspace(0.42, 0.75, size), sum(THICKNESS_UM)
    depth = np.linspace(-0.4, total + 0.3, 2 * size)
    with figure(path, 13.0, 5.0) as fig:
        field, passed, absorbed = fig.subplots(1, 3, width_ratios=(1.5, 0.4, 1.0))
        image = field.imshow(
            np.log10(intensity(wavelength, depth)), origin="lower", aspect="auto", cmap="inferno",
            vmin=-2.0, extent=(depth[0], depth[-1], 1e3 * wavelength[0], 1e3 * wavelength[-1]),
        )  # fmt: skip
        faces = np.concatenate([[0.0], np.cumsum(THICKNESS_UM)])
        field.vlines(faces, 1e3 * wavelength[0], 1e3 * wavelength[-1], color="white", linewidth=0.3)
        field.grid(False)
        field.set(title="cavity: intensity of the field", ylabel="wavelength (nm)")
        field.set_xlabel(r"depth ($\mathrm{\mu}$m)")
        fig.colorbar(image, ax=field, label=r"$\log_{10}|E|^2$", pad=0.01)
        media = [1.0, *LAYERS, 1.0]
        fine = np.sort(np.append(np.linspace(0.42, 0.75, 1500), MIDDLE_UM))
        T = stack(1.0, media, thickness_um=THICKNESS_UM, wavelength_um=fine, exact=False).T
        passed.plot(T, 1e3 * fine, color=GREY)
        passed.set(title="T", xlim=(0, 1.02), ylim=(420, 750), xticks=(0, 1), yticklabels=[])
        into = np.linspace(0.0, SILICON_UM + 0.06, 4 * size)
        for um, color in COLORS.items():
            media, of_light, light = silicon_on_silver(um)
            found = fields_at_depth(1.0, media, depth_um=into, **of_light).absorption
            label = f"{1e3 * um:.0f} nm: silicon {float(light.A[0]):.2f}, R {float(light.R):.2f}"
            absorbed.plot(1e3 * into, found, color=color, label=label)
        absorbed.axvline(1e3 * SILICON_UM, color=GREY, linewidth=0.8)
        absorbed.annotate("silver", (1e3 * SILICON_UM + 4, 0.3), fontsize=10)
        absorbed.set(title="silicon on silver: absorbed power", xlabel="depth (nm)", yscale="log")
        absorbed.set(ylabel=r"absorbed share for each $\mathrm{\mu}$m", ylim=(0.03, 60.0))
        absorbed.legend(fontsize=9, loc="upper left")


def main(argv=None) -> dict[str, float]:
    """Draws the picture, prints and returns the numbers."""
    picture, size = arguments(__doc__, "fields_in_depth.png", 300, "wavelengths", argv)
    draw(picture, size)
    depth = np.linspace(0.0, sum(THICKNESS_UM), 20001)
    largest = float(intensity(np.array([MIDDLE_UM]), depth).max())
    media, of_light, light = silicon_on_silver(0.45)
    cells = 20000
    middle = (np.arange(cells) + 0.5) * SILICON_UM / cells
    inside = fields_at_depth(1.0, media, depth_um=middle, **of_light).absorption
    results = {
        "largest": largest, "closed_form": (HIGH / LOW) ** (2 * PAIRS),
        "absorbed": float(np.mean(inside) * SILICON_UM), "layer": float(light.A[0]),
    }  # fmt: skip
    print("cavity: |E|^2 up to {largest:.3f}, closed form {closed_form:.3f}".format(**results))
    print(
        "silicon at 450 nm: absorbed power summed over depth {absorbed:.6f}, "
        "absorptance of the layer {layer:.6f}".format(**results)
    )
    return results


if __name__ == "__main__":
    main()
