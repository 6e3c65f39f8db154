"""A fit as one self-contained HTML page, which loads no other file, and as a cell of a notebook."""

from __future__ import annotations

import base64
import html
import math
import re
from collections.abc import Iterable, Sequence
from typing import Any

from fitting.output import summary
from fitting.output.export import WRITTEN_BY, data_columns
from fitting.process.visible import visible
from fitting.results.result import FitData

# A table of more rows is folded, since the same numbers are in the CSV files.
OPEN_ROWS = 40

_BODY = """font: 16px/1.5 system-ui, sans-serif; color: #1a1a1a; background: #fff;
  max-width: 56rem; margin: 2rem auto; padding: 0 1rem;"""
# Each rule begins a line, where `notebook` puts a prefix that restricts it to its cell.
_STYLE = """
h1 { font-size: 1.5rem; margin: 0 0 .5rem; overflow-wrap: anywhere; }
h2 { font-size: 1.1rem; margin: 2rem 0 .5rem; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .2rem 1.2rem; margin: 0; }
dt { color: #595959; font-weight: normal; }
dd { margin: 0; overflow-wrap: anywhere; }
.warning { border-left: .3rem solid #d55e00; background: #fdf3ec; padding: .4rem .8rem; }
.note { border-left: .3rem solid #0072b2; background: #eef5fa; padding: .4rem .8rem; }
figure { margin: 1.5rem 0; }
img { max-width: 100%; height: auto; }
figcaption { color: #595959; text-align: left; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .9rem; }
th { text-align: right; padding: .15rem .7rem; border-bottom: 1px solid #e6e6e6; }
td { text-align: right; padding: .15rem .7rem; border-bottom: 1px solid #e6e6e6; }
th:first-child { text-align: left; }
td:first-child { text-align: left; }
summary { cursor: pointer; }
footer { margin-top: 3rem; color: #595959; font-size: .85rem; }
"""


def element(tag: str, text: str, more: str = "") -> str:
    """Return an element; texts are escaped, since they may come from the user's data."""
    return f"<{tag}{more}>{html.escape(visible(text))}</{tag}>"


def html_table(title: str, rows: Sequence[Sequence[str]], level: str = "h2") -> str:
    """Return a table below its title; the first row is the header."""
    head = "".join(element("th", cell, " scope=col") for cell in rows[0])
    lines = ["".join(element("td", cell) for cell in row) for row in rows[1:]]
    body = "\n".join(f"<tr>{line}</tr>" for line in lines)
    text = (
        f"<div class=wide><table><thead><tr>{head}</tr></thead>\n"
        f"<tbody>\n{body}\n</tbody></table></div>"
    )
    if len(lines) > OPEN_ROWS:
        text = f"<details><summary>{len(lines)} rows</summary>\n{text}</details>"
    return f"{element(level, title)}\n{text}"


def figure(caption: str, png: bytes) -> str:
    """Return a picture, which the page itself holds. png: the bytes of a PNG file."""
    data = base64.b64encode(png).decode("ascii")
    source = f'alt="{html.escape(visible(caption))}" src="data:image/png;base64,{data}"'
    return f"<figure><img {source}>{element('figcaption', caption)}</figure>"


def _listed(rows: summary.Facts) -> str:
    """Return a list of labels and texts."""
    each = [element("dt", label) + element("dd", text) for label, text in rows]
    return "\n".join(["<dl>", *each, "</dl>"])


def _parts(fit: FitData, choice: Any, png: bytes, level: int) -> list[str]:
    """Return title, result, picture, warnings and notes, what was read and fitted, and compared."""
    below = f"h{level + 1}"
    told = [("warning", f"{name.capitalize()}: {text}") for name, text in summary.warnings_of(fit)]
    reasons = [] if choice is None else choice.reasons
    told += [("note", f"Note: {note.text}") for note in [*reasons, *fit.notes]]
    caption = "Data and fitted curves with one standard error, and data - fit."
    if fit.measurement is None:
        caption = "The fitted parameters of the batch."
    parts = [_listed(summary.facts(fit)), *([figure(caption, png)] if png else [])]
    parts += [element("p", text, f" class={kind}") for kind, text in told]
    if fit.shape:  # the table of a batch is too long to stand above the picture
        title = "Index over wavelength" if summary.by_wavelength(fit) else "Curves"
        parts.append(html_table(title, summary.batch_rows(fit, intervals=True), below))
    else:
        parts.insert(0, html_table("Parameters", summary.parameter_rows(fit), below))
    parts.append(_listed(summary.heading(fit)))
    if choice is not None:
        parts.append(html_table("Models compared", choice.table(), below))
    return [element(f"h{level}", summary.title_of(fit)), *parts]


def document(title: str, parts: Iterable[str], foot: str) -> str:
    """Return a page of these parts."""
    head = (
        f'<!DOCTYPE html>\n<!-- {WRITTEN_BY} -->\n<html lang="en"><head><meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"{element('title', title)}<style>body {{ {_BODY} }}{_STYLE}</style></head><body>"
    )
    return "\n".join([head, *parts, element("footer", foot), "</body></html>"]) + "\n"


def _cell(value: Any) -> str:
    if isinstance(value, str):
        return value
    return "" if math.isnan(value) else f"{value:.6g}"


def fit_page(fit: FitData, png: bytes, command: str = "", choice: Any = None) -> str:
    """Return the page of a fit, one self-contained HTML file.

    png: the picture. command: the command line that made the fit, for the foot of the page.
    choice: what `choose` compared, if a model was chosen.
    """
    parts = _parts(fit, choice, png, 1)
    if rows := summary.index_rows(fit):
        parts.append(html_table("Index over wavelength", [["wavelength_um", "eta", "k"], *rows]))
    if fit.measurement is not None:
        columns = data_columns(fit)
        rows = [list(map(_cell, row)) for row in zip(*columns.values(), strict=True)]
        title = "Data (powers as fractions, angles in degrees)"
        parts.append(html_table(title, [list(columns), *rows]))
    return document(summary.title_of(fit), parts, command)


def notebook(fit: FitData, png: bytes = b"", choice: Any = None) -> str:
    """Return the result and its picture as HTML for a cell, whose style affects no other."""
    style = re.sub(r"(?m)^(?=[a-z.])", ".fresnel-fit ", _STYLE)
    parts = [f"<style>{style}</style>", "<div class=fresnel-fit>", *_parts(fit, choice, png, 3)]
    return "\n".join([*parts, "</div>"]) + "\n"
