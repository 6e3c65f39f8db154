"""How the command ends: by what exit status, in one line, and always."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from fitting import fit, read_csv
from fitting.data.measurement import Measurement, MeasurementError
from tests.command_line import own_cache  # noqa: F401 (a fixture)
from tests.truth.simulated import GOLD

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]


def run(*arguments, environment=None, **options):
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | options
    return subprocess.run(
        [sys.executable, "-m", "fitting", *map(str, arguments)],
        text=True, cwd=ROOT, timeout=300, env={**os.environ, **(environment or {})}, **options,
    )  # fmt: skip


def in_one_line(done, *parts):
    assert done.returncode == 2, done
    assert done.stderr.startswith("fresnel-fit: ") and done.stderr.count("\n") == 1, done.stderr
    for part in parts:
        assert part in done.stderr


def test_numbers_that_no_fit_can_use_are_refused(tmp_path):
    in_one_line(run(GOLD, "--sample", "1e300 | free"), "1e300", "0.001 to 1000")
    in_one_line(run(GOLD, "--prior", "eta=1+-1e-300"), "fix it instead at 1")


def test_a_platform_that_is_not_there_is_named():
    done = run(GOLD, environment={"JAX_PLATFORMS": "abacus"})
    in_one_line(done, "JAX_PLATFORMS=abacus", "set it to cpu")


def test_a_backend_for_windows_that_is_not_there_does_not_matter(tmp_path):
    done = run(GOLD, "--plot", tmp_path / "a.png", "--quiet", environment={"MPLBACKEND": "abacus"})
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "a.png").stat().st_size > 10_000


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no full device")
@pytest.mark.parametrize("arguments", [[GOLD], [GOLD, "--json", "-"], ["--help"]])
def test_a_full_stdout_ends_in_one_line(arguments):
    with open("/dev/full", "w") as full:
        in_one_line(run(*arguments, stdout=full), "No space left")
        assert run(*arguments, stdout=full, stderr=full).returncode == 2


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&-", ">&- 2>&-"])
def test_closed_streams_are_no_error(tmp_path, closed):
    out = tmp_path / "out.json"
    command = f"{sys.executable} -m fitting {GOLD} --json {out} {closed}"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0 and "Traceback" not in done.stderr
    assert out.stat().st_size > 100


def ends(code, message):
    code = f"import fitting.__main__ as m\ndef main():\n    {code}\nm.main = main\nm.run()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert message in done.stderr
    return done


def test_a_defect_has_a_status_of_its_own_and_shows_where():
    done = ends("raise RuntimeError('an assumption')", "defect of the program")
    assert done.returncode == 70 and "RuntimeError: an assumption" in done.stderr


def test_an_interrupt_that_the_command_does_not_hear_is_no_defect():
    assert ends("raise KeyboardInterrupt", "").returncode == 130


def test_an_interrupt_while_the_command_is_imported_shows_no_traceback():
    code = (
        "import os, signal, sys, time\n"
        "class Slow:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'fitting.command.cli':\n"
        "            os.kill(os.getpid(), signal.SIGINT)\n"
        "            time.sleep(10)\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "sys.meta_path.insert(0, Slow())\n"
        "import fresnel_fit\n"
        "fresnel_fit.run()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert (done.returncode, done.stderr) == (130, "")


@pytest.mark.skipif(os.name != "posix", reason="the shell of this system has no limit of memory")
def test_a_limit_of_memory_that_jax_would_not_survive_is_named():
    command = f"ulimit -v 1000000; {sys.executable} -m fitting {GOLD}"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, cwd=ROOT)
    assert (done.returncode, done.stderr.count("\n")) == (71, 1)
    assert "limited to 1.0 GB" in done.stderr and "ulimit" in done.stderr


@pytest.mark.parametrize(
    "error",
    ["MemoryError", "RuntimeError('RESOURCE_EXHAUSTED: 9 GB')"]
    + ["ImportError('libjax.so: failed to map segment from shared object')"],
)
def test_too_little_memory_is_said_in_one_line(error):
    done = ends(f"raise {error}", "not enough memory")
    assert done.returncode == 71 and done.stderr.count("\n") == 1


def test_what_is_no_thickness_or_index_is_refused_by_name():
    measurement = Measurement.from_columns([30.0, 60.0], 0.5, R=[0.1, 0.2], T=[0.8, 0.7])
    for thickness in ("3", "-3 mm", "0 mm", "nan mm", "1e300 mm", "3 inches"):
        with pytest.raises(ValueError, match="thickness|is not an index"):
            fit(measurement, f"air | free {thickness} thick | air")
    for index in ("-1", "0", "nan", "1e9", "1+1i", "True"):
        with pytest.raises(ValueError, match="index|lossless"):
            fit(read_csv(GOLD), f"{index} | free")


@pytest.mark.parametrize(
    "settings", [{"fixed": {"k": "3"}}, {"bounds": {"k": ("0", 3)}}, {"priors": {"k": (3, "1")}}]
)
def test_a_text_is_no_number_of_a_setting(settings):
    with pytest.raises(ValueError, match="number"):
        fit(read_csv(GOLD), **settings)


def test_numbers_at_the_ends_of_the_floats_end_a_fit(tmp_path):
    """NaN is unlike itself, and a loop that waits for likeness ran for ever."""
    files = [tmp_path / f"{i}.csv" for i in range(4)]
    rows = "90,0,2.17e-146", "90,1,1e-150", "0,1e-300,1e-150", "45,1,1e-3"
    for file, row in zip(files, rows, strict=True):
        file.write_text(f"angle_deg,R_s,sigma_R_s\n{row}\n")
    code = (
        "import sys; from fitting.command.cli import main\n"
        "for file in sys.argv[1:]: assert main([file]) in (0, 1)"
    )
    # all in one process, which unlike this one can be ended when it takes too long
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, files)], capture_output=True, cwd=ROOT, timeout=300
    )
    assert done.returncode == 0, done.stderr


def test_a_standard_error_whose_square_is_no_number_is_refused():
    with pytest.raises(MeasurementError, match="its square underflows"):
        Measurement.from_columns([45.0], R_s=[0.5], sigma=2e-160)


where_SIGINT_is_heard = pytest.mark.skipif(
    signal.getsignal(signal.SIGINT) == signal.SIG_IGN,
    reason="SIGINT is ignored here, as of a job in the background, and so by what a test starts",
)


@where_SIGINT_is_heard
def test_what_python_cannot_interrupt_ends_too():
    """A compilation hears no signal, for a minute on a busy machine."""
    code = (
        "import time, fitting.__main__ as m\n"
        "def deaf():\n"
        "    said = False\n"
        "    while True:\n"
        "        try:\n"
        "            said = said or print('at work', flush=True) is None\n"
        "            time.sleep(60)\n"
        "        except KeyboardInterrupt:\n"
        "            pass\n"
        "m.main = deaf\n"
        "m.run()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None and process.stdout.readline() == b"at work\n"
        process.send_signal(signal.SIGINT)
        try:
            assert process.wait(timeout=60.0) == 130
        finally:
            process.kill()


@where_SIGINT_is_heard
def test_interrupted_in_a_long_fit_it_ends_at_once(tmp_path):
    angles, waves = np.meshgrid(np.arange(20.0, 80.0, 4.0), np.linspace(0.4, 0.8, 20_000))
    data = "\n".join(f"{a},{w:.6f},0.5" for a, w in zip(angles.ravel(), waves.ravel(), strict=True))
    (tmp_path / "long.csv").write_text("angle_deg,wavelength_um,R_s\n" + data + "\n")
    command = [sys.executable, "-m", "fitting", str(tmp_path / "long.csv"), "--intervals=profile"]
    process = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, stdout=subprocess.PIPE)
    time.sleep(8.0)
    assert process.poll() is None, "it should be long"
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60.0)
    assert process.returncode == 130 and b"Traceback" not in said
