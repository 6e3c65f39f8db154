"""Largest errors of simplified models over a scene, by textbook formulas in NumPy."""

import functools

import numpy as np

from examples.advisor import Scene, advise
from fresnel_jax.dispersion import material
from tests.truth.textbook import reflectances

WAVELENGTHS, ANGLES = 22, 700
# Next to the critical angle the textbook's form in float64 is off by sqrt(eps).
TEXTBOOK_ERROR = 1e-7
EPS = np.finfo(np.float64).eps


def silicon_mirror(wavelength_um):
    """Silicon at the Cu K-alpha line, delta 7.58e-6 and beta 1.75e-7, scaled to its neighbourhood.

    B. L. Henke, E. M. Gullikson, J. C. Davis, Atomic Data and Nuclear Data Tables 54, 181 (1993).
    """
    ratio = np.asarray(wavelength_um) / 1.5406e-4
    return 1.0 - 7.58e-6 * ratio**2, 1.75e-7 * ratio**4


SCENES = {
    "window glass": Scene({"pane": "window glass"}, (0.4, 0.7), accuracy=1e-3),
    "water from below": Scene({"air": 1.0}, (0.4, 0.7), (0.0, 80.0), 0.01, "water"),
    "gold": Scene({"gold": "gold"}, (0.4, 0.7), accuracy=0.01),
    "aluminium": Scene({"aluminium": "aluminium"}, (0.4, 0.7), (0.0, 85.0), accuracy=0.02),
    "silicon": Scene({"silicon": "silicon"}, (0.8, 1.4), accuracy=1e-3),
    "X-ray mirror": Scene({"Si": silicon_mirror}, (1.45e-4, 1.6e-4), (89.0, 90.0), 0.005),
}


@functools.cache
def advice(name):
    return advise(SCENES[name])


def media(name, wavelength):
    """eta, k, eta_i of a scene's only material."""
    rows = np.array([media_at(name, float(x)) for x in wavelength.ravel()])
    return [x.reshape(wavelength.shape) for x in rows.T]


@functools.cache
def media_at(name, wavelength):
    (given,) = SCENES[name].materials.values()
    return *index(given, wavelength), index(SCENES[name].eta_i, wavelength)[0]


def index(given, wavelength):
    given = named(given) if isinstance(given, str) else given
    return [float(x) for x in given(np.array(wavelength))] if callable(given) else [given, 0.0]


named = functools.cache(material)


def textbook(c, n, k, m):
    found = reflectances(c, n + 1j * k, m)
    return np.array([found["R_s"], found["R_p"]])


def mean(c, n, k, m):
    return np.mean(textbook(c, n, k, m), axis=0)


def normal(n, k, m):
    return ((n - m) ** 2 + k**2) / ((n + m) ** 2 + k**2)


def schlick(c, n, k, m):
    return normal(n, k, m) + (1 - normal(n, k, m)) * (1 - c) ** 5


def f82(c, n, k, m):
    at = 1 / 7
    excess = schlick(at, n, k, m) - mean(at, n, k, m)
    return schlick(c, n, k, m) - excess / (at * (1 - at) ** 6) * c * (1 - c) ** 6


def lazanyi(c, n, k, m):
    """With the 16 nodes that its docstring states: an X-ray edge lies between them."""
    nodes, weights = np.polynomial.legendre.leggauss(16)
    nodes, weights = 0.5 + 0.5 * nodes, 0.5 * weights
    shape = nodes * (1 - nodes) ** 6
    rows = [np.expand_dims(x, -1) for x in (n, k, m)]
    excess = schlick(nodes, *rows) - mean(nodes, *rows)
    a = np.sum(weights * excess * shape, axis=-1) / np.sum(weights * shape**2)
    return schlick(c, n, k, m) - a * c * (1 - c) ** 6


def large_index(c, n, k, m):
    n, M = n / m, (n * n + k * k) / m**2
    R_s = (M - 2 * n * c + c * c) / (M + 2 * n * c + c * c)
    R_p = (M * c * c - 2 * n * c + 1) / (M * c * c + 2 * n * c + 1)
    return (R_s + R_p) / 2


def polynomial(c, n, k, m, degree):
    """Lagrange's form through the zeros of the Chebyshev polynomial."""
    nodes = 0.5 + 0.5 * np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
    total = 0.0
    for i, node in enumerate(nodes):
        others = np.delete(nodes, i)
        basis = np.prod([(c - x) / (node - x) for x in others], axis=0)
        total = total + basis * mean(node, n, k, m)
    return total


def from_thin_side(approximation):
    def form(c, n, k, m):
        # Point by point: a dispersive index may cross that of the first medium within a scene.
        c, n, k, m = np.broadcast_arrays(c, n, k, m)
        thinner = (k == 0) & (n < m)
        cos2 = np.where(thinner, 1 - (m / n) ** 2 * (1 - c * c), 1.0)
        cosine = np.where(thinner, np.sqrt(np.maximum(cos2, 0)), c)
        R = approximation(cosine, np.where(thinner, m, n), k, np.where(thinner, n, m))
        return np.array([np.where(cos2 <= 0, 1.0, R)] * 2)

    return form


FORMS = {
    "exact, s and p": textbook,
    "k = 0, s and p": lambda c, n, k, m: textbook(c, n, 0 * k, m),
    "exact, unpolarized": lambda *x: np.array([mean(*x)] * 2),
    "k = 0": lambda c, n, k, m: np.array([mean(c, n, 0 * k, m)] * 2),
    "normal incidence": lambda c, n, k, m: np.array([normal(n, k, m) + 0 * c] * 2),
    "schlick": from_thin_side(schlick),
    "large_index": from_thin_side(large_index),
    "lazanyi_szirmay_kalos": from_thin_side(lazanyi),
    "f82": from_thin_side(f82),
    **{
        f"polynomial, degree {d}": from_thin_side(functools.partial(polynomial, degree=d))
        for d in (6, 8, 10)
    },
}


def band_centre(name, wavelength, bands):
    low, high = SCENES[name].wavelength_um
    number = np.clip(np.ceil((wavelength - low) / (high - low) * bands) - 1, 0, bands - 1)
    return low + (high - low) * (number + 0.5) / bands


def errors(name, model, wavelength, angle, light):
    """Of a model at points, by textbook formulas; float32: of arguments rounded to it."""
    c = np.sin(np.radians(90.0 - angle))
    used = band_centre(name, wavelength, model.bands) if model.bands else wavelength
    arguments = c, *media(name, used)
    if model.dtype == "float32":
        arguments = [
            np.asarray(x, np.float32).astype(float) for x in np.broadcast_arrays(*arguments)
        ]
    difference = FORMS[model.form](*arguments) - textbook(c, *media(name, wavelength))
    if light == "unpolarized":
        difference = np.mean(difference, axis=0, keepdims=True)
    return np.max(np.abs(difference), axis=0)


@functools.cache
def brute(name, model, light, wavelengths=WAVELENGTHS, angles=ANGLES):
    scene = SCENES[name]
    wavelength = np.linspace(*scene.wavelength_um, wavelengths)[:, None]
    angle = np.broadcast_to(np.linspace(*scene.angle_deg, angles), (wavelengths, angles))
    if model.dtype == "float32" and name == "water from below":
        # an error of sqrt(eps) within eps of the critical angle
        n, _, m = media(name, wavelength)
        near = np.random.default_rng(20261121).uniform(-1e-4, 1e-4, (wavelengths, 2000))
        angle = np.hstack([angle, np.degrees(np.arcsin(n / m)) + near])
    return np.max(errors(name, model, wavelength, angle, light))
