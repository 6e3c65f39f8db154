"""Seeded sets of (cos, eta, k, eta_i) at which published forms of the Fresnel equations fail."""

import numpy as np

SIZE = 250


def hard_sets(dtype, size: int = SIZE) -> dict[str, tuple[np.ndarray, ...]]:
    """Named sets of `size` points, exact in `dtype`; the same ones at every call."""
    random = np.random.default_rng(20261121)
    eps = np.finfo(dtype).eps
    one, zero = np.ones(size), np.zeros(size)

    def uniform(low, high):
        return random.uniform(low, high, size)

    def decades(low, high):
        return 10.0 ** random.uniform(low, high, size)

    def either(first, second):
        return np.where(random.random(size) < 0.5, first, second)

    def within_a_few_eps():
        return 1.0 + eps * random.integers(-16, 17, size) / 4.0

    def rounded(x):
        return x.astype(dtype).astype(float)

    sets = {
        "dielectric": (uniform(0, 1), uniform(1.1, 4), zero, one),
        "metal": (uniform(0, 1), decades(-1.3, 1), decades(-0.5, 1), one),
        "semiconductor": (uniform(0, 1), uniform(2, 5), decades(-3, 0.5), one),
        "grazing": (decades(-12, -1), uniform(1.01, 4), either(0, decades(-3, 1)), uniform(1, 2)),
        "normal": (
            1.0 - random.integers(0, 6, size) * eps / 2,
            uniform(0.2, 4),
            either(0, decades(-3, 1)),
            uniform(1, 4),
        ),
        "two media": (uniform(0, 1), uniform(0.3, 4), either(0, decades(-30, 1)), uniform(1, 4)),
        "X-ray": (decades(-5, 0), 1.0 - decades(-7, -4), decades(-11, -5), one),
        "tiny k": (uniform(0, 1), uniform(0.3, 3), decades(-30, -5), uniform(1, 3)),
        "huge index": (decades(-9, 0), decades(0, 8), either(0, decades(0, 8)), uniform(1, 4)),
        "epsilon near zero": (
            either(uniform(0, 1), 1.0 - decades(-13, -1)),
            decades(-6, 0),
            either(0, decades(-6, 0)),
            uniform(1, 2),
        ),
    }
    m = rounded(uniform(1, 4))
    cosines = either(uniform(0, 1), decades(-12, 0))
    sets["matched"] = (cosines, m * within_a_few_eps(), zero, m)
    sets["matched, tiny k"] = (cosines, m * within_a_few_eps(), decades(-30, -3), m)

    n, m = rounded(uniform(0.3, 0.98)), rounded(uniform(1.0, 4.0))
    n = rounded(n * m)
    critical = np.sqrt((1 - n / m) * (1 + n / m))
    sets["critical"] = (critical * within_a_few_eps(), n, zero, m)
    sets["critical, tiny k"] = (critical * within_a_few_eps(), n, decades(-30, -3), m)
    aside = critical * (1 + random.choice([-1, 1], size) * decades(-14, -1))
    sets["around critical"] = (np.clip(aside, 0, 1), n, zero, m)

    n, m = rounded(uniform(1, 4)), rounded(uniform(1, 4))
    brewster = m / np.hypot(n, m)
    sets["Brewster"] = (brewster * within_a_few_eps(), n, zero, m)
    sets["Brewster, tiny k"] = (brewster * within_a_few_eps(), n, decades(-30, -2), m)
    nearly_m = rounded(m * (1 + random.choice([-1, 1], size) * decades(-6, -2)))
    brewster = m / np.hypot(nearly_m, m)
    sets["Brewster, nearly matched"] = (
        brewster * within_a_few_eps(),
        nearly_m,
        either(0, decades(-8, -3)),
        m,
    )

    # the same from vacuum, and the other way round
    n = rounded(uniform(0.3, 0.98))
    sets["critical, from vacuum"] = (np.sqrt((1 - n) * (1 + n)) * within_a_few_eps(), n, zero, one)
    sets["matched, from vacuum"] = (cosines, within_a_few_eps(), zero, one)
    n = rounded(uniform(1, 4))
    sets["Brewster, from vacuum"] = (within_a_few_eps() / np.hypot(n, 1), n, zero, one)
    n, m = rounded(decades(1, 8)), rounded(uniform(1, 4))
    sets["Brewster, huge index"] = (
        m / np.hypot(n, m) * (1 + random.choice([-1, 1], size) * decades(-16, -1)),
        n,
        either(0, decades(-8, 0)),
        m,
    )
    # Where both angles move towards normal incidence; Brewster's angle of a still smaller index is
    # the one place that `reflectance` states as an exception (test_interface_accuracy.py).
    n, m = rounded(decades(-6, -0.5)), either(1.0, rounded(uniform(1.0, 4.0)))
    sets["critical, small index"] = (
        np.sqrt((1 - n / m) * (1 + n / m)) * within_a_few_eps(),
        n,
        either(0, decades(-30, -3)),
        m,
    )
    n = rounded(m * uniform(0.05, 0.4))
    sets["Brewster, small index"] = (
        m / np.hypot(n, m) * within_a_few_eps(),
        n,
        either(0, decades(-12, -3)),
        m,
    )
    sets["normal, huge k"] = (1.0 - decades(-16, -3), decades(-6, 8), decades(3, 8), m)
    exact = {name: tuple(np.asarray(x, dtype) for x in points) for name, points in sets.items()}
    return {name: (np.clip(c, 0, 1), n, k, m) for name, (c, n, k, m) in exact.items()}
