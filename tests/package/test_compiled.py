"""A compiled program gives what its function gives: options of the compiler may not change it."""

import time
from concurrent.futures import ThreadPoolExecutor

import jax
import numpy as np
import pytest

from fitting.data.measurement import Measurement
from fitting.problem.observations import observations
from fitting.problem.programs import _linearised
from fitting.problem.unknowns import index_outside, spectrum_of, unknowns
from fitting.process.compiled import compiled
from fitting.samples.parameters import Settings
from fitting.samples.sample import Sample
from fresnel_jax import powers
from fresnel_jax.layers import stack

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("text", "quantities", "free", "place"),
    [
        # An earlier form of this program was wrong by 2.5 with vectors of 512 bits, by jaxlib
        # 0.10.1 and 0.10.2, whether or not sums of products went to YNNPACK.
        ("air | cauchy:2 5..1000 nm | SiO2", ("psi", "delta"), ("angle_offset",), 109.5),
        pytest.param(
            "air | cauchy:2 3 mm thick | air", ("R", "T"), ("scale",), None, marks=pytest.mark.study
        ),
    ],
)
def test_values_and_derivatives_are_those_of_the_function(text, quantities, free, place):
    waves = np.linspace(0.33, 2.0, 60)
    data = {q: np.full(60, 20.0 if q in ("psi", "delta") else 0.3) for q in quantities}
    m = Measurement.from_columns(60.0, waves, **data)
    sample, settings = Sample.parse(text), Settings(free=free)
    seen = observations([m], "equal")
    u = unknowns(sample, spectrum_of([m], sample), settings, seen, "squares")
    outside = index_outside(sample, seen.points.wavelength_um)
    values = {"A": 2.05, "B": 0.017, "thickness_nm": place, "angle_offset": -0.25, "scale_0": 0.98}
    y = np.array([values.get(n.rpartition(".")[2], 0.3) for n in u.spec.moving], float)
    at = y, seen.points, u.held, outside
    expected = _linearised(*at, spec=u.spec)
    found = compiled(_linearised, "spec")(*at, spec=u.spec)
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-11 * np.abs(b).max())


def test_what_the_tests_compile_has_the_bits_of_what_users_compile():
    """The tests leave out passes of the compiler, by XLA_FLAGS in tests/conftest.py."""
    as_is = {
        "xla_backend_optimization_level": 3,
        "xla_llvm_disable_expensive_passes": False,
        "xla_cpu_parallel_codegen_split_count": 32,
    }
    random = np.random.default_rng(0)
    c, n, k = (random.uniform(0.0, high, 1000) for high in (1.0, 4.0, 3.0))

    def of_a_film(c, n, k):
        index = [np.ones(1000), n + 1j * k, np.full(1000, 1.5)]
        return stack(c, index, thickness_um=[0.2], wavelength_um=0.6, exact=False)

    slopes = jax.vmap(jax.grad(lambda c, n, k: powers(c, n, k).R_p, (0, 1, 2)))
    for function in (slopes, of_a_film):
        program = jax.jit(function).lower(c, n, k)
        found, wanted = (program.compile(options)(c, n, k) for options in (None, as_is))
        for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True):
            np.testing.assert_array_equal(a, b)


def test_of_several_threads_one_compiles():
    events = []

    def traced(x, *, spec):
        events.append("begins")
        time.sleep(0.1)
        events.append("ends")
        return x

    program = compiled(traced, "spec")
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda _: program(np.ones(3), spec="a"), range(4)))
        assert events == ["begins", "ends"]
        events.clear()
        list(pool.map(lambda spec: program(np.ones(3), spec=spec), "bc"))
        assert events[:2] == ["begins", "begins"]  # another program waits for none
