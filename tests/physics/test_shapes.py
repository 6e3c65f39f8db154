"""What public signatures promise of dtypes and shapes, held against what comes back."""

import functools
import typing

import jax
import numpy as np
import pytest

from fresnel_jax import amplitudes, directions, faceforward, microfacet, polarization, powers
from fresnel_jax.bsdf import Dielectric
from fresnel_jax.layers import slab, stack

UP, W = np.array([0.0, 0.0, 1.0]), np.tile([0.6, 0.0, 0.8], (5, 1))
FACETS = microfacet.TrowbridgeReitz(0.3)
FRAME = directions.local_frame(UP)
COS = np.linspace(0.1, 1.0, 5)


@functools.wraps(slab)
def plate(c, n, k):
    return slab(c, n, k, thickness_um=2.0, wavelength_um=0.5)


@functools.wraps(stack)
def a_film(c, index):
    return stack(c, index, thickness_um=[0.1], wavelength_um=0.5)


@functools.wraps(stack)
def a_film_on_a_plate(c, index):
    return stack(c, index, thickness_um=[0.1, 3.0], wavelength_um=0.5, coherent=(True, False))


def promised(hint, value):
    """The value is what the hint says; a named tuple is taken apart."""
    if isinstance(hint, type) and hasattr(hint, "_fields"):
        assert isinstance(value, hint)
        fields = typing.get_type_hints(hint)
        for name in hint._fields:
            promised(fields[name], getattr(value, name))
    else:
        hints = [x for x in typing.get_args(hint) if x is not type(None)] or [hint]
        assert value is None or isinstance(value, tuple(hints)), (hint, value.shape, value.dtype)


@pytest.mark.parametrize(
    "function, arguments",
    [
        (powers, (COS, 1.5, 0.1)),
        (amplitudes, (COS, 1.5)),
        (plate, (COS, 1.5, 0.1)),
        (a_film, (COS, [1.0, 1.3 + 0.1j, 1.5])),
        (a_film_on_a_plate, (COS, [1.0, 1.3, 1.4, 1.5])),
        (directions.reflect, (W, UP)),
        (directions.refract, (W, UP, 1.5)),
        (faceforward, (UP, W)),
        (directions.entering, (W, UP)),
        (directions.local_frame, (W,)),
        (directions.to_local, (W, FRAME)),
        (directions.to_world, (W, FRAME)),
        (FACETS.D, (W,)),
        (FACETS.Lambda, (W,)),
        (FACETS.G1, (W,)),
        (FACETS.G, (W, UP)),
        (FACETS.D_visible, (W, UP)),
        (FACETS.sample_visible, (W, np.full((5, 2), 0.3))),
        (microfacet.half_vector, (W, UP, 1.5)),
        (polarization.phases, (COS, 1.5)),
        (polarization.psi_delta, (COS, 1.5, 0.1)),
        (polarization.ellipsometric_ratio, (COS, 1.5)),
        (polarization.mueller_reflection, (COS, 1.5)),
        (polarization.mueller_refraction, (COS, 1.5)),
        (Dielectric(1.5, FACETS).sample, (W, 0.3, np.full((5, 2), 0.3))),
    ],
)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_what_signatures_promise(function, arguments, dtype):
    def single(x):
        return x.astype(dtype) if isinstance(x, np.ndarray) else x

    def checked(*arguments):
        value = function(*arguments)
        promised(typing.get_type_hints(function)["return"], value)
        return value

    # Traced, not run: shapes and dtypes are known then, and nothing is compiled.
    arrays = [x for x in map(single, arguments) if isinstance(x, np.ndarray)]

    def of_arrays(*arrays):
        rest = iter(arrays)
        return checked(*(next(rest) if isinstance(x, np.ndarray) else x for x in arguments))

    leaf = jax.tree.leaves(jax.eval_shape(of_arrays, *arrays))[0]
    assert 5 in leaf.shape
