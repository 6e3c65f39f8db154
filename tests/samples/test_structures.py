"""Rows of a model fit whose wavelengths repeat: the index is evaluated once for each wavelength."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from fitting import Measurement
from fitting.optics.observe import predicted
from fitting.optics.spec import NCS, Spec
from fitting.problem.observations import observations
from fitting.problem.unknowns import media_of
from fitting.samples.sample import Sample


def spec(channels, sample="cauchy:2"):
    media = media_of(Sample.parse(sample))
    names = ["substrate.A", "substrate.B"]
    if media.coherent:
        names = ["plate.A", "plate.B", "plate.thickness_um", "substrate.eta", "substrate.k"]
    return Spec(
        media=media, channels=channels, moving=tuple(names),
        coordinates=("plain",) * len(names), held=(), curves=((0,),) * len(channels),
    )  # fmt: skip


def measured(angles, wavelengths, **values):
    """Return all angles at all wavelengths, in an order of their own, some of them twice."""
    angle, wavelength = (a.ravel() for a in np.meshgrid(angles, wavelengths))
    order = np.random.default_rng(2).permutation(np.r_[: len(angle), :5])
    columns: dict[str, Any] = {name: np.full(len(order), value) for name, value in values.items()}
    return Measurement.from_columns(angle[order], wavelength[order], **columns)


@pytest.mark.parametrize(("sample", "values"), [
    ("cauchy:2", {"R_s": 0.1, "R_p": 0.1}),
    ("cauchy:2", {"psi": 20.0, "delta": 100.0, "R": 0.1}),
    ("air | cauchy:2 1 mm thick | air", {"T": 0.9, "R": 0.1}),
])  # fmt: skip
def test_the_same_as_at_every_row(sample, values):
    seen = observations(
        [measured([50.0, 60.0, 70.0], np.linspace(0.4, 0.8, 31), **values)], "equal"
    )
    points = seen.points
    assert points.place is not None and len(points.distinct_um) == 32  # padded by one
    np.testing.assert_array_equal(points.distinct_um[points.place], points.wavelength_um)
    one = spec(seen.channels, sample)
    two = [(1.5, 2.0), (0.01, 0.03), (1e3, 2e3), (1.0, 1.0), (0.0, 0.0)]
    at = {name: jnp.array(pair) for name, pair in zip(one.moving, two, strict=False)}
    once = predicted(one, at, points, 1.0)
    each = predicted(one, at, points._replace(distinct_um=None, place=None), 1.0)
    for channel in seen.channels:
        pairs = zip(once[channel], each[channel], strict=True) if channel == NCS else [
            (once[channel], each[channel])
        ]  # fmt: skip
        for a, b in pairs:
            assert a.shape == (len(points.wavelength_um), 2)
            # the same numbers, compiled apart
            np.testing.assert_allclose(a, b, rtol=1e-14, atol=1e-15)


def test_rows_that_do_not_repeat_are_left_alone():
    wavelengths = np.linspace(0.4, 0.8, 40)
    one_angle = Measurement.from_columns(60.0, wavelengths, psi=20.0, delta=100.0)
    one_wavelength = Measurement.from_columns(np.linspace(40.0, 70.0, 20), 0.5, R_s=0.1)
    without = Measurement.from_columns(np.linspace(40.0, 70.0, 20), R_s=0.1)
    for m in (one_angle, one_wavelength, without):
        assert observations([m], "equal").points.place is None
