"""The environment: the jaxlib that is installed compiles right programs for this processor."""

import jax
import jax.numpy as jnp
import jaxlib
import numpy as np
import pytest


@pytest.mark.parametrize(
    ("dtype", "sizes"), [(np.float64, (16_385, 40_000)), (np.float32, (32_769, 40_000))]
)
def test_a_sum_of_squared_products_is_that_of_its_rows(dtype, sizes):
    """jaxlib 0.10.2 returns wrong numbers in all rows after the first 16,384 (float32: 32,768)."""
    random = np.random.default_rng(20261129)
    eps = float(np.finfo(dtype).eps)
    for rows in sizes:
        counted = np.eye(3, dtype=dtype), np.arange(rows)[:, None] * np.array([1, 0, 0])
        drawn = random.standard_normal((3, 3)), random.standard_normal((rows, 3))
        for pair in (counted, drawn):
            m, x = (np.asarray(a, dtype) for a in pair)
            found = jax.jit(lambda x, m=m: jax.vmap(lambda r: jnp.sum((m @ r) ** 2))(x))(x)
            m, x = m.astype(float), x.astype(float)
            error = np.abs(np.asarray(found, float) - np.sum((x @ m.T) ** 2, 1))
            # What three products and two sums, squared and summed again, may round.
            wrong = np.sum(error > 16 * eps * np.sum((np.abs(x) @ np.abs(m).T) ** 2, 1))
            assert not wrong, (
                f"jaxlib {jaxlib.__version__} compiles wrong programs on this processor: {wrong} "
                f"of {rows} sums of squares are wrong ({np.dtype(dtype).name}). That of 0.10.2 is "
                "reported as jax-ml/jax#39103. Install another: pip install -U 'jax!=0.10.2'."
            )
