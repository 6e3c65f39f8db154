"""Our own tables, pipes, ranges of rows, invisible characters, large files."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from fitting import fit, read_csv
from fitting.command import cli
from fitting.data.measurement import MeasurementError
from fitting.output.export import data_csv
from fitting.process.visible import visible
from fitting.reader import text as text_module
from tests.truth.reading import read, refusal
from tests.truth.simulated import GOLD

ROOT = Path(__file__).resolve().parents[2]
TABLE = "angle,R\n10,.1\n45,.2\n80,.5\n"


def test_our_own_table_of_results_is_no_measurement(tmp_path: Path) -> None:
    """Its rows are of several quantities, and its fitted values may not be taken for measured."""
    text = data_csv(fit(read_csv(GOLD)))
    assert "--columns" in refusal(tmp_path, text) and "'value'" in refusal(tmp_path, text)


def test_standard_input_and_pipes(tmp_path: Path) -> None:
    code = "from fitting import read_csv; m = read_csv('-'); print(len(m), m.source)"
    done = subprocess.run(
        [sys.executable, "-c", code], input=TABLE, capture_output=True, text=True, cwd=ROOT
    )
    assert done.stdout == "3 standard input\n", done.stderr
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=lambda: pipe.write_text(TABLE))
    writer.start()
    assert len(read_csv(pipe)) == 3
    writer.join()


def test_a_file_that_is_too_large_is_refused_at_once(tmp_path: Path, monkeypatch) -> None:
    with open(tmp_path / "large.csv", "wb") as file:
        file.truncate(200_000_000)
    with pytest.raises(MeasurementError, match="more than 10 MB came"):
        read_csv(tmp_path / "large.csv")
    monkeypatch.setattr(text_module, "MAX_BYTES", 10)  # a pipe or a device has no size
    if Path("/dev/zero").exists():
        with pytest.raises(MeasurementError, match="the most that is read"):
            read_csv("/dev/zero")


LONG = 40_000


@pytest.mark.parametrize(
    "text",
    [
        "angle," + "_" * LONG + "\n",
        "#" + " " * LONG + "x\nangle,R\n",
        "# angle" + " " * LONG + "x\nangle,R\n",
        "#" + " wavelength" * LONG + "\nangle,R\n",
        "(" * LONG + "\nangle,R\n",
        "angle,R" + " (" * LONG + "\n",
        "# " + "1." * LONG + "\nangle,R\n",
        "# " + "aB" * LONG + "\nangle,R\n",
        "# " + "'d " * LONG + "\nangle,R\n",
        "angle,R" + "/" * LONG + "\n",
        "," * LONG + "\n",
        '"' * LONG + "\nangle,R\n",
        "# " + "\u5165" * LONG + "\nangle,R\n",
    ],
)
def test_no_line_takes_time_that_grows_as_its_square(tmp_path: Path, text: str) -> None:
    """All of these together take seconds; quadratic patterns took minutes for one of them."""
    (tmp_path / "a.csv").write_text(text + "10,.1\n45,.2\n80,.5\n")
    try:
        assert len(read_csv(tmp_path / "a.csv")) == 3
    except MeasurementError as refused:
        assert len(str(refused)) < 2_000


def test_columns_are_bounded_and_so_are_messages(tmp_path: Path) -> None:
    """Of 10,000 columns each angle was compared with each other one, two minutes long."""
    angles = ",".join(f"R({i / 120:.4f} deg)" for i in range(10_000))
    wide = "\n".join([f"wavelength_nm,{angles}", *(f"{w}" + ",.5" * 10_000 for w in (500, 510))])
    assert "10001 columns came, and 1000 are the most" in refusal(tmp_path, wide)
    codes = "".join(f"30,{i}{'0' * 10_000},.1\n" for i in (1, 2))
    said = refusal(tmp_path, "angle,polarization,R\n" + codes)
    assert "1000000" in said and said.endswith("are degrees.") and len(said) < 2_000


def test_delimiters_at_the_end_of_some_lines(tmp_path: Path) -> None:
    for text in ("angle,R,,\n10,.1\n45,.2\n80,.5\n", "angle,R\n10,.1\n45,.2,\n80,.5\n"):
        assert read(tmp_path, text).value.tolist() == [0.1, 0.2, 0.5]


def test_a_laser_and_a_temperature_in_comments(tmp_path: Path) -> None:
    for laser in ("HeNe 633 nm", "He-Ne laser 633 nm"):
        assert read(tmp_path, f"# {laser}\n{TABLE}").wavelength_um.tolist() == [0.633] * 3
    warm = "# temperature 20 \u00b0C\nwavelength_nm,R\n500,.1\n600,.2\n"
    assert read(tmp_path, warm).angle_deg.tolist() == [0.0, 0.0]


def test_lines_keep_the_header_above_the_rows_that_they_leave_out(tmp_path: Path) -> None:
    for lines, angles in (("3-", [45, 80]), ("4-4", [80]), ("2-3", [10, 45])):
        assert read(tmp_path, TABLE, lines=lines).angle_deg.tolist() == angles
    two = TABLE + "\nangle,T\n10,.9\n45,.8\n"
    m = read(tmp_path, two, lines="8-")
    assert set(m.quantity.tolist()) == {"T"} and m.angle_deg.tolist() == [45]


def test_a_role_given_twice_and_a_workbook_are_refused(tmp_path: Path) -> None:
    assert "gives R twice" in refusal(tmp_path, TABLE, columns="angle=1,R=2,R=1")
    assert "Save the sheet as CSV" in refusal(tmp_path, TABLE, "gold.xlsx")


EVIL = "\x1b[31mred\x1b[0m\x07\u202e\u200b"


def test_what_a_terminal_would_obey_is_shown(tmp_path: Path, capsys) -> None:
    name = EVIL + ".csv"
    (tmp_path / name).write_text(f"# {EVIL}\nangle,R,{EVIL}\n10,.1,1\n45,.2,2\n80,.5,3\n")
    out = tmp_path / "out.svg"
    cli.main([str(tmp_path / name), "--plot", str(out), "--json", str(tmp_path / "out.json")])
    cli.main([str(tmp_path / ("no" + name))])
    cli.main([str(tmp_path / name), "--json", str(tmp_path / EVIL / "x")])
    shown = capsys.readouterr()
    texts = [shown.out, shown.err, out.read_text(), (tmp_path / "out.json").read_text()]
    for text in texts:
        assert not set("\x1b\x07\u202e\u200b") & set(text)
    assert r"\x1b[31mred" in shown.out and r"\x1b[31mred" in shown.err
    import xml.dom.minidom

    xml.dom.minidom.parseString(out.read_text())
    with pytest.raises(SystemExit):
        cli.main(["--" + EVIL])
    assert "\x1b" not in capsys.readouterr().err


def test_what_is_visible_stays() -> None:
    for text in ("R_s (\u00b0) \u03bb \u5165\u5c04\u89d2", "", "a\u00a0b"):
        assert visible(text) == text
    assert visible("a\tb\nc") == r"a\tb\nc" and visible("a\tb\nc", "\t\n") == "a\tb\nc"
