"""A layer whose index is a function of depth, as thin layers.

The fields obey d(U, W)/dz = i k_0 ((0, g), (Q^2 / g, 0)) (U, W), linear in N^2 for s, and in N^2
and 1 / N^2 for p. A step of Magnus' integrator of fourth order without commutators is two
exponentials of linear combinations of these matrices at the two Gauss points of the step,

    exp(h (b A_1 + a A_2)) exp(h (a A_1 + b A_2)),    a, b = 1/4 +- sqrt(3)/6,

and each is a `Uniaxial` layer of thickness h / 2: N_o^2 = 2 (a N_1^2 + b N_2^2) for s and p, and
1 / N_e^2 = 2 (a / N_1^2 + b / N_2^2) for p. Its error is of the fourth order in h, that of
layers of the index in their middle of the second.

Source: S. Blanes and P. C. Moan 2006, Fourth- and sixth-order commutator-free Magnus integrators,
doi:10.1016/j.apnum.2005.11.004.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike

from .._numerics.arguments import as_float, check_length, real, real_or_complex
from .._numerics.index import Index, IndexLike
from .uniaxial import Uniaxial


def graded_layer(
    index: Callable[[Array], IndexLike], thickness_um: ArrayLike, *, layers: int = 64
) -> tuple[list[Uniaxial], list[Array]]:
    """The media and thicknesses of a layer with a graded index, for the lists of `stack`.

        media, d = graded_layer(lambda z: 1.5 + slope * z, 0.3)
        stack(c, [1.0, *media, 3.88], thickness_um=d, wavelength_um=0.5, exact=False)

    Args:
        index: the index of an isotropic medium at an array of depths in micrometres below the front
            of the layer: real, complex or an `Index`, of the shape of the array, with the depths on
            its leading axis, or of one that broadcasts behind it. It is called once, and may depend
            on traced parameters, for which the result has derivatives. It must be smooth: a layer
            for each smooth part of a profile that jumps or bends.
        thickness_um: of the whole layer, >= 0.
        layers: how many it becomes, an even number. The error falls as its fourth power, so that
            1 / 15 of what doubling it changes is what is left. Where N^2 is linear in depth and
            changes by a share s < 0.6, R is right to s ((1 + p) / layers)^4 with the phase
            p = 2 pi N thickness / wavelength, up to half a radian for each of the layers.

    Returns:
        `layers` uniaxial media, and as many equal thicknesses.

    Raises:
        ValueError: `layers` is no even number above 0; a thickness below 0 or infinite; or, in
            `stack`, a k that changes so steeply within a step that the combinations above are
            negative: more layers are wanted.
    """
    if not isinstance(layers, int) or layers < 2 or layers % 2:
        raise ValueError(f"layers is {layers!r}; an even number above 0 is wanted, such as 64")
    d = as_float(real(thickness_um, "thickness_um"), "thickness_um")
    check_length(d, "thickness_um")
    gauss = 0.5 + np.array([-1.0, 1.0]) * np.sqrt(3.0) / 6.0
    places = (2.0 * (np.arange(layers // 2)[:, None] + gauss) / layers).reshape(-1)
    depth = jnp.asarray(places, d.dtype).reshape((layers,) + (1,) * d.ndim) * d[None]
    found: Any = index(depth)
    n = jnp.asarray(real_or_complex(found.complex if isinstance(found, Index) else found, "index"))
    leading = (layers,) + (1,) * max(n.ndim - 1, 0)
    n2 = jnp.broadcast_to(n, jnp.broadcast_shapes(n.shape, leading)) ** 2

    def combined(z: Array) -> Array:
        a, b = 0.5 + 3.0**-0.5, 0.5 - 3.0**-0.5
        first, second = z[0::2], z[1::2]
        both = jnp.stack([a * first + b * second, b * first + a * second], axis=1)
        return jnp.sqrt(both.reshape(z.shape))

    return [*map(Uniaxial, combined(n2), 1.0 / combined(1.0 / n2))], [d / layers] * layers
