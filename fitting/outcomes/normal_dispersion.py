"""Whether an index without absorption rises with the wavelength, as that of no material does.

Source: the Kramers-Kronig relations; L. D. Landau and E. M. Lifshitz, Electrodynamics of Continuous
Media, sec. 84: where nothing is absorbed, the permittivity rises with the frequency.
"""

from __future__ import annotations

import numpy as np

from fitting.optics.averages import values_at
from fitting.problem.unknowns import Unknowns
from fitting.samples.dispersion import CAUCHY_NAMES, Model
from fitting.searching.search import End

# The rise of eta with the logarithm of the wavelength from which on it is told, if it is more than
# so many standard errors.
_LEAST, _ERRORS = 1e-3, 3.0


def rising_indices(u: Unknowns, end: End, wavelength_um: np.ndarray) -> tuple[str, ...]:
    """Return which eta rise with the wavelength somewhere in the data, as parameters are named."""
    values = values_at(u.spec, u.held, end.y)
    covariance = np.nan_to_num(end.known.covariance)
    out = []
    for place, model in zip(u.spec.media.places, u.spec.media.index, strict=True):
        if not isinstance(model, Model) or model.name != "cauchy":
            continue
        rise, slopes = np.zeros(len(wavelength_um)), np.zeros((len(wavelength_um), len(end.y)))
        for j, letter in enumerate(CAUCHY_NAMES[: model.terms]):
            name, by = f"{place}.{letter}", -2 * j * wavelength_um ** (-2.0 * j)
            rise += by * values[name]
            if name in u.spec.moving:
                slopes[:, u.spec.moving.index(name)] = by
        sigma = np.sqrt(np.maximum(np.einsum("wi,ij,wj->w", slopes, covariance, slopes), 0.0))
        if (rise > np.maximum(_ERRORS * sigma, _LEAST)).any():
            out.append(f"{u.labels[f'{place}.A'].removesuffix('A')}eta")
    return tuple(out)
