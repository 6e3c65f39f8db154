"""`stack` at every case of the map in which other programs fail, against mpmath."""

import jax
import numpy as np
import pytest

from fresnel_jax.layers import stack
from tests.truth import stack_cases, stack_oracle


# Of mirrors each number of layers is a program of its own; ten and a thousand layers are tested in
# test_stack_many_layers.py.
@pytest.mark.parametrize("family", [
    pytest.param(f, marks=[pytest.mark.study] * (f == "dielectric mirror"))
    for f in stack_cases.FAMILIES
])  # fmt: skip
def test_every_case_of_the_map(family):
    _, values, case = stack_cases.FAMILIES[family]
    for value in values:
        c, index, thickness, wavelength = case(float(value))
        exact = stack_oracle.stack(c, index, thickness, wavelength)[:4]
        found = stack(
            c, np.array(index), thickness_um=np.array(thickness), wavelength_um=wavelength
        )[:4]
        layers = len(thickness)
        bound = 64.0 if layers <= 10 else 8.0 * layers
        assert stack_cases.error_eps(found, exact) <= bound, (family, value)


@pytest.mark.study
def test_gradients_are_finite_at_every_case():
    """One program for all families of one film."""

    def total(c, n, k, thickness, wavelength):
        return sum(stack(c, n + 1j * k, thickness_um=thickness, wavelength_um=wavelength)[:4])

    gradient = jax.jit(jax.vmap(jax.grad(total, (0, 1, 2, 3, 4))))
    cases = [
        case(float(value))
        for _, values, case in stack_cases.FAMILIES.values()
        for value in values
        if len(case(float(value))[2]) == 1
    ]
    c, index, thickness, wavelength = (np.array(z) for z in zip(*cases, strict=True))
    found = gradient(c, index.real, index.imag, thickness, wavelength)
    assert all(np.isfinite(np.asarray(z)).all() for z in found)
