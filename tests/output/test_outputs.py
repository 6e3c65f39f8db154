"""Results never replace a measurement, go where they were asked for, and are whole or absent."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fitting import Measurement, fit
from fitting.command import cli
from fitting.output.export import WRITTEN_BY, OfFile, index_csv, rows_csv, rows_json
from fitting.output.files import (
    OutputError,
    ResultFile,
    begins,
    checked,
    refuse_repeats,
    report_files,
    write_whole,
)
from fitting.output.pictures import picture_bytes

ROOT = Path(__file__).resolve().parents[2]
SPECTRUM = "wavelength_nm,R\n400,0.3\n500,0.4\n"


@pytest.fixture(autouse=True)
def no_fit(monkeypatch):
    """Nothing here fits: what is wrong with a place is found before."""
    monkeypatch.setattr(cli, "_fit", lambda *_: pytest.fail("fitted before the place was refused"))


def refused(capsys, *arguments):
    assert cli.main([str(a) for a in arguments]) == 2
    return capsys.readouterr().err


def contents(folder):
    return {path.name: path.read_text() for path in folder.iterdir()}


def test_a_result_whose_name_is_derived_replaces_no_measurement(tmp_path, capsys):
    (tmp_path / "x.index.csv").write_text(SPECTRUM)
    (tmp_path / "other.csv").write_text(SPECTRUM.replace("400", "410"))
    before = contents(tmp_path)
    for files in (["x.index.csv"], ["other.csv", "x.index.csv"]):
        paths = [tmp_path / file for file in files]
        said = refused(capsys, *paths, "--csv", tmp_path / "x.csv")
        assert "x.index.csv is a file that this fit reads" in said
    assert contents(tmp_path) == before


@pytest.mark.parametrize("name", ["x.csv", "x.index.csv", "x.json", "x.svg", "x.yml"])
def test_a_result_replaces_no_file_that_no_fit_wrote(tmp_path, capsys, name):
    """A measurement may be named after --csv or --json by mistake."""
    (tmp_path / "s.csv").write_text(SPECTRUM)
    (tmp_path / name).write_text(SPECTRUM)
    before = contents(tmp_path)
    suffix = Path(name).suffix
    flag = {".svg": "--plot", ".yml": "--material"}.get(suffix, f"--{suffix[1:]}")
    said = refused(capsys, tmp_path / "s.csv", flag, tmp_path / name.replace(".index", ""))
    assert f"{name}: the file exists and was not written by a fit" in said
    assert "--overwrite" in said
    assert contents(tmp_path) == before
    (file,) = checked([ResultFile("csv", tmp_path / name)], overwrite=True)
    write_whole({file.path: "new"})
    assert contents(tmp_path)[name] == "new"


MATERIAL = "wavelength_um,n,k\n0.3,1.5,0\n0.6,1.5,0\n"


@pytest.mark.parametrize("sample", [
    "air | film.csv 10 nm | Si", "film.csv | free", "1.0 or film.csv",
    "air | bruggeman(SiO2, film.csv 30 %) 10..20 nm | Si",
])  # fmt: skip
@pytest.mark.parametrize("option", ["--sample", "--ratio-to"])
@pytest.mark.parametrize("out", [
    ("--csv", "film.csv"), ("--json", "./film.csv"), ("--plot", "link.svg"), ("--report", "."),
    ("--each", "--json", "film.csv"),
])  # fmt: skip
def test_materials_are_not_overwritten(tmp_path, capsys, monkeypatch, sample, option, out):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.csv").write_text(SPECTRUM)
    (tmp_path / "film.csv").write_text(MATERIAL)
    names = {"--plot": "link.svg", "--report": "data.csv"}
    if out[0] in names:
        os.link("film.csv", names[out[0]])
    if option == "--ratio-to":
        sample = "film.csv"
    before = contents(tmp_path)
    said = refused(capsys, "s.csv", option, sample, *out, "--overwrite")
    assert "is a file that this fit reads" in said
    assert contents(tmp_path) == before


def test_a_scan_to_divide_by_is_not_overwritten(tmp_path, capsys):
    (tmp_path / "s.csv").write_text(SPECTRUM)
    (tmp_path / "beam.csv").write_text(SPECTRUM)
    files = (tmp_path / "s.csv", "--divide-by", tmp_path / "beam.csv", "--scale", "1")
    said = refused(capsys, *files, "--csv", tmp_path / "beam.csv", "--overwrite")
    assert "is a file that this fit reads" in said


def test_what_every_kind_of_result_begins_with_is_recognized(tmp_path):
    pytest.importorskip("matplotlib")
    m = Measurement.from_columns([30.0, 45.0, 60.0], 0.5, R_s=[0.06, 0.09, 0.18])
    found = fit(m)
    found.report(tmp_path / "r")
    texts = [index_csv(found), rows_csv([OfFile("a.csv", found)]), rows_json([])]
    for i, text in enumerate(texts):
        (tmp_path / "r" / str(i)).write_text(text)
    for ending in ("svg", "pdf"):
        (tmp_path / "r" / f"p.{ending}").write_bytes(picture_bytes(found.plot(), ending))
    found.write_material(tmp_path / "r" / "m.yml")
    files = list((tmp_path / "r").iterdir())
    assert len(files) == 11
    assert [path.name for path in files if not begins(path)] == []
    for text in (SPECTRUM, "", "{}", f"angle,R\n# {WRITTEN_BY}\n", "REFERENCES: |\n    X"):
        (tmp_path / "other").write_text(text)
        assert not begins(tmp_path / "other")


@pytest.mark.study
def test_in_python_a_material_is_not_overwritten_either(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pytest.importorskip("yaml")
    (tmp_path / "film.yml").write_text("mine")
    m = Measurement.from_columns([30.0, 45.0, 60.0], 0.5, R_s=[0.06, 0.09, 0.18])
    found = fit(m)
    with pytest.raises(OutputError, match="was not written by a fit.*overwrite=True"):
        found.write_material("film.yml")
    found.write_material("film.yml", overwrite=True)
    assert begins("film.yml")
    (tmp_path / "glass.csv").write_text(MATERIAL)
    os.link("glass.csv", "glass.yml")
    found = fit(m, "glass.csv | free")
    with pytest.raises(OutputError, match="is a file that this fit reads"):
        found.write_material("glass.yml", overwrite=True)
    assert (tmp_path / "glass.csv").read_text() == MATERIAL


def test_a_report_replaces_no_measurement(tmp_path, capsys):
    """`fresnel-fit a.csv data.csv --report .`: data.csv is also a name of the report's."""
    for name in ("a.csv", "data.csv"):
        (tmp_path / name).write_text(SPECTRUM)
    before = contents(tmp_path)
    files = (tmp_path / "a.csv", tmp_path / "data.csv")
    assert "--overwrite" in refused(capsys, *files, "--report", tmp_path)
    assert "a file that this fit reads" in refused(
        capsys, *files, "--report", tmp_path, "--overwrite"
    )
    assert contents(tmp_path) == before


@pytest.mark.parametrize("link", [os.link, os.symlink])
def test_a_measurement_is_known_by_any_name(tmp_path, capsys, link):
    (tmp_path / "a.csv").write_text(SPECTRUM)
    (tmp_path / "b.csv").write_text(SPECTRUM)
    link(tmp_path / "b.csv", tmp_path / "c.json")
    said = refused(capsys, tmp_path / "a.csv", tmp_path / "b.csv", "--json", tmp_path / "c.json")
    assert "a file that this fit reads" in said
    assert (tmp_path / "b.csv").read_text() == SPECTRUM


def test_a_measurement_on_standard_input_is_known_too(tmp_path):
    (tmp_path / "a.csv").write_text(SPECTRUM)
    code = (
        "import sys; from pathlib import Path\n"
        "from fitting.output.files import ResultFile, checked\n"
        "checked([ResultFile('csv', Path(sys.argv[1]))], ['-'])"
    )
    with open(tmp_path / "a.csv") as file:
        done = subprocess.run(
            [sys.executable, "-c", code, str(tmp_path / "a.csv")],
            stdin=file, capture_output=True, text=True, cwd=ROOT,
        )  # fmt: skip
    assert "a file that this fit reads" in done.stderr


def test_one_measurement_given_twice_is_refused(tmp_path, capsys):
    (tmp_path / "a.csv").write_text(SPECTRUM)
    os.link(tmp_path / "a.csv", tmp_path / "b.csv")
    assert "count twice" in refused(capsys, tmp_path / "a.csv", tmp_path / "b.csv")
    with pytest.raises(OutputError, match="count twice"):
        refuse_repeats([str(tmp_path / "a.csv")] * 2)
    refuse_repeats(["-", str(tmp_path / "a.csv"), str(tmp_path / "none.csv")])


NEW = f"# a table, {WRITTEN_BY}\n"


def publish(folder, overwrite=False):
    wanted = report_files(folder, ("csv", "index", "plot", "page"), "--report", overwrite)
    write_whole({file.path: NEW for file in checked(wanted, overwrite=overwrite)})


def test_a_report_goes_into_a_new_an_empty_or_its_own_folder(tmp_path):
    empty, own, strange = (tmp_path / name for name in ("empty", "own", "strange"))
    empty.mkdir()
    strange.mkdir()
    (strange / "fit.json").write_text("a stranger's")
    (strange / "notes.txt").write_text("a stranger's")
    for folder in (empty, own, own):
        publish(folder)
        assert contents(folder) == {"fit.json": NEW}
    with pytest.raises(
        OutputError, match=r"--report .*other than .* report \(fit.json, notes.*--overwrite"
    ):
        publish(strange)
    assert contents(strange)["fit.json"] == "a stranger's"
    publish(strange, overwrite=True)
    assert contents(strange) == {"fit.json": NEW, "notes.txt": "a stranger's"}
    with pytest.raises(OutputError, match="other than those of a report"):
        publish(strange)  # it is still a stranger's


def test_what_a_killed_run_left_does_not_keep_a_report_from_its_folder(tmp_path):
    (tmp_path / ".fresnel-fit-0123456789abcdef.part").write_text("half")
    publish(tmp_path)
    assert (tmp_path / "fit.json").read_text() == NEW


def test_content_is_on_the_disk_before_it_takes_its_name(tmp_path, monkeypatch):
    events = []
    fsync, replace = os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda fd: (events.append(os.fstat(fd).st_ino), fsync(fd)))
    monkeypatch.setattr(os, "replace", lambda a, b: (events.append("name"), replace(a, b)))
    write_whole({tmp_path / "a": "new", tmp_path / "b": b"new"})
    files = [(tmp_path / name).stat().st_ino for name in "ab"]
    assert events == [*files, "name", "name"]


def test_names_of_any_length_can_be_written(tmp_path):
    name = "\u20ac" * 85  # 255 bytes, the most that a file system takes
    write_whole({tmp_path / name: "new"})
    assert contents(tmp_path) == {name: "new"}
    with pytest.raises(OutputError, match="--csv .*cannot be written .File name too long"):
        checked([ResultFile("csv", tmp_path / (name + "x"), "--csv")])


# Its children are killed: of one import instead of twelve.
_WRITER = """
import os, sys
from pathlib import Path
from fitting.output.files import write_whole

for line in sys.stdin:
    child = os.fork()
    if not child:
        print(os.getpid(), flush=True)
        for run in range(10**9):
            files = {Path(line.strip()) / name: f"{run:09d}" * 20_000 for name in ("a", "b", "c")}
            write_whole(files)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system copies no process")
def test_killed_at_any_moment_every_file_is_whole(tmp_path):
    """FRESNEL_KILLS sets how many kills (default 12)."""
    with subprocess.Popen(
        [sys.executable, "-W", "ignore", "-c", _WRITER], cwd=ROOT, text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    ) as writer:  # fmt: skip
        for kill in range(int(os.environ.get("FRESNEL_KILLS", "12"))):
            folder = tmp_path / str(kill % 3)
            print(folder, file=writer.stdin, flush=True)
            child = int(writer.stdout.readline())
            time.sleep(0.02 * (kill % 7) + 0.003 * kill % 0.05)
            os.kill(child, signal.SIGKILL)
            assert writer.stdout.readline() == f"{-signal.SIGKILL}\n"
            for name in ("a", "b", "c"):
                if (folder / name).exists():
                    text = (folder / name).read_text()
                    assert len(text) == 180_000 and text == text[:9] * 20_000
