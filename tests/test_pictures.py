"""The pictures: what is in them, that they can be written, and what is said without matplotlib."""

import importlib.util
import math
import struct
import zlib

import matplotlib
import numpy as np
import pytest
from fitting.bare_surface.solution import fit
from simulated import GOLD, simulated

from fitting.bare_surface.curves import curve, fitted_values
from fitting.measurement import Measurement, concatenate, read_csv
from fitting.output import plot


@pytest.fixture(scope="module")
def gold():
    measurement = read_csv(GOLD)
    return fit(measurement), measurement


@pytest.fixture(scope="module")
def spectrum():
    parts = [
        simulated(0.5, 2.2, 1e-3, wavelength_um=0.5),
        simulated(1.5, 0.0, 1e-3, wavelength_um=0.6),
        simulated(1.5, 0.0, 1e-3, wavelength_um=0.7, angles=(0.0,)),
    ]
    measurement = concatenate(*parts)
    return fit(measurement), measurement


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


def containers(axes):
    return {c.get_label(): c for c in axes.containers}


def test_the_data_the_curve_and_the_residuals_are_drawn_at_their_values(gold):
    result, m = gold
    top, bottom = plot.draw(result, m).axes
    for label, quantity, color in (
        (r"$R_\mathrm{s}$", "R_s", "#0072B2"),
        (r"$R_\mathrm{p}$", "R_p", "#D55E00"),
    ):
        of = m.quantity == quantity
        line, _, (bars,) = containers(top)[label]
        np.testing.assert_array_equal(line.get_xdata(), m.angle_deg[of])
        np.testing.assert_array_equal(line.get_ydata(), m.value[of])
        reach = [(s[1, 1] - s[0, 1]) / 2.0 for s in bars.get_segments()]
        np.testing.assert_allclose(reach, m.sigma[of], rtol=1e-9)
        fits = [
            x for x in top.lines if x.get_color() == color and len(np.asarray(x.get_xdata())) > 100
        ]
        angles = np.asarray(fits[0].get_xdata())
        assert (angles[0], angles[-1]) == (0.0, 90.0)
        np.testing.assert_array_equal(fits[0].get_ydata(), curve(result, angles, quantity)[0])
    fitted, _ = fitted_values(result, m)
    drawn = np.concatenate([c[0].get_ydata() for c in bottom.containers])
    np.testing.assert_array_equal(drawn, m.value - fitted)
    low, high = bottom.get_ylim()
    assert low == -high
    assert abs(drawn).max() < high


def test_the_band_is_one_sigma_wide(gold):
    result, m = gold
    top, _ = plot.draw(result, m).axes
    bands = [c.get_paths()[0].vertices for c in top.collections if len(c.get_paths()[0]) > 300]
    assert len(bands) == 2
    value, sigma = curve(result, [60.0], "R_s")
    at_60 = bands[0][np.isclose(bands[0][:, 0], 60.0), 1]
    assert at_60.max() == pytest.approx((value + sigma)[0], rel=1e-12)
    assert at_60.min() == pytest.approx((value - sigma)[0], rel=1e-12)


def test_the_title_says_what_was_found(gold):
    result, m = gold
    figure = plot.draw(result, m)
    texts = " ".join(t.get_text() for t in figure.axes[0].texts)
    assert "0.344 $\\pm$ 0.022" in texts
    assert figure.axes[0].get_title(loc="left") == "gold_532nm.csv"


def test_a_png_is_written_and_holds_more_than_white(gold, tmp_path):
    plot.save_plot(*gold, tmp_path / "gold.png")
    width, height, rows = pixels(tmp_path / "gold.png")
    assert width >= 1200
    assert height >= 1000
    assert len(set(rows[:: 4 * 7])) > 20


@pytest.mark.parametrize(("suffix", "start"), [(".pdf", b"%PDF"), (".svg", b"<?xml")])
def test_other_formats(gold, tmp_path, suffix, start):
    plot.save_plot(*gold, tmp_path / "staged", suffix)
    assert (tmp_path / "staged").read_bytes().startswith(start)


def test_the_users_style_is_neither_used_nor_changed(gold, tmp_path):
    with matplotlib.rc_context({"axes.facecolor": "black", "savefig.dpi": 10}):
        plot.save_plot(*gold, tmp_path / "gold.png")
        assert plot.draw(*gold).axes[0].get_facecolor() == (1.0, 1.0, 1.0, 1.0)
        assert matplotlib.rcParams["axes.facecolor"] == "black"
    assert pixels(tmp_path / "gold.png")[0] >= 1200


def test_a_spectrum_shows_the_index_with_its_errors_and_nothing_where_there_is_none(spectrum):
    result, m = spectrum
    assert result.status[2] == "undetermined"
    top, bottom, first, second = plot.draw(result, m).axes
    (eta_line, _, (bars,)) = first.containers[0]
    drawn = dict(zip(eta_line.get_xdata(), eta_line.get_ydata(), strict=True))
    assert drawn == {0.5: result.eta[0], 0.6: result.eta[1]}
    assert (bars.get_segments()[0][1, 1] - bars.get_segments()[0][0, 1]) / 2 == pytest.approx(
        result.sigma_eta[0], rel=1e-9
    )
    labels = {line.get_label(): line for line in second.lines}
    assert labels["not determined"].get_xdata().tolist() == [0.7]
    assert labels["95 % upper limit"].get_ydata().tolist() == [result.k_upper_limit[1]]
    assert sum(len(line.get_xdata()) for line in bottom.lines) == len(m) + 2  # and the line at 0
    drawn = {tuple(point) for c in top.containers for point in c.lines[0].get_xydata()}
    assert drawn == set(zip(m.wavelength_um, m.value, strict=True))
    fitted, _ = fitted_values(result, m)
    at_30 = (m.quantity == "R_s") & (m.angle_deg == 30.0)
    lines = [x for x in top.lines if x.get_linewidth() == 1.2]
    assert any(np.array_equal(x.get_ydata(), fitted[at_30]) for x in lines)


def test_a_spectrum_without_any_index_says_so(tmp_path):
    m = Measurement.from_columns(0.0, [0.4, 0.5, 0.6], R=[0.9, 0.91, 0.92])
    figure = plot.draw(fit(m), m)
    for axes in figure.axes[2:]:
        assert "not determined by these data" in [t.get_text() for t in axes.texts]
    figure.savefig(tmp_path / "normal.png")


def test_data_through_a_polariser_are_drawn_with_their_own_curve():
    angles = np.array([40.0, 50.0, 60.0, 70.0, 80.0])
    both = simulated(0.5, 2.2, 0.0, angles=angles)
    s, p = both.value[both.quantity == "R_s"], both.value[both.quantity == "R_p"]
    m = Measurement.from_columns(angles, polarizer_deg=30.0, R=0.75 * p + 0.25 * s)
    result = fit(m)
    top, _ = plot.draw(result, m).axes
    (line,) = [x for x in top.lines if len(np.asarray(x.get_xdata())) > 100]
    x, y = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    # the curve is drawn in 361 steps, between which it bends by less than 1e-4
    np.testing.assert_allclose(np.interp(angles, x, y), m.value, atol=1e-4)
    assert "30" in "".join(containers(top))


def test_a_few_close_angles_fill_the_picture(gold):
    m = gold[1]
    near = m.where((m.angle_deg > 44.0) & (m.angle_deg < 56.0))
    top, _ = plot.draw(fit(near), near).axes
    low, high = top.get_xlim()
    assert 38.0 < low < 44.7
    assert 54.7 < high < 62.0


@pytest.mark.parametrize("name", ["gold.jpg", "gold", "gold.PNG.txt"])
def test_an_unknown_kind_of_picture_is_refused(name):
    with pytest.raises(ValueError, match=r"\.png, \.pdf, \.svg"):
        plot.check_picture(name)


def test_capitals_are_no_mistake():
    plot.check_picture("GOLD.PNG")


def test_missing_matplotlib_is_named_with_its_extra(monkeypatch):
    found = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "matplotlib" else found(name)
    )
    with pytest.raises(ValueError, match=r"fresnel-jax\[plot\]"):
        plot.check_picture("gold.png")


def test_no_band_where_nothing_tells_the_noise():
    m = Measurement.from_columns([50.0, 70.0], R_p=[0.2, 0.3])
    result = fit(m)
    assert math.isnan(result.sigma_eta)
    top, _ = plot.draw(result, m).axes
    assert [t.get_text() for t in top.get_legend().get_texts()][-1] == "fit"
