"""Every public call under JAX's strict switches: no rank and no type is promoted implicitly.

Users who test with `jax_numpy_rank_promotion="raise"` and `jax_numpy_dtype_promotion="strict"` meet
the switches inside of our functions too, wherever they call or differentiate them.
"""

import inspect
import subprocess
import sys
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fresnel_jax
from fitting import Measurement, choose, fit, fit_many, fit_residuals, read_csv, simulate
from fresnel_jax.dispersion import DispersionModel
from fresnel_jax.performance import jax_has_begun, keep_memory
from tests.physics.public_calls import CALLS, N, cast

pytestmark = pytest.mark.slow


def total(tree, dtype):
    """The sum of all real and imaginary parts."""
    numbers = [x for x in jax.tree.leaves(tree) if x.dtype != bool]
    parts = [f(x).astype(dtype) for x in numbers for f in (jnp.real, jnp.imag)]
    return sum((jnp.sum(x) for x in parts), jnp.zeros((), dtype))


@pytest.fixture(autouse=True)
def strict(set_jax):
    set_jax(jax_numpy_rank_promotion="raise", jax_numpy_dtype_promotion="strict")


def test_every_public_call_is_among_them():
    calls = [name.split(" ")[0].split(".") for name in CALLS]
    named = {
        *(name[-2] for name in calls if len(name) > 1),
        *(".".join(name[1:]) for name in calls),
    }
    for module in (getattr(fresnel_jax, name) for name in fresnel_jax._SUBMODULES):
        for name in module.__all__:
            value = getattr(module, name)
            if not callable(value) or module is fresnel_jax.materials:
                continue
            if inspect.isclass(value) and not issubclass(value, eqx.Module):
                continue  # a result or an enumeration
            methods = [m for m in vars(value) if m[0] != "_" and callable(getattr(value, m))]
            if not inspect.isclass(value) or {*methods} <= {"index", "susceptibility"}:
                methods = [""]
            if value not in (DispersionModel, jax_has_begun, keep_memory):
                assert {f"{name}.{m}".rstrip(".") for m in methods} <= named, name


# What would be promoted in one precision would be in the other. Stacks take seconds to trace each:
# mapped, these stand for all: coherent and incoherent layers, and rough boundaries. What the others
# in the second line have is in these two and in "layers.stack".
STACKS = ("layers.stack mixed complex", "layers.stack rough")
FURTHER = tuple(f"layers.stack {x}" for x in ("complex", "mixed", "incoherent", "rough complex"))
EXACT_UNIAXIAL = "layers.stack of uniaxial media"  # its annotations are checked all the same


def of_few(name):
    return not name.startswith("layers.stack") or name in STACKS


# Of one boundary: what prepares the arguments of the others is that of `reflectance` and `powers`.
VARIANTS = (" of k", " without k", " of integers")


def is_study(name, dtype):
    variant = name.endswith(VARIANTS) and not name.startswith("interface.")
    return name in (*FURTHER, EXACT_UNIAXIAL) or dtype == "float64" or variant


@pytest.mark.parametrize(("name", "dtype"), [
    pytest.param(name, dtype, marks=[pytest.mark.study] * is_study(name, dtype))
    for name in CALLS for dtype in ("float32", "float64")
])  # fmt: skip
def test_value_and_gradient(name, dtype):
    """Traced, not run: what is promoted is known from shapes and types."""
    function, *arguments = CALLS[name]
    dtype = np.dtype(dtype).type
    arguments = [cast(x, dtype) for x in arguments]
    axes = [x.shape.index(N) if N in x.shape else None for x in arguments]
    value = {}

    def loss(*x):
        value["of all"] = function(*x)
        return total(value["of all"], dtype)

    # value and gradient are traced once; a function of no array has no gradient
    every = tuple(range(len(arguments)))
    whole = jax.grad(loss, argnums=every) if arguments else loss
    gradient = jax.eval_shape(whole, *arguments)
    for leaf in jax.tree.leaves(value):
        assert leaf.weak_type or leaf.dtype in (bool, dtype, np.result_type(dtype, np.complex64))
    if arguments:
        assert [g.dtype for g in gradient] == [x.dtype for x in arguments]
    # ranks are the same in both precisions
    mapped = dtype is np.float32 and "in_blocks" not in name and of_few(name)
    if mapped and any(axis is not None for axis in axes):
        jax.eval_shape(jax.vmap(function, axes), *arguments)


CHECKED = """
import sys
import jaxtyping
jaxtyping.install_import_hook("fresnel_jax", "beartype.beartype")
import jax, numpy
from tests.physics.public_calls import CALLS, cast
for name in sys.argv[1:]:
    function, *arrays = CALLS[name]
    jax.eval_shape(function, *(cast(x, numpy.float32) for x in arrays))
"""


@pytest.mark.parametrize(
    "names",
    [[*(CALLS.keys() - FURTHER)], pytest.param(FURTHER, marks=pytest.mark.study)],
    ids=["most", "further stacks"],
)
def test_annotations_hold_at_run_time(names):
    """jaxtyping's check of all annotations that the calls meet, our own functions' among them.

    In a process of its own, since beartype's errors would come before our own texts, which other
    tests expect, wherever a wrong argument is refused.
    """
    subprocess.run(
        [sys.executable, "-c", CHECKED, *names], cwd=Path(__file__).parents[2], check=True
    )


def decay(v, data):
    return (v["height"] * jnp.exp(-v["rate"] * data[0]) - data[1]) / 0.01


def mixing_ranks(v, data):
    return decay(v, data) + jnp.zeros((1, 30))


def mixing_types(v, data):
    return decay(v, data) * jnp.ones(30, np.float32)


TIMES = np.linspace(0.0, 2.0, 30)
DECAY = {"height": (0.5, 5.0), "rate": (0.1, 5.0)}, (TIMES, 2.0 * np.exp(-1.3 * TIMES))


@pytest.mark.study
def test_fits_have_settings_of_their_own(tmp_path):
    """Whose programs promote as NumPy does, in threads too; a caller's own function may not."""
    angle, wave = np.linspace(20.0, 80.0, 9), np.linspace(0.4, 0.9, 20)
    light = simulate("constant", {"eta": 0.4, "k": 2.5}, angle, 0.5, "R_s")
    file = tmp_path / "curve.csv"
    np.savetxt(file, np.c_[angle, light], delimiter=",", header="angle_deg,R_s", comments="")
    bare = fit(read_csv(file))
    assert bare.predict([30.0, 60.0], "R_s").value.shape == (2,)
    assert bare.eta == pytest.approx(0.4, rel=1e-6)
    assert fit_many(angle, R_s=np.stack([light] * 3)).k == pytest.approx([2.5] * 3, rel=1e-6)
    film, values = "air | cauchy:1 100..400 nm | Si", {"A": 1.45, "thickness_nm": 250.0}
    seen = Measurement.from_columns(10.0, wave, R=simulate(film, values, 10.0, wave, "R"))
    fitted = fit(seen, film)
    assert fitted.parameters["thickness_nm"].value == pytest.approx(250.0, rel=1e-6)
    assert fitted.index(0.5).eta == pytest.approx(1.45, rel=1e-6)
    assert fit_residuals(decay, *DECAY).parameters["rate"].value == pytest.approx(1.3, rel=1e-6)


@pytest.mark.study
def test_the_choice_of_a_model_has_settings_of_its_own():
    wave = np.linspace(0.4, 0.9, 20)
    values = {"A": 1.5, "B": 0.01}
    seen = simulate("cauchy:2", values, 60.0, wave, "R_s")
    noise = 1e-4 * np.random.default_rng(1).standard_normal(20)
    assert choose(Measurement.from_columns(60.0, wave, R_s=seen + noise)).fit.status == "converged"


@pytest.mark.parametrize("residuals", [mixing_ranks, mixing_types])
def test_a_function_of_the_caller_is_checked(residuals):
    with jax.numpy_rank_promotion("allow"), jax.numpy_dtype_promotion("standard"):
        assert fit_residuals(residuals, *DECAY).status == "converged"
    with pytest.raises((ValueError, TypeError), match="promotion"):
        fit_residuals(residuals, *DECAY)
