"""What the compiler makes of each form: operations a point, and loops.

    python -m benchmarks.speed.operations

Counted in the programs that XLA's CPU compiler has optimised: arithmetic, comparisons and
selections, and in brackets the divisions and square roots among them, each of which costs several
of the others. Loops beyond the first store and load what they share.
"""

import functools
import re

import jax
import jax.numpy as jnp

from fresnel_jax import powers, reflectance
from tests.truth import printed

POINTS = 1_000
FREE = {"parameter", "constant", "broadcast", "bitcast", "fusion", "tuple"}
COSTLY = {"divide", "sqrt", "rsqrt"}

plain = functools.partial(reflectance, compensated=False)


def with_gradient(R, count: int):
    """Value, and derivatives with respect to all arguments but the cosine."""
    return jax.vmap(jax.value_and_grad(R, argnums=tuple(range(1, count))))


FORMS = {  # lossless, lossy
    "`reflectance`": (reflectance, reflectance),
    "`reflectance(..., compensated=False)`": (plain, plain),
    "plain sums, fewest divisions": (printed.plain_lossless, None),
    "printed form (FrDielectric, FrConductor)": (printed.pbrt4_dielectric, printed.pbrt3_conductor),
    "`powers`: R and T of s and p": (powers, powers),
    "`reflectance` with its gradient": (
        with_gradient(reflectance, 2),
        with_gradient(reflectance, 3),
    ),
    "the same, not compensated": (with_gradient(plain, 2), with_gradient(plain, 3)),
}


def cell(function, lossless: bool) -> str:
    if function is None:
        return ""
    c = jnp.linspace(0.1, 0.9, POINTS)
    arguments = (c, c + 1.2) if lossless else (c, c + 1.2, c + 0.1)
    text = jax.jit(function).lower(*arguments).compile().as_text()
    operations = [x for x in re.findall(r"= \S+ ([a-z-]+)\(", text) if x not in FREE]
    costly = sum(x in COSTLY for x in operations)
    loops = text.count(" fusion(")
    return f"{len(operations)} ({costly})" + (f", {loops} loops" if loops > 1 else "")


def main():
    jax.config.update("jax_enable_x64", True)
    print("| | lossless | lossy |\n| --- | --- | --- |")
    for name, (lossless, lossy) in FORMS.items():
        print(f"| {name} | {cell(lossless, True)} | {cell(lossy, False)} |")


if __name__ == "__main__":
    main()
