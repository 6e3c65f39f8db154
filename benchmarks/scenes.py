"""The classes of scene: seeded points (cos, eta, k) at which methods are compared.

Light comes from vacuum in every class, so that all contestants get what they can take; eta is
relative, and below 1 where total reflection is wanted. The points are exact in the given dtype.
"""

import numpy as np

CLASSES = ("dielectric", "metal", "near-critical", "grazing", "index-matched", "X-ray")
# Which have k = 0 throughout: contestants for lossless media take part in these only.
LOSSLESS = ("dielectric", "near-critical", "index-matched")


def points(scene: str, dtype, size: int = 240) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """cos, eta, k of one class; the same ones at every call."""
    random = np.random.default_rng([20261121, CLASSES.index(scene)])
    eps = np.finfo(dtype).eps
    half_digits = np.log10(eps) / 2

    def uniform(low, high):
        return random.uniform(low, high, size)

    def decades(low, high):
        return 10.0 ** random.uniform(low, high, size)

    def rounded(x):
        return np.asarray(x, dtype).astype(float)

    zero = np.zeros(size)
    if scene == "dielectric":
        values = uniform(0, 1), uniform(1.3, 2.5), zero
    elif scene == "metal":
        values = uniform(0, 1), decades(-1.3, 0.6), uniform(2, 7)
    elif scene == "near-critical":
        eta = rounded(uniform(0.4, 0.95))
        critical = np.sqrt((1 - eta) * (1 + eta))
        sides = random.choice([-1, 1], size)
        values = np.clip(critical * (1 + sides * decades(2 * half_digits, -1)), 0, 1), eta, zero
    elif scene == "grazing":
        absorbing = random.random(size) < 0.5
        values = (
            decades(half_digits, -1.5),
            uniform(1.1, 4),
            np.where(absorbing, uniform(0.1, 7), 0),
        )
    elif scene == "index-matched":
        sides = random.choice([-1, 1], size)
        values = uniform(0, 1), 1 + sides * decades(half_digits, -3), zero
    else:
        delta = decades(-6, -4)
        near_edge = np.sqrt(2 * delta) * decades(-1, 1)
        values = np.minimum(near_edge, 1), 1 - delta, delta * decades(-3, -1)
    return tuple(np.asarray(x, dtype) for x in values)


def timed(lossless: bool, dtype, size: int) -> tuple[np.ndarray, ...]:
    """(cos, eta) or (cos, eta, k) for timing; ordinary values, any number of them."""
    random = np.random.default_rng(20261122)
    cosine, eta, k = (random.uniform(*x, size) for x in ((0.01, 1), (1.1, 4), (0.1, 5)))
    values = (cosine, eta) if lossless else (cosine, eta, k)
    return tuple(np.asarray(x, dtype) for x in values)


# The one material of contestants that take one material and many angles.
ONE_MATERIAL = (1.5, 3.0)
