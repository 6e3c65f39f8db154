"""The recipes of CONTRIBUTING.md, carried out on a copy of the package."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
pytestmark = pytest.mark.docs  # of `make test-docs`


def recipe(kind, name):
    (found,) = re.findall(rf"```{kind} recipe={name}\n(.*?)```", TEXT, re.DOTALL)
    return found


@pytest.fixture
def copy(tmp_path):
    shutil.copytree(ROOT / "fitting", tmp_path / "fitting")
    return tmp_path


def edited(copy, name):
    """Make the replacements of a recipe; return the files that were changed."""
    files = set()
    for line in recipe("text", name).splitlines():
        path, _, change = line.partition(": ")
        old, _, new = change.partition(" -> ")
        text = (copy / path).read_text(encoding="utf-8")
        assert text.count(old) == 1, line
        new = new.replace("|", "\n") if path.endswith(".ini") else new
        (copy / path).write_text(text.replace(old, new), encoding="utf-8")
        files.add(path)
    return files


def run(copy, code):
    code = f"import sys; sys.path.insert(0, {str(copy)!r})\n{code}"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=copy, timeout=600
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_dispersion_model_is_one_entry_in_one_file(copy):
    code = recipe("python", "dispersion")
    code = code.replace("from fitting.samples.dispersion import KINDS, Kind\n", "")
    code = code.replace("from fitting.samples.parameters import Parameter\n", "")
    code = code.replace("from fresnel_jax import dispersion\n", "")
    file = copy / "fitting" / "samples" / "dispersion.py"
    file.write_text(file.read_text(encoding="utf-8") + code, encoding="utf-8")
    out = run(copy, """
import numpy as np
from fitting import Measurement, fit, simulate
waves = np.linspace(0.4, 0.8, 12)
truth = {"A": 1.6, "slope": 0.05}
R = {q: simulate("linear", truth, 60.0, waves, q) for q in ("R_s", "R_p")}
found = fit(Measurement.from_columns(60.0, waves, sigma=1e-3, **R), "linear")
assert found.names == ("A", "slope"), found.names
assert abs(found.parameters["slope"].value - 0.05) < 1e-6
assert "slope" in str(found)
print(found.status)
""")  # fmt: skip
    assert out.strip() == "converged"


def test_a_power_is_one_entry_in_one_file(copy):
    assert len(edited(copy, "power")) == 1
    out = run(copy, """
import numpy as np
from fitting import Measurement, fit, read_csv, simulate
angles = np.linspace(20.0, 80.0, 12)
truth = {"eta": 0.5, "k": 2.0}
seen = simulate("constant", truth, angles, 0.5, "R_45")
s, p = (simulate("constant", truth, angles, 0.5, q) for q in ("R_s", "R_p"))
assert np.allclose(seen, 0.5 * (s + p), atol=1e-15)
found = fit(Measurement.from_columns(angles, 0.5, R_45=seen, sigma=1e-3), "constant")
assert abs(found.parameters["eta"].value - 0.5) < 1e-6
assert "R_45" in str(found)
with open("own.csv", "w") as file:
    file.write("angle_deg,R_45,sigma_R_45\\n")
    file.writelines(f"{a},{r},0.001\\n" for a, r in zip(angles, seen))
read = read_csv("own.csv", wavelength_um=0.5)
assert set(read.quantity) == {"R_45"} and np.allclose(read.value, seen)
assert (read.sigma == 1e-3).all()
print(found.status)
""")  # fmt: skip
    assert out.strip() == "converged"


def test_a_number_of_two_powers_is_two_files(copy):
    """R_p / R_s has no upper limit, and no notes that are meant for psi and Delta."""
    assert len(edited(copy, "ratio")) == 2
    out = run(copy, """
import numpy as np
from fitting import Measurement, fit, read_csv, simulate
waves, truth = np.linspace(0.4, 0.8, 40), {"A": 1.46, "B": 0.004, "C": 0.0, "thickness_nm": 310.0}
sample = "air | cauchy 300 nm | Si"
seen, R_s, R_p = (simulate(sample, truth, 65.0, waves, q) for q in ("R_ratio", "R_s", "R_p"))
assert np.allclose(seen, R_p / R_s, rtol=1e-12)
with open("own.csv", "w") as file:
    file.write("wavelength_nm,R_ratio,sigma_R_ratio\\n")
    file.writelines(f"{1e3 * w},{r},0.001\\n" for w, r in zip(waves, seen))
found = fit(read_csv("own.csv", angle_deg=65.0), sample)
assert abs(found.parameters["thickness_nm"].value - 310.0) < 1e-3, found
angles = np.linspace(20.0, 80.0, 13)
bare = simulate("constant", {"eta": 0.5, "k": 2.0}, angles, 0.5, "R_ratio")
free = fit(Measurement.from_columns(angles, 0.5, R_ratio=bare, sigma=1e-3))
assert abs(free.eta - 0.5) < 1e-6 and "pseudo" not in str(free), free
print(found.status)
""")  # fmt: skip
    assert out.strip() == "converged"


def test_a_power_with_a_letter_of_its_own_is_at_most_four_files(copy):
    """Absorptance of a plate, and its s and p: read by its header, fitted, drawn, refused."""
    assert len(edited(copy, "letter")) <= 4
    out = run(copy, """
from pathlib import Path
import numpy as np
from fitting import Measurement, MeasurementError, fit, read_csv, simulate
from fitting.reader.names import role_of

sample, truth = "air | constant 1 mm thick | air", {"eta": 1.6, "k": 5e-5}
angles, waves = np.linspace(10.0, 80.0, 9), np.linspace(0.4, 0.7, 7)
made = {q: simulate(sample, truth, angles, 0.5, q)
        for q in ("A", "A_s", "A_p", "R_s", "T_s", "R_p", "T_p")}
for light in "sp":
    rest = 1.0 - made["R_" + light] - made["T_" + light]
    assert np.allclose(made["A_" + light], rest, atol=1e-14) and (rest > 0.3).all()
assert np.allclose(made["A"], 0.5 * (made["A_s"] + made["A_p"]), atol=1e-14)

def read(text, name="plate.csv", **options):
    Path(name).write_text(text)
    return read_csv(name, **options)

def table(header, *columns):
    return header + "\\n" + "".join(",".join(map(str, row)) + "\\n" for row in zip(*columns))

def refused(call, *parts):
    try:
        call()
    except ValueError as error:
        assert all(part in str(error) for part in parts), error
    else:
        raise AssertionError

one = read(table("angle (deg),A_s,std A_s,Ap", angles, made["A_s"], [1e-3] * 9, made["A_p"]),
           wavelength_um=0.5, sigma=1e-3)
assert set(one.quantity) == {"A_s", "A_p"} and np.allclose(one.value[:9], made["A_s"])
assert np.isfinite(one.sigma).all()
found = fit(one, sample)
for name, value in truth.items():
    assert abs(found.parameters[name].value / value - 1.0) < 1e-5, found
assert "A_s" in str(found)
figure = found.plot()
assert "absorptance" in {axes.get_ylabel() for axes in figure.axes}
figure.savefig("picture.png")
seen = found.predict(angles, "A_p", 0.5)
assert np.allclose(seen.value, made["A_p"], atol=1e-6)

percent = read(table("aoi,Absorptance (%)", angles, 100 * made["A"]), wavelength_um=0.5)
assert set(percent.quantity) == {"A"} and np.allclose(percent.value, made["A"])
assert "9 A (unpolarized) in percent" in percent.understood
light = read(table("angle,A,polarization", angles, made["A_p"], ["TM"] * 9))
assert set(light.quantity) == {"A_p"}
turned = read(table("angle,A,polarizer (deg)", angles, made["A"], [30] * 9),
              polarization="angle-from-p")
assert set(turned.quantity) == {"A"} and (turned.polarizer_deg == 30).all()
spectrum = read(table("wavelength (nm),A", 1e3 * waves, [0.5] * 7))
assert not spectrum.angle_deg.any() and "normal incidence" in spectrum.understood
assert set(read(table("angle,A", angles, made["A"]), "As grown.csv").quantity) == {"A"}

for name, kind in {"A": ("value", "A"), "A_p": ("value", "A_p"), "As": ("value", "A_s"),
                   "std A": ("sigma", "A"), "absorptance s": ("value", "A_s"),
                   "Absorptance A": ("value", "A"),
                   "sA": ("unclear", "sigma_A"), "a": ("", ""), "Absorbance": ("", ""),
                   "lambda (A)": ("wavelength", "")}.items():
    assert role_of(name)[:2] == kind, (name, role_of(name))
refused(lambda: read(table("angle,A,A_s,A_p", angles, *[made["A"]] * 3)), "A beside A_s and A_p")
refused(lambda: read("# transmittance\\n" + table("angle,A", angles, made["A"])),
        "the name says A", "transmittance")
refused(lambda: read("# absorptance\\n" + table("angle,R", angles, made["A"])), "absorptance")
refused(lambda: read(table("wavelength (nm),A_s", 1e3 * waves, [0.5] * 7)), "angle_deg=")
refused(lambda: read(table("angle,A", angles, 1.2 + made["A"])), "absorptance", "outside [0, 1]")
refused(lambda: read(table("angle,A", angles, made["A"]), ratio_to="Si"), "A came", "reflectances")
refused(lambda: fit(one, "free"), "A_p, A_s", "bare surface", "thick")
print(found.status)
""")  # fmt: skip
    assert out.strip() == "converged"


def test_an_observable_that_is_no_power_is_at_most_four_files(copy):
    """Of a plate with its back face: fitted alone, with psi and Delta and with R; read, drawn."""
    assert len(edited(copy, "number")) <= 4
    out = run(copy, """
import numpy as np
from fitting import Measurement, MeasurementError, choose, fit, read_csv, simulate
sample, truth = "air | constant 1 mm thick | air", {"eta": 1.6, "k": 1e-5}
angles = np.linspace(40.0, 80.0, 9)

made = {q: simulate(sample, truth, angles, 0.5, q) for q in ("psi", "delta", "R", "depolarization")}

assert (made["depolarization"] > 0.01).any() and (made["depolarization"] < 1.0).all()
own = simulate("constant", {"eta": 1.6, "k": 0.0}, angles, 0.5, "depolarization")
assert np.allclose(own, 0.0, atol=1e-14)
for names in (["depolarization"], ["psi", "delta", "depolarization"], ["R", "depolarization"]):
    m = Measurement.from_columns(angles, 0.5, sigma=1e-3, **{q: made[q] for q in names})
    found = fit(m, sample, fixed={"k": 1e-5})
    assert abs(found.parameters["eta"].value - 1.6) < 1e-6, names
    assert "depolarization" in str(found)
    if "psi" in names:
        found.plot().savefig("picture.png")
    assert np.allclose(found.predict(angles, "depolarization", 0.5).value,
                       made["depolarization"], atol=1e-6)
rows = zip(angles, made["depolarization"])
with open("plate.csv", "w") as file:
    file.write("angle (deg),depolarization,std depolarization\\n")
    file.writelines(f"{a},{d},0.001\\n" for a, d in rows)
m = read_csv("plate.csv", wavelength_um=0.5)
assert set(m.quantity) == {"depolarization"} and np.allclose(m.value, made["depolarization"])
assert abs(fit(m, sample, fixed={"k": 1e-5}).parameters["eta"].value - 1.6) < 1e-6
try:
    Measurement.from_columns(angles, 0.5, depolarization=np.full(9, 1.5))
except MeasurementError as error:
    assert "depolarization 1.5 is outside [0, 1]" in str(error), error
else:
    raise AssertionError
print(found.status)
""")  # fmt: skip
    assert out.strip() == "converged"


def test_a_text_format_is_two_files(copy):
    module = copy / "fitting" / "reader" / "toy.py"
    module.write_text(recipe("python", "format"), encoding="utf-8")
    assert len({module, *edited(copy, "format")}) == 2
    (copy / "a.toy").write_text("TOY\nangle R_s\n30,0.1\n60,0.2\n")
    out = run(copy, """
from fitting import read_csv
m = read_csv("a.toy")
assert m.value.tolist() == [0.1, 0.2] and m.angle_deg.tolist() == [30.0, 60.0]
print(m.understood)
""")  # fmt: skip
    assert "a toy file" in out


def test_the_map_names_every_file():
    own = {p.name for p in (ROOT / "fitting").glob("*.py") if not p.name.startswith("__")}
    told = set(re.findall(r"\b(\w+\.py)\b", TEXT))
    assert own <= told, own - told


def test_no_module_stem_comes_twice():
    stems = [p.stem for p in (ROOT / "fitting").rglob("*.py") if p.stem != "__init__"]
    assert len(stems) == len(set(stems)), sorted(s for s in stems if stems.count(s) > 1)
