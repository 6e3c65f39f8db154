"""psi and Delta without a model: the pseudo-index by the command, and what is said about it.

Oracle: the closed form of R. M. A. Azzam and N. M. Bashara (1977), section 4.2, with an
ellipsometer's rho = tan(psi) exp(i Delta) = r_p / r_s in the convention n - i k.
"""

import json
import re

import numpy as np
import pytest

from fitting import Measurement, fit, read_csv
from fitting.command import cli
from fitting.process.progress import listening
from tests.estimates import intervals
from tests.truth.reading import columns_of
from tests.truth.textbook import reflectances

pytestmark = pytest.mark.slow

WAVELENGTHS = np.linspace(0.4, 0.8, 9)
HEAD = "angle_deg,wavelength_um,psi,delta"


def closed_form(angle_deg, psi_deg, delta_deg):
    """Return <n> + i <k>; <k> may be negative."""
    theta = np.radians(angle_deg)
    rho = np.tan(np.radians(psi_deg)) * np.exp(1j * np.radians(delta_deg))
    epsilon = np.sin(theta) ** 2 * (1.0 + (np.tan(theta) * (1.0 - rho) / (1.0 + rho)) ** 2)
    return np.conj(np.sqrt(epsilon))


def film(angle_deg, wavelength_um, index, substrate, thickness_um):
    """Return psi and Delta of a film by Airy's sum, n - i k and rho = r_p / r_s."""

    angle, wavelength_um, index, substrate = np.broadcast_arrays(
        angle_deg, wavelength_um, index, substrate
    )

    def boundary(first, second):
        (n1, c1), (n2, c2) = first, second
        r_s = (n1 * c1 - n2 * c2) / (n1 * c1 + n2 * c2)
        r_p = (n2 * c1 - n1 * c2) / (n2 * c1 + n1 * c2)
        return np.array([r_p, r_s])

    sine = np.sin(np.radians(angle))
    media = [
        (n, np.sqrt(1.0 - (sine / n) ** 2 + 0j)) for n in (np.ones_like(index), index, substrate)
    ]
    n, c = media[1]
    turn = np.exp(-4j * np.pi * n * c * thickness_um / wavelength_um)
    top, bottom = boundary(*media[:2]), boundary(*media[1:])
    r_p, r_s = (top + bottom * turn) / (1.0 + top * bottom * turn)
    rho = r_p / r_s
    return np.degrees(np.arctan(np.abs(rho))), np.degrees(np.angle(rho)) % 360.0


def table(path, *columns, head):
    rows = zip(*columns, strict=True)
    path.write_text(head + "\n" + "".join(",".join(f"{c:.9f}" for c in r) + "\n" for r in rows))
    return str(path)


@pytest.fixture(scope="module")
def bare(tmp_path_factory):
    """A bare metal at 70 degrees, by wavelength."""
    substrate = 0.2 + WAVELENGTHS - 1j * (1.0 + 4.0 * WAVELENGTHS)
    psi, delta = film(70.0, WAVELENGTHS, 1.5, substrate, 0.0)
    path = tmp_path_factory.mktemp("bare") / "bare.csv"
    return table(path, np.full(len(psi), 70.0), WAVELENGTHS, psi, delta, head=HEAD)


@pytest.fixture(scope="module")
def coated(tmp_path_factory):
    """A clear film on glass at 60 degrees, by wavelength."""
    psi, delta = film(60.0, WAVELENGTHS, 2.1, 1.46, 0.17)
    path = tmp_path_factory.mktemp("coated") / "coated.csv"
    return table(path, np.full(len(psi), 60.0), WAVELENGTHS, psi, delta, head=HEAD)


def test_the_oracle_knows_a_bare_surface():
    psi, delta = film(65.0, 0.6, 1.5, 0.3 - 3.0j, 0.0)
    assert closed_form(65.0, psi, delta) == pytest.approx(0.3 + 3.0j, rel=1e-12)


def test_one_angle_by_wavelength_with_every_result(bare, tmp_path, capsys):
    out, csv = tmp_path / "fit.json", tmp_path / "fit.csv"
    assert cli.main([bare, "--json", str(out), "--csv", str(csv)]) == 0
    shown = capsys.readouterr().out
    assert "wavelength_um  <n>" in shown and "9 wavelengths: 9 converged" in shown
    assert "which is assumed" in " ".join(shown.split())
    assert "ask for a k below 0" not in shown
    data = json.loads(out.read_text())
    found = np.array(data["eta"]) + 1j * np.array(data["k"])
    true = 0.2 + WAVELENGTHS + 1j * (1.0 + 4.0 * WAVELENGTHS)
    np.testing.assert_allclose(found, true, rtol=1e-6)  # nine decimals of a degree in the file
    assert data["parameters"]["eta"]["sigma"] == [None] * 9
    assert "pseudo_index" in [note["code"] for note in data["notes"]]
    index = columns_of(csv.with_name("fit.index.csv"))  # fmt: skip
    np.testing.assert_array_equal(index["eta"], data["eta"])
    rows = columns_of(csv)  # fmt: skip
    assert len(rows) == 18 and np.abs(rows["residual"]).max() < 1e-6


def test_every_wavelength_is_told_of(bare):
    steps = []
    with listening(steps.append):
        fit(read_csv(bare))
    assert steps[0].total == sum(step.done for step in steps) == 2 * len(WAVELENGTHS)
    steps.clear()
    with listening(steps.append):
        fit(read_csv(bare), "constant")
    assert {"errors and intervals"} < {step.stage for step in steps}


def test_report_and_reference(bare, tmp_path, capsys):
    pytest.importorskip("matplotlib")
    folder = tmp_path / "report"
    assert cli.main([bare, "--reference", "gold", "--report", str(folder)]) == 0
    assert "gold: at 0.4 um eta" in " ".join(capsys.readouterr().out.split())
    assert {p.name for p in folder.glob("[!.]*")} == {
        "data.csv", "fit.json", "fit.png", "index.csv", "report.html",
    }  # fmt: skip
    page = (folder / "report.html").read_text()
    assert "&lt;n&gt;" in page and "data:image/png;base64," in page and "<n>" not in page
    assert "--reference gold" in page


def test_a_film_that_no_bare_surface_imitates(coated, tmp_path, capsys):
    out = tmp_path / "fit.json"
    assert cli.main([coated, "--json", str(out)]) == 1
    data, m = json.loads(out.read_text()), read_csv(coated)
    psi, delta = (m.value[m.quantity == q] for q in ("psi", "delta"))
    pseudo = closed_form(60.0, psi, delta)
    below = pseudo.imag < -1e-6
    assert 2 < below.sum() < 7  # the film gives both
    found = np.array(data["eta"]) + 1j * np.array(data["k"])
    np.testing.assert_allclose(found[~below], pseudo[~below], rtol=1e-6)
    assert (found[below].imag == 0.0).all()
    # There the best of all indices without absorption, by a scan.
    for i in np.flatnonzero(below):
        n = np.linspace(1.2, 4.0, 28001)
        assert found[i].real == pytest.approx(n[np.argmin(misfit(n, psi[i], delta[i]))], abs=2e-4)
    shown = " ".join(capsys.readouterr().out.split())
    # Without a degree of freedom a fit that is off its data is none; its values are kept.
    status = np.array(data["status"])
    off = [*map(misfit, found.real[:, None], psi, delta)]
    rms = np.sqrt(np.ravel(off) / 3.0)[below]
    np.testing.assert_array_equal(status[below] == "not converged", rms > 0.1)
    assert (status[~below] == "converged").all() and (rms > 0.1).any()
    # At one of them the misfit is as small as an ellipsometer's errors are.
    assert f"at {below.sum() - 1} of 9 wavelengths" in shown and "ask for a k below 0" in shown
    assert "starting points led to this minimum" not in shown
    assert "starting points led to the best minimum" not in shown


def misfit(n, psi_deg, delta_deg):
    """Return the misfit of clear bare media at 60 degrees in N, C, S."""

    def sphere(psi, delta):
        two = np.radians(2.0 * psi)
        d = np.radians(delta)
        return np.array([np.cos(two), np.sin(two) * np.cos(d), np.sin(two) * np.sin(d)])

    seen = sphere(psi_deg, delta_deg)[:, None]
    return ((sphere(*film(60.0, 1.0, 1.5, n, 0.0)) - seen) ** 2).sum(0)


def test_several_angles_without_a_wavelength(tmp_path, capsys):
    angle = np.array([50.0, 60.0, 70.0, 75.0])
    psi, delta = film(angle, 1.0, 1.5, 3.8 - 0.5j, 0.0)
    file = table(tmp_path / "si.csv", angle, psi, delta, head="angle_deg,psi,delta")
    out = tmp_path / "si.json"
    assert cli.main([file, "--json", str(out)]) == 0
    data = json.loads(out.read_text())
    assert data["eta"] == pytest.approx(3.8, rel=1e-7) and data["k"] == pytest.approx(0.5, rel=1e-6)
    assert data["wavelength_um"] is None and data["dof"] == 6
    assert re.search(r"  <n> +\(?3\.(80|79)", capsys.readouterr().out)
    assert cli.main([file, "--reference", "Si"]) == 2
    assert "--wavelength-um" in capsys.readouterr().err


def test_the_sign_of_delta_shows(tmp_path, capsys):
    angle = np.array([50.0, 60.0, 70.0, 75.0])
    psi, delta = film(angle, 1.0, 1.5, 3.8 - 0.5j, 0.0)
    # At two wavelengths: of one alone the causes would be looked for.
    columns = (np.tile(a, 2) for a in (angle, psi, 360.0 - delta))
    file = table(tmp_path / "si.csv", np.repeat([0.9, 1.0], 4), *columns,
                 head="wavelength_um,angle_deg,psi,delta")  # fmt: skip
    assert cli.main([file]) == 1  # a misfit
    assert "Delta has the other sign" in " ".join(capsys.readouterr().out.split())


def test_angles_that_do_not_agree_on_one_index():
    angle = np.array([50.0, 60.0, 70.0])
    psi, delta = film(angle, 0.6, 2.1, 3.8 - 0.5j, 0.06)
    found = fit(Measurement.from_columns(angle, 0.6, psi=psi, delta=delta))
    assert found.k > 0.1 and found.status == "misfit"
    assert "does not describe" in " ".join(w.text for w in found.warnings)
    assert any("no bare boundary has these psi and Delta together" in n.text for n in found.notes)


def test_reflectance_beside(tmp_path):
    angle, wavelength = (a.ravel() for a in np.meshgrid([65.0, 75.0], [0.5, 0.6]))
    substrate = 1.0 + wavelength - 2j * wavelength
    psi, delta = film(angle, wavelength, 1.5, substrate, 0.0)
    R_s = reflectances(np.cos(np.radians(angle)), np.conj(substrate))["R_s"]
    file = table(
        tmp_path / "both.csv", angle, wavelength, psi, delta, R_s,
        head="angle_deg,wavelength_um,psi,delta,R_s",
    )  # fmt: skip
    out = tmp_path / "both.json"
    assert cli.main([file, "--json", str(out), "--quiet"]) == 0
    data = json.loads(out.read_text())
    np.testing.assert_allclose(data["eta"], [1.5, 1.6], rtol=1e-7)
    np.testing.assert_allclose(data["k"], [1.0, 1.2], rtol=1e-7)
    assert data["n_data"] == [6, 6]


def test_intervals_as_of_a_fit_alone(tmp_path, capsys):
    angle = np.array([50.0, 60.0, 70.0, 75.0])
    psi, delta = film(angle, 1.0, 1.5, 3.8 - 0.1j, 0.0)
    psi = psi + 0.05 * np.random.default_rng(3).standard_normal(4)
    file = table(tmp_path / "si.csv", angle, psi, delta, head="angle_deg,psi,delta")
    out = tmp_path / "si.json"
    assert cli.main([file, "--intervals", "profile", "--json", str(out)]) == 0
    assert "(profile likelihood)" in " ".join(capsys.readouterr().out.split())
    data = json.loads(out.read_text())
    alone = fit(read_csv(file), "constant", intervals="profile")
    assert {data["parameters"][n]["interval_kind"] for n in ("eta", "k")} == {"profile"}
    ends = [data["parameters"][n]["interval"] for n in ("eta", "k")]
    np.testing.assert_allclose(ends, intervals(alone))
    assert ends[0][0] < 3.8 < ends[0][1]


def test_psi_alone_is_too_little(tmp_path, capsys):
    file = table(tmp_path / "psi.csv", [70.0, 70.0], [0.5, 0.6], [20.0, 21.0],
                 head="angle_deg,wavelength_um,psi")  # fmt: skip
    assert cli.main([file]) == 1
    shown = " ".join(capsys.readouterr().out.split())
    assert "2 wavelengths: 2 undetermined" in shown and "not determined separately" in shown
    # What was not measured is not missed either.
    assert "misses the data" not in shown and "no bare boundary" not in shown
    assert "what to do" in shown


def test_transmittance_is_refused_with_what_to_say(tmp_path, capsys):
    file = table(tmp_path / "plate.csv", [70.0], [0.5], [20.0], [0.8],
                 head="angle_deg,wavelength_um,psi,T")  # fmt: skip
    assert cli.main([file]) == 2
    error = capsys.readouterr().err
    assert "T cannot be fitted" in error and "free 3 mm thick" in error and error.count("\n") == 1


def test_reference_beside_a_spectrum_of_reflectances(tmp_path, capsys):
    pytest.importorskip("matplotlib")

    m = Measurement.from_columns(
        np.tile([30.0, 60.0, 75.0], 3), np.repeat([0.5, 0.6, 0.7], 3),
        R_s=[0.5, 0.6, 0.8, 0.7, 0.8, 0.9, 0.8, 0.9, 0.95],
    )  # fmt: skip
    lines = [line for axes in fit(m).plot("gold").axes for line in axes.lines]
    assert "gold (reference)" in [line.get_label() for line in lines]


def test_measured_films(measured_files, tmp_path):
    folder = measured_files / "hafnia_film_psi_delta"
    m = read_csv(folder / "hafnia_on_silica_60deg_psi_delta.csv", angle_deg=60.0)
    psi, delta = (m.value[m.quantity == q] for q in ("psi", "delta"))
    found = fit(m)
    pseudo = closed_form(60.0, psi, delta)[np.argsort(m.wavelength_um[m.quantity == "psi"])]
    above = pseudo.imag > 0.0
    np.testing.assert_allclose(found.eta[above], pseudo.real[above], rtol=1e-8)
    np.testing.assert_allclose(found.k[above], pseudo.imag[above], rtol=1e-7)
    assert (found.k[~above] == 0.0).all() and 40 < (~above).sum() < 80
    assert any("ask for a k below 0" in note.text for note in found.notes)
    polymer = read_csv(
        measured_files / "ep4_polymer_psi_delta" / "corefine_polyBrush_ellipsometry.dat"
    )
    one = fit(polymer)
    # Silicon under 27 nm of a polymer: the index is nobody's, and the fit good at all angles.
    assert abs(one.eta - 3.84) > 0.5 and one.k > 1.0 and one.rms < 0.003
    assert "which is assumed" in one.notes[0].text


def test_stated_errors_tell_a_wrong_sign_of_delta_that_the_misfit_alone_does_not():
    """A weak absorber: a misfit of .002 is that of a good ellipsometer, but here 13 errors."""
    index = 4.4 - 0.02j
    psi, delta = film(65.0, WAVELENGTHS, index, index, 0.0)
    for sign, wrong in ((1.0, False), (-1.0, True)):
        m = Measurement.from_columns(
            65.0, WAVELENGTHS, psi=psi, delta=sign * delta % 360.0, sigma=0.01
        )
        fits = fit(m, errors="stated")
        assert any("ask for a k below 0" in note.text for note in fits.notes) == wrong
        assert fits.rms.max() < 0.006


def test_a_fit_with_a_prior_or_a_start_is_of_the_pseudo_index_too():
    """It was said of fits without settings alone."""
    psi, delta = film(60.0, 0.5, 2.1, 1.46 + 0j, 0.17)
    m = Measurement.from_columns([60.0], 0.5, psi=[psi], delta=[delta], sigma=0.1)
    found = fit(m, starts=4, start={"eta": 1.5})
    assert [note.code for note in found.notes] == ["pseudo_index", "pseudo_index_misfit"]
