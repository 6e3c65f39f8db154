"""Result files that are written whole or not at all, and never over a file that is read."""

from __future__ import annotations

import contextlib
import os
import re
import stat
from collections.abc import Iterable
from pathlib import Path
from typing import BinaryIO

from fitting.process.interrupt import last_acts

try:
    import fcntl
except ImportError:  # a system without these locks keeps the leftovers of killed runs
    fcntl = None

# The name of a result file until it is complete. The process that writes it holds a lock on it.
_STAGED = ".fresnel-fit-{}.part"
MARK = ".fresnel-fit-report"
"""An empty file in the folder of every report, by which a later report may write there."""
STDIN = "-"
WRITTEN_BY = "written by fresnel-fit"
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


def _identity(path: str | os.PathLike[str]) -> tuple[int, int] | None:
    """Return device and inode of a file, the same for all its names; None if there is no file."""
    try:
        status = os.fstat(0) if os.fspath(path) == STDIN else os.stat(path)
    except (OSError, ValueError):
        return None
    return status.st_dev, status.st_ino


def refuse_repeats(inputs: Iterable[str]) -> None:
    """Raise OutputError if a file is given twice, since its data would count twice in the fit."""
    seen: dict[tuple[int, int], str] = {}
    for name in inputs:
        identity = _identity(name)
        if identity in seen:
            raise OutputError(
                f"{name}: this is the same file as {seen[identity]}; its data would count twice. "
                "Give it once."
            )
        if identity is not None:
            seen[identity] = name


def _lock(file: BinaryIO) -> None:
    """Take the lock of an open file; OSError if another process holds it, or there are no locks."""
    if fcntl is None:
        raise OSError
    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _clean(folder: Path) -> None:
    """Remove the incomplete files of killed runs in ``folder``, whose lock no process holds."""
    for path in folder.glob(_STAGED.format("[0-9a-f]" * 16)):
        with contextlib.suppress(OSError), path.open("r+b") as file:
            _lock(file)
            path.unlink()


def begins(path: str | os.PathLike[str], pattern: re.Pattern[bytes] = _OF_A_FIT) -> bool:
    """Return whether a file can be read and begins in this way (default: as a file of a fit)."""
    try:
        with open(path, "rb") as stream:
            return pattern.match(stream.read(_LARGEST_PICTURE)) is not None
    except OSError:
        return False


def write_text(path: Path, text: str) -> None:
    """Write a text with the same line ends on every system.

    Bytes of a file name that are no text are written as escapes.
    """
    path.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")


class _Staged:
    """An empty file beside its later place, open and locked."""

    def __init__(self, folder: Path) -> None:
        while True:
            self.path = folder / _STAGED.format(os.urandom(8).hex())
            # 0o666 less the user's umask, as for any file that a program makes
            descriptor = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
            self._file = os.fdopen(descriptor, "wb")
            with contextlib.suppress(OSError):  # of a file system without locks
                _lock(self._file)
            # Another run may have removed it as an incomplete file between opening and locking.
            if _identity(self.path) is not None:
                return
            self._file.close()

    def publish(self, final: Path) -> None:
        """Give the file its name, once its content is on the disk."""
        os.fsync(self._file.fileno())
        self._file.close()
        os.replace(self.path, final)

    def remove(self) -> None:
        self.path.unlink(missing_ok=True)
        self._file.close()


def _sync(folder: Path) -> None:
    """Put the names in ``folder`` on the disk, where the system can."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


class Outputs:
    """Files that appear complete, when everything has been written, or not at all.

    Each file is written in its folder under a temporary name, which is opened at once, so that a
    folder that is missing or read-only is refused before the fit and not after it. On leaving the
    context, files that were not published are removed; those of a killed run, by the next run::

        with Outputs() as outputs:
            json_file = outputs.open("gold.json")
            ...
            json_file.write_bytes(text)
            outputs.publish()
    """

    def __init__(self, *, overwrite: bool = False) -> None:
        """overwrite: whether a folder of other files is taken, and files of others are replaced."""
        self._overwrite = overwrite
        self._staged: dict[Path, _Staged] = {}
        self._made: list[Path] = []

    def folder(self, path: str | os.PathLike[str], *, flag: str = "") -> Path:
        """Return the folder ``path``, new, empty or made by an earlier report, and mark it.

        A folder that is made here is removed if nothing is published.
        Raises OutputError where it cannot be.
        """
        name, folder = f"{flag} {path}".strip(), Path(path)
        try:
            folder.mkdir()
            self._made.append(folder)
        except FileExistsError:
            if not folder.is_dir():
                raise OutputError(f"{name}: this is a file; name a folder.") from None
        except FileNotFoundError:
            raise OutputError(
                f"{name}: there is no folder {folder.parent}; create it first."
            ) from None
        except OSError as error:
            raise OutputError(
                f"{name}: the folder cannot be created ({error.strerror})."
            ) from error
        _clean(folder)
        mark = folder / MARK
        if mark.is_file() and not mark.is_symlink():
            return folder
        others = sorted(os.listdir(folder))
        if others and not self._overwrite:
            raise OutputError(
                f"{name}: the folder holds files other than those of a report "
                f"({', '.join(others[:3])}{', ...' if len(others) > 3 else ''}). Name a new "
                f"folder, or {'add --overwrite' if flag else 'give overwrite=True'} to write the "
                "report into this one, where it replaces files of the same names."
            )
        if not others:  # a folder with other files is not marked: the next report asks again
            self.open(mark, flag=flag)
        return folder

    def open(
        self,
        path: str | os.PathLike[str],
        *,
        flag: str = "",
        inputs: Iterable[str] = (),
    ) -> Path:
        """Return the file to write to in place of ``path``, empty now.

        flag: how the user named the file, for the error's text. inputs: files that must not be
        overwritten, by whatever name. An existing file of an earlier fit is replaced and keeps its
        permissions; of a symbolic link the target is replaced.
        Raises OutputError where nothing can be written.
        """
        name = f"{flag} {path}".strip()
        final = Path(os.path.realpath(path))
        identity = _identity(final)
        if final in self._staged:
            raise OutputError(f"{name}: two results cannot go to the same file; give each a name.")
        for file in inputs:
            if identity is not None and identity == _identity(file):
                raise OutputError(
                    f"{name}: {final.name} is a file that this fit reads, which must not be "
                    "overwritten; choose another name."
                )
        mode = None
        if final.exists():
            mode = final.stat().st_mode
            if not stat.S_ISREG(mode):
                what = "a folder" if stat.S_ISDIR(mode) else "not a regular file"
                raise OutputError(f"{name}: this is {what}; name a file.")
            if not os.access(final, os.W_OK):
                raise OutputError(
                    f"{name}: the file exists and is write-protected; choose another name."
                )
            if not self._overwrite and final.stat().st_size and not begins(final):
                raise OutputError(
                    f"{name}: the file exists and was not written by a fit. Choose another name, "
                    f"or {'add --overwrite' if flag else 'give overwrite=True'} to replace it."
                )
        elif not final.parent.is_dir():
            raise OutputError(f"{name}: there is no folder {final.parent}; create it first.")
        _clean(final.parent)
        try:
            staged = _Staged(final.parent)
            self._staged[final] = staged
            if mode is not None:
                os.chmod(staged.path, stat.S_IMODE(mode))
        except OSError as error:
            raise OutputError(f"{name}: cannot be written ({error.strerror}).") from error
        return staged.path

    def publish(self) -> None:
        """Rename every file to its final name, each in one atomic step of the file system.

        Raises OutputError where the file system refuses.
        """
        folders = {final.parent for final in self._staged}
        while self._staged:
            final, staged = next(iter(self._staged.items()))
            try:
                staged.publish(final)
            except OSError as error:
                raise OutputError(f"{final}: cannot be written ({error.strerror}).") from error
            del self._staged[final]
        for folder in folders:
            _sync(folder)
        self._made.clear()

    def __enter__(self) -> Outputs:
        last_acts.append(self._remove)
        return self

    def __exit__(self, *_: object) -> None:
        last_acts.remove(self._remove)
        self._remove()

    def _remove(self) -> None:
        for staged in self._staged.values():
            staged.remove()
        self._staged.clear()
        for folder in reversed(self._made):
            with contextlib.suppress(OSError):  # another program has put a file into it
                folder.rmdir()
        self._made.clear()
