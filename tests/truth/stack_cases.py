"""Stacks at which programs for stacks fail, as functions of one quantity.

Each family is {label: (name of the quantity, its values, case)}; case(value) is cos_theta_i, the
indices, the thicknesses in micrometres and the wavelength. The map of the peers' failures
(`make stability`) draws them, and tests/physics/test_stack_failures.py holds `stack` to every one.
"""

import numpy as np


def _silver(thickness):
    return 0.5, [1.0, 0.055 + 3.32j, 1.52], [thickness], 0.5


def _infrared_metal(thickness):
    return 0.7, [1.0, 30.0 + 110.0j, 1.0], [thickness], 10.0


def _gap(thickness):
    return 0.5, [1.52, 1.0, 1.52], [thickness], 0.6


def _close_to_critical(offset):
    sine = (1.0 / 1.52) * (1.0 + offset)
    return float(np.sqrt(1.0 - sine**2)), [1.52, 1.38, 1.0], [0.1], 0.6


def _plate(thickness):
    return 0.8, [1.0, 1.52, 1.33], [thickness], 0.6


def _mirror(pairs):
    n = int(pairs)
    return 0.9, [1.0, *([2.35, 1.46] * n), 1.52], [0.06, 0.1] * n, 0.55


def _x_rays(grazing):
    return grazing, [1.0, 1.0 - 7.4e-6 + 1.7e-7j, 1.0 - 1.2e-5 + 1.2e-6j], [0.03], 1.54e-4


FAMILIES = {
    "silver film": ("thickness, um", np.geomspace(0.01, 1e6, 17), _silver),
    "metal in the infrared": ("thickness, um", np.geomspace(1e-3, 1e5, 17), _infrared_metal),
    "frustrated total reflection": ("gap, um", np.geomspace(0.01, 1e5, 15), _gap),
    "film next to the critical angle": (
        "relative distance of the sine",
        np.geomspace(1e-15, 1e-3, 13),
        _close_to_critical,
    ),
    "lossless plate": ("thickness, um", np.geomspace(0.1, 1e8, 19), _plate),
    "dielectric mirror": ("pairs of layers", np.array([1, 3, 10, 30, 100, 300]), _mirror),
    "film in X-rays": ("cosine of the angle", np.geomspace(1e-6, 0.1, 11), _x_rays),
}


def error_eps(found, exact) -> float:
    """The largest error of R_s, R_p, T_s, T_p in eps (2.2e-16) of each.

    An R below 1e-2 counts relative to its root, since contributions cancel in it; a value that is
    exactly 0 counts relative to 1, and below 1e-30 relative to that.
    """
    worst = 0.0
    for i, (value, truth) in enumerate(zip(found, exact, strict=True)):
        truth = float(truth)
        if not np.isfinite(value):
            return np.inf
        size = np.sqrt(truth) if i < 2 and truth < 1e-2 else truth
        size = 1.0 if truth == 0.0 else max(size, 1e-30)
        worst = max(worst, abs(float(value) - truth) / size)
    return worst / float(np.finfo(float).eps)
