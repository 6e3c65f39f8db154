"""eta and k of a named material, shown for comparison in the table and in pictures."""

from __future__ import annotations

import numpy as np


def reference_index(name: str, wavelength_um: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return wavelengths, eta and k of a named material, within the range of its source.

    Raises ValueError for a name that `fresnel_jax.materials` does not have.
    """
    from fitting.process.compiled import fit_settings
    from fresnel_jax.dispersion import material

    found = material(name)
    low, high = found.range_um or (0.0, np.inf)
    inside = wavelength_um[(wavelength_um >= low) & (wavelength_um <= high)]
    with fit_settings():
        eta, k = (np.asarray(a) for a in found(inside)) if len(inside) else (inside, inside)
    return inside, eta, k


def check_reference(name: str, wavelength_um: np.ndarray, asked: str = "reference") -> None:
    """Raise ValueError for an unknown material, or if no wavelength of the data is known.

    asked: the argument or the option that named the material, for the text.
    """
    from fresnel_jax.dispersion import material

    try:
        material(name)
    except ValueError as error:
        raise ValueError(f"{asked} {name}: {error}, and so does fresnel-fit --materials.") from None
    if not np.isfinite(wavelength_um).any():
        raise ValueError(
            f"{asked} {name}: its index depends on the wavelength, which the data do not state; "
            "give it when the file is read (wavelength_um, --wavelength-um)."
        )


def reference_text(name: str, wavelength_um: np.ndarray) -> str:
    """Return eta and k of a material at the ends and in the middle of the measured wavelengths."""
    known = np.unique(wavelength_um[np.isfinite(wavelength_um)])
    inside, eta, k = reference_index(name, known)
    if not len(inside):
        return f"{name}: its source has no data at the measured wavelengths"
    some = sorted({0, len(inside) // 2, len(inside) - 1})
    parts = [f"at {inside[i]:.4g} um eta {eta[i]:.4g}, k {k[i]:.4g}" for i in some]
    return f"{name}: {'; '.join(parts)}"
