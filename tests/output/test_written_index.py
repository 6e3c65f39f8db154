"""The index that a fit found, as a file that other programs take."""

from dataclasses import replace

import numpy as np
import pytest

from fitting import fit, read_csv, simulate
from fitting.command.cli import main
from fitting.samples.material_files import read_material
from tests.command_line import nothing_in, own_cache, refused  # noqa: F401 (a fixture)

yaml = pytest.importorskip("yaml")
NM = np.linspace(450.0, 800.0, 30)
TRUTH = {"A": 1.6, "B": 0.008, "thickness_nm": 420.0}
FILM = "air | cauchy:2 100..1000 nm | Si"


@pytest.fixture(scope="module")
def curve(tmp_path_factory):
    R = simulate("air | cauchy:2 420 nm | Si", TRUTH, 0.0, NM / 1e3, "R")
    R = R + 1e-3 * np.random.default_rng(5).standard_normal(len(R))
    file = tmp_path_factory.mktemp("film") / "film.csv"
    rows = [f"{w:.6f},{r:.6f},0.001" for w, r in zip(NM, R, strict=True)]
    file.write_text("\n".join(["wavelength_nm,R,sigma_R", *rows]))
    return file


@pytest.fixture(scope="module")
def found(curve):
    return fit(read_csv(curve, angle_deg=0), FILM, intervals="quadratic")


def test_of_a_film(found, tmp_path):
    """Eta and its errors come back from the files."""
    file, errors = found.write_material(tmp_path / "oxide.yml")
    band = found.index()
    content = yaml.safe_load(file.read_text())
    told = content["CONDITIONS"]["thickness_nm"].split(" ")
    assert float(told[0]) == pytest.approx(420.0, abs=1.0) and told[3] == "nm"
    assert content["CONDITIONS"]["angle_of_incidence_deg"] == "0"
    assert "film.csv" in content["REFERENCES"]
    assert "A = 1." in content["COMMENTS"]
    np.testing.assert_allclose(read_material(file)(band.wavelength_um).eta, band.eta, rtol=1e-6)
    table = np.genfromtxt(errors, delimiter=",", names=True, skip_header=1)
    np.testing.assert_allclose(table["sigma_n"], band.sigma_eta, rtol=1e-6)
    # the substrate, by its name
    other, _ = found.write_material(tmp_path / "silicon.yml", "substrate")
    np.testing.assert_allclose(
        read_material(other)(0.6).eta, found.index(0.6, "substrate").eta[0], rtol=1e-3
    )


def test_of_the_command(curve, tmp_path, capsys):
    out = tmp_path / "out.yml"
    command = [str(curve), "--angle-deg", "0", "--sample", FILM, "--intervals", "quadratic"]
    assert main([*command, "--quiet", "--material", str(out)]) == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out.yml", "out_errors.csv"]
    assert read_material(out).range_um == pytest.approx((0.45, 0.8))
    # a file of somebody else is not replaced unasked
    (tmp_path / "out_errors.csv").write_text("mine")
    assert "was not written by a fit" in refused(capsys, *command, "--material", out)
    assert "must end in .yml" in refused(capsys, *command, "--material", tmp_path / "out.txt")
    assert "shows a single fit" in refused(capsys, *command, "--each", "--material", out)
    assert (tmp_path / "out_errors.csv").read_text() == "mine"


@pytest.mark.study
def test_of_several_fitted_media_each_has_a_file_of_its_own(curve, tmp_path, capsys):
    sample = "air | cauchy:2 400..440 nm | constant"
    command = [str(curve), "--angle-deg", "0", "--sample", sample, "--intervals", "quadratic"]
    command += ["--starts", "8", "--material"]
    main([*command, str(tmp_path / "out.yml")])
    capsys.readouterr()
    ends = (".yml", "_errors.csv")
    names = [f"out_{place}{end}" for place in ("film", "substrate") for end in ends]
    assert nothing_in(tmp_path, *names)
    film, substrate = (read_material(tmp_path / name)(NM / 1e3).eta for name in names[::2])
    assert np.ptp(substrate) < 1e-12 < 1e-3 < np.ptp(film)  # a constant, and a Cauchy film
    (tmp_path / "out_substrate.yml").write_text("mine")
    assert "was not written by a fit" in refused(capsys, *command, tmp_path / "out.yml")
    several = "air | cauchy 300 nm | constant or cauchy"
    command[command.index(sample)] = several
    assert "have different fitted media" in refused(capsys, *command, tmp_path / "out.yml")


def test_what_is_not_known_is_not_written(found, tmp_path):
    """Of an index free at every wavelength only those wavelengths that have one."""
    status = np.where(NM < 600.0, "undetermined", "converged")
    free = replace(found, status=status)
    file, errors = free.write_material(tmp_path / "free.yml")
    assert read_material(file).range_um == pytest.approx((NM[NM > 600.0].min() / 1e3, 0.8))
    assert len(errors.read_text().splitlines()) == 2 + (NM > 600.0).sum()
    with pytest.raises(ValueError, match="the data do not determine"):
        replace(found, status="not converged").write_material(tmp_path / "none.yml")
    assert nothing_in(tmp_path, "free.yml", "free_errors.csv")
