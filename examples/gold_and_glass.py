"""Gold and glass: how much light they reflect, by angle and wavelength, and in which colour.

Glass (N-BK7, Sellmeier's formula) has nearly the same index for all visible light: it reflects 4 %
of every colour head on and everything at grazing incidence. The index eta + ik of gold (Johnson and
Christy 1972) changes in the green, where its electrons begin to absorb: it reflects red light
almost wholly and blue light by less than half,

    R = ((eta - 1)^2 + k^2) / ((eta + 1)^2 + k^2)        at normal incidence.

That is the colour of gold. Towards grazing incidence it fades to white, as on any surface. The
strips show the colour of reflected daylight, computed over the visible wavelengths.
"""

import jax
import jax.numpy as jnp
import numpy as np
from _picture import BLUE, GREY, ORANGE, arguments, figure

from fresnel_jax import reflectance
from fresnel_jax.colour import linear_srgb, srgb_encode, xyz
from fresnel_jax.dispersion import material

jax.config.update("jax_enable_x64", True)

GOLD, GLASS = material("gold"), material("BK7")
RANGE_UM = (0.3, 1.0)
# Contours, and where their labels find room.
GOLD_LABELS = {0.4: (30, 0.375), 0.6: (30, 0.515), 0.8: (30, 0.553), 0.95: (30, 0.64)}
GLASS_LABELS = {0.05: (43, 0.65), 0.1: (61, 0.65), 0.2: (72, 0.65), 0.6: (84, 0.65)}


def reflectance_map(matter, angle_deg, wavelength_um):
    """Unpolarized R, shape (wavelengths, angles)."""
    eta, k = matter(wavelength_um[:, None])
    return reflectance(jnp.cos(jnp.deg2rad(angle_deg)), eta, k)


def reflected_rgb(matter, angle_deg):
    """Linear sRGB of daylight after one reflection, shape (angles, 3); white is (1, 1, 1)."""
    wavelength = np.linspace(0.38, 0.78, 81)
    return linear_srgb(xyz(reflectance_map(matter, angle_deg, wavelength).T, wavelength))


def draw(path, size: int) -> None:
    """The indices; R over angle and wavelength; the colours over the angle."""
    wavelength, angle = np.linspace(*RANGE_UM, size), np.linspace(0.0, 90.0, size)
    with figure(path, 12.6, 5.4) as fig:
        grid = fig.add_gridspec(2, 3, width_ratios=(0.8, 1.0, 1.0), height_ratios=(1.0, 0.09))
        index = fig.add_subplot(grid[:, 0])
        curves = ((GOLD, 0, ORANGE, r"gold, $\eta$"), (GOLD, 1, BLUE, r"gold, $k$"),
                  (GLASS, 0, GREY, r"glass, $\eta$"))  # fmt: skip
        for matter, part, color, label in curves:
            values = np.broadcast_to(matter(wavelength)[part], wavelength.shape)
            index.plot(wavelength, values, color=color)
            index.annotate(
                label, (wavelength[-1], values[-1]), (-4, 5), textcoords="offset points",
                ha="right", color=color, fontsize=12,
            )  # fmt: skip
        index.set(xlabel=r"wavelength ($\mathrm{\mu}$m)", xlim=RANGE_UM, ylim=(0.0, None))
        index.set_title("index of refraction")

        maps = []
        for column, (matter, name, labels) in enumerate(
            ((GOLD, "gold", GOLD_LABELS), (GLASS, "glass", GLASS_LABELS)), start=1
        ):
            R = np.asarray(reflectance_map(matter, angle, wavelength))
            plot, strip = (fig.add_subplot(grid[row, column]) for row in (0, 1))
            plot.grid(False)
            strip.grid(False)
            maps.append(plot)
            image = plot.imshow(
                R, extent=(0.0, 90.0, *RANGE_UM), origin="lower", aspect="auto", cmap="magma",
                vmin=0.0, vmax=1.0,
            )  # fmt: skip
            lines = plot.contour(
                angle,
                wavelength,
                R,
                list(labels),
                linewidths=1.0,
                colors=["white" if at < 0.7 else "black" for at in labels],
            )
            plot.clabel(lines, fontsize=9, manual=list(labels.values()))
            plot.set(title=f"reflectance of {name}", xticks=[])
            strip.imshow(
                np.clip(srgb_encode(reflected_rgb(matter, angle)), 0.0, 1.0)[None], aspect="auto",
                extent=(0.0, 90.0, 0.0, 1.0),
            )  # fmt: skip
            strip.set(xlabel="angle of incidence (degrees)", yticks=[], xticks=range(0, 91, 15))
            strip.set_title("colour of reflected white light", fontsize=10.5)
        maps[0].set_ylabel(r"wavelength ($\mathrm{\mu}$m)")
        fig.colorbar(image, ax=maps, pad=0.01, label="R, unpolarized")


def main(argv=None) -> dict[str, float]:
    """Draws the picture, prints and returns the numbers."""
    picture, size = arguments(__doc__, "gold_and_glass.png", 400, "points along an axis", argv)
    draw(picture, size)
    at = jnp.array([0.45, 0.5876, 0.65])
    gold, glass = (reflectance_map(matter, jnp.zeros(1), at)[:, 0] for matter in (GOLD, GLASS))
    results = {
        "gold_blue": float(gold[0]),
        "gold_red": float(gold[2]),
        "glass_yellow": float(glass[1]),
        "gold_rgb": tuple(map(float, reflected_rgb(GOLD, jnp.zeros(1))[0])),
        "grazing_rgb": tuple(map(float, reflected_rgb(GOLD, jnp.full(1, 90.0))[0])),
    }
    print(
        "at normal incidence gold reflects {gold_blue:.4f} at 0.45 um and {gold_red:.4f} at "
        "0.65 um, glass {glass_yellow:.6f} at 0.5876 um".format(**results)
    )
    print("colour of gold, linear sRGB:", *(f"{value:.3f}" for value in results["gold_rgb"]))
    return results


if __name__ == "__main__":
    main()
