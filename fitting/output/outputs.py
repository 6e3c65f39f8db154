"""Result files that are written whole or not at all."""

from __future__ import annotations

import contextlib
import os
import stat
from pathlib import Path
from types import TracebackType


class OutputError(ValueError):
    """A result file cannot be written where it was asked for; the text says which and why."""


class Outputs:
    """Files that appear complete, when everything has been written, or not at all.

    Each is written beside its place under another name, which is opened at once: a folder that is
    missing or read-only is found before the work is done and not after. As a context manager it
    removes what was not published::

        with Outputs() as outputs:
            json_file = outputs.open("gold.json")
            ...
            json_file.write_bytes(text)
            outputs.publish()
    """

    def __init__(self) -> None:
        self._staged: dict[Path, Path] = {}
        self._made: list[Path] = []

    def folder(self, path: str | os.PathLike[str], *, flag: str = "") -> Path:
        """Return the folder ``path``, made if need be (and removed if nothing is published).

        Raises OutputError where it cannot be.
        """
        name, folder = f"{flag} {path}".strip(), Path(path)
        try:
            folder.mkdir()
            self._made.append(folder)
        except FileExistsError:
            if not folder.is_dir():
                raise OutputError(f"{name}: this is a file; a folder was wanted.") from None
        except FileNotFoundError:
            raise OutputError(
                f"{name}: there is no folder {folder.parent}; make it first."
            ) from None
        except OSError as error:
            raise OutputError(f"{name}: cannot be made ({error.strerror}).") from error
        return folder

    def open(self, path: str | os.PathLike[str], *, flag: str = "", source: str = "") -> Path:
        """Return the file to write to in place of ``path``, empty now.

        flag: how the user named the file, for the error's text. source: file that must not be
        overwritten. An existing file is replaced and keeps its permissions; of a symbolic link
        the target is replaced.
        Raises OutputError where nothing can be written.
        """
        name = f"{flag} {path}".strip()
        final = Path(os.path.realpath(path))
        if final in self._staged:
            raise OutputError(f"{name}: two results cannot go to the same file.")
        if source and os.path.exists(source) and final == Path(os.path.realpath(source)):
            raise OutputError(f"{name}: this is the measurement itself; choose another name.")
        mode = None
        if final.exists():
            mode = final.stat().st_mode
            if not stat.S_ISREG(mode):
                what = "a folder" if stat.S_ISDIR(mode) else "not a regular file"
                raise OutputError(f"{name}: this is {what}; a file name was wanted.")
            if not os.access(final, os.W_OK):
                raise OutputError(f"{name}: the file is there and must not be written to.")
        elif not final.parent.is_dir():
            raise OutputError(f"{name}: there is no folder {final.parent}; make it first.")
        staged = final.with_name(f".{final.name[:100]}.{os.urandom(4).hex()}")
        try:
            # 0o666 less the user's umask, as for any file that a program makes
            os.close(os.open(staged, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
            self._staged[final] = staged
            if mode is not None:
                os.chmod(staged, stat.S_IMODE(mode))
        except OSError as error:
            raise OutputError(f"{name}: cannot be written ({error.strerror}).") from error
        return staged

    def publish(self) -> None:
        """Put every file in its place. Each replacement is one step of the file system.

        Raises OutputError where the file system refuses.
        """
        while self._staged:
            final, staged = next(iter(self._staged.items()))
            try:
                os.replace(staged, final)
            except OSError as error:
                raise OutputError(f"{final}: cannot be written ({error.strerror}).") from error
            del self._staged[final]
        self._made.clear()

    def __enter__(self) -> Outputs:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for staged in self._staged.values():
            staged.unlink(missing_ok=True)
        self._staged.clear()
        for folder in reversed(self._made):
            with contextlib.suppress(OSError):  # somebody else's file has come into it
                folder.rmdir()
        self._made.clear()
