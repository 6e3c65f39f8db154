"""Try the built wheel with each supported Python and jax: `make matrix`.

For each environment: the wheel is installed into a fresh virtual environment and, in a folder of
its own outside of the checkout, the tests of the physics run on the installed package, and the
command `fresnel-fit` fits the files that ship with the project, whose tables have to be those of
docs. Then `make demo` and all tests of continuous integration, those of `make test` among them, run
in a fresh clone with the same versions. Prints a table in Markdown, and the last lines of what
failed.

    python .ci/matrix.py [--only oldest,...] [--without-make-test] [--pre] [PYTHON ...]

PYTHON: interpreters; without any, those of CPython 3.11 to 3.13 that are on PATH. The oldest
versions of pyproject.toml are tried with the first one, the newest that pip finds with each.
--pre: pre-releases too (PIP_EXTRA_INDEX_URL then names where jax keeps its nightly builds).
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PYTHONS = ("python3.11", "python3.12", "python3.13")
SHOWN = ("jax", "jaxlib", "numpy", "scipy", "equinox", "optimistix")
HEAD = ("environment", "Python", *SHOWN, "physics", "shipped files", "make demo", "make test")
PASSED = "passed"


def run(command: list, folder: Path, log: Path, **environment: str) -> tuple[bool, str]:
    """Return whether a command succeeded, and what it printed, which is added to ``log``."""
    done = subprocess.run(
        [str(x) for x in command], cwd=folder, env={**os.environ, **environment}, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    with log.open("a") as out:
        out.write(f"$ {' '.join(map(str, command))}\n{done.stdout}\n")
    return done.returncode == 0, done.stdout


def version_of(python: str) -> str:
    """Return the version of an interpreter; "" if it is none or does not run."""
    code = "import platform; print(platform.python_version())"
    try:
        done = subprocess.run([python, "-c", code], capture_output=True, text=True)
    except OSError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def oldest() -> list[str]:
    """Return pyproject's floors as constraints; jaxlib's is that of jax."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    floors = dict(re.findall(r"^([\w-]+)>=([\d.]+)", "\n".join(project["dependencies"]), re.M))
    return [f"{name}=={floor}" for name, floor in (floors | {"jaxlib": floors["jax"]}).items()]


def try_one(
    name: str, python: str, constraints: list[str], wheel: Path, options: argparse.Namespace
) -> tuple[dict[str, str], list[str]]:
    """Return the row of an environment, and the ends of what failed in it."""
    row, failed = {"environment": name, "Python": version_of(python)}, []
    with tempfile.TemporaryDirectory(prefix=f"matrix-{name}-") as place:
        folder, log = Path(place), Path(place) / "log.txt"
        limits = folder / "constraints.txt"
        limits.write_text("\n".join(constraints))
        settings = {"PIP_CONSTRAINT": str(limits), **({"PIP_PRE": "1"} if options.pre else {})}

        def step(what: str, command: list, where: Path = folder) -> str | None:
            """Fill in the cell ``what``; return what was printed, None after a failure."""
            start = time.monotonic()
            good, printed = run(command, where, log, **settings)
            counts = re.findall(r"(\d+) passed", printed)
            told = f"{sum(map(int, counts))} {PASSED}" if counts else PASSED
            row[what] = f"{told if good else 'FAILED'}, {time.monotonic() - start:.0f} s"
            if good:
                return printed
            failed.append(f"{name}, {what}:\n" + "\n".join(printed.splitlines()[-40:]))
            return None

        binaries = folder / "venv" / "bin"
        step("install", [python, "-m", "venv", folder / "venv"])
        if step("install", [binaries / "pip", "install", "-q", f"{wheel}[test]"]) is None:
            return row, failed
        _, printed = run([binaries / "pip", "list", "--format=freeze"], folder, log)
        row |= dict(line.split("==") for line in printed.splitlines() if line.count("==") == 1)
        for part in ("tests", "examples", "pyproject.toml"):
            source, copy = ROOT / part, folder / "tree" / part
            copy.parent.mkdir(exist_ok=True)
            (shutil.copytree if source.is_dir() else shutil.copy)(source, copy)
        pytest = [binaries / "python", "-m", "pytest", "-q", "--durations=0", "--durations-min=60"]
        step("physics", [*pytest, "-n", "2", "tests/physics"], folder / "tree")
        docs = "".join(p.read_text(encoding="utf-8") for p in (ROOT / "docs").rglob("*.md"))
        for file in sorted((ROOT / "examples" / "data").glob("*.csv")):
            table = re.search(rf"```text\n({re.escape(file.name)}\n.*?)```", docs, re.DOTALL)
            printed = step("shipped files", [binaries / "fresnel-fit", file])
            if printed is None or table is None or printed.split() != table[1].split():
                failed.append(f"{name}, {file.name}: not the table of docs\n{printed}")
                row["shipped files"] = "FAILED"
                break
        step("make demo", ["git", "clone", "-q", ROOT, folder / "clone"])
        step("make demo", ["make", "-s", "demo", f"PYTHON={python}"], folder / "clone")
        if not options.without_make_test:
            step(
                "make test",
                ["make", "-s", "test-all", "test-docs", f"PYTHON={python}"],
                folder / "clone",
            )
        if failed and options.logs:
            shutil.copy(log, options.logs / f"{name}.txt")
    return row, failed


def main() -> int:
    """Try all environments; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("python", nargs="*", default=PYTHONS)
    parser.add_argument("--only", default="", help="names of environments, by commas")
    parser.add_argument("--without-make-test", action="store_true")
    parser.add_argument("--pre", action="store_true")
    parser.add_argument("--logs", type=Path, help="folder for the whole output of what failed")
    options = parser.parse_args()
    pythons = [python for python in options.python if version_of(python)]
    if not pythons:
        parser.error(f"none of {', '.join(options.python)} runs; name interpreters")
    newest = {f"newest-{version_of(p).rpartition('.')[0]}": (p, list[str]()) for p in pythons}
    environments = {"oldest": (pythons[0], oldest())} | newest
    chosen = options.only.split(",") if options.only else [*environments]
    if not {*chosen} <= {*environments}:
        parser.error(f"--only {options.only}: {', '.join(environments)} are there")
    rows, failed = [], []
    with tempfile.TemporaryDirectory() as place:
        build = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", place, ROOT]
        good, printed = run(build, ROOT, Path(place) / "log.txt")
        if not good:
            print(printed)
            return 1
        (wheel,) = Path(place).glob("*.whl")
        for name in chosen:
            row, bad = try_one(name, *environments[name], wheel, options)
            rows.append(row)
            failed += bad
            print(f"{name}: {'failed' if bad else 'passed'}", file=sys.stderr, flush=True)
    head = [column for column in HEAD if any(column in row for row in rows)]
    print("| " + " | ".join(head) + " |\n|" + " --- |" * len(head))
    for row in rows:
        print("| " + " | ".join(row.get(column, "") for column in head) + " |")
    print(*failed, sep="\n\n")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
