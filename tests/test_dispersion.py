"""Dispersion models against many digits, quadrature and conservation laws."""

import equinox as eqx
import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from scipy import integrate, interpolate

from fresnel_jax import reflectance
from fresnel_jax._faddeeva import faddeeva
from fresnel_jax.dispersion import (
    HC_EV_UM,
    BrendelBormann,
    Cauchy,
    Constant,
    DrudeLorentz,
    Material,
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
def test_faddeeva_function_and_its_derivative(dtype):
    """Against mpmath's complementary error function, which has its own series and fractions."""
    random = np.random.default_rng(5)
    x = np.concatenate([random.uniform(-10, 10, 40), random.normal(0, 200, 20)]).astype(dtype)
    y = (10.0 ** random.uniform(-4, 1.5, 60)).astype(dtype)
    compiled = jax.jit(lambda x, y: jax.jvp(faddeeva, (x, y), (jnp.ones_like(x), 0 * y)))
    (re, im), (d_re, d_im) = compiled(x, y)
    assert re.dtype == d_re.dtype == dtype
    errors, slope_errors = [], []
    with mp.workdps(60):
        for i in range(60):
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
    gradient = jax.jit(jax.grad(value, (0, 1), allow_int=True))(model, wavelengths)
    compiled = jax.jit(value)
    leaves, tree = jax.tree.flatten((model, wavelengths))
    slopes = jax.tree.leaves(gradient)
    assert len(leaves) == len(slopes)
    step = 1e-6
    for i, (leaf, slope) in enumerate(zip(leaves, slopes, strict=True)):
        for position in np.ndindex(leaf.shape):
            up, down = (
                compiled(*jax.tree.unflatten(tree, [*leaves[:i], moved, *leaves[i + 1 :]]))
                for moved in (leaf.at[position].add(step), leaf.at[position].add(-step))
            )
            difference = float((up - down) / (2 * step))
            np.testing.assert_allclose(slope[position], difference, rtol=2e-6, atol=2e-8)


def test_tables_are_met_exactly_and_never_overshoot():
    """Against scipy's interpolant with the same slopes, and by what it is chosen for."""
    random = np.random.default_rng(11)
    knots = np.cumsum(random.uniform(0.01, 0.2, 40)) + 0.2
    eta, k = random.uniform(0.2, 4.0, 40), np.sort(10.0 ** random.uniform(-25, 1, 40))[::-1]
    table = Tabulated(knots, eta, k)
    at_knots = table(knots)
    np.testing.assert_array_equal(at_knots.eta, eta)
    np.testing.assert_array_equal(at_knots.k, k)
    fine = np.linspace(knots[0], knots[-1], 4001)
    result = table(fine)
    np.testing.assert_allclose(
        result.eta, interpolate.PchipInterpolator(knots, eta)(fine), rtol=1e-13
    )
    np.testing.assert_allclose(
        result.k, interpolate.PchipInterpolator(knots, k)(fine), rtol=1e-9, atol=1e-15
    )
    left = np.clip(np.searchsorted(knots, fine, side="right") - 1, 0, 38)
    for values, column in ((result.eta, eta), (result.k, k)):
        bounds = np.sort([column[left], column[left + 1]], axis=0)
        assert (np.asarray(values) >= bounds[0] * (1 - 1e-15)).all()
        assert (np.asarray(values) <= bounds[1] * (1 + 1e-15)).all()
    assert (np.diff(np.asarray(result.k)) <= 0).all()  # over 26 decades
    slope = jax.vmap(jax.grad(lambda w: table(w).eta))
    inner = knots[1:-1]
    np.testing.assert_allclose(slope(inner * (1 - 1e-13)), slope(inner), atol=1e-7)


def test_a_flat_table_has_finite_derivatives():
    """Both secants are 0 there, and so is the denominator of their harmonic mean."""
    flat = Tabulated(np.array([0.4, 0.6, 0.8, 1.0]), np.full(4, 1.5))
    assert jax.grad(lambda w: flat(w).eta)(0.7) == 0.0
    by_table = jax.grad(lambda t: t(jnp.array(0.7)).eta)(flat)
    assert np.isfinite(by_table.eta).all() and np.isfinite(by_table.wavelength_um).all()
    np.testing.assert_allclose(by_table.eta, [0.0, 0.5, 0.5, 0.0], atol=1e-15)


def test_interpolation_error_falls_with_the_step():
    """As the cube of the step where the function is monotone, the slopes being second-order."""

    def largest_error(rows):
        knots = np.linspace(0.3, 1.0, rows)
        fine = np.linspace(0.35, 0.95, 2001)
        return np.abs(
            np.asarray(Tabulated(knots, 1 + knots**-2.0)(fine).eta) - 1 - fine**-2.0
        ).max()

    coarse, fine = largest_error(41), largest_error(81)
    assert 6.5 < coarse / fine < 20.0
    assert fine < 2e-5


@both_types
def test_small_tables_and_types(dtype):
    line = Tabulated(np.array([0.4, 0.8], dtype), np.array([1.0, 2.0], dtype))
    eta, k = line(np.array([0.4, 0.5, 0.8], dtype))
    assert eta.dtype == dtype
    np.testing.assert_allclose(eta, [1.0, 1.25, 2.0], rtol=4 * np.finfo(dtype).eps)
    assert not np.asarray(k).any()
    # k whose products of slopes underflow in float32
    knots, k = np.array([0.4, 0.6, 0.8, 1.0]), np.array([1e-22, 3e-23, 1e-24, 1e-25])
    between = np.array([0.5, 0.7, 0.9])
    tiny = Tabulated(knots.astype(dtype), np.ones(4, dtype), k.astype(dtype))
    true = interpolate.PchipInterpolator(knots, k * 1e25)(between) * 1e-25
    np.testing.assert_allclose(tiny(between.astype(dtype)).k, true, rtol=64 * np.finfo(dtype).eps)


def test_wavelengths_outside_are_refused_or_nan():
    glass = Material(GLASS, (0.3, 2.5), "BK7")
    with pytest.raises(ValueError, match=r"BK7 is known from 0.3 to 2.5 um.*of 3 um came"):
        glass(np.array([0.5, 3.0]))
    with pytest.raises(ValueError, match=r"550 nm is 0.55"):
        glass(550.0)
    with pytest.raises(ValueError, match="nan um came"):
        glass(np.nan)
    wavelengths = jnp.array([0.1, 0.5, 3.0])
    eta, k = eqx.filter_jit(glass)(wavelengths)
    np.testing.assert_array_equal(np.isnan(eta), [True, False, True])
    np.testing.assert_array_equal(np.isnan(k), [True, False, True])
    # what lies outside, here on a pole, does not reach the derivative of what lies inside
    on_pole = Material(Sellmeier([1.0], [0.25]), (0.6, 2.5), "pole")
    slopes = jax.jit(jax.grad(lambda w: on_pole(w).eta[1]))(jnp.array([0.5, 0.7, 3.0]))
    assert slopes[1] != 0.0 and np.isfinite(slopes).all()
    # ends that were computed in other units
    assert np.isfinite(glass(2500.0 * 1e-3 * (1 + 2e-16)).eta)
    assert np.isfinite(Material(GLASS, (0.24797, 2.5))(np.float32(0.24797)).eta)
    # the formula itself extrapolates, a table does not
    assert np.isfinite(glass.model(3.0).eta)
    table = MODELS["table"]
    with pytest.raises(ValueError, match=r"the table is known from 0.3 to 1.4 um"):
        table(1.5)
    assert np.isnan(jax.jit(lambda t, w: t(w).eta)(table, 1.5))
    assert np.isfinite(Material(GLASS, None)(20.0).eta)


def test_models_are_pytrees_that_map_and_compile():
    widths = jnp.array([[0.05], [0.1], [0.2]])
    models = jax.vmap(lambda g: DrudeLorentz([80.0], [0.0], g))(widths)
    eta, k = jax.jit(jax.vmap(lambda m, w: m(w), (0, None)))(models, jnp.array([0.5, 0.6]))
    assert eta.shape == k.shape == (3, 2)
    one = DrudeLorentz([80.0], [0.0], [0.1])(np.array([0.5, 0.6]))
    np.testing.assert_allclose(eta[1], one.eta, rtol=1e-14)
    # a metal's reflectance, differentiated with respect to the damping of its electrons
    slope = jax.jit(jax.grad(lambda m: reflectance(0.8, *m(0.6))))(drude(9.0, 0.05))
    assert np.isfinite(slope.widths_ev).all() and slope.widths_ev[0] < 0


def test_types_and_shapes_of_what_comes_back():
    single = typed(GLASS, np.float32)
    assert GLASS(np.float32(0.5)).eta.dtype == np.float32
    assert single(np.float64(0.5)).eta.dtype == np.float64
    assert single(0.5).eta.dtype == np.float32 and GLASS(0.5).eta.dtype == np.float64
    assert GLASS([1, 2]).eta.dtype == np.float64
    assert Constant(1.5)(np.ones((2, 3), np.float32)).k.shape == (2, 3)
    assert Constant(1.5)(np.ones(2, np.float32)).eta.dtype == np.float32


@pytest.mark.parametrize(
    "build, text",
    [
        (lambda: Sellmeier([1.0, 2.0], [0.1]), r"strengths \(2,\), poles_um2 \(1,\)"),
        (lambda: Sellmeier([1.0], [0.1], 1.0, [0.1]), "as many powers as coefficients"),
        (lambda: Cauchy([1.5, 0.1], [0]), "as many powers as coefficients"),
        (lambda: DrudeLorentz([1.0], [0.0, 1.0], [0.1, 0.1]), "resonances_ev"),
        (lambda: BrendelBormann(1.0, 0.1, [1.0], [1.0], [0.1], [0.1, 0.2]), "deviations_ev"),
        (lambda: Tabulated([0.4, 0.3], [1.5, 1.5]), "ascending"),
        (lambda: Tabulated([0.3], [1.5]), "at least two"),
        (lambda: Tabulated([0.3, 0.4], [1.5]), "eta has shape"),
        (lambda: Tabulated([0.3, 0.4], [1.5, 1.5], [0.1, -0.1]), "k holds a value"),
        (lambda: Tabulated([0.3, 0.4], [1.5, np.nan]), "eta holds a value"),
        (lambda: Material(GLASS, (2.5, 0.3)), "the shorter one first"),
    ],
)
def test_wrong_parameters_are_refused(build, text):
    with pytest.raises(ValueError, match=text):
        build()
