"""`fresnel-fit --map`: table, exit status, page and picture, refusals."""

import re

import numpy as np
import pytest

from fitting.command import cli
from tests.command_line import own_cache  # noqa: F401 (a fixture)
from tests.maps import cubes

for name in ("xarray", "zarr"):
    pytest.importorskip(name, reason="the extra maps is not installed")
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
        (["--loss", "huber"], "loss came; a map has the options of fit_many"),
        (["--wavelength-um", "0.4..x"], "numbers were wanted"),
        (["--plot", "map.txt"], "must end in"), (["--sample", "constant"], "other sample"),
        (["--quantity", "R_x"], "there is no quantity R_x"),
    ):  # fmt: skip
        assert cli.main([*command, *more]) == 2
        assert words in capsys.readouterr().err
    assert cli.main(["--map", "another.npy", *command[1:]]) == 2
    assert "takes one cube" in capsys.readouterr().err
