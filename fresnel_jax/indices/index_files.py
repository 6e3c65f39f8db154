"""An index from a YAML file of the refractiveindex.info database, or from tables of n and of k.

YAML is read by PyYAML, an optional dependency (extra `yaml`): a parser of our own would know only
the part of YAML that those files use today.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .._numerics.index import Index
from .published_formulas import PublishedFormula
from .spectral import DispersionModel
from .tabulated import Tabulated

# An alias may stand for gigabytes. The largest table of the database has 61,730 rows.
_LONGEST_YAML, _DEEPEST, _MOST_PARTS = 5_000_000, 20, 10_000
# k of metals in the far infrared is some thousand: 6,100 is the most in the database.
_LARGEST = 1e6

# n or k: a model, and the wavelengths from which to which it holds.
Part = tuple[DispersionModel, tuple[float, float]]


class _Both(DispersionModel):
    """The n of one model and the k of another."""

    n: DispersionModel
    k: DispersionModel | None = eqx.field(default=None)

    def index(self, wavelength_um: Array) -> Index:
        eta = self.n.index(wavelength_um).eta
        k = jnp.zeros_like(eta) if self.k is None else self.k.index(wavelength_um).k
        return Index(eta, k)


def yaml_parts(text: str) -> dict[str, Part]:
    """The n, and k where there is one, of a file of the refractiveindex.info database."""
    try:
        import yaml
    except ImportError:
        raise ValueError(
            "reading YAML needs PyYAML, which is not installed. Install it (pip install pyyaml, or "
            "fresnel-jax with its extra 'yaml'), or save the index as CSV with the columns "
            "wavelength_um, n, k"
        ) from None
    if len(text) > _LONGEST_YAML:
        most = _LONGEST_YAML // 10**6
        raise ValueError(f"more than {most} MB of YAML came, the most that is read. Leave rows out")
    loader = getattr(yaml, "CBaseLoader", yaml.BaseLoader)  # values stay texts, whatever their tags
    depth = 0
    try:
        for count, event in enumerate(yaml.parse(text, loader)):
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if isinstance(event, yaml.AliasEvent) or depth > _DEEPEST or count > _MOST_PARTS:
                raise ValueError(
                    f"the YAML has an alias (*name), more than {_DEEPEST} levels or more than "
                    f"{_MOST_PARTS} parts, which no index needs. Write it as one table of rows"
                )
        content = _plain(yaml.compose(text, loader))
    except yaml.YAMLError as error:
        reason = " ".join(str(error).split())[:90]
        raise ValueError(f"the file is not valid YAML ({reason})") from None
    entries = content.get("DATA") if isinstance(content, dict) else None
    if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
        raise ValueError(
            "there is no list DATA, which a file of the refractiveindex.info database has"
        )
    parts: dict[str, Part] = {}
    for entry in entries:
        kind = " ".join(str(entry.get("type")).split())
        formula = kind.startswith("formula")
        holds = "n" if formula else kind.removeprefix("tabulated ")
        if holds not in ("n", "k", "nk"):
            continue
        if twice := set(holds) & set(parts):
            raise ValueError(f"DATA holds {min(twice)} twice; keep one of them")
        if formula:
            parts["n"] = _formula(entry, kind)
            continue
        lines = str(entry.get("data")).splitlines()
        rows = [_numbers(line, "a row of data") for line in lines if line.strip()]
        if not rows or any(len(row) != 1 + len(holds) for row in rows):
            wanted = f"rows of {1 + len(holds)} numbers each"
            raise ValueError(f"the data of {kind!r} are not {wanted}")
        wavelength, *columns = np.array(rows).T
        for name, column in zip(holds, columns, strict=True):
            parts[name] = tabulated(wavelength, column, name)
    if "n" not in parts:
        kinds = ", ".join(str(e.get("type"))[:20] for e in entries[:8]) or "nothing"
        raise ValueError(
            f"DATA holds {kinds}, and no n (tabulated n, tabulated nk, formula 1 to 9 were wanted)"
        )
    return parts


def _plain(node: Any) -> Any:
    """A node of YAML as a dict, a list or a text."""
    if node is None or isinstance(node.value, str):
        return node and node.value
    if not all(isinstance(part, tuple) for part in node.value):
        return [_plain(part) for part in node.value]
    names = [str(_plain(key)) for key, _ in node.value]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"{twice[:40]!r} stands twice in one entry; write it once")
    return dict(zip(names, (_plain(value) for _, value in node.value), strict=True))


def joined(n: Part, k: Part | None) -> Part:
    """The index with this n and k (None: 0), over the wavelengths of both."""
    low, high = n[1] if k is None else (max(n[1][0], k[1][0]), min(n[1][1], k[1][1]))
    if not low < high:
        raise ValueError(
            f"the wavelengths of n ({n[1][0]:g} to {n[1][1]:g} um) and of k do not overlap"
        )
    return _Both(n[0], None if k is None else k[0]), (low, high)


def _formula(entry: Mapping[str, Any], kind: str) -> Part:
    found = re.fullmatch(r"formula\s+([1-9])", kind)
    if not found:
        raise ValueError(f"an entry has the type {kind[:40]!r}; formula 1 to formula 9 were wanted")
    # older files say "range"
    limits = _numbers(entry.get("wavelength_range", entry.get("range")), "wavelength_range")
    if len(limits) != 2:
        raise ValueError(f"wavelength_range holds {len(limits)} numbers; two were wanted")
    coefficients = tuple(_numbers(entry.get("coefficients"), "coefficients"))
    model, low, high = PublishedFormula(int(found[1]), coefficients), min(limits), max(limits)
    if not 0.0 < low < high < np.inf:
        raise ValueError(f"wavelength_range is {low:g} to {high:g}; two, above 0, were wanted")
    at = np.geomspace(low, high, 101)
    try:
        with jax.ensure_compile_time_eval(), jax.enable_x64(True):
            n = np.asarray(model.index(jnp.asarray(at)).eta)
    except ArithmeticError:  # a power of two coefficients
        n = np.full(len(at), np.inf)
    wrong = np.flatnonzero(~(np.isreal(n) & (n > 0.0) & (n <= _LARGEST)))
    if len(wrong):
        raise ValueError(
            f"{kind} gives n = {n[wrong[0]]:.4g} at {at[wrong[0]]:.4g} um, and from 0 to "
            f"{_LARGEST:g} was wanted. Correct the coefficients, or shorten wavelength_range"
        )
    return model, (low, high)


def _numbers(text: Any, name: str) -> list[float]:
    try:
        return [float(x.replace("_", "no number")) for x in str(text).split()]
    except ValueError:
        came = repr(str(text)[:60])
        raise ValueError(f"{name} is {came}; numbers separated by blanks were wanted") from None


def tabulated(wavelength: np.ndarray, x: np.ndarray, name: str) -> Part:
    """N (with k = 0) or k in order of wavelength, with means of repeated wavelengths."""
    each, place, count = np.unique(wavelength, return_inverse=True, return_counts=True)
    if not (np.isfinite(each).all() and each[0] > 0.0):
        raise ValueError(f"a wavelength is {each[0]:g}; numbers above 0 were wanted")
    if not (np.abs(x) <= _LARGEST).all():
        raise ValueError(f"an n or k is no number, or above {_LARGEST:g}")
    if len(each) < 2:
        raise ValueError("there is one wavelength; two or more were wanted")
    mean = np.bincount(place, x) / count
    columns = (mean, np.zeros_like(mean)) if name == "n" else (np.ones_like(mean), mean)
    return Tabulated(each, *columns), (float(each[0]), float(each[-1]))
