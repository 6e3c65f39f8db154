"""One self-contained HTML page of facts, warnings, pictures and tables; it loads no other file."""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from fitting.process.visible import visible

# A table of more rows is folded, since the same numbers are in the CSV files.
OPEN_ROWS = 40

_BODY = """font: 16px/1.5 system-ui, sans-serif; color: #1a1a1a; background: #fff;
  max-width: 56rem; margin: 2rem auto; padding: 0 1rem;"""
# Each rule begins a line, where `fragment` puts a prefix that restricts it to a notebook's cell.
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


class Table(NamedTuple):
    """A table of the page: its heading, the headers of the columns, and rows of texts."""

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]


def _escaped(text: str) -> str:
    return html.escape(visible(text))


def _table(table: Table, level: str = "h2") -> str:
    head = "".join(f"<th scope=col>{_escaped(cell)}</th>" for cell in table.head)
    rows = "\n".join(
        "<tr>" + "".join(f"<td>{_escaped(cell)}</td>" for cell in row) + "</tr>"
        for row in table.rows
    )
    body = (
        f"<div class=wide><table><thead><tr>{head}</tr></thead>\n"
        f"<tbody>\n{rows}\n</tbody></table></div>"
    )
    if len(table.rows) > OPEN_ROWS:
        body = f"<details><summary>{len(table.rows)} rows</summary>\n{body}</details>"
    return f"<{level}>{_escaped(table.title)}</{level}>\n{body}"


def _head(
    title: str,
    facts: Iterable[tuple[str, str]],
    warnings: Iterable[str],
    notes: Iterable[str],
    level: str,
    numbered: bool,
) -> list[str]:
    parts = [
        f"<{level}>{_escaped(title)}</{level}>",
        "<dl>",
        *(f"<dt>{_escaped(label)}</dt><dd>{_escaped(text)}</dd>" for label, text in facts),
        "</dl>",
    ]
    for i, text in enumerate(warnings, 1):
        label = f"Warning {i}" if numbered else "Warning"
        parts.append(f"<p class=warning>{label}: {_escaped(text)}</p>")
    return parts + [f"<p class=note>Note: {_escaped(text)}</p>" for text in notes]


def page(
    title: str,
    facts: Iterable[tuple[str, str]],
    warnings: Iterable[str],
    notes: Iterable[str],
    pictures: Iterable[tuple[str, bytes]],
    tables: Iterable[Table],
    foot: str,
    first: Iterable[Table] = (),
    numbered: bool = False,
) -> str:
    """Return the page. facts: label and text. pictures: caption and the bytes of a PNG file.

    first: tables that stand above the pictures. numbered: whether warnings have numbers, to which a
    table refers. All texts are escaped, since they may come from the user's data; pictures are
    embedded.
    """
    parts = [
        "<!DOCTYPE html>",
        '<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{_escaped(title)}</title><style>body {{ {_BODY} }}{_STYLE}</style></head><body>",
        *_head(title, facts, warnings, notes, "h1", numbered),
        *(_table(table) for table in first),
    ]
    for caption, png in pictures:
        data = base64.b64encode(png).decode("ascii")
        parts.append(
            f'<figure><img alt="{_escaped(caption)}" src="data:image/png;base64,{data}">'
            f"<figcaption>{_escaped(caption)}</figcaption></figure>"
        )
    parts += [_table(table) for table in tables]
    parts += [f"<footer>{_escaped(foot)}</footer>", "</body></html>"]
    return "\n".join(parts) + "\n"


def fragment(
    title: str,
    facts: Iterable[tuple[str, str]],
    warnings: Iterable[str],
    notes: Iterable[str],
    tables: Iterable[Table],
    numbered: bool = False,
) -> str:
    """Return `page` without pictures as a part of another page; its style affects no other part."""
    scoped = re.sub(r"(?m)^(?=[a-z.])", ".fresnel-fit ", _STYLE)
    parts = [f"<style>{scoped}</style>", "<div class=fresnel-fit>"]
    parts += _head(title, facts, warnings, notes, "h3", numbered)
    parts += [_table(table, "h4") for table in tables]
    return "\n".join([*parts, "</div>"]) + "\n"
