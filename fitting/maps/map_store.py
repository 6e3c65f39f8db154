"""The store of a map: a Zarr group on disk that is the state of the work, and its lock.

There are four arrays for each parameter (value, sigma, lower, upper), chi2, warnings as bits, and
status, all with the pixels' axes, in chunks of one block each. The chunk of status is written last:
where it exists, the block is done.
"""

from __future__ import annotations

import contextlib
import functools
import importlib.util
import json
import os
import socket
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fitting.data.errors import MissingExtra
from fitting.results import result_parts as parts
from fitting.results.sentences import SENTENCES

PENDING, MASKED = "pending", "masked"
# The number of a status is its place here; the colour is that of its pixels in pictures.
STATUSES = {PENDING: "#ffffff", parts.CONVERGED: "#009E73", parts.UNDETERMINED: "#E69F00",
            parts.NOT_CONVERGED: "#D55E00", parts.NO_DATA: "#bbbbbb", parts.REFUSED: "#CC79A7",
            MASKED: "#595959", parts.MISFIT: "#56B4E9"}  # fmt: skip
STATUS = {name: np.uint8(i) for i, name in enumerate(STATUSES)}
# A warning that maps alone have: a search afresh met a lower minimum than that of the grid.
ORDER = "fringe_order"
BITS = {code: np.uint64(1 << i) for i, code in enumerate((*SENTENCES, ORDER))}
ENDS = {"": "", "_sigma": "standard error of ", "_lower": "95 % interval begins: ",
        "_upper": "95 % interval ends: "}  # fmt: skip


def package(name: str) -> Any:
    """Return a package of the extra "maps", or raise ImportError that names the extra."""
    if importlib.util.find_spec(name) is None:
        raise MissingExtra("a map", name, "maps")
    return importlib.import_module(name)


@functools.lru_cache(8)
def opened_once(kind: Callable[..., Any], written_ns: int, *source: Any) -> Any:
    """Return a store or a cube of a path, opened once in a process each time it was written."""
    return kind(*source)


@contextlib.contextmanager
def lock(out: Path) -> Iterator[None]:
    """Be the only process that fits into a store, or refuse and name the other one."""
    file = out.with_name(f"{out.name}.lock")
    with open(file, "a+", encoding="utf-8") as handle:
        try:
            import fcntl

            # The system releases the lock of a process that dies.
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            handle.seek(0)
            raise ValueError(
                f"{out}: {handle.read()} is fitting into this store. Wait for its end, or stop it."
            ) from None
        except (ImportError, OSError):
            pass  # a system or a disk without locks: two processes would write the same
        handle.truncate(0)
        handle.write(f"process {os.getpid()} on {socket.gethostname()}")
        handle.flush()
        try:
            yield
        finally:
            file.unlink(missing_ok=True)


class MapStore:
    """A store that is open: where its blocks are, which are done, and the writing of one."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path, self.group = Path(path), package("zarr").open_group(path, mode="r+")
        self.attributes: dict[str, Any] = self.group.attrs.asdict()
        units = self.attributes["begin"]["units"]
        names = [*(name + end for name in units for end in ENDS), "chi2", "warnings", "status"]
        self.arrays: dict[str, Any] = {name: self.group[name] for name in names}
        self.shape, self.block = self.arrays["status"].shape, self.arrays["status"].chunks

    def __reduce__(self) -> Any:
        """In another process the store is opened again."""
        written_ns = os.stat(self.path / "zarr.json").st_mtime_ns
        return opened_once, (MapStore, written_ns, self.path)

    def index(self, place: tuple[int, ...]) -> tuple[slice, ...]:
        """Return the pixels of a block, by its place in the grid of blocks."""
        each = zip(place, self.block, self.shape, strict=True)
        return tuple(slice(i * b, min((i + 1) * b, n)) for i, b, n in each)

    def done(self, place: tuple[int, ...]) -> bool:
        """Return whether a block is done."""
        key = self.arrays["status"].metadata.encode_chunk_key(place)
        return (self.path / "status" / key).exists()

    def missing(self) -> list[tuple[int, ...]]:
        """Return the places of the blocks that are not done."""
        blocks = (-(-n // b) for n, b in zip(self.shape, self.block, strict=True))
        return [place for place in np.ndindex(*blocks) if not self.done(place)]

    def write(self, place: tuple[int, ...], values: Mapping[str, np.ndarray]) -> None:
        """Write a block; its status last."""
        for name in (n for n in self.arrays if n in values):  # others keep their fill value
            self.arrays[name][self.index(place)] = values[name]

    def dataset(self) -> Any:
        """Return the store as an xarray Dataset, of which nothing is loaded yet."""
        found = package("xarray").open_dataset(
            self.path, engine="zarr", chunks=None, consolidated=False
        )[[*self.arrays]]
        del found.attrs["begin"], found.attrs["fresnel_map"]
        return found


def begun(out: Path, wanted: Mapping[str, Any]) -> bool:
    """Return whether a store is at a path; raise ValueError where it is of something else."""
    known: dict[str, Any] = {}
    with contextlib.suppress(FileNotFoundError, NotADirectoryError, KeyError, ValueError):
        known = package("zarr").open_group(out, mode="r").attrs.asdict()
    if "fresnel_map" not in known and out.exists() and (out.is_file() or any(out.iterdir())):
        raise ValueError(f"{out}: it exists, and is no map of this program; name another one.")
    if known.get("fresnel_map") != "whole":
        return False
    for name, came in json.loads(json.dumps(wanted)).items():
        held = known[name]
        if name == "options":
            came = {n: v for n, v in came.items() if v != held.get(n)}
            held = {n: held.get(n) for n in came}
        if came != held:
            text = "" if name == "input" else f": {held}, and {came} came"
            raise ValueError(
                f"{out}: it is a map with other {name}{text}. Name another store, or delete it."
            )
    return True


def create(out: Path, cube: Any, block: tuple[int, ...], attributes: Mapping[str, Any]) -> None:
    """Make an empty store; its attributes are written last and mean that it is whole."""
    places = cube.data.coords.to_dataset().assign_attrs(fresnel_map="begun")
    places.to_zarr(out, mode="w", zarr_format=3, consolidated=False)
    group = package("zarr").open_group(out, mode="r+")

    def array(name: str, kind: str, fill: Any, **known: Any) -> None:
        group.create_array(
            name, shape=cube.shape, chunks=block, dtype=kind, fill_value=fill,
            dimension_names=cube.pixels, attributes=known,
        )  # fmt: skip

    for name, unit in attributes["begin"]["units"].items():
        for end, words in ENDS.items():
            array(name + end, "float64", np.nan, units=unit or "1", long_name=words + name)
    array("chi2", "float64", np.nan, units="1", long_name="chi2 by degrees of freedom")
    # What the numbers and bits mean is said as in the CF conventions.
    array("warnings", "uint64", 0, flag_masks=[int(b) for b in BITS.values()],
          flag_meanings=" ".join(BITS), long_name="warnings of the fit, a bit each")  # fmt: skip
    array("status", "uint8", 0, flag_values=[*range(len(STATUS))],
          flag_meanings=" ".join(s.replace(" ", "_") for s in STATUS))  # fmt: skip
    group.attrs.update({**attributes, "fresnel_map": "whole"})
