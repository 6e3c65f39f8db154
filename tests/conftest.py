"""Shared by all tests: float64 is on (float32 is tested with float32 arrays)."""

import ctypes
import gc
import os
import shutil
import sys
import tempfile
from pathlib import Path

import jax
import pytest

jax.config.update("jax_enable_x64", True)

# A fifth to a quarter less time to compile, and no other bit (tests/package/test_compiled.py):
# LLVM's costlier passes are left out, and a program is not cut into parts for many cores. jaxlib
# 0.8 to 0.12 know these; a process would end at one that is not known.
FAST = (
    "--xla_backend_optimization_level=1 --xla_llvm_disable_expensive_passes=true "
    "--xla_cpu_parallel_codegen_split_count=1"
)
if FAST not in os.environ.get("XLA_FLAGS", ""):  # a worker has them already
    os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} {FAST}".strip()

# Traced programs are many small objects that live on: going through them again and again took a
# sixth of the time of tests that trace.
gc.set_threshold(100_000, 50, 100)

# A gigabyte of programs, for a worker to stay below 1.5; of the 65,530 mappings of a process.
MOST_MAPPINGS = 4_000
# The workers of a run share what takes a second to compile, in a folder that is gone afterwards.
# Not what takes less: writing thousands of programs ended in a segmentation fault of jaxlib once.
LEAST_SECONDS = 1.0
FOLDER = pytest.StashKey[Path]()
# Neighbours in this list have programs in common. The long files of maps stand far from the middle,
# where two workers meet.
ROOMS = ("physics", "maps", "samples", "package", "docs", "reader", "output", "command", "choice",
         "uncertainty", "films", "fits")  # fmt: skip


def pytest_configure(config):
    shared = getattr(config, "workerinput", {}).get("folder")
    folder = config.stash[FOLDER] = Path(shared or tempfile.mkdtemp(prefix="fresnel-tests-"))
    jax.config.update("jax_compilation_cache_dir", str(folder / "programs"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", LEAST_SECONDS)


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node):
    node.workerinput["folder"] = str(node.config.stash[FOLDER])


def pytest_unconfigure(config):
    if not hasattr(config, "workerinput"):
        shutil.rmtree(config.stash[FOLDER], ignore_errors=True)


def pytest_collection_modifyitems(items):
    rooms = {room: i for i, room in enumerate(ROOMS)}
    items.sort(key=lambda item: rooms.get(item.path.parent.name, 0))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """With ``--dist loadfile`` every second worker takes files from the end of the list.

    So one compiles the programs of physics and another those of fits, each of them once, until they
    meet in the middle.
    """
    if config.getvalue("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadFileScheduling

    class FromBothEnds(LoadFileScheduling):
        def _assign_work_unit(self, node):
            if int(node.gateway.id.removeprefix("gw")) % 2:
                self.workqueue.move_to_end(next(reversed(self.workqueue)), last=False)
            super()._assign_work_unit(node)

    config.option.loadscopereorder = False
    return FromBothEnds(config, log)


@pytest.fixture(scope="module", autouse=True)
def _few_compiled_programs():
    """Give memory back, and forget compiled programs when there are many, for their mappings.

    What compiling used stays in pieces between the programs: half of what a worker took.
    """
    yield
    mappings = Path("/proc/self/maps")
    if mappings.exists() and len(mappings.read_bytes().splitlines()) > MOST_MAPPINGS:
        jax.clear_caches()
        gc.collect()
    if sys.platform == "linux" and hasattr(libc := ctypes.CDLL(None), "malloc_trim"):
        libc.malloc_trim(0)


@pytest.fixture
def set_jax():
    """A function that sets switches of jax, for all threads; they are set back after the test."""
    before = {}

    def update(**switches):
        for name, value in switches.items():
            before.setdefault(name, getattr(jax.config, name))
            jax.config.update(name, value)

    yield update
    update(**before)


@pytest.fixture(scope="session")
def cache(request) -> Path:
    """The folder of what commands of these tests compiled; `command_line.own_cache` uses it."""
    return request.config.stash[FOLDER] / "commands"


@pytest.fixture(scope="session")
def measured_files() -> Path:
    """The folder of measured files, which are not part of the project."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the measured files (../shared/data) are not here; they are not distributed")
    return folder
