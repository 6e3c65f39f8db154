"""Sums of many points under `jax.jit` on the CPU: what each form of the sum costs.

    python -m benchmarks.speed.losses

Prints the tables of docs/losses.md: mean squared residuals of one material, relative to the
elementwise kernel in the same run.
"""

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.speed.timing import fastest
from fresnel_jax import powers, reflectance

ETA, K = 1.7, 0.4


def fenced(x):
    info = jnp.finfo(x.dtype)
    return jax.lax.reduce_precision(x, info.nexp, info.nmant)


SUMS = {
    "`jnp.sum(x)`, `jnp.mean(x)`": jnp.sum,
    "`x.reshape(b, -1).sum(0).sum()`": lambda x: x.reshape(100, -1).sum(0).sum(),
    "`jnp.sum(lax.optimization_barrier(x))`": lambda x: jnp.sum(jax.lax.optimization_barrier(x)),
    "`jnp.sum(x[:-1])`": lambda x: jnp.sum(x[:-1]),
    "`jnp.sum(jnp.where(x == x, x, nan))`": lambda x: jnp.sum(jnp.where(x == x, x, jnp.nan)),
    "`jnp.sum(lax.reduce_precision(x, nexp, nmant))`": lambda x: jnp.sum(fenced(x)),
}


def squares(cosine, data, eta, k):
    """Elementwise squared residuals, by `powers`: nothing in it stops the compiler by itself."""
    both = powers(cosine, eta, k)
    return (0.5 * (both.R_s + both.R_p) - data) ** 2


def of_sums(squares, sums) -> None:
    print("| form of the sum | loss, 1e5 float64 | loss, 1e6 float32 | gradient, 1e5 float64 |")
    print("| --- | --- | --- | --- |")
    columns = [("loss", 10**5, "float64"), ("loss", 10**6, "float32"), ("grad", 10**5, "float64")]
    table = {name: [] for name in sums}
    for what, size, dtype in columns:
        cosine = jnp.asarray(np.random.default_rng(0).uniform(0, 1, size), dtype)
        arguments = (cosine, 0.5 * cosine, jnp.asarray(ETA, dtype), jnp.asarray(K, dtype))
        losses = {name: lambda *a, add=add: add(squares(*a)) for name, add in sums.items()}
        if what == "loss":
            programs = {name: jax.jit(loss) for name, loss in losses.items()}
            programs["elementwise"] = jax.jit(squares)
        else:
            programs = {
                name: jax.jit(jax.value_and_grad(loss, argnums=(2, 3)))
                for name, loss in losses.items()
            }
            each = jax.vmap(jax.value_and_grad(squares, argnums=(2, 3)), (0, 0, None, None))
            programs["elementwise"] = jax.jit(each)
        times = fastest(programs, arguments)
        for name in sums:
            table[name].append(f"{times[name] / times['elementwise']:.2f}")
    for name, cells in table.items():
        print(f"| {name} | {' | '.join(cells)} |")


def by_reflectance(cosine, data, eta, k):
    return (reflectance(cosine, eta, k) - data) ** 2


def main():
    jax.config.update("jax_enable_x64", True)
    print("by `powers`:\n")
    of_sums(squares, SUMS)
    print("\nby `reflectance`:\n")
    of_sums(by_reflectance, {"`jnp.sum(x)`, `jnp.mean(x)`": jnp.sum})


if __name__ == "__main__":
    main()
