"""The files of pictures: formats, the same bytes each time, fonts, names, missing matplotlib."""

import importlib.util
import struct
import warnings
import zlib

import matplotlib
import pytest

from fitting import fit
from fitting.data.measurement import Measurement
from fitting.measured_file import read_csv
from fitting.output import pictures
from tests.truth.simulated import GOLD


@pytest.fixture(scope="module")
def gold():
    return fit(read_csv(GOLD))


def saved(found, path, reference=None):
    path.write_bytes(pictures.picture_bytes(found.plot(reference), path.suffix))


def pixels(path):
    """Width, height and decompressed rows of a PNG, read by hand; every chunk is checked."""
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    at, body, size = 8, b"", (0, 0)
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at : at + 8])
        chunk = data[at + 8 : at + 8 + length]
        (check,) = struct.unpack(">I", data[at + 8 + length : at + 12 + length])
        assert zlib.crc32(kind + chunk) == check
        if kind == b"IHDR":
            size = struct.unpack(">II", chunk[:8])
        if kind == b"IDAT":
            body += chunk
        at += 12 + length
    return *size, zlib.decompress(body)


def test_a_png_is_written_and_holds_more_than_white(gold, tmp_path):
    saved(gold, tmp_path / "gold.png")
    width, height, rows = pixels(tmp_path / "gold.png")
    assert width >= 1200
    assert height >= 1000
    assert len(set(rows[:: 4 * 7])) > 20


@pytest.mark.parametrize(("suffix", "start"), [(".pdf", b"%PDF"), (".svg", b"<?xml")])
def test_other_formats(gold, suffix, start):
    assert pictures.picture_bytes(gold.plot(), suffix).startswith(start)


def test_the_users_style_is_neither_used_nor_changed(gold, tmp_path):
    with matplotlib.rc_context({"axes.facecolor": "black", "savefig.dpi": 10}):
        saved(gold, tmp_path / "gold.png")
        assert gold.plot().axes[0].get_facecolor() == (1.0, 1.0, 1.0, 1.0)
        assert matplotlib.rcParams["axes.facecolor"] == "black"
    assert pixels(tmp_path / "gold.png")[0] >= 1200


@pytest.mark.parametrize("name", ["gold.jpg", "gold", "gold.PNG.txt"])
def test_an_unknown_kind_of_picture_is_refused(name):
    with pytest.raises(ValueError, match=r"\.png, \.pdf, \.svg"):
        pictures.check_picture(name)


def test_capitals_are_no_mistake():
    pictures.check_picture("GOLD.PNG")


def test_missing_matplotlib_is_named_with_its_extra(monkeypatch):
    found = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "matplotlib" else found(name)
    )
    with pytest.raises(ValueError, match="pip install matplotlib .*extra 'plot'"):
        pictures.check_picture("gold.png")


@pytest.mark.parametrize("suffix", [".svg", ".pdf", ".png"])
def test_the_same_picture_is_the_same_file(gold, suffix, monkeypatch):
    first = pictures.picture_bytes(gold.plot(), suffix)
    # The time of writing would be another.
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1000000000")
    assert pictures.picture_bytes(gold.plot(), suffix) == first


def test_letters_that_the_font_does_not_have_are_named(tmp_path):
    m = Measurement.from_columns(
        [40.0, 60.0, 70.0, 80.0], source="\u91d1\u5c5e.csv", R_s=[0.80, 0.86, 0.90, 0.95]
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        saved(fit(m), tmp_path / "a.png")
    told = {str(w.message) for w in caught}
    for letter in "\u91d1\u5c5e":
        assert any(f"Glyph {ord(letter)} " in text for text in told)


def test_a_name_is_no_formula_and_has_no_control_characters(tmp_path):
    m = Measurement.from_columns(
        [40.0, 60.0, 70.0, 80.0], source="a$b_\\x$\x1b.csv", R_s=[0.80, 0.86, 0.90, 0.95]
    )
    saved(fit(m), tmp_path / "a.svg")
    text = (tmp_path / "a.svg").read_text()
    assert "\x1b" not in text
    assert r"a$b_\x$\x1b.csv" in text


def test_python_is_told_of_a_missing_matplotlib(gold, monkeypatch, tmp_path):
    found = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "matplotlib" else found(name)
    )
    with pytest.raises(ImportError, match="pip install matplotlib .*extra 'plot'"):
        gold.plot()
    with pytest.raises(ImportError, match="pip install matplotlib .*extra 'plot'"):
        gold.report(tmp_path / "new")
    assert not (tmp_path / "new").exists()
