"""Which warnings the fits of a bare surface get, for all curves at once."""

from __future__ import annotations

from typing import Any

import numpy as np

from fitting.bare_surface import thresholds as limit
from fitting.bare_surface.answer import Answer
from fitting.bare_surface.arrange import Arranged
from fitting.bare_surface.common_error import Taken
from fitting.diagnostics import Finding
from fitting.sentences import SENTENCES


def shaped(values: Any, a: Arranged) -> Any:
    """Return (N, ...) in the batch's shape; of one curve as a Python scalar where it is one."""
    array = np.asarray(values)
    array = array.reshape(a.shape + array.shape[1:])
    return array.item() if array.ndim == 0 else array


def _trade(information: np.ndarray) -> float:
    """Return by how much k^2 changes for one of eta along what the data see least; NaN: nothing."""
    _, vectors = np.linalg.eigh(np.nan_to_num(information))
    along_eta, along_u = vectors[:, 0]
    return along_u / along_eta if along_eta else np.nan


def _of_floor(f: Answer, taken: Taken) -> dict[str, np.ndarray]:
    """Return where a common error was taken, and where that changes more than the errors tell."""
    used = np.isfinite(taken.gain)
    with np.errstate(all="ignore"):
        apart = [
            np.abs(f.values[name] - taken.by_factor[:, i]) > f.values[f"sigma_{name}"]
            for i, name in enumerate(("eta", "k"))
        ]
    return {"errors_floor": used, "errors_differ": used & np.logical_or(*apart)}


def _of_others(f: Answer) -> dict[str, Any]:
    """Return how many other solutions there are, and the best of them."""
    there = [one.there for one in f.others]

    def first(name: str) -> np.ndarray:
        return np.select(there, [one.values[name] for one in f.others], np.nan)

    return {
        "count": np.sum(there, axis=0), "parameters": ("eta", "k"),
        "delta_chi2": np.select(there, [one.excess for one in f.others], np.nan),
        "values": np.stack([first("eta"), first("k")], -1),
    }  # fmt: skip


def findings(a: Arranged, f: Answer, taken: Taken, errors: str) -> tuple[Finding, ...]:
    v, s = f.values, f.solved
    with np.errstate(all="ignore"):
        chi2_reduced = np.where(f.dof > 0, v["chi2"] / f.dof, np.nan)
        share, rms = v["sigma_eta"] / v["eta"], np.sqrt(s.plain / s.count)
        correlation = v["covariance"][:, 0, 1] / (v["sigma_eta"] * v["sigma_k"])
    of_chi2 = {
        "chi2_reduced": chi2_reduced, "factor": np.sqrt(chi2_reduced),
        "errors": "stated" if errors == "stated" else "scaled",
    }  # fmt: skip
    at_k = {"eta": v["eta"], "k": v["k"], "eta_i": a.data.eta_i}
    slopes = np.full(len(v["eta"]), np.nan)
    for i in np.flatnonzero(f.codes["combination"]):
        slopes[i] = _trade(v["information"][i])
    values: dict[str, dict[str, Any]] = {
        "not_converged": {"evaluations": s.evaluations.astype(int)},
        "perfect_mirror": {"least_reflectance": v["least_reflectance"]},
        "no_reflection": {"eta_i": a.data.eta_i},
        "circle": at_k, "same_at_45_degrees": at_k, "combination": {**at_k, "slope": slopes},
        "does_not_describe": {"rms": rms, "sample": "one bare surface"},
        "compatible_with_zero": {
            "parameter": "k", "limit": v["limit"], "even": v["eta"] >= a.data.eta_i,
        },
        "poorly_determined": {"parameters": ("eta",), "shares": share[:, None]},
        "correlated": {
            "first": ("eta",), "second": ("k",), "correlation": correlation[:, None]
        },
        "chi2_large": of_chi2, "chi2_small": of_chi2,
        "flat_curve": {"below_deg": limit.FLAT_BELOW_DEG},
        "no_degrees_of_freedom": {
            "n_data": s.count.astype(int), "unknowns": 2, "stated": np.isfinite(v["sigma_eta"]),
        },
        "other_minima": _of_others(f),
    }  # fmt: skip
    codes = f.codes | _of_floor(f, taken)
    floored = np.stack([v["eta"], v["k"]], -1)
    values["errors_floor"] = {
        "chi2_reduced": chi2_reduced, "floor": taken.floor, "gain": taken.gain
    }  # fmt: skip
    values["errors_differ"] = {
        "parameters": ("eta", "k"), "floor": floored, "factor": taken.by_factor
    }  # fmt: skip
    return tuple(
        Finding(
            code,
            np.reshape(codes[code], a.shape),
            {
                name: shaped(v, a) if isinstance(v, np.ndarray) else v
                for name, v in values.get(code, {}).items()
            },
        )
        for code in SENTENCES
        if code in codes and codes[code].any()
    )
