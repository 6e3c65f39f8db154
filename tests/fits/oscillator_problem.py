"""A least-squares problem with the spectrum of a sample that has oscillators."""

import numpy as np

from fitting import Measurement, Sample, simulate
from fitting.problem.observations import observations
from fitting.problem.problem import FitOptions, Problem
from fitting.problem.programs import targets_of
from fitting.problem.unknowns import index_outside, spectrum_of, unknowns
from fitting.samples.parameters import Settings

ENERGY = np.linspace(1.3, 4.1, 40)


def measured(sample, values, columns):
    wavelength = 1.239841984 / ENERGY
    data = {q: simulate(sample, values, 65.0, wavelength, q) for q in columns}
    return Measurement.from_columns(65.0, wavelength, sigma=1e-3, **data)


def job(sample, m):
    read = Sample.parse(sample)
    seen = observations([m], "stated")
    u = unknowns(read, spectrum_of([m], read), Settings(), seen, "squares")
    outside = index_outside(read, seen.points.wavelength_um)
    return Problem(u, seen, targets_of(u, seen, outside), Settings(), FitOptions())
