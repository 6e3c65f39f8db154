"""Who takes part. A contestant is described here by name and built only in its own process.

`points` evaluates materials that differ from point to point, `curve` one material at many angles
(contestants whose cost lies in the material are timed so). Both give R of unpolarized light.
"""

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from benchmarks import peers
from tests.truth import printed

OURS, PRINTED, TIER, APPROXIMATE, ARRAYS, PEER, LIMIT = (
    "ours",
    "printed form in JAX",
    "ours, not compensated",
    "approximation",
    "NumPy, numba",
    "other package",
    "limit",
)


@dataclass(frozen=True)
class Contestant:
    name: str
    family: str
    lossless: bool = True  # takes part where k = 0
    lossy: bool = True
    one_material: bool = False  # timed with one material and many angles
    package: str | None = None
    dtypes: tuple[str, ...] = ("float32", "float64")
    environment: dict[str, str] = field(default_factory=dict)

    loss: bool = False  # a mean squared residual and its gradient are timed too
    large_only: bool = False  # timed at 1e5 points and more only
    kept: bool = False  # after `keep_memory`

    @property
    def variant(self) -> bool:
        """The same program in another environment."""
        return self.kept or bool(self.environment)

    @property
    def runs_on_gpu(self) -> bool:
        return self.package in (None, "tmmax") and self.family != ARRAYS and not self.variant

    def installed(self) -> bool:
        return self.package is None or importlib.util.find_spec(self.package) is not None


@dataclass
class Built:
    """A contestant in its own process."""

    points: Callable  # (c, eta) or (c, eta, k) -> R
    curve: Callable
    in_jax: Callable | None = None  # the untraced function, where it can be differentiated
    gradient: Callable | None = None  # (c, eta, k) -> (3, N), by other means
    to_device: Callable = np.asarray
    wait: Callable = np.shape  # arrays that are there already


# The vector width is XLA's choice otherwise; see docs/speed.md why it should stay so.
WIDE = {"XLA_FLAGS": "--xla_cpu_prefer_vector_width=512"}

CONTESTANTS = [
    Contestant("reflectance", OURS, loss=True),
    Contestant("reflectance, memory kept", OURS, kept=True, loss=True, large_only=True),
    Contestant("reflectance, 512 bit too", OURS, kept=True, environment=WIDE, large_only=True),
    Contestant("fresnel_dielectric", OURS, lossy=False),
    Contestant("powers (R and T)", OURS),
    Contestant("pbrt-v4 FrDielectric", PRINTED, lossy=False),
    Contestant("pbrt-v4 FrComplex", PRINTED, loss=True),
    Contestant("pbrt-v3 FrConductor", PRINTED, loss=True),
    Contestant("reflectance, plain sums", TIER, loss=True),
    Contestant("fewest divisions, lossless", TIER, lossy=False),
    Contestant("Schlick", APPROXIMATE),
    Contestant("large index", APPROXIMATE),
    Contestant("Lazanyi", APPROXIMATE, one_material=True),
    Contestant("F82", APPROXIMATE, one_material=True),
    Contestant("polynomial 6", APPROXIMATE, one_material=True),
    Contestant("polynomial 10", APPROXIMATE, one_material=True),
    Contestant("table of 64", APPROXIMATE, one_material=True),
    Contestant("k dropped", APPROXIMATE, lossless=False),
    Contestant("NumPy, real form", ARRAYS),
    Contestant("numba, real form", ARRAYS, package="numba"),
    Contestant("numba, all cores", ARRAYS, package="numba", large_only=True),
    *(
        Contestant(
            name,
            PEER,
            one_material=name not in ("Tmm", "Tmmax", "Mitsuba"),
            package=x.package,
            dtypes=x.dtypes,
        )
        for name, x in peers.ALL.items()
    ),
    Contestant("copy bandwidth", LIMIT),
    Contestant("square root and division", LIMIT),
    Contestant("jax.jit(a + b + c)", LIMIT),
]


def build(name: str, dtype: str) -> Built:
    """The contestant, imported and ready; its programs are compiled at the first call."""
    contestant = next(x for x in CONTESTANTS if x.name == name)
    if contestant.family == PEER:
        built = peers.ALL[name](dtype)
        in_jax = getattr(built, "in_jax", None)
        pad = _zero_k(built.points), _zero_k(built.curve)
        if contestant.package in ("tmmax", "jaxlayerlumos"):
            return _in_jax(*pad, in_jax)
        return Built(*pad, gradient=getattr(built, "gradient", None))
    if name in ("NumPy, real form",):
        return Built(_zero_k(numpy_real_form), _zero_k(numpy_real_form))
    if name in LIMITS_IN_PLACE:
        return _in_place(LIMITS_IN_PLACE[name])
    if contestant.package == "numba":
        function = _zero_k(_numba(name))
        return Built(function, function)
    function = _jax_function(name)
    import jax

    return _in_jax(jax.jit(function), jax.jit(function), function)


def _in_jax(points, curve, untraced) -> Built:
    import jax

    return Built(points, curve, untraced, jax.numpy.asarray, jax.block_until_ready)


# What the machine can do at best, written into memory that is there already: the first argument is
# donated, and takes the result of the call before. Each gives numbers that stay in range.
LIMITS_IN_PLACE = {
    "copy bandwidth": lambda xp, x, *rest: xp.minimum(x, 1.0) + sum(rest),
    "square root and division": lambda xp, x, divisor, *_: xp.sqrt(xp.abs(x)) / divisor,
}


def _in_place(function) -> Built:
    import jax
    import jax.numpy as jnp

    compiled = jax.jit(lambda *x: function(jnp, *x), donate_argnums=0)
    state = {}

    def call(first, *rest):
        x = state.pop(first.shape, None)
        state.clear()
        state[first.shape] = compiled(jnp.copy(first) if x is None else x, *rest)
        return state[first.shape]

    return Built(call, call, None, jax.numpy.asarray, jax.block_until_ready)


def _zero_k(function):
    """A function of (c, eta, k) that takes (c, eta) too."""
    zeros = {}

    def of_two_or_three(c, eta, k=None):
        if k is None:
            key = np.shape(eta), str(getattr(eta, "dtype", ""))
            if key not in zeros:
                zeros[key] = type(eta)(0) if np.ndim(eta) == 0 else eta * 0
            k = zeros[key]
        return function(c, eta, k)

    return of_two_or_three


def _jax_function(name):
    from fresnel_jax import approximate, fresnel_dielectric, powers, reflectance

    def R_and_T(*arguments):
        # all four results are computed and used; their sum would be the constant 2
        R_s, R_p, T_s, T_p = powers(*arguments)
        return 0.5 * (R_s + R_p), T_s, T_p

    def table(c, *material):
        import jax.numpy as jnp

        root = jnp.linspace(0.0, 1.0, 64, dtype=c.dtype)
        nodes = (root * root).reshape(-1, *[1] * jnp.ndim(material[0]))
        values = reflectance(nodes, *material)
        place = jnp.sqrt(c) * 63.0
        low = jnp.clip(place.astype("int32"), 0, 62)
        at = values if values.ndim == 1 else None
        if at is not None:
            below, above = at[low], at[low + 1]
        else:
            below, above = (jnp.take_along_axis(values, i[None], 0)[0] for i in (low, low + 1))
        return below + (place - low) * (above - below)

    functions = {
        "fresnel_dielectric": fresnel_dielectric,
        "powers (R and T)": R_and_T,
        "pbrt-v4 FrDielectric": printed.pbrt4_dielectric,
        "pbrt-v4 FrComplex": _zero_k_in_jax(printed.pbrt4_complex),
        "pbrt-v3 FrConductor": _zero_k_in_jax(printed.pbrt3_conductor),
        "reflectance, plain sums": lambda *x: reflectance(*x, compensated=False),
        "fewest divisions, lossless": printed.plain_lossless,
        "Schlick": approximate.schlick,
        "large index": approximate.large_index,
        "Lazanyi": approximate.lazanyi_szirmay_kalos,
        "F82": approximate.f82,
        "polynomial 6": lambda *x: approximate.polynomial(*x, degree=6),
        "polynomial 10": lambda *x: approximate.polynomial(*x, degree=10),
        "table of 64": table,
        "k dropped": lambda c, eta, k: reflectance(
            c, approximate.real_index(approximate.normal_reflectance(eta, k))
        ),
        "jax.jit(a + b + c)": lambda *x: sum(x[1:], x[0]),
    }
    return functions.get(name, reflectance)


def _zero_k_in_jax(function):
    return lambda c, eta, k=None: function(c, eta, eta * 0 if k is None else k)


def numpy_real_form(c, eta, k):
    """Eq. 8.3 of pbrt-v3 in NumPy."""
    c2 = c * c
    sin2, eta2, k2 = 1.0 - c2, eta * eta, k * k
    t0 = eta2 - k2 - sin2
    modulus = np.sqrt(t0 * t0 + 4.0 * eta2 * k2)
    a = np.sqrt(np.maximum(0.5 * (modulus + t0), 0.0))
    t1, t2 = modulus + c2, 2.0 * c * a
    t3, t4 = c2 * modulus + sin2 * sin2, t2 * sin2
    with np.errstate(invalid="ignore"):
        R_s = (t1 - t2) / (t1 + t2)
        return 0.5 * (R_s + R_s * (t3 - t4) / (t3 + t4))


def _numba(name):
    import math

    import numba

    def real_form(c, eta, k, out):
        for i in numba.prange(c.size):
            c2 = c[i] * c[i]
            one, half = c.dtype.type(1), c.dtype.type(0.5)
            sin2, eta2, k2 = one - c2, eta[i] * eta[i], k[i] * k[i]
            t0 = eta2 - k2 - sin2
            modulus = math.sqrt(t0 * t0 + (eta2 + eta2) * (k2 + k2))
            a = math.sqrt(max(half * (modulus + t0), c.dtype.type(0)))
            t1, t2 = modulus + c2, (c[i] + c[i]) * a
            t3, t4 = c2 * modulus + sin2 * sin2, t2 * sin2
            R_s = (t1 - t2) / (t1 + t2)
            out[i] = half * (R_s + R_s * (t3 - t4) / (t3 + t4))

    compiled = numba.njit(real_form, parallel=name == "numba, all cores", error_model="numpy")

    def call(c, eta, k):
        out = np.empty_like(c)
        compiled(c, eta, k, out)
        return out

    return call
