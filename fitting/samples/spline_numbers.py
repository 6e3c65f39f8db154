"""The number of splines of a sample whose text does not give it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fitting.measurements.measurement import Measurement
from fitting.samples.dispersion import Model
from fitting.samples.sample import Sample
from fitting.samples.spline_index import NAME, usual_terms


def with_numbers(sample: Sample, measurements: Sequence[Measurement]) -> Sample:
    """Return the sample with the number of splines that suits these data in its text."""
    if not any(m.index == Model(NAME, 0) for m in sample.media):
        return sample
    wavelengths = np.concatenate([m.wavelength_um for m in measurements])
    known = wavelengths[np.isfinite(wavelengths)]
    which = Model(NAME, usual_terms(len(np.unique(known)), len(known)))
    return Sample(
        tuple(
            m._replace(index=which, text=str(which)) if m.index == Model(NAME, 0) else m
            for m in sample.media
        )
    )
