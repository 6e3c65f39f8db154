"""The fitted index of a medium as a YAML file in the format of refractiveindex.info.

Other programs read it, and so does the next fit: ``--sample 'air | film.yml 80 nm | Si'``. The
format has no place for standard errors; they go into a CSV file beside it, which `material_files`
reads too.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from fitting.data.units import span_of
from fitting.output.as_data import INDEX_MARK
from fitting.process.visible import visible
from fitting.results.result import Fit
from fitting.results.result_parts import CONVERGED, UNDETERMINED, Estimate, IndexBand
from fitting.samples.known_media import MaterialFile
from fitting.samples.sample import Sample

_ENDINGS = (".yml", ".yaml")


def errors_beside(path: str | os.PathLike[str], flag: str = "") -> Path:
    """Return the path for the errors of a material file; ValueError if that is not a .yml.

    flag: the option that named the file, for the text.
    """
    file = Path(path)
    if file.suffix.lower() not in _ENDINGS:
        name = f"{flag} {file}".strip()
        raise ValueError(f"{name}: the name of a material file must end in .yml.")
    return file.with_name(f"{file.stem}_errors.csv")


def of_medium(path: str | os.PathLike[str], medium: str | None) -> Path:
    """Return where the index of one medium goes: out_film.yml beside out.yml.

    medium: its place in the sample; None for the only one, which goes to ``path`` itself.
    """
    file = Path(path)
    return file if medium is None else file.with_name(f"{file.stem}_{medium}{file.suffix}")


def _quoted(text: str) -> str:
    """Return any text in quotes, which YAML cannot misread."""
    return '"' + visible(text).replace("\\", "\\\\").replace('"', '\\"') + '"'


def material_texts(
    band: IndexBand, reference: str, comments: str, conditions: Mapping[str, str]
) -> tuple[str, str]:
    """Return the texts of the YAML file and of the CSV with the errors.

    Rows without a number are left out. Raises ValueError where none is left.
    """
    columns = np.array([band.wavelength_um, band.eta, band.k, band.sigma_eta, band.sigma_k], float)
    rows = columns.T[np.isfinite(columns[:3]).all(axis=0)]
    if not len(rows):
        raise ValueError(
            "eta and k are known at no wavelength, and no file was written: the wavelength is not "
            "stated, or the data do not determine eta and k."
        )
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    lines = []
    for key, text in (("REFERENCES", reference), ("COMMENTS", comments)):
        lines += [f"{key}: |", *(f"    {visible(line)}" for line in text.splitlines())]
    lines += ["CONDITIONS:", *(f"  {name}: {_quoted(text)}" for name, text in conditions.items())]
    lines += ["DATA:", "  - type: tabulated nk", "    data: |"]
    lines += ["        " + " ".join(f"{x:.9g}" for x in row[:3]) for row in rows]
    table = [f"# {INDEX_MARK}", "wavelength_um,n,k,sigma_n,sigma_k"]
    table += (",".join(f"{x:.9g}" for x in row) for row in rows)
    return "\n".join(lines) + "\n", "\n".join(table) + "\n"


def _with_error(e: Estimate) -> str:
    """Return a value with six digits, so that a formula gives the curve again, and its error."""
    error = f" +- {float(e.sigma):.2g}" if e.free and np.isfinite(e.sigma) else ""
    return f"{float(e.value):.6g}{error} {e.unit}".strip()


def _conditions(fit: Fit) -> dict[str, str]:
    """Return sample, angles and all that is not an index, by name."""
    out = {"sample": str(fit.sample)}
    if fit.measurement is not None:
        out["angle_of_incidence_deg"] = span_of(fit.measurement.angle_deg)
    for name, e in fit.parameters.items():
        if "thickness" in name and np.ndim(e.value) == 0:
            out[name] = _with_error(e)
    return out


def files_named(samples: Sequence[Sample]) -> list[str]:
    """Return the files with an index that are media of samples."""
    known = [part for s in samples for medium in s.media for part in medium.known]
    return [part.path for part in known if isinstance(part, MaterialFile)]


def fitted_media(samples: Sequence[Sample]) -> tuple[str | None, ...]:
    """Return the places of the media whose index is fitted; (None,) where there is one or none.

    Raises ValueError for samples among which one is going to be chosen, if their fitted media
    differ in place, since it is not known yet which files there will be.
    """
    each = {
        tuple(place for place, m in zip(s.places[1:], s.media[1:], strict=True) if m.unknown)
        for s in samples
    }
    if max(map(len, each)) <= 1:
        return (None,)
    if len(each) > 1:
        raise ValueError(
            "--material: the samples that are compared have different fitted media. Choose one of "
            "them first, and write its media in a fit of that sample alone."
        )
    return each.pop()


def texts_of(fit: Fit, medium: str | None = None) -> tuple[str, str]:
    """Return the YAML text and that of the errors. medium: as for `Fit.index`.

    If the index is free at every wavelength, those are left out at which the data do not determine
    it. Raises ValueError where there is no index or no wavelength.
    """
    band = fit.index(None, medium)
    good = [CONVERGED] if fit.shape else [CONVERGED, UNDETERMINED]
    known = np.isin(np.broadcast_to(np.ravel(fit.status), band.eta.shape), good)
    m = fit.measurement
    comments = ["The standard errors of n and k are in the CSV file beside this one."]
    if not fit.shape:
        own = {n: e for n, e in fit.parameters.items() if "thickness" not in n}
        comments += [f"{name} = {_with_error(e)}" for name, e in own.items()]
        comments += [f"Warning: {w.text}" for w in fit.warnings]
    reference = f"Fitted by fresnel-fit to {'arrays' if m is None else m.source}"
    some = IndexBand(*(column[known] for column in band))
    return material_texts(some, reference, "\n".join(comments), _conditions(fit))
