"""Killed processes, full and read-only disks: the store goes on, and its bits are the same."""

import os
import resource
import signal
import subprocess
import time

import numpy as np
import pytest

from fitting.process.progress import listening
from tests.maps import cubes

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


@pytest.mark.parametrize("kills", [2, pytest.param(KILLS, marks=pytest.mark.study)])
def test_a_killed_command_goes_on_to_the_same_bits(cube, tmp_path, cache, kills):
    out = tmp_path / "m.zarr"
    count = killed_until_whole(cube[0], out, cache, kills, lambda process: [process.pid])
    assert count >= min(kills, 2)
    assert cubes.chunks(out) == cube[1]


@pytest.mark.study
def test_killed_workers_and_clients_of_dask_go_on_to_the_same_bits(cube, tmp_path, cache):
    random = np.random.default_rng(3)

    def victims(process):
        workers = workers_of(process)
        return [process.pid] if not workers or random.random() < 0.3 else workers

    out = tmp_path / "m.zarr"
    count = killed_until_whole(cube[0], out, cache, KILLS, victims, "--workers", "2")
    assert count >= KILLS / 2
    assert cubes.chunks(out) == cube[1]


def test_workers_give_the_same_bits_and_a_deadly_block_is_left_out(cube, tmp_path, capfd):
    import dask
    import distributed

    from fitting import fit_map

    values = np.load(cube[0])
    kwargs = {"sigma": cubes.SIGMA, "block": 40}
    here = tmp_path / "here.zarr"
    fit_map(cubes.labelled(values), out=here, **kwargs)
    out = tmp_path / "m.zarr"
    deadly = cubes.Deadly(cubes.labelled(values), 450)
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None,
                                 silence_logs=50, env={"NPROC": "1"}) as cluster,
        distributed.Client(cluster) as client,
    ):  # fmt: skip
        found = fit_map(deadly, out=out, client=client, **kwargs)
        assert found.attrs["failed_blocks"] == ["22:24, 0:20"]
        assert (found["status"].values[22:] == 0).all() and (found["status"].values[:22] > 0).all()
        found = fit_map(cubes.labelled(values), out=out, client=client, **kwargs)
        assert found.attrs["failed_blocks"] == []
    assert cubes.chunks(out) == cubes.chunks(here)


@pytest.mark.study
def test_a_scheduler_without_workers_and_one_that_ends_are_told(tmp_path, monkeypatch):
    import distributed

    from fitting import fit_map
    from fitting.maps import map_workers

    values, _ = cubes.surfaces((8, 5))
    monkeypatch.setattr(map_workers, "QUIET_S", 0.5)
    none = {"n_workers": 0, "dashboard_address": None, "silence_logs": 50, "processes": False}
    with distributed.LocalCluster(**none) as cluster, distributed.Client(cluster) as client:
        with pytest.raises(ValueError, match="this scheduler has no worker; start some"):
            fit_map(cubes.labelled(values), out=tmp_path / "m.zarr", client=client, sigma=0.002)
        monkeypatch.setattr(client, "wait_for_workers", lambda *_, **__: None)
        told = []

        def then(step):
            told.append(step.doing)
            if step.doing:
                client.loop.add_callback(cluster.scheduler.close)

        with listening(then), pytest.raises(ValueError, match="the scheduler .* does not answer"):
            fit_map(cubes.labelled(values), out=tmp_path / "m.zarr", client=client, sigma=0.002)
        assert "waiting for workers: there is none" in told


def limited(bytes_of_a_file):
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (bytes_of_a_file, bytes_of_a_file))


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
