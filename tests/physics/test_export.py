"""Programs written by `jax.export`: results keep their names, and a batch may have any size."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import export

from fresnel_jax import amplitudes, powers, reflectance
from fresnel_jax.bsdf import Dielectric
from fresnel_jax.directions import local_frame, refract
from fresnel_jax.dispersion import material
from fresnel_jax.layers import slab, stack
from fresnel_jax.polarization import phases, psi_delta

pytestmark = pytest.mark.slow

GOLD = material("gold").model
UP = jnp.array([0.0, 0.0, 1.0])


def direction(c):
    return jnp.stack([jnp.sqrt(1.0 - c * c), 0.0 * c, c], -1)


CALLS = {
    "powers": lambda c: powers(c, 1.5, 0.1),
    "reflectance": lambda c: reflectance(c, 1.5, 0.1),
    "amplitudes": lambda c: amplitudes(c, 1.5),
    "phases": lambda c: phases(c, 0.2, 3.0),
    "psi_delta": lambda c: psi_delta(c, 0.2, 3.0),
    "slab": lambda c: slab(c, 1.5, thickness_um=1.0, wavelength_um=0.5),
    "stack": lambda c: stack(c, [1.0, 1.4 + 0.1j, 1.5], thickness_um=[0.1], wavelength_um=0.5),
    "fast stack": lambda c: stack(
        c, [1.0, 1.4 + 0.1j, 1.5], thickness_um=[0.1], wavelength_um=0.5, exact=False
    ),
    "incoherent": lambda c: stack(
        c, [1.0, 1.5, 1.0], thickness_um=[9.0], wavelength_um=0.5, coherent=False
    ),
    "refract": lambda c: refract(direction(c), UP, 1.5),
    "local_frame": lambda c: local_frame(direction(c)),
    "sample": lambda c: Dielectric(1.5).sample(direction(c), 0.3, jnp.array([0.1, 0.2])),
    "flags": lambda c: Dielectric(1.5 + c).flags(),
    "index": lambda c: GOLD(0.5 + 0.1 * c),
}


# Their results are those of "stack", "powers", "psi_delta" and "refract".
STUDIES = ("fast stack", "incoherent", "reflectance", "phases", "local_frame")


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.study] * (n in STUDIES)) for n in CALLS]
)
def test_a_written_program_gives_the_same_result_for_any_batch(name):
    function = jax.jit(CALLS[name])
    (free,) = export.symbolic_shape("batch")
    given = jax.ShapeDtypeStruct((free,), jnp.float64)
    again = export.deserialize(export.export(function)(given).serialize())
    cosines = np.array([0.2, 0.9, 0.5])
    want, batch = function(cosines), cosines
    if "stack" in name or name == "incoherent":  # of one: its axis comes last in every result
        batch, want = cosines[:1], jax.tree.map(lambda x: np.asarray(x)[..., :1], want)
    got = again.call(batch)
    assert type(got) is type(want)
    for a, b in zip(jax.tree.leaves(got), jax.tree.leaves(want), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-14)
