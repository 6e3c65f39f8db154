"""The fitted index of a medium as a file of the form of refractiveindex.info, for other programs.

The next fit takes it as a material: ``--sample 'air | film.yml 80 nm | Si'``.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fitting.output.outputs import Outputs
from fitting.result import CONVERGED, UNDETERMINED, Estimate, Fit
from fitting.sample import Sample
from fitting.written_material import errors_beside, material_texts

_FITTED_BY = "Fitted by fresnel-fit"
# What a material file that a fit wrote begins with.
MATERIAL_MARK = f"REFERENCES: |\n    {_FITTED_BY}"


def _with_error(e: Estimate) -> str:
    text = f"{float(e.value):.6g}"
    if e.free and np.isfinite(e.sigma):
        text += f" +- {float(e.sigma):.2g}"
    return f"{text} {e.unit}".strip()


def _conditions(fit: Fit) -> dict[str, object]:
    """Return sample, angles and all that is not an index, by name."""
    out: dict[str, object] = {"sample": str(fit.sample)}
    if fit.measurement is not None:
        angles = np.unique(fit.measurement.angle_deg)
        ends = dict.fromkeys(f"{a:g}" for a in (angles[0], angles[-1]))
        out["angle_of_incidence_deg"] = " to ".join(ends)
    for name, e in fit.parameters.items():
        if "thickness" in name and np.ndim(e.value) == 0:
            out[name] = _with_error(e)
    return out


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
            "--material: the samples have several fitted media, and not the same ones. Fit the one "
            "that is taken by itself, and write its media then."
        )
    return each.pop()


def texts_of(fit: Fit, medium: str | None = None) -> tuple[str, str]:
    """Return the YAML text and that of the errors. medium: as for `Fit.index`.

    Of an index that is free at every wavelength those wavelengths are left out at which the data
    give none. Raises ValueError where there is no index or no wavelength.
    """
    band = fit.index(None, medium)
    good = [CONVERGED] if fit.shape else [CONVERGED, UNDETERMINED]
    known = np.isin(np.broadcast_to(np.ravel(fit.status), band.eta.shape), good)
    known &= np.isfinite(band.wavelength_um)
    if not known.any():
        raise ValueError(
            "there is no index to be written: its wavelength is not known, or the data give none."
        )
    m = fit.measurement
    comments = ["Errors are standard errors, in the CSV file beside this one."]
    if not fit.shape:
        own = {n: e for n, e in fit.parameters.items() if "thickness" not in n}
        comments += [f"{name} = {_with_error(e)}" for name, e in own.items()]
        comments += [f"Warning: {w.text}" for w in fit.warnings]
    return material_texts(
        band.wavelength_um[known], band.eta[known], band.k[known],
        sigma_eta=band.sigma_eta[known], sigma_k=band.sigma_k[known],
        reference=f"{_FITTED_BY} to {'arrays' if m is None else m.source}",
        comments="\n".join(comments), conditions=_conditions(fit),
    )  # fmt: skip


def write(fit: Fit, path: str | os.PathLike[str], medium: str | None = None) -> tuple[Path, Path]:
    """Write both files, or none of them, and return their paths."""
    places = Path(path), errors_beside(path)
    texts = texts_of(fit, medium)
    with Outputs() as outputs:
        staged = [outputs.open(place) for place in places]
        for file, text in zip(staged, texts, strict=True):
            file.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")
        outputs.publish()
    return places
