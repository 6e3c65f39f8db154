"""``fresnel-fit --map CUBE --out maps.zarr``: a cube of curves, fitted pixel by pixel."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from fitting.command.terminal import FITTED, Refused, complain, refusals, say
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
    ("block", "N", "curves that are fitted, and in memory, at a time (10000)", {"type": int}),
    ("workers", "N", "fit in N processes (Dask)", {"type": int}),
    ("scheduler", "ADDRESS", "fit on the workers of this Dask scheduler: tcp://host:8786"),
    ("scheduler-file", "FILE", "the same, of the scheduler that wrote this file"),
)  # fmt: skip


@contextlib.contextmanager
def _cluster(arguments: Any) -> Iterator[Any]:
    """Give a client of the workers that were asked for; None: this process alone fits."""
    if not (arguments.workers or arguments.scheduler or arguments.scheduler_file):
        yield None
        return
    from fitting.maps.cube import package
    from fitting.process.side_by_side import PROCESSORS

    distributed = package("distributed", "--workers")
    if arguments.scheduler or arguments.scheduler_file:
        known = {"address": arguments.scheduler, "scheduler_file": arguments.scheduler_file}
        with distributed.Client(**{n: v for n, v in known.items() if v}) as client:
            yield client
        return
    # What XLA reads when it starts; each worker has its share of the processors.
    share = {"NPROC": str(max(PROCESSORS // arguments.workers, 1)), "TF_CPP_MIN_LOG_LEVEL": "3",
             "JAX_PLATFORMS": os.environ.get("JAX_PLATFORMS", "cpu")}  # fmt: skip
    with (
        distributed.LocalCluster(
            n_workers=arguments.workers, threads_per_worker=1, processes=True, env=share,
            dashboard_address=":0", silence_logs=50,
        ) as cluster,
        distributed.Client(cluster) as client,
    ):  # fmt: skip
        yield client


def _numbers(text: str | None, option: str) -> list[float] | None:
    """Return numbers with commas between them, or LOW..HIGH:COUNT."""
    import numpy as np

    try:
        if text is None:
            return None
        low, dots, rest = text.partition("..")
        if dots:
            high, _, count = rest.partition(":")
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
        from fitting.maps.map_fit import fit_map, source_of
        from fitting.maps.map_page import map_file, status_rows
        from fitting.maps.map_store import MapStore
        from fitting.output import files, pictures
        from fitting.output.summary import rows_aligned

        picture = Path(arguments.plot) if arguments.plot else None
        if picture is not None and picture.suffix.lower() != ".html":
            pictures.check_picture(arguments.plot)
        sigma: Any = arguments.sigma
        with contextlib.suppress(TypeError, ValueError):
            sigma = float(sigma)
        quantity = arguments.quantity and [q.strip() for q in arguments.quantity.split(",")]
        data = {
            "sigma": sigma, "mask": arguments.mask, "dataset": arguments.dataset,
            "quantity": quantity, "angle_deg": _numbers(arguments.angle_deg, "--angle-deg"),
            "wavelength_um": _numbers(arguments.wavelength_um, "--wavelength-um"),
        }  # fmt: skip
        more = {"block": arguments.block} if arguments.block else {}
        shared = [n for n in (arguments.shared or "").split(",") if n.strip()]
        with _cluster(arguments) as client, shown("blocks", quiet=arguments.quiet):
            found = fit_map(
                arguments.file[0], arguments.sample, arguments.out, client=client, shared=shared,
                **data, **more, **{n: v for n, v in options.items() if v},
            )  # fmt: skip
        store = MapStore(arguments.out)
        if not arguments.quiet:
            say(f"{arguments.out}: {found.attrs['sample']}; {found.attrs['read']}\n")
            say("\n".join(rows_aligned(status_rows(store))) + "\n")
        if picture is not None:
            cube = source_of(arguments.file[0], arguments.sample, **data).open()
            content = map_file(picture, found, store, cube, arguments.command)
            try:
                files.write_whole({picture: content})
            except files.OutputError as error:
                raise Refused(str(error)) from error
    failed = found.attrs["failed_blocks"]
    for pixels in failed:
        complain(f"{arguments.out}: the workers that fitted the pixels {pixels} died; not fitted.")
    return BLOCKS_FAILED if failed else FITTED
