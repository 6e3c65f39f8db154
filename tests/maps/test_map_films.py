"""Maps of films: starts from a grid, fringe orders, shared parameters and their errors."""

import numpy as np
import pytest

from fitting import fit_map, simulate
from fitting.maps.cube import open_cube
from fitting.maps.map_store import BITS, ORDER, STATUS

xarray = pytest.importorskip("xarray", reason="the extra maps is not installed")
pytest.importorskip("zarr", reason="the extra maps is not installed")
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::DeprecationWarning")]
WAVELENGTH_UM = np.linspace(0.45, 0.8, 30)
SIGMA = 0.003


def cube(thickness, sample, **truth):
    """Spectra of films, of each different thickness once, with noise, as a DataArray in nm."""
    random = np.random.default_rng(6)
    known, which = np.unique(thickness, return_inverse=True)
    R = np.stack([
        simulate(sample, {**truth, "thickness_nm": d}, 0.0, WAVELENGTH_UM, "R") for d in known
    ])  # fmt: skip
    values = R[which.reshape(thickness.shape)]
    values = values + SIGMA * random.standard_normal(values.shape)
    coords = {"wavelength": ("wavelength", WAVELENGTH_UM * 1e3, {"units": "nm"})}
    return xarray.DataArray(values, dims=("y", "x", "wavelength"), coords=coords, name="R")


def test_another_fringe_order_between_the_pixels_of_the_grid_is_found_and_flagged(tmp_path):
    sample = "air | constant 60..1500 nm | 3.9"
    film = {"eta": 1.46, "k": 0.0}
    thickness = np.full((24, 24), 300.0)
    thickness[8:10, 8:10] = 900.0  # no pixel of the grid: 1, 4, 7, 10, ...
    found = fit_map(
        cube(thickness, sample, **film), sample, tmp_path / "m.zarr", sigma=SIGMA, angle_deg=0.0,
        fixed=film,
    )  # fmt: skip
    error = np.abs(found["thickness_nm"].values - thickness)
    assert (error < 5.0 * found["thickness_nm_sigma"].values).all()
    flagged = (found["warnings"].values & BITS[ORDER]) != 0
    np.testing.assert_array_equal(flagged, thickness == 900.0)


def test_shared_parameters_are_one_value_and_their_errors_are_carried_on(tmp_path):
    sample = "air | constant 100..900 nm | 3.9"
    thickness = 300.0 + np.add.outer(np.arange(12.0), np.arange(12.0)).round()
    data = cube(thickness, sample, eta=1.46, k=0.0)
    options = {"sigma": SIGMA, "angle_deg": 0.0, "fixed": {"k": 0.0}}
    # R is the same for eta and 3.9 / eta, whose two faces are exchanged.
    bounds = {"eta": (1.3, 1.8)}
    shared = fit_map(
        data, sample, tmp_path / "shared.zarr", shared="eta", bounds=bounds, **options
    )  # fmt: skip
    held = fit_map(
        data, sample, tmp_path / "held.zarr", sigma=SIGMA, angle_deg=0.0,
        fixed={"k": 0.0, "eta": shared.attrs["shared"]["eta"][0]},
    )  # fmt: skip
    assert "eta" not in shared
    value, sigma = shared.attrs["shared"]["eta"]
    assert abs(value - 1.46) < 3.0 * sigma
    assert sigma < 1e-3  # that of one of the 36 pixels of the grid is 0.0025
    # At fixed fringes n d is known: d falls as eta rises.
    at_fixed = held["thickness_nm_sigma"].values
    carried = np.sqrt(shared["thickness_nm_sigma"].values ** 2 - at_fixed**2)
    step = 1e-3
    moved = fit_map(
        data, sample, tmp_path / "moved.zarr", sigma=SIGMA, angle_deg=0.0,
        fixed={"k": 0.0, "eta": value + step},
    )  # fmt: skip
    slope = (moved["thickness_nm"].values - held["thickness_nm"].values) / step
    np.testing.assert_allclose(carried, np.abs(slope) * sigma, rtol=0.15)
    width = (shared["thickness_nm_upper"] - shared["thickness_nm_lower"]).values
    narrow = (held["thickness_nm_upper"] - held["thickness_nm_lower"]).values
    np.testing.assert_allclose(width / narrow, shared["thickness_nm_sigma"].values / at_fixed)


def test_a_block_of_which_all_curves_are_refused_is_no_error():
    data = xarray.DataArray(np.full((3, 2, 5), 7.0), name="R")
    cube = open_cube(data, 0.1, angle_deg=0.0, wavelength_um=np.linspace(0.5, 0.9, 5))
    curves, status = cube.block((slice(0, 3), slice(0, 2)))
    assert (status == STATUS["refused"]).all() and np.isnan(curves["R"]).all()
    assert curves["sigma"] == 0.1
