"""Killed processes, full and read-only disks: the store goes on, and its bits are the same."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from tests.maps import cubes

pytestmark = pytest.mark.slow

for name in ("xarray", "zarr", "distributed"):
    pytest.importorskip(name, reason="the extra maps is not installed")
KILLS = 20


@pytest.fixture(scope="module")
def cube(tmp_path_factory, cache):
    """A cube on disk, and the chunks of the map that nothing interrupted."""
    folder = tmp_path_factory.mktemp("cube")
    values, _ = cubes.surfaces()
    values[2, 3], values[:, 7] = np.nan, 0.0
    np.save(folder / "cube.npy", values)
    whole = cubes.run(
        cubes.arguments(folder / "cube.npy", folder / "m.zarr", "--block", "4"), cache
    )
    assert (whole.returncode, whole.stderr) == (0, "")
    return folder / "cube.npy", cubes.chunks(folder / "m.zarr")


def done(out):
    return {p for p in out.glob("status/c/**/*") if p.is_file() and ".partial" not in p.name}


def workers_of(process):
    """The processes below a process that run spawned workers."""
    below = {}
    for folder in os.listdir("/proc"):
        if folder.isdecimal():
            try:
                with open(f"/proc/{folder}/stat") as file:
                    parent = int(file.read().rpartition(")")[2].split()[1])
                with open(f"/proc/{folder}/cmdline") as file:
                    below[int(folder)] = parent, file.read()
            except OSError:
                continue
    found, edge = [], {process.pid}
    while edge:
        edge = {p for p, (parent, _) in below.items() if parent in edge}
        found += [p for p in edge if "spawn_main" in below[p][1]]
    return found


def killed_until_whole(cube, out, cache, kills, victims, *more):
    """Run the command and kill it at random moments at which it works; return how often."""
    random = np.random.default_rng(8)
    command = cubes.arguments(cube, out, "--block", "4", *more)
    count = 0
    while True:
        begun = done(out)
        process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=cubes.ROOT,
                                   env=cubes.environment(cache))  # fmt: skip
        while process.poll() is None and count < kills:
            if len(done(out)) > len(begun):
                time.sleep(random.uniform(0.0, 0.2))
                for victim in victims(process):
                    os.kill(victim, signal.SIGKILL)
                    count += 1
                begun = done(out)
            time.sleep(0.01)
        errors = process.communicate()[1]
        if process.returncode != -signal.SIGKILL:
            assert process.returncode == 0, errors
            return count


@pytest.mark.parametrize(
    ("kills", "more"),
    [(2, ()), pytest.param(KILLS, (), marks=pytest.mark.study),
     pytest.param(KILLS, ("--workers", "2"), marks=pytest.mark.study)],
)  # fmt: skip
def test_a_killed_command_goes_on_to_the_same_bits(cube, tmp_path, cache, kills, more):
    random = np.random.default_rng(3)

    def victims(process):
        workers = workers_of(process)
        return [process.pid] if not workers or random.random() < 0.3 else workers

    out = tmp_path / "m.zarr"
    count = killed_until_whole(cube[0], out, cache, kills, victims, *more)
    assert count >= max(kills / 2, 2)
    assert cubes.chunks(out) == cube[1]


# Dask may run it twice in a process.
DEADLY = """
import os
from fitting.maps.cube import Cube

def block(cube, index, whole=Cube.block):
    if os.path.exists({flag!r}) and index[0].start <= 22 < index[0].stop:
        os._exit(1)
    return whole(cube, index)

Cube.block = block
"""


def test_a_block_that_kills_its_workers_is_left_out_and_the_others_are_the_same(
    cube, tmp_path, cache
):
    import distributed

    from fitting import fit_map

    file, flag, preload = tmp_path / "s.json", tmp_path / "deadly", tmp_path / "deadly.py"
    preload.write_text(DEADLY.format(flag=str(flag)))
    flag.touch()
    environment = cubes.environment(cache) | {
        "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0", "NPROC": "1"
    }  # fmt: skip
    begins = (["scheduler", "--host", "127.0.0.1", "--port", "0"],
              ["worker", "--nthreads", "1", "--preload", str(preload)])  # fmt: skip
    running = [
        subprocess.Popen([sys.executable, "-m", "dask", *begin, "--scheduler-file", str(file),
                          "--no-dashboard"], cwd=tmp_path, env=environment,
                         stderr=subprocess.DEVNULL) for begin in begins
    ]  # fmt: skip
    try:
        out = tmp_path / "m.zarr"
        more = "--block", "40", "--scheduler-file", str(file)
        ended = cubes.run(cubes.arguments(cube[0], out, *more), cache, timeout=500)
        assert ended.returncode == 3, ended.stderr
        *_, last = ended.stderr.splitlines()  # Dask itself may warn of results that were lost
        assert "the workers that fitted the pixels 22:24, 0:20 died" in last
        assert len(done(out)) == 11
        flag.unlink()
        values = cubes.labelled(np.load(cube[0]))
        kwargs = {"sigma": cubes.SIGMA, "block": 40}
        with distributed.Client(scheduler_file=str(file)) as client:
            found = fit_map(values, out=out, client=client, **kwargs)
        assert found.attrs["failed_blocks"] == []
        fit_map(values, out=tmp_path / "here.zarr", **kwargs)
        assert cubes.chunks(out) == cubes.chunks(tmp_path / "here.zarr")
    finally:
        for process in reversed(running):
            process.terminate()
            process.wait(60)


@pytest.mark.study
def test_a_scheduler_without_workers_and_one_that_ends_are_told(tmp_path, monkeypatch):
    import distributed

    from fitting import fit_map
    from fitting.maps import map_fit

    values, _ = cubes.surfaces((8, 5))
    monkeypatch.setattr(map_fit, "WAIT_S", 0.5)
    none = {"n_workers": 0, "dashboard_address": None, "silence_logs": 50, "processes": False}
    with distributed.LocalCluster(**none) as cluster, distributed.Client(cluster) as client:
        with pytest.raises(ValueError, match="this scheduler has no worker; start some"):
            fit_map(cubes.labelled(values), out=tmp_path / "m.zarr", client=client, sigma=0.002)

        def ends(*_, **__):
            client.loop.add_callback(client.loop.call_later, 1.0, cluster.scheduler.close)

        monkeypatch.setattr(client, "wait_for_workers", ends)
        with pytest.raises(ValueError, match="the scheduler .* does not answer"):
            fit_map(cubes.labelled(values), out=tmp_path / "m.zarr", client=client, sigma=0.002)


def mounted(folder, options):
    """Mount memory at a folder, or skip."""
    folder.mkdir(exist_ok=True)
    command = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)]
    if subprocess.run(command, capture_output=True).returncode:
        pytest.skip("this process may not mount a small disk")


def test_a_full_disk_and_one_that_is_read_only_end_in_a_sentence(cube, tmp_path, cache):
    disk = tmp_path / "disk"
    mounted(disk, "size=600k")
    try:
        out = disk / "m.zarr"
        command = cubes.arguments(cube[0], out, "--block", "4")
        full = cubes.run(command, cache)
        assert full.returncode == 2
        assert "cannot be written (No space left on device)" in full.stderr
        assert len(full.stderr.splitlines()) == 1 and 0 < len(done(out)) < 120
        subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
        fixed = cubes.run(command, cache)
        assert fixed.returncode == 2 and "Read-only file system" in fixed.stderr
        subprocess.run(["mount", "-o", "remount,rw,size=20M", str(disk)], check=True)
        again = cubes.run(command, cache)
        assert (again.returncode, again.stderr) == (0, "")
        assert cubes.chunks(out) == cube[1]
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def test_input_that_breaks_off_ends_in_a_sentence(cube, tmp_path, cache):
    import zarr

    values = np.load(cube[0])
    group = zarr.open_group(tmp_path / "cube.zarr", mode="w")
    array = group.create_array("R", shape=values.shape, chunks=(2, 20, 2, 12), dtype="f8",
                               dimension_names=("y", "x", "quantity", "angle"))  # fmt: skip
    array[...] = values
    command = cubes.arguments(tmp_path / "cube.zarr", tmp_path / "m.zarr", "--block", "40")
    chunk = tmp_path / "cube.zarr" / "R" / "c" / "7" / "0" / "0" / "0"
    whole = chunk.read_bytes()
    chunk.write_bytes(whole[: len(whole) // 2])
    broken = cubes.run([*command, "--dataset", "R"], cache)
    assert broken.returncode == 2 and len(broken.stderr.splitlines()) == 1
    assert "the pixels 14:16, 0:20 of the input cannot be read" in broken.stderr
    assert len(done(tmp_path / "m.zarr")) == 7
    chunk.write_bytes(whole)
    again = cubes.run([*command, "--dataset", "R"], cache)
    assert (again.returncode, again.stderr) == (0, "")
    assert len(done(tmp_path / "m.zarr")) == 12
