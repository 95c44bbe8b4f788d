"""Where a backup lies: a directory, or one .tar file of the same content.

    SHA256SUMS                       hash and name of each file below, as sha256sum -c reads it
    motorid.sqlite3                  the database
    runs/RUN_ID                      the bytes of each run
    fits/FIT_ID/ATTEMPT/NAME         the outputs of each fit that succeeded

The sums are written last: a backup without them was interrupted.
"""

from __future__ import annotations

import abc
import contextlib
import hashlib
import io
import os
import re
import shutil
import tarfile
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from app.identifiers import is_id
from app.space import is_full
from app.storage import sync_directory
from identification.errors import InputError, OptionError

__all__ = ["DATABASE", "SUMS", "AbstractTarget", "copied", "is_name", "opened", "target"]

DATABASE = "motorid.sqlite3"
SUMS = "SHA256SUMS"

_BLOCK_BYTES = 1 << 20
_OUTPUT = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,100}")


def is_name(name: str) -> bool:
    """Whether a file of this name can be part of a backup, and so can be put nowhere else."""
    match name.split("/"):
        case ["motorid.sqlite3" | "SHA256SUMS"]:
            return True
        case ["runs", run_id]:
            return is_id("run", run_id)
        case ["fits", fit_id, attempt, output]:
            return (
                is_id("fit", fit_id)
                and attempt.isascii()
                and attempt.isdigit()
                and bool(_OUTPUT.fullmatch(output))
            )
    return False


def copied(source: BinaryIO, into: BinaryIO) -> str:
    """Copy all bytes and give their SHA-256."""
    digest = hashlib.sha256()
    while block := source.read(_BLOCK_BYTES):
        digest.update(block)
        into.write(block)
    return digest.hexdigest()


class AbstractTarget(abc.ABC):
    """A backup that is being written."""

    @abc.abstractmethod
    def add(self, name: str, source: BinaryIO) -> str:
        """Take the bytes of a file in under a name, and give their SHA-256."""

    @abc.abstractmethod
    def finish(self, sums: str) -> None:
        """Add the sums; the backup is complete and on the disk."""

    @abc.abstractmethod
    def discard(self) -> None:
        """Remove what was written, so that the place is as it was before."""


class _Folder(AbstractTarget):
    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._is_new = not directory.exists()
        directory.mkdir(parents=True, exist_ok=True, mode=0o700)

    def add(self, name: str, source: BinaryIO) -> str:
        path = self._directory / name
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with path.open("xb") as write:
            digest = copied(source, write)
            write.flush()
            os.fsync(write.fileno())
        return digest

    def finish(self, sums: str) -> None:
        (self._directory / SUMS).write_text(sums, encoding="ascii")
        sync_directory(self._directory)

    def discard(self) -> None:
        # Only what a backup has: someone may have put something beside it.
        for part in ("runs", "fits"):
            shutil.rmtree(self._directory / part, ignore_errors=True)
        with contextlib.suppress(OSError):
            for name in (DATABASE, SUMS):
                (self._directory / name).unlink(missing_ok=True)
            if self._is_new:
                self._directory.rmdir()


class _Hashing(io.RawIOBase):
    """A file that hashes what is read of it."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.digest = hashlib.sha256()

    def read(self, size: int = -1) -> bytes:
        block = self._file.read(size)
        self.digest.update(block)
        return block


class _Tar(AbstractTarget):
    def __init__(self, file: Path) -> None:
        self._file = file
        handle = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
        self._stream = os.fdopen(handle, "wb")
        self._tar = tarfile.open(fileobj=self._stream, mode="w", format=tarfile.PAX_FORMAT)

    def add(self, name: str, source: BinaryIO) -> str:
        member = tarfile.TarInfo(name)
        member.size = os.fstat(source.fileno()).st_size
        member.mode = 0o600
        hashing = _Hashing(source)
        self._tar.addfile(member, hashing)
        return hashing.digest.hexdigest()

    def finish(self, sums: str) -> None:
        member = tarfile.TarInfo(SUMS)
        member.size, member.mode = len(sums), 0o600
        self._tar.addfile(member, io.BytesIO(sums.encode("ascii")))
        self._tar.close()
        self._stream.flush()
        os.fsync(self._stream.fileno())
        self._stream.close()
        sync_directory(self._file.absolute().parent)

    def discard(self) -> None:
        with contextlib.suppress(OSError):
            self._file.unlink(missing_ok=True)
        with contextlib.suppress(OSError):
            # What is still to be written finds no more space than what was.
            self._stream.close()


def target(path: Path) -> AbstractTarget:
    """A new backup at a path: one file where it ends with .tar, else a directory.

    Raises:
        OptionError: Something is there already, or it cannot be written.
    """
    is_empty = path.is_dir() and not any(path.iterdir())
    if (path.exists() or path.is_symlink()) and (path.suffix == ".tar" or not is_empty):
        raise OptionError(
            f"{path} is there already, and a backup overwrites nothing; name another",
            value=str(path),
        )
    try:
        return _Tar(path) if path.suffix == ".tar" else _Folder(path)
    except OSError as error:
        raise OptionError(
            f"{path}: cannot be written ({error.strerror}); name another place", value=str(path)
        ) from error


@contextlib.contextmanager
def opened(path: Path) -> Iterator[Iterator[tuple[str, BinaryIO]]]:
    """The files of a backup, one after the other, names as they stand in it.

    Raises:
        InputError: It is no backup, or cannot be read.
        OSError: No space is left for what is made of it.
    """
    try:
        if path.is_dir():
            yield _files_of_folder(path)
            return
        with tarfile.open(path, mode="r:") as tar:
            yield _files_of_tar(tar, path)
    except tarfile.TarError as error:
        raise InputError("is no complete .tar file of 'motorid backup'", file=str(path)) from error
    except OSError as error:
        if is_full(error):
            # That of what is read into.
            raise
        raise InputError(
            f"cannot be read ({error.strerror}); expected a backup of 'motorid backup'",
            file=str(path),
        ) from error


def _files_of_folder(folder: Path) -> Iterator[tuple[str, BinaryIO]]:
    for path in sorted(folder.rglob("*")):
        if path.is_symlink() or not (path.is_file() or path.is_dir()):
            raise InputError("is no ordinary file; a backup has no others", file=str(path))
        if path.is_file():
            with path.open("rb") as file:
                yield path.relative_to(folder).as_posix(), file


def _files_of_tar(tar: tarfile.TarFile, path: Path) -> Iterator[tuple[str, BinaryIO]]:
    for member in tar:
        file = tar.extractfile(member) if member.isreg() and not member.issparse() else None
        if file is None:
            raise InputError(
                f"{member.name[:200]!r} is no ordinary file; a backup has no others",
                file=str(path),
            )
        with file:
            yield member.name, file  # type: ignore[misc]
