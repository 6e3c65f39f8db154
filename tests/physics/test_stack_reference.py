"""Stacks against what others published: the reference reflectivities of ORSO.

Neutron reflectivity is the s problem with N_j^2 = 1 - wavelength^2 (SLD_j - SLD_0) / pi and
cos(theta) = Q wavelength / 4 pi. The answers are those that the programs of the Open Reflectometry
Standards Organisation agree on.
"""

import numpy as np
import pytest

from fresnel_jax.layers import stack


def _orso(folder, number):
    layers = np.loadtxt(folder / f"test{number}.layers", ndmin=2)
    data = np.loadtxt(folder / f"test{number}.dat", usecols=(0, 1))
    return layers, data[:, 0], data[:, 1]


@pytest.mark.study
@pytest.mark.parametrize(
    ("number", "within"),
    [pytest.param(n, 1e-4, marks=[pytest.mark.study] * (n in (0, 1))) for n in (0, 1, 2, 3, 6, 7)],
)
def test_neutron_stacks_of_orso(measured_files, number, within):
    folder = measured_files / "orso"
    layers, Q, R = _orso(folder, number)
    wavelength = 4.0 * np.pi / Q.max() * 0.99  # angstrom, but any unit will do
    sld = 1e-6 * (layers[:, 1] - layers[0, 1] + 1j * layers[:, 2])
    index = np.sqrt(1.0 - wavelength**2 * np.conj(sld) / np.pi)
    index[0] = 1.0
    index = index.real + 1j * np.abs(index.imag)
    rough = layers[1:, 3, None]
    # as many of each at least, so that stacks of as many layers are one compiled program
    wide = np.pad(Q, (0, max(0, 1001 - len(Q))), mode="edge")
    got = stack(
        wide * wavelength / (4.0 * np.pi),
        index[:, None],
        thickness_um=layers[1:-1, 0, None],
        wavelength_um=wavelength,
        roughness_um=rough if np.any(rough) else None,
    )
    error = np.abs(np.asarray(got.R_s)[: len(R)] - R) / R
    assert np.max(error) < within
