"""`fresnel-fit --map`: table, exit status, page and picture, refusals."""

import re

import numpy as np
import pytest

from fitting import fit_many, fit_map
from fitting.command import cli
from tests.command_line import own_cache  # noqa: F401 (a fixture)
from tests.maps import cubes

xarray = pytest.importorskip("xarray", reason="the extra maps is not installed")
pytest.importorskip("zarr", reason="the extra maps is not installed")
pytest.importorskip("matplotlib")
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")


def test_table_page_picture_and_refusals(tmp_path, capsys):
    values, _ = cubes.surfaces((4, 4))
    values[1, 1], values[2] = 0.0, np.nan
    values[3, 3, 0] += 0.1 * np.cos(np.arange(12.0))  # no bare surface
    np.save(tmp_path / "cube.npy", values)
    command = cubes.arguments(tmp_path / "cube.npy", tmp_path / "m.zarr")[3:]
    command.remove("--quiet")
    assert cli.main([*command, "--plot", str(tmp_path / "map.html")]) == 0
    told = capsys.readouterr().out
    assert "4 y x 4 x; R_s, R_p; 12 angles 25 to 80 deg" in told
    rows = [re.split(r"  +", line.strip()) for line in told.splitlines()[1:]]
    assert ["converged", "11", "68.75%"] in rows and ["no data", "4", "25.00%"] in rows
    assert ["refused", "1", "6.25%"] in rows
    page = (tmp_path / "map.html").read_text()
    assert "errors_relative" in page and page.count("data:image/png") == 5
    assert cli.main([*command, "--quiet", "--plot", str(tmp_path / "map.png")]) == 0
    assert (tmp_path / "map.png").read_bytes()[1:4] == b"PNG"
    for more, words in (
        (["--json", "x.json"], "--json is of single fits"),
        (["--wavelength-um", "0.4..x"], "numbers were wanted"),
        (["--plot", "map.txt"], "must end in"), (["--sample", "constant"], "other sample"),
        (["--quantity", "R_x"], "there is no quantity R_x"),
    ):  # fmt: skip
        assert cli.main([*command, *more]) == 2
        assert words in capsys.readouterr().err
    with pytest.raises(ValueError, match="near came; a map has the options of fit_many"):
        fit_map(values, near=None)
    assert cli.main(["--map", "another.npy", *command[1:]]) == 2
    assert "takes one cube" in capsys.readouterr().err


def test_loss_priors_and_starts_are_those_of_a_batch(tmp_path):
    values, _ = cubes.surfaces((3, 2))
    values[..., 4] = np.clip(values[..., 4] + 0.1, 0.0, 1.0)
    np.save(tmp_path / "cube.npy", values)
    command = cubes.arguments(tmp_path / "cube.npy", tmp_path / "m.zarr")[3:]
    more = ["--loss", "huber", "--prior", "k=2+-1", "--starts", "24"]
    assert cli.main([*command, *more]) == 0
    found = xarray.open_zarr(tmp_path / "m.zarr", consolidated=False)
    wanted = fit_many(
        cubes.ANGLE_DEG, R_s=values[..., 0, :], R_p=values[..., 1, :], sigma=cubes.SIGMA,
        loss="huber", priors={"k": (2.0, 1.0)}, starts=24,
    )  # fmt: skip
    for name, e in wanted.parameters.items():
        np.testing.assert_allclose(found[name], e.value, rtol=1e-6)
        np.testing.assert_allclose(found[name + "_sigma"], e.sigma, rtol=1e-6)
