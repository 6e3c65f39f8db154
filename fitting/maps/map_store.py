"""The store of a map: a Zarr group on disk that is the state of the work, and its lock.

There are four arrays for each parameter (value, sigma, lower, upper), chi2, warnings as bits, and
status, all with the pixels' axes, in chunks of one block each. The chunk of status is written last:
where it exists, the block is done.
"""

from __future__ import annotations

import contextlib
import functools
import json
import math
import os
import socket
import threading
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fitting.maps.cube import Cube, package
from fitting.results import result_parts as parts
from fitting.results.sentences import SENTENCES

PENDING, MASKED = "pending", "masked"
STATUSES = (PENDING, parts.CONVERGED, parts.UNDETERMINED, parts.NOT_CONVERGED, parts.NO_DATA,
            parts.REFUSED, MASKED, parts.MISFIT)  # fmt: skip
# A warning that maps alone have: the fringe order of a pixel is in doubt.
ORDER = "fringe_order"
CODES = (*SENTENCES, ORDER)
ENDS = ("", "_sigma", "_lower", "_upper")
# A lock of another host, or of a system without file locks, is alive if it was touched so lately.
TOUCHED_S, STALE_S = 20.0, 120.0


class MapStoreError(ValueError):
    """A store cannot be used or written; the text says why, and what to do."""


@contextlib.contextmanager
def lock(out: Path) -> Iterator[None]:
    """Be the only process that fits into a store; refuse where another one is, by its name.

    The system releases the lock of a process that dies. Where it has no such locks, and for
    processes of other hosts, a lock counts until it has not been touched for `STALE_S` seconds.
    """
    file = out.with_name(f"{out.name}.lock")
    with contextlib.ExitStack() as closing:
        while True:
            handle = closing.enter_context(open(file, "a+", encoding="utf-8"))
            locked = _locked_by_system(handle)
            handle.seek(0)
            text = handle.read()
            owner = json.loads(text) if text.endswith("}") else {}
            here = owner.get("host") == socket.gethostname() and locked is not None
            fresh = time.time() - os.stat(handle.fileno()).st_mtime < STALE_S
            if locked is False or (owner and not here and fresh):
                raise MapStoreError(
                    f"{out}: process {owner.get('process', '?')} on {owner.get('host', '?')} is "
                    f"fitting into this store. Wait for its end, or stop it."
                )
            with contextlib.suppress(FileNotFoundError):  # it ended and removed its file
                if os.path.samestat(os.stat(file), os.fstat(handle.fileno())):
                    break
        handle.truncate(0)
        handle.write(json.dumps({"host": socket.gethostname(), "process": os.getpid()}))
        handle.flush()
        ended = threading.Event()

        def touch() -> None:
            while not ended.wait(TOUCHED_S):
                with contextlib.suppress(OSError):
                    os.utime(file)

        threading.Thread(target=touch, daemon=True).start()
        try:
            yield
        finally:
            ended.set()
            with contextlib.suppress(OSError):
                file.unlink()


def _locked_by_system(handle: Any) -> bool | None:
    """Return whether the lock of a file is ours; None where the system has no such locks."""
    try:
        import fcntl

        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except (ImportError, OSError):
        return None
    return True


class MapStore:
    """A store that is open: where its blocks are, which are done, and the writing of one."""

    def __init__(self, path: str) -> None:
        self.path, self.group = Path(path), package("zarr", "a map").open_group(path, mode="r+")
        self.attributes: dict[str, Any] = self.group.attrs.asdict()
        self.arrays = dict(self.group.arrays())
        self.status = self.arrays["status"]
        self.shape, self.block = self.status.shape, self.status.chunks
        self.blocks = tuple(-(-n // b) for n, b in zip(self.shape, self.block, strict=True))

    def index(self, place: tuple[int, ...]) -> tuple[slice, ...]:
        """Return the pixels of a block, by its place in the grid of blocks."""
        each = zip(place, self.block, self.shape, strict=True)
        return tuple(slice(i * b, min((i + 1) * b, n)) for i, b, n in each)

    def pixels(self, place: tuple[int, ...]) -> int:
        """Return how many pixels a block has."""
        return math.prod(s.stop - s.start for s in self.index(place))

    def done(self, place: tuple[int, ...]) -> bool:
        """Return whether a block is done."""
        key = self.status.metadata.encode_chunk_key(place)
        return (self.path / "status" / key).exists()

    def missing(self) -> list[tuple[int, ...]]:
        """Return the places of the blocks that are not done."""
        return [place for place in np.ndindex(*self.blocks) if not self.done(place)]

    def write(self, place: tuple[int, ...], values: Mapping[str, np.ndarray]) -> None:
        """Write a block; its status last."""
        index = self.index(place)
        inner = tuple(slice(0, s.stop - s.start) for s in index)
        for name in sorted(values, key=lambda name: name == "status"):
            self.arrays[name][index] = values[name][inner]


@functools.lru_cache(4)
def store_of(path: str, fingerprint: str) -> MapStore:
    """Return an open store, opened once in a process; fingerprint: of what it shall hold."""
    return MapStore(path)


def begun(out: Path) -> dict[str, Any] | None:
    """Return the attributes of the store at a path, None where there is none.

    Raises MapStoreError for a path that holds something else.
    """
    zarr = package("zarr", "a map")
    if not out.exists() or not any(out.iterdir() if out.is_dir() else [out]):
        return None
    try:
        known = zarr.open_group(os.fspath(out), mode="r").attrs.asdict()
    except (FileNotFoundError, NotADirectoryError, KeyError, ValueError):
        known = {}
    if "fresnel_map" not in known:
        raise MapStoreError(f"{out}: it exists, and is no map of this program; name another one.")
    return known if known["fresnel_map"] == "whole" else None


def refuse_other(out: Path, known: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
    """Raise MapStoreError where a store is of another input, sample or options."""
    for name in ("sample", "options", "input"):
        if (came := json.loads(json.dumps(wanted[name]))) != known.get(name):
            held: Any = known.get(name)
            if name == "options":
                came = {n: v for n, v in came.items() if v != held.get(n)}
                held = {n: held.get(n) for n in came}
            said = "" if name == "input" else f": {held}, and {came} came"
            raise MapStoreError(
                f"{out}: it is a map with other {name}{said}. Name another store, or delete it."
            )


def create(
    out: Path, cube: Cube, block: tuple[int, ...], units: Mapping[str, str],
    attributes: Mapping[str, Any],
) -> None:  # fmt: skip
    """Make an empty store; its attributes are written last and mean that it is whole."""
    zarr = package("zarr", "a map")
    group = zarr.open_group(os.fspath(out), mode="w", zarr_format=3)
    group.attrs.update({"fresnel_map": "begun"})

    def array(name: str, kind: str, fill: Any, **known: Any) -> None:
        made = group.create_array(
            name, shape=cube.shape, chunks=block, dtype=kind, fill_value=fill,
            dimension_names=cube.pixels,
        )  # fmt: skip
        made.attrs.update(known)

    ends = "", "standard error of ", "95 % interval begins: ", "95 % interval ends: "
    for name, unit in units.items():
        for end, words in zip(ENDS, ends, strict=True):
            array(name + end, "float64", np.nan, units=unit or "1", long_name=words + name)
    array("chi2", "float64", np.nan, units="1", long_name="chi2 by degrees of freedom")
    array(
        "warnings", "uint64", 0, flag_masks=[1 << i for i in range(len(CODES))],
        flag_meanings=" ".join(CODES), long_name="warnings of the fit, a bit each",
    )  # fmt: skip
    array(
        "status", "uint8", 0, flag_values=list(range(len(STATUSES))),
        flag_meanings=" ".join(s.replace(" ", "_") for s in STATUSES),
    )  # fmt: skip
    for name, (values, unit) in cube.places.items():
        made = group.create_array(name, data=np.asarray(values), dimension_names=(name,))
        made.attrs.update({"units": unit} if unit else {})
    group.attrs.update({**attributes, "fresnel_map": "whole"})


def dataset(out: Path) -> Any:
    """Return the store as an xarray Dataset, of which nothing is loaded yet."""
    found = package("xarray", "a map").open_dataset(
        os.fspath(out), engine="zarr", chunks=None, consolidated=False
    )
    parameters = [name + end for name in found.attrs["begin"]["units"] for end in ENDS]
    for inner in ("begin", "places", "fresnel_map"):
        del found.attrs[inner]
    return found[[*parameters, "chi2", "status", "warnings"]]
