"""What the results of all functions, named tuples, have in common."""

from typing import TypeVar

from jax import export

Result = TypeVar("Result", bound=type)


def exported(result: Result) -> Result:
    """A class of results that programs written by `jax.export` may return."""
    name = f"fresnel_jax.{result.__name__}"
    export.register_namedtuple_serialization(result, serialized_name=name)
    return result
