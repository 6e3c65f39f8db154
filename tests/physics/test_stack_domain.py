"""Stacks over the whole domain of indices, thicknesses and angles: no NaN, and in balance."""

import numpy as np
import pytest

from tests.physics.stacks import stack_of_many

# Decades of the moduli of indices and of the thickness in wavelengths.
DOMAIN = {np.float32: ((-3.0, 4.0), 20.0), np.float64: ((-6.0, 8.0), 30.0)}


@pytest.mark.parametrize("dtype", [np.float64, pytest.param(np.float32, marks=pytest.mark.study)])
@pytest.mark.parametrize(("layers", "coherent"), [
    (3, True), (2, False), *(pytest.param(*x, marks=pytest.mark.study)
                             for x in ((1, True), (2, True), (1, False), (3, False))),
])  # fmt: skip
def test_no_stack_gives_nan(dtype, layers, coherent):
    """1 in 1,000 did: a clear incoherent layer between an evanescent one and total reflection."""
    random, count = np.random.default_rng(layers), 4000
    (low, high), thickest = DOMAIN[dtype]
    shape = (layers + 2, count)
    modulus, phase = 10.0 ** random.uniform(low, high, shape), random.uniform(0.0, 1.5, shape)
    # Half of them usual: a thickness near the wavelength and clear media near each other.
    usual = random.random(count) < 0.5
    modulus = np.where(usual, 10.0 ** random.uniform(-1.0, 1.0, shape), modulus)
    phase = np.where(usual & (random.random(shape) < 0.7), 0.0, phase)
    modulus[0], phase[0] = 10.0 ** random.uniform(-1.0, 0.5, count), 0.0
    depth = 10.0 ** np.where(
        usual, random.uniform(-4.0, 4.0, (layers, count)),
        random.uniform(-20.0, thickest, (layers, count)),
    )  # fmt: skip
    cosine = np.where(usual, random.uniform(0, 1, count), 10.0 ** random.uniform(-10, 0, count))
    index = (modulus * np.exp(1j * phase)).astype(f"c{2 * np.dtype(dtype).itemsize}")
    given = cosine.astype(dtype), index, 0.5 * depth.astype(dtype), np.full(count, 0.5, dtype)
    found = stack_of_many(*given, coherent=coherent)
    for R, T, A in ((found.R_s, found.T_s, found.A_s), (found.R_p, found.T_p, found.A_p)):
        total = np.asarray(R + T + A.sum(0))
        assert np.isfinite(total).all()
        # A metal thinner than its skin depth is no incoherent layer; its A has no more digits.
        if coherent:
            np.testing.assert_allclose(total, 1.0, atol=256 * np.finfo(dtype).eps)
