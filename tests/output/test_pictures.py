"""The pictures: what is in them, at which values, in which panels."""

import math
from typing import Any

import numpy as np
import pytest

from fitting import fit, fit_many, simulate
from fitting.data.measurement import Measurement, concatenate
from fitting.measured_file import read_csv
from fitting.output.pictures import picture_bytes
from fresnel_jax.dispersion import HC_EV_UM
from tests.truth.simulated import GOLD, simulated, textbook

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def gold():
    return fit(read_csv(GOLD))


@pytest.fixture(scope="module")
def spectrum():
    parts = [
        simulated(0.5, 2.2, 1e-3, wavelength_um=0.5),
        simulated(1.5, 0.0, 1e-3, wavelength_um=0.6),
        simulated(1.5, 0.0, 1e-3, wavelength_um=0.7, angles=(0.0,)),
    ]
    return fit(concatenate(*parts))


def saved(found, path, reference=None):
    path.write_bytes(picture_bytes(found.plot(reference), path.suffix))


def containers(axes):
    return {c.get_label(): c for c in axes.containers}


def test_the_data_the_curve_and_the_residuals_are_drawn_at_their_values(gold):
    m = gold.measurement
    top, bottom = gold.plot().axes
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
        np.testing.assert_array_equal(fits[0].get_ydata(), gold.predict(angles, quantity).value)
    fitted = gold.predict().value
    drawn = np.concatenate([c[0].get_ydata() for c in bottom.containers])
    np.testing.assert_array_equal(drawn, m.value - fitted)
    low, high = bottom.get_ylim()
    assert low == -high
    assert abs(drawn).max() < high


def test_the_band_is_one_sigma_wide(gold):
    top, _ = gold.plot().axes
    bands = [c.get_paths()[0].vertices for c in top.collections if len(c.get_paths()[0]) > 300]
    assert len(bands) == 2
    value, sigma = gold.predict([60.0], "R_s")
    at_60 = bands[0][np.isclose(bands[0][:, 0], 60.0), 1]
    assert at_60.max() == pytest.approx((value + sigma)[0], rel=1e-12)
    assert at_60.min() == pytest.approx((value - sigma)[0], rel=1e-12)


def test_the_title_says_what_was_found(gold):
    figure = gold.plot()
    texts = " ".join(t.get_text() for t in figure.axes[0].texts)
    assert "0.344 $\\pm$ 0.022" in texts
    assert figure.axes[0].get_title(loc="left") == "gold_532nm.csv"


def test_a_spectrum_shows_the_index_with_its_errors_and_nothing_where_there_is_none(spectrum):
    result, m = spectrum, spectrum.measurement
    assert result.status[2] == "undetermined"
    *pairs, first, second = result.plot().axes  # two panels, of three angles each
    tops, bottoms = pairs[:2], pairs[2:]
    (eta_line, _, (bars,)) = first.containers[0]
    drawn = dict(zip(eta_line.get_xdata(), eta_line.get_ydata(), strict=True))
    assert drawn == {0.5: result.eta[0], 0.6: result.eta[1]}
    assert (bars.get_segments()[0][1, 1] - bars.get_segments()[0][0, 1]) / 2 == pytest.approx(
        result.parameters["eta"].sigma[0], rel=1e-9
    )
    labels = {line.get_label(): line for line in second.lines}
    assert labels["not determined"].get_xdata().tolist() == [0.7]
    assert labels["95 % upper limit"].get_ydata().tolist() == [
        result.parameters["k"].upper_limit[1]
    ]
    residuals = [line for bottom in bottoms for line in bottom.lines]
    assert sum(len(line.get_xdata()) for line in residuals) == len(m) + 4  # and the lines at 0
    containers = [c for top in tops for c in top.containers]
    drawn = {tuple(point) for c in containers for point in c.lines[0].get_xydata()}
    assert drawn == set(zip(m.wavelength_um, m.value, strict=True))
    fitted = result.predict().value
    at_30 = (m.quantity == "R_s") & (m.angle_deg == 30.0)
    assert any(
        np.array_equal(x.get_ydata(), fitted[at_30]) and x.get_linestyle() == "-"
        for x in tops[0].lines
    )


def test_a_spectrum_without_any_index_says_so(tmp_path):
    m = Measurement.from_columns(0.0, [0.4, 0.5, 0.6], R=[0.9, 0.91, 0.92])
    figure = fit(m).plot()
    for axes in figure.axes[2:]:
        assert "not determined by these data" in [t.get_text() for t in axes.texts]
    figure.savefig(tmp_path / "normal.png")


def test_data_through_a_polarizer_are_drawn_with_their_own_curve():
    angles = np.array([40.0, 50.0, 60.0, 70.0, 80.0])
    both = simulated(0.5, 2.2, 0.0, angles=angles)
    s, p = both.value[both.quantity == "R_s"], both.value[both.quantity == "R_p"]
    m = Measurement.from_columns(angles, polarizer_deg=30.0, R=0.75 * p + 0.25 * s)
    top, _ = fit(m).plot().axes
    (line,) = [x for x in top.lines if len(np.asarray(x.get_xdata())) > 100]
    x, y = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    # the curve is drawn in 361 steps, between which it bends by less than 1e-4
    np.testing.assert_allclose(np.interp(angles, x, y), m.value, atol=1e-4)
    assert "30" in "".join(containers(top))


def test_a_few_close_angles_fill_the_picture():
    near = simulated(0.5, 2.2, 1e-3, angles=(44.7, 50.0, 54.7))
    top, _ = fit(near).plot().axes
    low, high = top.get_xlim()
    assert 38.0 < low < 44.7
    assert 54.7 < high < 62.0


def test_no_band_where_nothing_tells_the_noise():
    m = Measurement.from_columns([50.0, 70.0], R_p=[0.2, 0.3])
    result = fit(m)
    assert math.isnan(result.parameters["eta"].sigma)
    top, _ = result.plot().axes
    assert [t.get_text() for t in top.get_legend().get_texts()][-1] == "fit"


def glass_plate(angles=(0.0,)):
    """R, R_back and T of a plate of one glass, where R and R_back are the same."""
    waves = np.linspace(0.4, 1.6, 13)
    text = "air | cauchy-urbach:2 3 mm thick | air"
    # The edge of a fit is the highest photon energy of its data.
    true = {"A": 1.5, "B": 0.004, "k_edge": 3e-5, "urbach_ev": 0.3, "edge_ev": HC_EV_UM / 0.4}
    points = [(a, w) for a in angles for w in waves]
    angle, wave = np.array(points).T
    of = {q: simulate(text, true, angle, wave, q) for q in ("R", "R_back", "T")}
    rng = np.random.default_rng(2)
    noisy: dict[str, Any] = {q: v + 1e-3 * rng.normal(size=len(v)) for q, v in of.items()}
    return Measurement.from_columns(angle, wave, sigma=1e-3, **noisy), text


@pytest.fixture(scope="module")
def plate():
    m, text = glass_plate()
    return fit(m, text, intervals="quadratic", starts=8)


@pytest.mark.study
def test_eta_and_k_have_panels_of_their_own_and_k_is_logarithmic_over_decades(plate):
    figure = plate.plot()
    top, _, first, second = figure.axes  # no twin axes among them
    assert len({str(axes.get_position().bounds) for axes in figure.axes}) == 4
    assert second.get_yscale() == "log"
    assert first.get_yscale() == "linear"
    band = plate.index(np.linspace(0.4, 1.6, 300))
    (line,) = second.lines
    np.testing.assert_array_equal(line.get_ydata(), band.k)
    assert all(c.get_paths()[0].vertices[:, 1].min() >= 0.0 for c in second.collections)
    marks = {c.get_label(): (c[0].get_marker(), c[0].get_markerfacecolor()) for c in top.containers}
    # R lies on R_back: each has a mark of its own, and one of them is hollow.
    assert len({mark for mark, _ in marks.values()}) == 3
    assert marks[r"$R_\mathrm{back}$"][1] == "none"
    styles = {x.get_linestyle() for x in top.lines if len(np.asarray(x.get_xdata())) > 100}
    assert styles == {"-", "--"}


def test_no_band_of_k_below_0():
    waves = np.array([0.5, 0.6, 0.7])
    parts = [simulated(1.5, 0.03, 5e-3, wavelength_um=w, seed=i) for i, w in enumerate(waves)]
    found = fit(concatenate(*parts))
    second = found.plot().axes[-1]
    assert second.get_ylim()[0] >= -0.05 * second.get_ylim()[1]


@pytest.fixture(scope="module")
def ellipsometry():
    """psi and Delta of a clear substance through Brewster's angle, where Delta jumps."""
    angle = np.array([50.0, 55.0, 60.0, 63.0, 64.0, 66.0, 70.0])
    true = {"eta": 2.0, "k": 0.02}
    psi, delta = (simulate("constant", true, angle, 0.6, q) for q in ("psi", "delta"))
    return fit(Measurement.from_columns(angle, 0.6, psi=psi, delta=delta, sigma=0.1))


def test_psi_and_delta_have_panels_units_and_marks_of_their_own(ellipsometry):
    figure = ellipsometry.plot()
    psi, delta, below_psi, below_delta = figure.axes
    assert "degrees" in psi.get_ylabel() and "degrees" in delta.get_ylabel()
    assert psi.containers[0][0].get_marker() != delta.containers[0][0].get_marker()
    m = ellipsometry.measurement
    np.testing.assert_array_equal(
        delta.containers[0][0].get_ydata(), m.value[m.quantity == "delta"]
    )
    for axes in (below_psi, below_delta):
        assert axes.get_xlabel() == "angle of incidence (degrees)"
        assert axes.get_ylabel().startswith("data")


def test_a_curve_at_one_wavelength_is_smooth(ellipsometry):
    delta = ellipsometry.plot().axes[1]
    (line,) = [x for x in delta.lines if len(np.asarray(x.get_xdata())) > 100]
    x, y = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    expected = simulate("constant", ellipsometry.values, x, 0.6, "delta")
    np.testing.assert_allclose(y, expected, atol=1e-6)


@pytest.mark.study
def test_a_delta_that_goes_round_is_broken_there():
    """Delta was measured from -180 to 180, and passes 180."""
    angle = np.linspace(40.0, 88.0, 25)
    delta = simulate("constant", {"eta": 0.3, "k": 3.0}, angle, 0.6, "delta")
    psi = simulate("constant", {"eta": 0.3, "k": 3.0}, angle, 0.6, "psi")
    m = Measurement.from_columns(
        angle, 0.6, psi=psi, delta=(delta + 180.0) % 360.0 - 180.0, sigma=0.1
    )
    found = fit(m)
    axes = found.plot().axes[1]
    (line,) = [x for x in axes.lines if len(np.asarray(x.get_xdata())) > 100]
    y = np.asarray(line.get_ydata())
    assert np.nanmin(y) >= -180.0 and np.nanmax(y) <= 180.0
    assert np.nanmax(np.abs(np.diff(y))) < 180.0


def test_a_second_file_with_a_scale_of_its_own_has_its_own_curve():
    angles = np.array([30.0, 45.0, 60.0, 70.0, 80.0])
    value = textbook(angles, np.full(5, "R_s"), 0.5, 2.2)
    both = [
        Measurement.from_columns(angles, R_s=share * value, sigma=1e-3, source=f"{share}.csv")
        for share in (1.0, 0.9)
    ]
    names = ("scale[1.0.csv R_s]", "scale[0.9.csv R_s]")
    found = fit(both, "constant", free=names[1], intervals="quadratic", starts=8)
    top = found.plot().axes[0]
    drawn = [np.asarray(x.get_xydata()) for x in top.lines if x.get_linestyle() in ("-", "--")]
    fitted = found.predict().value
    for i in range(2):
        at = np.stack([angles, fitted[5 * i : 5 * i + 5]], -1)
        assert any(
            np.allclose(np.interp(angles, line[:, 0], line[:, 1]), at[:, 1], atol=2e-4)
            for line in drawn if len(line) > 1
        )  # fmt: skip
    assert len({c[0].get_color() for c in top.containers}) == 2


def test_warnings_stand_on_the_picture(gold):
    figure = gold.plot()
    text = " ".join(figure.get_supxlabel().split())
    assert text.startswith("Warning: ")
    assert "reduced chi2 is 75.41" in text


def test_a_batch_without_data_is_drawn_over_its_curves_or_as_a_map(tmp_path):
    angles = np.array([30.0, 50.0, 65.0, 75.0, 82.0])
    of = {q: textbook(angles, np.full(5, q), 0.5, 2.2) for q in ("R_s", "R_p")}
    noise = 1e-3 * np.random.default_rng(1).normal(size=(2, 3, 4, 5))
    found = fit_many(angles, R_s=of["R_s"] + noise[0], R_p=of["R_p"] + noise[1])
    figure = found.plot()
    image = figure.axes[0].images[0].get_array()
    np.testing.assert_array_equal(image, found.eta)
    saved(found, tmp_path / "map.png")
    row = fit_many(angles, R_s=of["R_s"] + noise[0, 0], R_p=of["R_p"] + noise[1, 0])
    first = row.plot().axes[0]
    assert first.containers[0][0].get_ydata().tolist() == row.eta.tolist()
    m = Measurement.from_columns(angles, **{q: of[q] + noise[i, 0, 2] for i, q in enumerate(of)})
    bottom = row[2].plot(measurement=m).axes[1]
    drawn = np.concatenate([c[0].get_ydata() for c in bottom.containers])
    np.testing.assert_allclose(drawn, m.value - row[2].predict(m).value)
    with pytest.raises(ValueError, match=r"keeps no data. Give those of the curve: fit.plot\(meas"):
        row[2].plot()
    with pytest.raises(ValueError, match=r"Pick the fit of its curve: fit\[3\].plot"):
        row.plot(measurement=m)


def nine_angles(quantities=("psi", "delta")):
    angle, wave = (a.ravel() for a in np.meshgrid(np.arange(45.0, 90.0, 5.0), [0.5, 0.6, 0.7]))
    each: dict[str, Any] = {q: simulate("1.5+0.1i", {}, angle, wave, q) for q in quantities}
    return Measurement.from_columns(angle, wave, source="nine <angles>", **each)


@pytest.mark.parametrize(("quantities", "shape"), [(("psi", "delta"), (3, 2)), (("R_s",), (1, 3))])
def test_a_measurement_is_drawn_with_at_most_three_angles_a_panel(quantities, shape):
    m = nine_angles(quantities)
    figure = m.plot()
    assert len(figure.axes) == shape[0] * shape[1]
    drawn = [len(axes.containers) for axes in figure.axes]
    assert max(drawn) == 3 and sum(drawn) == 9 * len(quantities)
    values = np.concatenate([c[0].get_ydata() for axes in figure.axes for c in axes.containers])
    np.testing.assert_array_equal(np.sort(values), np.sort(m.value))
    shown = [axes.get_xlabel() for axes in figure.axes]
    assert shown.count("wavelength (nm)") == shape[1]  # on the lowest of each column
    figure.draw_without_rendering()
    labels = [text.get_text() for text in figure.axes[-1].get_xticklabels()]
    assert {"500", "600", "700"} <= set(labels)


def test_a_measurement_is_a_table_in_a_notebook_and_a_dataframe():
    m = nine_angles()
    page = m._repr_html_()
    assert "nine &lt;angles&gt;: took 54 values of psi, delta" in page
    assert page.count("<tr>") == 11 and "44 more rows" in page and "<th>sigma</th>" not in page
    frame = m.to_dataframe()
    assert list(frame) == ["angle_deg", "wavelength_um", "quantity", "value"]
    np.testing.assert_array_equal(frame["value"], m.value)


def test_the_curves_of_further_fits_are_drawn_and_no_panel_of_a_k_that_is_0():
    angle, wave = (a.ravel() for a in np.meshgrid([0.0, 50.0], np.linspace(0.4, 0.8, 12)))
    R = simulate("cauchy:2", {"A": 1.5, "B": 0.001}, angle, wave, "R_s")
    m = Measurement.from_columns(
        angle, wave, R_s=R + 5e-3 * np.random.default_rng(0).normal(size=24)
    )
    one, two = (fit(m, sample, intervals="quadratic") for sample in ("cauchy:2", "constant"))
    figure = one.plot(others=two)
    top, bottom, eta = figure.axes[:3]
    assert len(one.plot().axes) == 3  # data, residuals, eta
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == [f"{f.sample}, rms {f.rms:#.2g}" for f in (one, two)]
    curves = [line for line in top.lines if line.get_linestyle() == "--"]
    assert len(curves) == 2  # one an angle
    residuals = [line for line in bottom.lines if line.get_linestyle() == "--"]
    off = np.concatenate([line.get_ydata() for line in residuals])
    np.testing.assert_allclose(np.sort(off), np.sort(two.residuals))
    np.testing.assert_allclose(eta.lines[-1].get_ydata(), two.parameters["eta"].value)
