"""``fresnel-fit --map CUBE --out maps.zarr``: a cube of curves, fitted pixel by pixel."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fitting.command.terminal import FITTED, complain, refusals, say
from fitting.process.progress import shown

# Blocks that kill their workers again and again are left out, and the rest is done.
BLOCKS_FAILED = 3
OPTIONS = (
    ("map", None, "FILE is a cube of curves (Zarr, ENVI .hdr, HDF5, .npy); fit every pixel into "
     "the store --out, or go on with those that it lacks", {"action": "store_true"}),
    ("out", "MAPS.zarr", "the store of the map", {"default": "maps.zarr"}),
    ("dataset", "NAME", "the array in a file that has several"),
    ("quantity", "NAME,..", "what the values are, where the file does not say it: R or R_s,R_p"),
    ("mask", "NAME", "an array of the file that is true in pixels to leave out"),
    ("shared", "NAME,..", "parameters that all pixels share; found from a grid of pixels, then "
     "held, with their errors in those of the others"),
    ("block", "N", "curves fitted together (10000); two blocks are in memory", {"type": int}),
    ("workers", "N", "fit in N processes (Dask)", {"type": int}),
    ("scheduler", "ADDRESS", "fit on the workers of this Dask scheduler: tcp://host:8786"),
    ("scheduler-file", "FILE", "the same, of the scheduler that wrote this file"),
)  # fmt: skip


def _client(arguments: Any) -> Any:
    """Return the context of a client of the workers that were asked for, or of None."""
    from fitting.maps.map_store import package
    from fitting.process.side_by_side import PROCESSORS

    known = {"address": arguments.scheduler, "scheduler_file": arguments.scheduler_file}
    if arguments.workers:
        # What XLA reads when it starts; each worker has its share of the processors.
        share = {"NPROC": str(max(PROCESSORS // arguments.workers, 1)), "TF_CPP_MIN_LOG_LEVEL": "3",
                 "JAX_PLATFORMS": os.environ.get("JAX_PLATFORMS", "cpu")}  # fmt: skip
        known = {"n_workers": arguments.workers, "threads_per_worker": 1, "env": share,
                 "dashboard_address": ":0", "silence_logs": 50}  # fmt: skip
    known = {n: v for n, v in known.items() if v}
    return package("distributed").Client(**known) if known else contextlib.nullcontext()


def _numbers(text: str | None, option: str) -> list[float] | None:
    """Return numbers with commas between them, or LOW..HIGH:COUNT."""
    import numpy as np

    if not text:
        return None
    low, _, rest = text.partition("..")
    high, _, count = rest.partition(":")
    try:
        if rest:
            return np.linspace(float(low), float(high), int(count)).tolist()
        return [float(x) for x in text.split(",")]
    except ValueError:
        raise ValueError(
            f"{option} {text}: numbers were wanted, 0.5,0.6 or LOW..HIGH:COUNT, for example "
            "0.4..0.8:60."
        ) from None


def run_map(arguments: Any, options: Mapping[str, Any]) -> int:
    """Fit a map, and report and draw it; options: of the fit, as of `fit`."""
    with refusals():
        if len(arguments.file) != 1:
            raise ValueError("--map takes one cube; several files came.")
        for flag in ("json", "csv", "report", "reference", "material", "each"):
            if getattr(arguments, flag):
                raise ValueError(
                    f"--{flag} is of single fits; a map is in the store --out, and --plot draws it."
                )
        from fitting.maps import map_page
        from fitting.maps.cube import open_cube
        from fitting.maps.map_fit import fit_map
        from fitting.output import files, pictures
        from fitting.output.summary import rows_aligned

        as_page = str(arguments.plot).lower().endswith(".html")
        if arguments.plot and not as_page:
            pictures.check_picture(arguments.plot)
        with contextlib.suppress(TypeError, ValueError):  # else the name of an array
            arguments.sigma = float(arguments.sigma)
        quantity = arguments.quantity and [q.strip() for q in arguments.quantity.split(",")]
        data = {
            "sigma": arguments.sigma, "mask": arguments.mask, "dataset": arguments.dataset,
            "quantity": quantity, "angle_deg": _numbers(arguments.angle_deg, "--angle-deg"),
            "wavelength_um": _numbers(arguments.wavelength_um, "--wavelength-um"),
        }  # fmt: skip
        more = {n: v for n, v in {**options, "block": arguments.block}.items() if v}
        shared = [n for n in (arguments.shared or "").split(",") if n.strip()]
        file = arguments.file[0]
        with _client(arguments) as client, shown("blocks", quiet=arguments.quiet):
            found = fit_map(
                file, arguments.sample, arguments.out, client=client, shared=shared, **data, **more
            )
        if not arguments.quiet:
            say(f"{arguments.out}: {found.attrs['sample']}; {found.attrs['read']}\n")
            say("\n".join(rows_aligned(map_page.counts(found, "status"))) + "\n")
        if arguments.plot:
            if as_page:
                cube = open_cube(file, **data, spectrum="wavelength" in found["status"].dims)
                content: Any = map_page.map_page(found, cube, arguments.command)
            else:
                suffix = Path(arguments.plot).suffix
                content = pictures.picture_bytes(map_page.plot_map(found), suffix)
            files.write_whole({Path(arguments.plot): content})
    failed = found.attrs["failed_blocks"]
    for pixels in failed:
        complain(f"{arguments.out}: the workers that fitted the pixels {pixels} died; not fitted.")
    return BLOCKS_FAILED if failed else FITTED
