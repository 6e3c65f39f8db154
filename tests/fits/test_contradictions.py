"""What the data contradict is told: errors of the caller's own residuals, priors, bad functions."""

import jax.numpy as jnp
import numpy as np
import pytest

from fitting import fit_residuals

X = np.linspace(0.0, 1.0, 30)
Y = np.exp(-2.0 * X) + 0.01 * np.random.default_rng(0).standard_normal(30)
RANGES = {"a": (0.0, 3.0), "b": (0.0, 5.0)}


def decay(values, data):
    return (values["a"] * jnp.exp(-values["b"] * data[0]) - data[1]) / 0.01


def line(values, data):
    return (values["a"] * (1.0 - values["b"] * data[0]) - data[1]) / 0.01


def root(values, data):
    return jnp.sqrt(-1.0 - values["a"]) * data[0] - values["b"] * data[1]


def _codes(found):
    return {w.code for w in found.warnings}


@pytest.mark.parametrize("errors", ["scaled", "stated"])
def test_a_wrong_function_is_told(errors):
    assert not _codes(fit_residuals(decay, RANGES, (X, Y), errors=errors))
    found = fit_residuals(line, RANGES, (X, Y), errors=errors)
    assert "chi2_large" in _codes(found)
    assert "times the stated errors" in found.warnings[0].text


def test_residuals_in_another_unit_are_not_called_too_small():
    found = fit_residuals(lambda v, d: 0.01 * decay(v, d), RANGES, (X, Y))
    assert not _codes(found)


def test_a_prior_that_the_data_contradict():
    stated = {"errors": "stated", "priors": {"b": (3.0, 0.01)}}
    found = fit_residuals(decay, RANGES, (X, Y), **stated)
    [told] = [w for w in found.warnings if w.code == "prior_contradicted"]
    assert told.values["priors"]["b"][:2] == (3.0, 0.01)
    assert "the data contradict the prior of b, 3 +- 0.01" in told.text
    near = fit_residuals(decay, RANGES, (X, Y), errors="stated", priors={"b": (2.0, 0.01)})
    assert not _codes(near)
    both = (np.stack([X, X]), np.stack([Y, np.exp(-3.0 * X)]))
    batch = fit_residuals(decay, RANGES, both, batch=True, **stated)
    assert [("prior_contradicted" in _codes(batch[i])) for i in range(2)] == [True, False]


def test_residuals_that_are_nowhere_finite():
    gap = Y.copy()
    gap[3] = np.nan
    with pytest.raises(ValueError, match="1 of 30, the first of them number 3"):
        fit_residuals(decay, RANGES, (X, gap))
    with pytest.raises(ValueError, match="30 of 30"):
        fit_residuals(root, RANGES, (X + 1.0, Y))


def test_starting_values_of_a_logarithm_are_above_0():
    ranges = {"a": {"start": (-1.0, 3.0), "coordinate": "log"}, "b": (0.0, 5.0)}
    with pytest.raises(ValueError, match="starts from -1; starting values above 0 were wanted"):
        fit_residuals(decay, ranges, (X, Y))
