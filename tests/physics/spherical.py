"""Directions by cosine and azimuth."""

import numpy as np


def direction(z, phi):
    z, phi = np.broadcast_arrays(z, phi)
    r = np.sqrt((1.0 - z) * (1.0 + z))
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1)
