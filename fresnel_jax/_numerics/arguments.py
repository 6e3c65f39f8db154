"""Arguments at the border: what is refused by name, what selects a program, what becomes floats."""

from __future__ import annotations

import dataclasses
import functools
import inspect
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike

from .index import Index, IndexLike

# No rounding of a dot product of unit vectors, in float32 or coarser, comes this far above 1.
_LARGEST_COSINE = 1.001
# Of an array so many values are looked at, evenly spaced: 5 us, whatever its size.
_LOOKED_AT = 1024
# Arrays of more values are shown by their shape.
_FEW = 8
_HALF = ("float16", "bfloat16")


def structure(cos_theta_i, eta, k, eta_i):
    """The arguments with an exact Python 0 for k, or 1 for eta_i, replaced by None.

    None is structure, not a value: the program for lossless media or for light from vacuum leaves
    out what they do not need. A complex eta or an `Index` is taken apart here. Values are refused
    only where they can be read in 6 us: Python numbers, NumPy arrays, and JAX arrays that lie in
    the CPU's memory.
    """
    (eta, k), eta_i = index_parts(eta, k), lossless(eta_i, "eta_i")
    cos_theta_i, k, eta_i = (
        real_or_complex(x, name)
        for x, name in ((cos_theta_i, "cos_theta_i"), (k, "k"), (eta_i, "eta_i"))
    )
    broadcast_shape(cos_theta_i=cos_theta_i, eta=eta, k=k, eta_i=eta_i)
    if jnp.iscomplexobj(eta_i):
        raise ValueError(
            "eta_i is complex, a real number is wanted; only eta may be complex. Between two "
            "absorbing media R and T are no separate powers; fresnel_complex(cos, eta / eta_i) is "
            "the R of the relative index, and layers.stack takes a first medium that absorbs"
        )
    for name, value in (("cos_theta_i", cos_theta_i), ("k", k)):
        if jnp.iscomplexobj(value):
            raise ValueError(f"{name} is complex, a real number is wanted; only eta may be complex")
    check_cosine(cos_theta_i)
    check_index(eta, k)
    check_positive(eta_i, "eta_i")
    k = None if is_exactly(k, 0) else k
    eta_i = None if is_exactly(eta_i, 1) else eta_i
    return cos_theta_i, eta, k, eta_i


def index_parts(eta, k) -> tuple[Any, Any]:
    """eta and k of an index that is real, complex or an `Index`; k: the argument beside it.

    ValueError for any other tuple, and for a k beside an index that has one.
    """
    if isinstance(eta, tuple) and not isinstance(eta, Index):
        raise ValueError(
            f"eta is a tuple of {len(eta)}; wanted a real or a complex index or an Index(eta, k), "
            "as a dispersion model gives it. Several indices are an array"
        )
    if not isinstance(eta, Index):
        eta = real_or_complex(eta, "eta")
        if not jnp.iscomplexobj(eta):
            return eta, k
    if not is_exactly(k, 0):
        raise ValueError("a complex eta already contains k; leave the argument k out")
    if isinstance(eta, Index):
        return real(eta.eta, "eta"), real(eta.k, "k")
    return (np if _known(eta) else jnp).real(eta), (np if _known(eta) else jnp).imag(eta)


def lossless(index, name: str) -> Any:
    """The real part of an `Index` whose k is 0, NaN where a traced k is not; else what came."""
    if not isinstance(index, Index):
        return index
    if readable(index.k) and np.any(np.asarray(index.k) != 0.0):
        raise ValueError(f"{name} is an Index with k > 0; wanted the index of a lossless medium")
    return jnp.where(jnp.asarray(index.k) == 0.0, index.eta, jnp.nan)


def broadcast_shape(**arguments) -> tuple[int, ...]:
    """The shape that the arguments broadcast to; ValueError, with their names, if there is none.

    None has the shape (). A tuple is the shape itself, for an array of which it is a part.
    """
    shapes = [x if type(x) is tuple else np.shape(x) for x in arguments.values()]
    try:
        return jnp.broadcast_shapes(*shapes)
    except ValueError:
        *names, last = arguments
        raise ValueError(
            f"the shapes of {', '.join(names)} and {last}, {', '.join(map(str, shapes))}, "
            "do not broadcast to one shape; add axes of length 1 so that they do, "
            "e.g. eta[:, None]"
        ) from None


def is_exactly(value, number: int) -> bool:
    # Not a NumPy scalar, whose dtype counts.
    return type(value) in (int, float) and value == number


def real_or_complex(value, name: str) -> Any:
    """The value, a list or tuple as an array; ValueError, with the name, for other types."""
    if isinstance(value, Index):
        raise ValueError(f"{name} is an Index(eta, k); wanted an array of numbers")
    if type(value) in (float, int, complex):
        return value
    if not isinstance(value, jax.Array | np.ndarray | np.generic):
        # a list of jax's own numbers, traced ones among them, only jax can join
        join = jnp.asarray if _holds_jax_arrays(value) else np.asarray
        try:
            value = join(value)
        except (TypeError, ValueError):
            raise ValueError(f"{name} is {value!r:.60}; wanted an array of numbers") from None
    dtype = value.dtype
    if not (jnp.issubdtype(dtype, jnp.number) or dtype.name == "bool"):
        raise ValueError(f"{name} is {value!r:.60}; wanted a number or an array of numbers")
    if dtype.name in _HALF:
        raise ValueError(
            f"{name} is {dtype.name}, which holds too few digits of a reflectance; "
            f"wanted float32 or float64: {name}.astype('float32')"
        )
    return value


def _holds_jax_arrays(values) -> bool:
    return any(isinstance(x, jax.Array) for x in jax.tree.leaves(values))


def _known(value) -> bool:
    return isinstance(value, int | float | complex | np.ndarray | np.generic)


def readable(value) -> bool:
    """True if no tracer, no other device and no computation stands between us and the numbers.

    An array that is still being computed is let through: two hundred calls of 100 points, each of
    the result of the last, took 51 to 77 ms where they were waited for, 40 to 45 without, and 27 to
    45 without a look at any value (2 busy cores).
    """
    if not isinstance(value, jax.Array):
        return _known(value)
    if isinstance(value, Tracer) or not value.is_fully_addressable:
        return False
    if not value.is_ready():  # pyright: ignore[reportAttributeAccessIssue]
        return False
    return all(device.platform == "cpu" for device in value.devices())


def _some_values(value) -> np.ndarray:
    flat = np.asarray(value).reshape(-1)
    return flat[:: max(1, flat.size // _LOOKED_AT)]


def check_cosine(cosine, name: str = "cos_theta_i"):
    """ValueError for a readable cosine beyond what rounding makes of 1."""
    if type(cosine) in (float, int):
        largest = abs(cosine)
    elif readable(cosine) and np.size(cosine):
        some = _some_values(cosine)
        largest = max(float(some.max()), -float(some.min()))  # NaN is let through
    else:
        return
    if largest > _LARGEST_COSINE:
        raise ValueError(
            f"{name} is {largest:g}, which is no cosine; wanted a number in [-1, 1]. "
            "If it is an angle in degrees: jnp.cos(jnp.deg2rad(angle))"
        )


def _ends(value) -> tuple[float, float] | None:
    """The smallest and the largest of the values that can be read; NaN is no number here.

    None of what has none: traced, empty, or a complex number, which other checks refuse.
    """
    if type(value) in (float, int):
        return float(value), float(value)
    if not readable(value) or not np.size(value) or np.iscomplexobj(value):
        return None
    some = _some_values(value)
    return float(np.fmin.reduce(some)), float(np.fmax.reduce(some))


def check_extinction(k, name: str = "k"):
    """ValueError for a readable k < 0, or one that is infinite."""
    ends = _ends(k)
    if ends is not None and ends[0] < 0:
        raise ValueError(
            f"{name} is {ends[0]:g}; wanted k >= 0. With the time dependence exp(-i w t) of this "
            "library eta + ik absorbs; conjugate an index that is written eta - ik"
        )
    if ends is not None and ends[1] == np.inf:
        raise ValueError(f"{name} is infinite; a perfect conductor is a large one, such as 1e8")


def check_positive(value, name: str, or_zero: bool = False):
    """ValueError for a readable value <= 0, or < 0, or one that is infinite."""
    ends = _ends(value)
    if ends is None:
        return
    if ends[0] < 0 or (ends[0] == 0 and not or_zero):
        raise ValueError(f"{name} is {ends[0]:g}; wanted {'>= 0' if or_zero else '> 0'}")
    if ends[1] == np.inf:
        raise ValueError(f"{name} is infinite; wanted a finite number")


def check_unit(direction, name: str):
    """ValueError for a readable direction (..., 3) whose length is not 1."""
    if isinstance(direction, list | tuple) and all(map(_known, direction)):
        direction = np.asarray(direction)
    if not readable(direction) or np.shape(direction)[-1:] != (3,) or not np.size(direction):
        return
    if jnp.result_type(direction).name in _HALF:  # refused by its name
        return
    some = np.asarray(direction, float).reshape(-1, 3)
    length = np.sqrt((some[:: max(1, len(some) // _LOOKED_AT)] ** 2).sum(-1))
    off = length[np.abs(length - 1.0) > _LARGEST_COSINE - 1.0]  # NaN is let through
    if off.size:
        raise ValueError(
            f"{name} has the length {off[0]:g}; wanted a unit vector. Divide it by its length: "
            f"{name} / jnp.linalg.norm({name}, axis=-1, keepdims=True)"
        )


def values_shown(model: Any) -> str:
    """A model with the values of its fields, of large and unreadable arrays their shape.

    ``Dielectric(eta=1.5, distribution=TrowbridgeReitz(alpha_x=0.1, alpha_y=0.1), ...)``
    """
    if isinstance(model, jax.Array | np.ndarray):
        if np.size(model) > _FEW or not readable(model):
            return f"{jnp.result_type(model).name}{list(np.shape(model))}"
        digits = {"float_kind": lambda x: f"{x:.6g}"}
        return np.array2string(np.asarray(model), separator=", ", formatter=digits)  # pyright: ignore
    if not dataclasses.is_dataclass(model):
        return repr(model)
    each = ((f.name, getattr(model, f.name)) for f in dataclasses.fields(model))
    return f"{type(model).__name__}({', '.join(f'{n}={values_shown(x)}' for n, x in each)})"


def check_media(index):
    """ValueError for readable absolute indices that are 0, infinite, or have a part below 0."""
    if not (np.iscomplexobj(index) and readable(index)):
        return check_positive(index, "the real part of index")
    some = _some_values(index)
    check_extinction(np.imag(some), "the imaginary part of index")
    check_positive(np.real(some), "the real part of index", or_zero=True)
    check_positive(np.abs(some), "the modulus of index")


def check_length(value, name: str):
    """ValueError for a readable length < 0, or one that is infinite."""
    ends = _ends(value)
    if ends is not None and (ends[0] < 0 or ends[1] == np.inf):
        wrong = ends[0] if ends[0] < 0 else np.inf
        raise ValueError(f"{name} is {wrong:g}; wanted a finite number of micrometres >= 0")


def check_index(eta, k):
    """ValueError for a readable eta < 0, or k < 0, or an index that is 0."""
    check_extinction(k)
    check_positive(eta, "eta", or_zero=not is_exactly(k, 0))  # an ideal plasma has eta = 0


def _check_first_index(index):
    check_positive(lossless(index, "eta_i"), "eta_i")


def looked_at(function):
    """A compiled function whose readable cosine and indices are looked at before it is called."""
    signature = inspect.signature(function)

    @functools.wraps(function)
    def checked(*arguments, **named):
        given = signature.bind(*arguments, **named).arguments
        if "cos_theta_i" in given:
            check_cosine(given["cos_theta_i"])
        if "eta" in given:
            check_index(*index_parts(given["eta"], given.get("k", 0.0)))
        if "eta_i" in given:
            _check_first_index(given["eta_i"])
        return function(*arguments, **named)

    return checked


def real(value, name: str) -> Any:
    """`real_or_complex` without the complex."""
    value = real_or_complex(value, name)
    if jnp.iscomplexobj(value):
        raise ValueError(f"{name} is complex, a real number is wanted")
    return value


def named_floats(**arguments) -> tuple[Array, ...]:
    """The arguments as arrays of one floating-point type; wrong ones are refused by their name.

    An index eta, beside a k, may be complex or an `Index`, and eta_i a lossless `Index`.
    """
    if "k" in arguments:
        arguments["eta"], arguments["k"] = index_parts(arguments["eta"], arguments["k"])
    if "eta_i" in arguments:
        arguments["eta_i"] = lossless(arguments["eta_i"], "eta_i")
    return as_floats(*(real(value, name) for name, value in arguments.items()))


def as_floats(*arguments) -> tuple[Any, ...]:
    """The arguments as arrays of one floating-point type; None stays None."""
    dtype = jnp.result_type(*(x for x in arguments if x is not None), 1.0)
    return tuple(None if x is None else jnp.asarray(x, dtype) for x in arguments)


def all_floats(cos_theta_i, eta, k, eta_i) -> tuple[Array, ...]:
    """`as_floats` with arrays of 0 for a k, and of 1 for an eta_i, that is None."""
    c, n, k, m = as_floats(cos_theta_i, eta, k, eta_i)
    return c, n, jnp.zeros_like(n) if k is None else k, jnp.ones_like(n) if m is None else m


def as_float(x: ArrayLike | Sequence[Any], name: str) -> Array:
    """x as an array of floats; a Python number stays weakly typed and so leaves float32 alone."""
    x = jnp.asarray(real(x, name))
    return x if jnp.issubdtype(x.dtype, jnp.floating) else x.astype(jnp.result_type(float))


def float_named(name: str):
    """`as_float` as the converter of the field of that name."""
    return functools.partial(as_float, name=name)


def lossless_index(x: IndexLike, name: str) -> Array:
    """`as_float` of the index of a lossless medium."""
    x = real(lossless(x, name), name)
    check_positive(x, name)
    return as_float(x, name)


def index_named(name: str):
    """`lossless_index` as the converter of the field of that name."""
    return functools.partial(lossless_index, name=name)


def float_checked(name: str, check: Callable[[Any, str], None]):
    """`float_named`, of what `check(x, name)` lets through."""

    def converter(x: ArrayLike | Sequence[Any]) -> Array:
        x = real(x, name)
        check(x, name)
        return as_float(x, name)

    return converter


extinction = float_checked("k", check_extinction)
not_negative = functools.partial(check_positive, or_zero=True)
