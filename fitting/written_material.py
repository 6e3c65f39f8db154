"""A fitted index as a file in the form of refractiveindex.info, and its errors as CSV.

`fitting.material_files` reads both again; `output.material` writes those of a fit.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fitting.visible import visible

ENDINGS = (".yml", ".yaml")
ERRORS_HEAD = "wavelength_um,n,k,sigma_n,sigma_k"


def errors_beside(path: str | os.PathLike[str]) -> Path:
    """Return the path for the errors of a material file; ValueError for another kind of name."""
    file = Path(path)
    if file.suffix.lower() not in ENDINGS:
        raise ValueError(f"{file.name}: wanted a name that ends in .yml")
    return file.with_name(f"{file.stem}_errors.csv")


def of_medium(path: str | os.PathLike[str], medium: str | None) -> Path:
    """Return the path for the index of one medium: out_film.yml beside out.yml.

    medium: its place in the sample; None: the only one, which goes to ``path`` itself.
    """
    file = Path(path)
    return file if medium is None else file.with_name(f"{file.stem}_{medium}{file.suffix}")


def material_texts(
    wavelength_um: Any,
    eta: Any,
    k: Any,
    *,
    sigma_eta: Any = None,
    sigma_k: Any = None,
    reference: str = "",
    comments: str = "",
    conditions: Mapping[str, object] | None = None,
) -> tuple[str, str]:
    """Return the texts of the YAML file and of the CSV with the errors; see `write_material`."""
    columns = [np.atleast_1d(np.asarray(x, float)) for x in (wavelength_um, eta, k)]
    known = np.isfinite(columns).all(axis=0)
    if not known.any():
        raise ValueError("no wavelength has an index; nothing was written")
    order = np.flatnonzero(known)[np.argsort(columns[0][known], kind="stable")]
    lines = []
    for key, text in (("REFERENCES", reference), ("COMMENTS", comments)):
        if text:
            lines += [f"{key}: |", *(f"    {visible(line)}" for line in text.splitlines())]
    if conditions:
        lines += ["CONDITIONS:", *(f"  {name}: {_plain(v)}" for name, v in conditions.items())]
    lines += ["DATA:", "  - type: tabulated nk", "    data: |"]
    lines += ["        " + " ".join(f"{c[i]:.9g}" for c in columns) for i in order]
    errors = [
        np.broadcast_to(math.nan if s is None else np.asarray(s, float), columns[0].shape)
        for s in (sigma_eta, sigma_k)
    ]
    rows = [",".join(f"{c[i]:.9g}" for c in (*columns, *errors)) for i in order]
    table = [ERRORS_HEAD, *rows]
    return "\n".join(lines) + "\n", "\n".join(table) + "\n"


def write_material(
    path: str | os.PathLike[str], wavelength_um: Any, eta: Any, k: Any, **more: Any
) -> tuple[Path, Path | None]:
    """Write an index as a file in the form of refractiveindex.info, its errors as CSV beside it.

    path: ends in .yml. wavelength_um, eta, k: (W,). sigma_eta, sigma_k: (W,) standard errors, for
    which that form has no place; they are written to ``NAME_errors.csv``. reference, comments:
    plain text. conditions: name -> value, such as ``{"temperature": 293, "thickness": "108 nm"}``.
    Returns both paths (None: no errors). Rows without a finite number are left out.
    """
    file, beside = Path(path), errors_beside(path)
    try:
        text, errors = material_texts(wavelength_um, eta, k, **more)
    except ValueError as error:
        raise ValueError(f"{file.name}: {error}") from None
    file.write_text(text, encoding="utf-8")
    if more.get("sigma_eta") is None and more.get("sigma_k") is None:
        return file, None
    beside.write_text(errors, encoding="utf-8")
    return file, beside


def _plain(value: object) -> str:
    """Return a number unchanged and any text in quotes, so that YAML cannot misread it."""
    if isinstance(value, int | float):
        return f"{value:g}"
    return '"' + visible(str(value)).replace("\\", "\\\\").replace('"', '\\"') + '"'
