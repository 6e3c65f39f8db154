"""What the compiler makes of the interface: one elementwise loop without branches."""

import re

import jax
import jax.numpy as jnp
import jaxlib.version
import pytest

from fresnel_jax import fresnel_complex, powers, reflectance

N = 100_000


def compiled(function, *arguments) -> str:
    return jax.jit(function).lower(*arguments).compile().as_text()


@pytest.mark.skipif(jax.default_backend() != "cpu", reason="it counts the loops of the CPU")
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("count", [2, 3, 4])
def test_reflectance_is_one_fused_loop(count, dtype):
    """Of jaxlib 0.11 min(|cos|, 1) and an array of ones are loops of their own (`opaque`)."""
    text = compiled(reflectance, *(jnp.ones(N, dtype) for _ in range(count)))
    entry = text[text.index("ENTRY") :]
    assert entry.count(" fusion(") == (3 if jaxlib.version.__version_info__[:2] == (0, 11) else 1)


@pytest.mark.parametrize("function", [powers, reflectance])
def test_no_gather_no_branch_no_complex_root(function):
    x = jnp.ones(N)
    for text in (
        compiled(function, x, x, x, x),
        compiled(
            jax.vmap(
                jax.grad(lambda *a: sum(function(*a)) if function is powers else function(*a))
            ),
            x,
            x,
            x,
            x,
        ),
    ):
        operations = set(re.findall(r"= \S+ ([a-z-]+)\(", text))
        assert not operations & {"gather", "conditional", "while", "custom-call", "complex"}


def test_complex_index_needs_no_complex_arithmetic():
    text = compiled(fresnel_complex, jnp.ones(N), jnp.ones(N, "complex128"))
    roots = re.findall(r"= (\S+) (?:sqrt|power|divide|multiply)\(", text)
    assert roots and not any(kind.startswith("c") for kind in roots)
