"""Candidates of `choose` that share a compiled program, and derivatives by partial ones."""

import jax
import numpy as np
import pytest

from fitting.data.measurement import Measurement
from fitting.fits import fit_checked
from fitting.optics.observe import predicted
from fitting.optics.spec import NCS
from fitting.problem.observations import observations
from fitting.problem.problem import FitOptions
from fitting.problem.programs import Residuals, targets_of
from fitting.problem.unknowns import spectrum_of, unknowns
from fitting.samples.dispersion import parse_model, wider
from fitting.samples.parameters import Settings
from fitting.samples.sample import Sample
from fitting.searching.starts import starts
from tests.truth.simulated import textbook

WAVES = np.linspace(0.4, 1.0, 24)


def measured(**values):
    angle, wavelength = np.repeat([55.0, 70.0], len(WAVES)), np.tile(WAVES, 2)
    columns = {name: np.full(len(angle), value) for name, value in values.items()}
    return Measurement.from_columns(angle, wavelength, **columns)


def of(m, sample, settings):
    seen = observations([m], "equal")
    which = Sample.parse(sample)
    return seen, unknowns(which, spectrum_of([m], which), settings, seen, "squares")


@pytest.mark.study
@pytest.mark.parametrize(("sample", "free", "values"), [
    ("lorentz:1", ("angle_offset", "divergence", "scale"), {"R_s": 0.4, "R_p": 0.3}),
    ("air | lorentz:1 3 um thick | air", (), {"T": 0.2, "R": 0.1}),
    ("air | lorentz:1 110 nm | 3.88+0.016i", (), {"R_p": 0.2, "psi": 20.0, "delta": 100.0}),
])  # fmt: skip
def test_the_derivative_is_the_sum_over_the_partial_ones(sample, free, values):
    seen, u = of(measured(**values), sample, Settings(free))
    y = starts(u.moving, 4, 3)
    direction = np.random.default_rng(1).standard_normal(y.shape)

    def shown(y, directions):
        v = u.spec.values(y, u.held)
        found = predicted(u.spec, v, seen.points, np.float64(1.0), directions)
        return [row for c in u.spec.channels for row in (found[c] if c == NCS else [found[c]])]

    @jax.jit
    def both(y, direction):
        return [jax.jvp(lambda y, n=n: shown(y, n), (y,), (direction,))[1] for n in (1, 99)]

    with jax.enable_x64(True):
        whole, summed = (np.array(a) for a in both(y, direction))
    assert np.isfinite(whole).all() and np.abs(whole).min(axis=(1, 2)).max() > 0.0
    scale = np.abs(whole).max()
    np.testing.assert_allclose(summed, whole, rtol=1e-9, atol=1e-12 * scale)


@pytest.mark.parametrize(
    ("sample", "factor"),
    [
        pytest.param("air | lorentz:2 110 nm | BK7 1 mm thick | air", 3, marks=pytest.mark.study),
        ("air | lorentz:2 110 nm | 3.88+0.016i", 1.5),
    ],
)
def test_the_solver_forms_no_further_derivative_of_a_film_for_a_further_unknown(sample, factor):
    seen, u = of(measured(R_p=0.2), sample, Settings())
    targets = targets_of(u, seen, np.float64(1.0))

    def work(residuals):
        """Return the floating-point operations of one more direction."""

        def several(y, count):
            along = jax.linearize(residuals, y)[1]
            return [along(y) for _ in range(count)]

        y = np.asarray(starts(u.moving, 4, 3))
        some = [jax.jit(several, static_argnums=1).lower(y, count) for count in (1, 2)]
        return np.diff([lowered.cost_analysis()["flops"] for lowered in some])[0]

    def plain(y):
        v = u.spec.values(y, u.held)
        return predicted(u.spec, v, seen.points, targets.eta_i)["R_p"]

    with jax.enable_x64(True):
        assert factor * work(lambda y: Residuals(u.spec)(y, targets)[0]) < work(plain)


FAMILIES = [
    ("cauchy:2", "cauchy:3", "cauchy-urbach:2"),
    ("sellmeier:1", "sellmeier:2"),
    ("drude", "lorentz:1", "drude-lorentz:1"),
    ("lorentz:2", "drude-lorentz:2"),
]


@pytest.mark.parametrize("family", FAMILIES, ids=" ".join)
def test_special_cases_have_the_program_of_the_wider_model(family):
    m = measured(R_s=0.3, psi=20.0, delta=100.0)
    own = [of(m, model, Settings()) for model in family]
    shared = [of(m, model, Settings(shared=True)) for model in family]
    assert {u.spec for _, u in shared} == {shared[-1][1].spec}
    assert len({u.spec for _, u in own}) == len(family)
    for (_, a), (_, b), name in zip(own, shared, family, strict=True):
        assert wider(wider(parse_model(name))) == wider(parse_model(name))
        free = {w.parameter.name: w for w in a.moving}
        assert {w.parameter.name: w for w in b.moving if w.free} == free
        assert [b.labels[n] for n in free] == [a.labels[n] for n in free]
        # the same starts, for what is free
        at = [w.parameter.name for w in b.moving]
        rows = [at.index(w.parameter.name) for w in a.moving]
        np.testing.assert_array_equal(starts(b.moving, 64, 5)[rows], starts(a.moving, 64, 5))


@pytest.mark.study
@pytest.mark.parametrize(
    "model",
    ["cauchy:2", "sellmeier:1", "lorentz:1", pytest.param("drude", marks=pytest.mark.study)],
)
def test_a_special_case_is_the_same_fit_in_the_wider_program(model):
    rng = np.random.default_rng(7)
    angle, wavelength = np.repeat([55.0, 70.0], len(WAVES)), np.tile(WAVES, 2)
    eta = 1.5 + 0.01 / wavelength**2
    k = 0.0 * eta if model in ("cauchy:2", "sellmeier:1") else 0.3 + wavelength
    data = {
        q: textbook(angle, np.full(len(angle), q), eta, k) + 1e-3 * rng.standard_normal(len(angle))
        for q in ("R_s", "R_p")
    }
    m = Measurement.from_columns(angle, wavelength, sigma=1e-3, **data)
    asked = FitOptions("scaled", "quadratic")
    alone, shared = (
        fit_checked([m], Sample.parse(model), Settings(shared=wide), asked)
        for wide in (False, True)
    )
    assert list(shared.parameters) == list(alone.parameters)
    assert (shared.status, shared.dof) == (alone.status, alone.dof)
    assert shared.bic == pytest.approx(alone.bic, abs=1e-4)
    for name, e in alone.parameters.items():
        assert shared.parameters[name].value == pytest.approx(e.value, abs=0.02 * e.sigma + 1e-9)
        assert shared.parameters[name].sigma == pytest.approx(e.sigma, rel=1e-3, nan_ok=True)
    assert [w.code for w in shared.warnings] == [w.code for w in alone.warnings]
    values = [f.fitted for f in (alone, shared)]
    np.testing.assert_allclose(values[1], values[0], atol=1e-6)
