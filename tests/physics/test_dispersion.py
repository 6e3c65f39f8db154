"""Dispersion models against many digits, quadrature and conservation laws."""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from scipy import integrate

from fresnel_jax._numerics.faddeeva import faddeeva
from fresnel_jax.dispersion import (
    HC_EV_UM,
    BrendelBormann,
    Cauchy,
    Constant,
    DrudeLorentz,
    Sellmeier,
    Tabulated,
    drude,
    lorentz_drude,
)

both_types = pytest.mark.parametrize("dtype", [np.float64, np.float32])


def exact(x):
    """The binary numbers of an array as mpmath numbers."""
    return [mp.mpf(float(v)) for v in np.atleast_1d(np.asarray(x))]


def true_energy(wavelength):
    """Photon energy in eV from the defining constants of the SI."""
    h, c, e = mp.mpf("6.62607015e-34"), 299792458, mp.mpf("1.602176634e-19")
    return h * c / e * mp.mpf(10) ** 6 / wavelength


def true_index(permittivity):
    """The root with a positive imaginary part (or a positive real one)."""
    root = mp.sqrt(permittivity)
    return -root if root.imag < 0 else root


def sellmeier_permittivity(model, wavelength):
    square = wavelength**2
    total = exact(model.constant)[0]
    for b, c in zip(exact(model.strengths), exact(model.poles_um2), strict=True):
        total += b * square / (square - c)
    for a, power in zip(exact(model.coefficients), model.powers, strict=True):
        total += a * wavelength**power
    return mp.mpc(total)


def oscillator_permittivity(model, wavelength):
    energy = true_energy(wavelength)
    total = mp.mpc(exact(model.eps_inf)[0])
    fields = (model.strengths_ev2, model.resonances_ev, model.widths_ev)
    for s, e, g in zip(*map(exact, fields), strict=True):
        total += s / (e**2 - energy**2 - mp.j * energy * g)
    return total


def gaussian_permittivity(model, wavelength):
    """Brendel and Bormann's definition: Lorentz terms averaged over a Gaussian of resonances."""
    energy = true_energy(wavelength)
    s_0, g_0 = exact(model.drude_strength_ev2)[0], exact(model.drude_width_ev)[0]
    total = exact(model.eps_inf)[0] - s_0 / (energy * (energy + mp.j * g_0))
    fields = (model.strengths_ev2, model.resonances_ev, model.widths_ev, model.deviations_ev)
    for s, e, g, d in zip(*map(exact, fields), strict=True):

        def weighted(x, s=s, e=e, g=g, d=d):
            gauss = mp.exp(-((x - e) ** 2) / (2 * d**2)) / (mp.sqrt(2 * mp.pi) * d)
            return gauss * s / (x**2 - energy**2 - mp.j * energy * g)

        cuts = {e + i * d for i in range(-12, 13, 2)}
        for pole in (energy, -energy):  # where the Lorentz term is steep
            if abs(pole - e) < 12 * d:
                cuts |= {pole - g, pole, pole + g}
        total += mp.quad(weighted, sorted(cuts))
    return total


def worst_error(model, permittivity, wavelengths, digits=40):
    """Largest relative error of eta and of k (k where it is not 0) in eps."""
    eps = float(np.finfo(wavelengths.dtype).eps)
    eta, k = model(wavelengths)
    assert eta.dtype == k.dtype == wavelengths.dtype and eta.shape == wavelengths.shape
    errors = []
    with mp.workdps(digits):
        for i, wavelength in enumerate(exact(wavelengths)):
            true = true_index(permittivity(model, wavelength))
            for value, part in ((eta[i], true.real), (k[i], true.imag)):
                if part == 0:
                    assert float(value) == 0.0
                else:
                    errors.append(abs(mp.mpf(float(value)) / part - 1))
    return float(max(errors)) / eps


def typed(model, dtype):
    """The model with parameters of one type, so that oracle and model see the same numbers."""
    return jax.tree.map(lambda x: jnp.asarray(x, dtype), model)


GLASS = Sellmeier([1.03961212, 0.231792344, 1.01046945], [0.00600069867, 0.0200179144, 103.560653])
CRYSTAL = Sellmeier([1.5], [0.0143], 1.42, [-0.0106, -2.05e-5], [2, 4])
METAL = lorentz_drude(
    9.03, [0.76, 0.024, 0.01, 0.071], [0.053, 0.241, 0.345, 0.87], [0.0, 0.415, 0.83, 2.969]
)
ABSORBER = DrudeLorentz([3.0, 40.0], [4.0, 9.0], [0.3, 1e-20], 1.2)
BROADENED = BrendelBormann(
    62.8, 0.05, [4.4, 4.08, 25.4], [0.218, 2.885, 4.069], [0.074, 0.035, 0.083],
    [0.742, 0.349, 0.83],
)  # fmt: skip


@both_types
@pytest.mark.parametrize(
    "model, permittivity, low, high, bound",
    [
        (GLASS, sellmeier_permittivity, 0.3, 2.5, 3),
        (CRYSTAL, sellmeier_permittivity, 0.36, 5.4, 3),
        (METAL, oscillator_permittivity, 0.25, 6.0, 12),
        (drude(9.0, 0.05, 1.5), oscillator_permittivity, 0.2, 100.0, 12),
        (ABSORBER, oscillator_permittivity, 0.35, 20.0, 12),
    ],
)
def test_formulas_against_many_digits(dtype, model, permittivity, low, high, bound):
    model = typed(model, dtype)
    wavelengths = np.geomspace(low, high, 97).astype(dtype)
    assert worst_error(model, permittivity, wavelengths) <= bound


@both_types
def test_cauchy_against_many_digits(dtype):
    model = typed(Cauchy([1.513, -0.003169, 0.003962], [0, 2, -2]), dtype)
    usual = typed(Cauchy([1.5, 0.004, 1e-4]), dtype)
    wavelengths = np.geomspace(0.31, 4.6, 33).astype(dtype)
    for tested, powers in ((model, (0, 2, -2)), (usual, (0, -2, -4))):
        eta, k = tested(wavelengths)
        assert eta.dtype == dtype and not np.asarray(k).any()
        true = [
            sum(a * w**p for a, p in zip(exact(tested.coefficients), powers, strict=True))
            for w in exact(wavelengths)
        ]
        true = np.array([float(x) for x in true])
        np.testing.assert_allclose(eta, true, rtol=4 * np.finfo(dtype).eps)


@both_types
def test_k_keeps_its_digits_however_small(dtype):
    """Far from a narrow resonance k is 1e-24 (1e-12 in float32) beside an eta of 1.5."""
    width = 1e-23 if dtype is np.float64 else 1e-11
    model = typed(DrudeLorentz([100.0], [10.0], [width]), dtype)
    wavelengths = np.linspace(0.4, 2.0, 17).astype(dtype)
    assert 0 < float(model(wavelengths).k.max()) < width
    assert worst_error(model, oscillator_permittivity, wavelengths) <= 12


@both_types
def test_sellmeier_next_to_a_pole(dtype):
    """Wavelengths 1 to 1e5 eps from it, where l^2 - C from rounded squares has no digit left."""
    eps = np.finfo(dtype).eps
    model = typed(Sellmeier([1.0], [0.0143]), dtype)
    pole = np.sqrt(np.asarray(model.poles_um2)[0])
    wavelengths = (pole * (1 + eps * np.array([2, 4, 32, 1e3, 1e5]))).astype(dtype)
    assert worst_error(model, sellmeier_permittivity, wavelengths) <= 3
    below = (pole * (1 - eps * np.array([4, 32, 1e3]))).astype(dtype)
    eta, k = model(below)
    assert not np.asarray(eta).any() and (np.asarray(k) > 1).all()
    assert worst_error(model, sellmeier_permittivity, below) <= 3


def test_sellmeier_on_a_pole_is_infinite_and_documented():
    model = Sellmeier([1.0], [0.25])
    assert model(0.5).eta == np.inf and model(0.5).k == 0.0
    assert not np.isfinite(jax.grad(lambda w: model(w).eta)(0.5))


@both_types
@pytest.mark.parametrize("count", [20, pytest.param(60, marks=pytest.mark.study)])
def test_faddeeva_function_and_its_derivative(dtype, count):
    """Against mpmath's complementary error function, which has its own series and fractions."""
    random = np.random.default_rng(5)
    x = np.where(
        np.arange(count) < 2 * count // 3, random.uniform(-10, 10, count),
        random.normal(0, 200, count),
    ).astype(dtype)  # fmt: skip
    y = (10.0 ** random.uniform(-4, 1.5, count)).astype(dtype)
    compiled = jax.jit(lambda x, y: jax.jvp(faddeeva, (x, y), (jnp.ones_like(x), 0 * y)))
    (re, im), (d_re, d_im) = compiled(x, y)
    assert re.dtype == d_re.dtype == dtype
    errors, slope_errors = [], []
    with mp.workdps(60):
        for i in range(count):
            z = mp.mpc(float(x[i]), float(y[i]))
            # beyond |z| = 25 the continued fraction has 60 digits and erfc none that count
            if abs(z) < 25:
                with mp.workdps(600):
                    w = mp.exp(-z * z) * mp.erfc(-mp.j * z)
            else:
                w = mp.mpf(0)
                for j in range(120, 0, -1):
                    w = mp.mpf(j) / 2 / (z - w)
                w = mp.j / mp.sqrt(mp.pi) / (z - w)
            slope = -2 * z * w + 2 * mp.j / mp.sqrt(mp.pi)
            errors.append(abs(mp.mpc(float(re[i]), float(im[i])) - w) / abs(w))
            slope_errors.append(abs(mp.mpc(float(d_re[i]), float(d_im[i])) - slope) / abs(slope))
    bound = 2.5e-14 if dtype is np.float64 else 10 * np.finfo(dtype).eps
    assert max(errors) < bound
    assert max(slope_errors) < (1e-11 if dtype is np.float64 else 20 * np.finfo(dtype).eps)


@pytest.mark.study
@both_types
def test_brendel_bormann_is_the_average_over_a_gaussian(dtype):
    """By quadrature of the definition; float64 errors come from the Faddeeva function."""
    model = typed(BROADENED, dtype)
    wavelengths = np.array([0.3, 0.55, 6.0], dtype)
    bound = 100 if dtype is np.float64 else 12
    assert worst_error(model, gaussian_permittivity, wavelengths, digits=20) <= bound


def permittivity(model, energy):
    eta, k = model(HC_EV_UM / energy)
    return np.asarray((eta + 1j * k) ** 2)


@pytest.mark.parametrize("at", [0.3, 2.5, 4.0, 8.0, 20.0])
def test_oscillators_obey_kramers_and_kronig(at):
    """Re eps from a principal-value integral over Im eps, Drude term included."""
    model = DrudeLorentz([20.0, 30.0, 10.0], [0.0, 4.0, 7.0], [0.5, 0.8, 1.5], 1.3)

    def dissipated(energy):
        return energy * permittivity(model, energy).imag / (energy + at)

    principal, _ = integrate.quad(
        dissipated, 1e-9, 60.0, weight="cauchy", wvar=at, limit=400, epsabs=1e-11
    )
    tail, _ = integrate.quad(
        lambda e: dissipated(e) / (e - at), 60.0, np.inf, limit=400, epsabs=1e-11
    )
    true = 1.3 + 2 / np.pi * (principal + tail)
    np.testing.assert_allclose(permittivity(model, at).real, true, atol=1e-6)


def test_oscillators_obey_the_sum_rule():
    """The integral of E Im eps is pi / 2 times all squared plasma energies."""
    model = DrudeLorentz([20.0, 30.0], [0.0, 4.0], [0.5, 0.8])
    below, _ = integrate.quad(lambda e: e * permittivity(model, e).imag, 1e-9, 50.0, limit=400)
    above, _ = integrate.quad(lambda e: e * permittivity(model, e).imag, 50.0, np.inf, limit=400)
    np.testing.assert_allclose(below + above, np.pi / 2 * 50.0, rtol=1e-6)


MODELS = {
    "constant": Constant(1.5, 0.1),
    "cauchy": Cauchy([1.5, 0.004, 1e-4]),
    "sellmeier": CRYSTAL,
    "oscillators": METAL,
    "broadened": BROADENED,
    "table": Tabulated(
        [0.3, 0.5, 0.7, 1.0, 1.4], [1.0, 1.6, 1.5, 1.3, 1.2], [2.0, 1.0, 0.2, 0, 0.1]
    ),
}


@pytest.mark.parametrize("name", MODELS)
def test_derivatives_against_differences(name):
    """With respect to the wavelength and to every parameter."""
    model = MODELS[name]

    def value(model, wavelength):
        eta, k = model.index(wavelength)
        return jnp.sum(eta) + 0.7 * jnp.sum(k)

    wavelengths = jnp.array([0.55, 0.81, 1.2])
    # one program for both
    compiled = jax.jit(jax.value_and_grad(value, (0, 1), allow_int=True))
    gradient = compiled(model, wavelengths)[1]
    leaves, tree = jax.tree.flatten((model, wavelengths))
    slopes = jax.tree.leaves(gradient)
    assert len(leaves) == len(slopes)
    step = 1e-6
    for i, (leaf, slope) in enumerate(zip(leaves, slopes, strict=True)):
        for position in np.ndindex(leaf.shape):
            up, down = (
                compiled(*jax.tree.unflatten(tree, [*leaves[:i], moved, *leaves[i + 1 :]]))[0]
                for moved in (leaf.at[position].add(step), leaf.at[position].add(-step))
            )
            difference = float((up - down) / (2 * step))
            np.testing.assert_allclose(slope[position], difference, rtol=2e-6, atol=2e-8)
