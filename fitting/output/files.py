"""The files of a result: written whole or not at all, and never over a file that is read."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Container, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from fitting.output.export import data_csv, index_csv, json_text, material_of
from fitting.output.page import fit_page
from fitting.output.pictures import draw, picture_bytes
from fitting.process.progress import tell
from fitting.results.result import FitData
from fitting.samples.known_media import MaterialFile
from fitting.samples.sample import Sample

# What a report folder holds. The page comes last, since the picture goes into it.
REPORT = {
    "json": "fit.json", "csv": "data.csv", "index": "index.csv", "plot": "fit.png",
    "page": "report.html",
}  # fmt: skip
STDIN = "-"
# The name of a file until it is complete begins so; a killed run may leave it.
_INCOMPLETE = ".fresnel-fit-"
# What the files of a fit begin with: tables, JSON, pages, materials, and pictures, of which the
# name of the program stands among the properties.
_OF_A_FIT = re.compile(
    rb"# [^\n]*, written by fresnel-fit\n"
    rb'|\{\n  "written_by": "fresnel-fit'
    rb"|<!DOCTYPE html>\n<!-- written by fresnel-fit"
    rb"|REFERENCES: \|\n    Fitted by fresnel-fit"
    rb"|(?s:(?:\x89PNG|%PDF|<\?xml).*\bfresnel-fit\b)"
)
_LARGEST_PICTURE = 10_000_000


class OutputError(ValueError):
    """A result file cannot be written where it was wanted; the text says which file and why."""


class ResultFile(NamedTuple):
    """A file that was asked for.

    what: its content: "json", "csv" (the data), "index", "plot", "page", "material", or "errors"
        of a material. path: where it goes.
    asked: the option by which it was asked for, for messages; "" in Python.
    medium: whose index it holds; None for the only one.
    in_report: whether it is one of a report, whose folder is made if there is none.
    """

    what: str
    path: Path
    asked: str = ""
    medium: str | None = None
    in_report: bool = False


def _identity(path: str | os.PathLike[str]) -> tuple[int, int] | None:
    """Return device and inode of a file, the same for all its names; None if there is no file."""
    try:
        status = os.fstat(0) if os.fspath(path) == STDIN else os.stat(path)
    except (OSError, ValueError):
        return None
    return status.st_dev, status.st_ino


def refuse_repeats(inputs: Iterable[str]) -> None:
    """Raise OutputError if a file is given twice, since its data would count twice in the fit."""
    seen: dict[Any, str] = {}
    for name in inputs:
        identity = _identity(name)
        if identity in seen:
            raise OutputError(
                f"{name}: this is the same file as {seen[identity]}; its data would count twice. "
                "Give it once."
            )
        seen |= {identity: name} if identity else {}


def begins(path: str | os.PathLike[str], pattern: re.Pattern[bytes] = _OF_A_FIT) -> bool:
    """Return whether a file can be read and begins in this way (default: as a file of a fit)."""
    try:
        with open(path, "rb") as stream:
            return pattern.match(stream.read(_LARGEST_PICTURE)) is not None
    except OSError:
        return False


def _overwrite(asked: str) -> str:
    return "add --overwrite" if asked else "give overwrite=True"


def report_files(
    folder: str | os.PathLike[str], without: Container[str] = (), asked: str = "",
    overwrite: bool = False,
) -> list[ResultFile]:  # fmt: skip
    """Return the files of a report in ``folder``, which is new or empty, or holds files of fits.

    without: contents that are left out. overwrite: it may hold other files. Raises OutputError for
    another folder.
    """
    name, folder = f"{asked} {folder}".strip(), Path(folder)
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"{name}: this is a file; name a folder.")
    if not folder.parent.is_dir():
        raise OutputError(f"{name}: there is no folder {folder.parent}; create it first.")
    inside = [] if overwrite or not folder.exists() else sorted(folder.iterdir())
    others = [p.name for p in inside if not (p.name.startswith(_INCOMPLETE) or begins(p))]
    if others:
        raise OutputError(
            f"{name}: the folder holds files other than those of a report "
            f"({', '.join(others[:3])}{', ...' if len(others) > 3 else ''}). Name a new folder, or "
            f"{_overwrite(asked)} to write the report into this one, where it replaces files of "
            "the same names."
        )
    files = [f for f in REPORT.items() if f[0] not in without]
    return [ResultFile(what, folder / file, asked, in_report=True) for what, file in files]


def material_files(
    path: str | os.PathLike[str], media: Sequence[str | None] = (None,), asked: str = ""
) -> list[ResultFile]:
    """Return the files of the index and the errors of media: of several, out_film.yml of out.yml.

    Raises ValueError for a path that does not end in .yml.
    """
    file = Path(path)
    if file.suffix.lower() not in (".yml", ".yaml"):
        name = f"{asked} {file}".strip()
        raise ValueError(f"{name}: the name of a material file must end in .yml.")
    stems = [file.stem if len(media) == 1 else f"{file.stem}_{medium}" for medium in media]
    return [
        ResultFile(what, file.with_name(stem + ending), asked, medium)
        for stem, medium in zip(stems, media, strict=True)
        for what, ending in (("material", file.suffix), ("errors", "_errors.csv"))
    ]


def fitted_media(samples: Sequence[Sample]) -> tuple[str | None, ...]:
    """Return the places of the media whose index is fitted; (None,) where there is one or none.

    Raises ValueError for samples among which one is going to be chosen, if their fitted media
    differ in place, since it is not known yet which files there will be.
    """
    each = {
        tuple(place for place, m in zip(s.places[1:], s.media[1:], strict=True) if m.unknown)
        for s in samples
    }
    if max(map(len, each)) <= 1:
        return (None,)
    if len(each) > 1:
        raise ValueError(
            "--material: the samples that are compared have different fitted media. Choose one of "
            "them first, and write its media in a fit of that sample alone."
        )
    return each.pop()


def files_named(*samples: Sample | None) -> list[str]:
    """Return the files with an index that are media of samples."""
    known = [part for s in samples if s is not None for m in s.media for part in m.known]
    return [part.path for part in known if isinstance(part, MaterialFile)]


def checked(
    files: Iterable[ResultFile], inputs: Sequence[str] = (), overwrite: bool = False
) -> list[ResultFile]:
    """Return the files with the paths that links lead to, if all of them can be written.

    inputs: files that must not be overwritten, by whatever name. overwrite: files that no fit wrote
    may be replaced. Raises OutputError, before anything is fitted or written.
    """
    out: dict[Path, ResultFile] = {}
    read = {_identity(file) for file in inputs} - {None}
    for file in files:
        final = Path(os.path.realpath(file.path))
        try:
            wrong = "two results cannot go to the same file; give each a name." * (final in out)
            wrong = wrong or _obstacle(final, file, read, overwrite)
        except OSError as error:
            wrong = f"cannot be written ({error.strerror})."
        if wrong:
            raise OutputError(f"{file.asked} {file.path}: {wrong}".strip())
        out[final] = file._replace(path=final)
    return list(out.values())


def _obstacle(final: Path, file: ResultFile, read: Container[Any], overwrite: bool) -> str:
    """Return what keeps a file from being written; "" for nothing. May raise OSError.

    read: the identities of the files that the fit reads.
    """
    if _identity(final) in read:
        return (
            f"{final.name} is a file that this fit reads, which must not be overwritten; choose "
            "another name."
        )
    if final.exists():
        if not final.is_file():
            return f"this is {'a folder' if final.is_dir() else 'not a regular file'}; name a file."
        if not os.access(final, os.W_OK):
            return "the file exists and is write-protected; choose another name."
        if not overwrite and final.stat().st_size and not begins(final):
            return (
                "the file exists and was not written by a fit. Choose another name, or "
                f"{_overwrite(file.asked)} to replace it."
            )
    new = file.in_report and not final.parent.exists()
    folder = final.parent.parent if new else final.parent
    if not folder.is_dir():
        return f"there is no folder {folder}; create it first."
    with tempfile.TemporaryFile(dir=folder):  # whether files can be made there
        return ""


def write_whole(contents: Mapping[Path, str | bytes]) -> None:
    """Write files that appear complete, each in one step of the file system, or not at all.

    Each is written beside its place and renamed when all are on the disk. An existing file keeps
    its permissions; its folder is made if there is none. Lines end alike on every system; bytes of
    a file name that are no text are written as escapes. Raises OutputError where the file system
    refuses.
    """
    staged: dict[Path, Path] = {}
    path = Path()
    try:
        for path, content in contents.items():
            if isinstance(content, str):
                content = content.encode("utf-8", "backslashreplace")
            path.parent.mkdir(exist_ok=True)
            staged[path] = path.with_name(f"{_INCOMPLETE}{os.urandom(8).hex()}.part")
            with open(staged[path], "xb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            if path.exists():
                shutil.copymode(path, staged[path])
        for path, temporary in staged.items():
            os.replace(temporary, path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror}).") from error
    finally:
        for temporary in staged.values():
            temporary.unlink(missing_ok=True)


def write_files(
    fit: FitData, files: Iterable[ResultFile], *, reference: str | None = None, command: str = "",
    choice: Any = None, decimal: str = ".",
) -> None:  # fmt: skip
    """Write every file that was asked for, or none.

    files: as `checked` returns them. reference: a named material, drawn beside eta and k. command:
    how the fit was asked for, for the foot of the page. choice: a `Choice`, if a model was chosen.
    decimal: decimal mark of the tables; with "," their cells are separated by semicolons.
    """
    png, contents = b"", {}
    for what, path, asked, medium, in_report in files:
        tell(asked)
        if what == "plot":
            # the page of a report has the warnings beside its picture
            drawn = draw(fit, reference, warnings=not in_report)
            content = png = picture_bytes(drawn, path.suffix)
        elif what == "page":
            content = fit_page(fit, png, command, choice)
        elif what == "json":
            content = json_text(fit, choice)
        elif what in ("csv", "index"):
            content = (data_csv if what == "csv" else index_csv)(fit, decimal)
        else:
            content = material_of(fit, medium)[what == "errors"]
        contents[path] = content
    write_whole(contents)


def write_checked(fit: FitData, files: Iterable[ResultFile], overwrite: bool) -> list[ResultFile]:
    """Write files of a fit in Python, and return them; no material of its sample is replaced."""
    wanted = checked(files, files_named(fit.sample), overwrite)
    write_files(fit, wanted)
    return wanted
