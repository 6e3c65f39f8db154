"""The built site: no warning, docstrings as they were meant, signatures as wide as the page."""

import html
import os
import re
import subprocess
import sys

import pytest

from tests.command_line import ROOT

pytestmark = pytest.mark.docs  # of `make test-docs`
SIGNATURE = 80  # characters that fit beside the navigation (mkdocs.yml: line_length)


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """Name -> text of each built page of the API reference."""
    site = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "-d", str(site)],
        cwd=ROOT, capture_output=True, text=True, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return {p.name: p.read_text(encoding="utf-8") for p in (site / "api").glob("*.html")}


def blocks(pages, pattern):
    """(page, what the group of a pattern holds) of all pages; there are some."""
    found = [(name, x) for name in pages for x in re.findall(pattern, pages[name], re.DOTALL)]
    assert found
    return found


def test_what_is_returned_is_one_text(pages):
    for name, body in blocks(pages, r'doc-section-title">Returns:</span>(.*?)</ul>'):
        assert body.count('<li class="doc-section-item') == 1, f"{name}: {body[:300]}"


def test_no_text_became_the_title_of_a_section(pages):
    """The text of 'Returns: text' on one line is read as a title, and 'name:' alone as a box."""
    titles = {"Parameters:", "Returns:", "Raises:"}
    for name, title in blocks(pages, r'doc-section-title">(.*?)</span>'):
        assert title in titles, name
    for name, text in pages.items():
        assert "<summary>" not in text, name


def test_signatures_are_no_wider_than_the_page(pages):
    for name, body in blocks(pages, r'<div class="doc-signature highlight">(.*?)</pre>'):
        for line in html.unescape(re.sub("<[^>]+>", "", body)).splitlines():
            assert len(line) <= SIGNATURE, f"{name}: {line}"
