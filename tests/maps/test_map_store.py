"""A map is what `fit_many` says of its pixels; its store goes on, and is of one input alone."""

import importlib.util
import os
import re
import socket
import subprocess
import sys

import numpy as np
import pytest

import fitting
from fitting import fit_many, fit_map
from fitting.maps import cube as cubes_of
from fitting.maps.map_store import STATUSES, lock
from fitting.process.progress import listening
from tests.maps import cubes

pytest.importorskip("xarray", reason="the extra maps is not installed")
pytest.importorskip("zarr", reason="the extra maps is not installed")
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")
BLOCK = 100


def status_of(dataset):
    return np.array([*STATUSES])[dataset["status"].values]


def test_values_errors_and_statuses_are_those_of_fit_many(tmp_path):
    values, eta = cubes.surfaces()
    values[2, 3] = np.nan
    values[:, 7] = 0.0  # a dead detector column
    values[5, 5] = 40.0  # saturated
    values[20:] = np.nan  # whole blocks
    found = fit_map(cubes.labelled(values), out=tmp_path / "m.zarr", sigma=cubes.SIGMA, block=BLOCK)
    many = fit_many(cubes.ANGLE_DEG, R_s=values[:, :, 0], R_p=values[:, :, 1], sigma=cubes.SIGMA)
    for name in ("eta", "k"):
        e = many.parameters[name]
        for end, wanted in (("", e.value), ("_sigma", e.sigma), ("_lower", e.interval[..., 0]),
                            ("_upper", e.interval[..., 1])):  # fmt: skip
            np.testing.assert_allclose(found[name + end], wanted, rtol=1e-4)
    np.testing.assert_allclose(found["chi2"], many.chi2_reduced, rtol=1e-4)
    np.testing.assert_array_equal(status_of(found), many.status)
    assert set(np.unique(many.status)) == {"converged", "no data", "refused"}
    bits = found["warnings"]
    codes = bits.attrs["flag_meanings"].split()
    for one in many.findings:
        mask = np.uint64(bits.attrs["flag_masks"][codes.index(one.code)])
        np.testing.assert_array_equal((bits.values & mask) != 0, one.at)
    good = status_of(found) == "converged"
    within = np.abs(found["eta"].values - eta) < 2.0 * found["eta_sigma"].values
    assert within[good].mean() > 0.9
    assert found.attrs["sample"] == "free" and found.attrs["versions"].keys() >= {"jax", "zarr"}


def test_sigma_of_each_pixel_and_mask(tmp_path):
    values, _ = cubes.surfaces()
    sigma = np.full(values.shape, cubes.SIGMA)
    sigma[1, 1] = 0.0
    sigma[:5, :, 0] = np.nan  # whole blocks without an error of R_s
    mask = np.zeros(values.shape[:2], bool)
    mask[3:5, 2] = True
    y_mm = "y", np.linspace(-5.0, 5.0, 24), {"units": "mm"}
    found = fit_map(cubes.labelled(values, y=y_mm), out=tmp_path / "m.zarr", block=BLOCK,
                    sigma=cubes.labelled(sigma), mask=mask)  # fmt: skip
    np.testing.assert_array_equal(found["y"], y_mm[1])
    assert found["y"].attrs["units"] == "mm"
    state = status_of(found)
    assert state[1, 1] == "refused" and (state[3:5, 2] == "masked").all()
    assert np.isnan(found["eta"].values[mask]).all()
    values[:5, :, 0] = np.nan
    many = fit_many(cubes.ANGLE_DEG, R_s=values[:, :5, 0], R_p=values[:, :5, 1], sigma=cubes.SIGMA)
    np.testing.assert_allclose(found["eta"][2, 4], many.eta[2, 4], rtol=1e-4)
    np.testing.assert_allclose(found["k"][9, 4], many.k[9, 4], rtol=1e-4)


def test_it_goes_on_with_missing_blocks_alone_and_refuses_what_is_another(tmp_path):
    values, _ = cubes.surfaces()
    out, data = tmp_path / "m.zarr", cubes.labelled(values)
    reports = []
    with listening(reports.append):
        fit_map(data, out=out, sigma=cubes.SIGMA, block=BLOCK)
    assert re.fullmatch(r"[\d,]+ curves/s, 0 s left", reports[-1].doing)
    whole = cubes.chunks(out)
    names = sorted(n for n in whole if n.startswith("status"))
    assert len(names) > 2
    times = {n: (out / n).stat().st_mtime_ns for n in whole}
    (out / names[1]).unlink()
    (out / names[1].replace("status", "eta")).write_bytes(b"half of a chunk")
    fit_map(data, out=out, sigma=cubes.SIGMA, block=BLOCK)
    assert cubes.chunks(out) == whole
    assert {n for n in whole if (out / n).stat().st_mtime_ns != times[n]} == {
        n for n in whole if n.partition("/")[2] == names[1].partition("/")[2]
    }
    for change, words in (
        ({"sample": "constant"}, "other sample: free, and constant"),
        ({"errors": "stated"}, "other options: {'errors': 'auto'}, and {'errors': 'stated'}"),
        ({"data": data + 1e-9}, "other input"), ({"sigma": 0.003}, "other input"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=words):
            fit_map(**{"data": data, "out": out, "sigma": cubes.SIGMA, "block": BLOCK, **change})
    assert cubes.chunks(out) == whole
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "file").write_text("mine")
    with pytest.raises(ValueError, match="is no map"):
        fit_map(data, out=tmp_path / "other", sigma=cubes.SIGMA)


def test_a_second_writer_is_refused_and_a_dead_one_is_none(tmp_path):
    values, _ = cubes.surfaces((2, 2))
    out = tmp_path / "m.zarr"
    holds = (
        "import sys, pathlib, time; from fitting.maps.map_store import lock\n"
        "with lock(pathlib.Path(sys.argv[1])): print('held', flush=True); time.sleep(60)"
    )
    other = subprocess.Popen([sys.executable, "-c", holds, str(out)], stdout=subprocess.PIPE,
                             cwd=cubes.ROOT)  # fmt: skip
    assert other.stdout.readline() == b"held\n"
    words = f"process {other.pid} on {socket.gethostname()}"
    with pytest.raises(ValueError, match=words):
        fit_map(cubes.labelled(values), out=out, sigma=cubes.SIGMA)
    other.kill()
    other.wait()
    other.stdout.close()
    file = tmp_path / "m.zarr.lock"
    assert file.read_text() == words
    with lock(out):
        assert file.read_text() == f"process {os.getpid()} on {socket.gethostname()}"
        with pytest.raises(ValueError, match=f"process {os.getpid()} on"), lock(out):
            pass
    assert not file.exists()


def test_every_file_is_the_same_map(tmp_path):
    h5py = pytest.importorskip("h5py", reason="the extra maps is not installed")
    spectral = pytest.importorskip("spectral", reason="the extra maps is not installed")
    random = np.random.default_rng(1)
    R = random.uniform(0.1, 0.6, (5, 4, 3)).astype(np.float32)
    waves = np.array([500.0, 600.0, 700.0])
    known = {"quantity": ("R",), "angle_deg": (0.0,), "spectrum": True}
    by_hand = {**known, "wavelength_um": tuple(waves / 1e3)}
    import xarray
    import zarr

    coords = {"wavelength": ("wavelength", waves, {"units": "nm"})}
    array = xarray.DataArray(R, dims=("y", "x", "wavelength"), name="R", coords=coords)
    array.to_dataset(name="cube").to_zarr(tmp_path / "c.zarr", zarr_format=3, consolidated=False)
    np.save(tmp_path / "c.npy", R)
    zarr.save_array(tmp_path / "bare.zarr", R)
    with h5py.File(tmp_path / "c.h5", "w") as file:
        file["entry/data"] = R
    with h5py.File(tmp_path / "labelled.nxs", "w") as file:
        file["R"], file["nm"] = R, waves
        file["nm"].make_scale()
        file["nm"].attrs["units"] = "nm"
        for axis, label in zip(file["R"].dims, ("y", "x", "wavelength"), strict=True):
            axis.label = label
        file["R"].dims[2].attach_scale(file["nm"])
    spectral.envi.save_image(
        str(tmp_path / "c.hdr"), R, metadata={"wavelength": list(waves), "wavelength units": "nm"}
    )
    opened = [
        cubes_of.open_cube(array, **{**known, "quantity": None}),
        cubes_of.open_cube(str(tmp_path / "c.zarr"), **known),
        cubes_of.open_cube(str(tmp_path / "c.hdr"), **known),
        cubes_of.open_cube(str(tmp_path / "c.npy"), **by_hand),
        cubes_of.open_cube(str(tmp_path / "c.h5"), **by_hand),
        cubes_of.open_cube(str(tmp_path / "bare.zarr"), **by_hand),
        cubes_of.open_cube(str(tmp_path / "labelled.nxs"), dataset="R", **known),
    ]
    index = slice(1, 3), slice(0, 4), slice(1, 3)
    for one in opened:
        assert one.pixels == ("y", "x", "wavelength") and one.shape == (5, 4, 3)
        np.testing.assert_array_equal(one.data["wavelength"], waves / 1e3)
        assert str(one).endswith("R; 1 angle 0 deg; 3 wavelengths 0.5 to 0.7 um")
        curves, _ = one.block(index)
        assert curves["sigma"] is None
        np.testing.assert_array_equal(curves["R"][..., 0], R[1:3, :, 1:3])
    with pytest.raises(ValueError, match="name one of entry/data"):
        cubes_of.open_cube(str(tmp_path / "c.h5"), dataset="data", **by_hand)
    with pytest.raises(ValueError, match="no angle came"):
        cubes_of.open_cube(str(tmp_path / "c.zarr"), quantity="R")
    (tmp_path / "t.hdr").write_bytes((tmp_path / "c.hdr").read_bytes())
    for ending in (".npy", ".h5", ".img"):
        whole = (tmp_path / f"c{ending}").read_bytes()
        (tmp_path / f"t{ending}").write_bytes(whole[:-40])
        path = tmp_path / f"t{'.hdr' if ending == '.img' else ending}"
        with pytest.raises(ValueError, match=path.name):
            cubes_of.open_cube(str(path), dataset="entry/data", **by_hand)


def test_a_missing_extra_is_named(monkeypatch, tmp_path):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ImportError, match="extra 'maps'"):
        fit_map(np.zeros(3), out=tmp_path / "m.zarr")


def test_import_of_fitting_needs_none_of_it():
    code = (
        "import sys, fitting; fitting.fit_many, fitting.fit_map; print(sorted({'zarr', 'xarray', "
        "'dask', 'distributed', 'h5py'} & sys.modules.keys()))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True,
                          cwd=cubes.ROOT, check=True)  # fmt: skip
    assert done.stdout == "[]\n"
    assert "fit_map" in fitting.__all__
