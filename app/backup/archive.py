"""Backup formats: a directory, or one .tar file with the same content.

    SHA256SUMS                       hash and name of each file below, in sha256sum -c format
    motorid.sqlite3                  database
    runs/RUN_ID                      bytes of each run
    fits/FIT_ID/ATTEMPT/NAME         outputs of each successful fit

The checksums are written last: a backup without them is incomplete.
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

from app.disk import is_full
from app.identifiers import is_id
from identification.errors import InputError, OptionError
from identification.result.atomic import sync

__all__ = ["DATABASE", "SUMS", "AbstractTarget", "is_name", "opened", "stored", "target"]

DATABASE = "motorid.sqlite3"
SUMS = "SHA256SUMS"

_BLOCK_BYTES = 1 << 20
_OUTPUT = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,100}")


def is_name(name: str) -> bool:
    """Return True if a name is allowed in a backup; no allowed name leaves the target directory."""
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


def stored(path: Path, source: BinaryIO) -> str:
    """Write all bytes to a new file and to the disk, and return their SHA-256."""
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    digest = hashlib.sha256()
    with open(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as into:
        while block := source.read(_BLOCK_BYTES):
            digest.update(block)
            into.write(block)
        into.flush()
        os.fsync(into.fileno())
    return digest.hexdigest()


class AbstractTarget(abc.ABC):
    """Backup being written."""

    @abc.abstractmethod
    def add(self, name: str, source: BinaryIO) -> str:
        """Store a file under a name and return its SHA-256."""

    @abc.abstractmethod
    def finish(self, sums: str) -> None:
        """Store the checksums and sync to disk; the backup is complete."""

    @abc.abstractmethod
    def discard(self) -> None:
        """Remove everything written to the target."""


class _Folder(AbstractTarget):
    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._is_new = not directory.exists()
        directory.mkdir(parents=True, exist_ok=True, mode=0o700)

    def add(self, name: str, source: BinaryIO) -> str:
        return stored(self._directory / name, source)

    def finish(self, sums: str) -> None:
        (self._directory / SUMS).write_text(sums, encoding="ascii")
        sync(self._directory)

    def discard(self) -> None:
        # Remove only backup files: the directory may contain others by now.
        for part in ("runs", "fits"):
            shutil.rmtree(self._directory / part, ignore_errors=True)
        with contextlib.suppress(OSError):
            for name in (DATABASE, SUMS):
                (self._directory / name).unlink(missing_ok=True)
            if self._is_new:
                self._directory.rmdir()


class _Hashing(io.RawIOBase):
    """File that hashes the bytes read from it."""

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
        sync(self._file.absolute().parent)

    def discard(self) -> None:
        with contextlib.suppress(OSError):
            self._file.unlink(missing_ok=True)
        with contextlib.suppress(OSError):
            # Closing flushes the buffer, which fails again on a full disk.
            self._stream.close()


def target(path: Path) -> AbstractTarget:
    """Create a new backup at a path: one file for .tar, else a directory.

    Raises:
        OptionError: The path already exists or cannot be written.
    """
    is_empty = path.is_dir() and not any(path.iterdir())
    if (path.exists() or path.is_symlink()) and (path.suffix == ".tar" or not is_empty):
        raise OptionError(
            f"{path} is there already, and a backup overwrites nothing; choose another path"
        )
    try:
        return _Tar(path) if path.suffix == ".tar" else _Folder(path)
    except OSError as error:
        raise OptionError(
            f"{path}: cannot be written ({error.strerror}); choose another path"
        ) from error


@contextlib.contextmanager
def opened(path: Path) -> Iterator[Iterator[tuple[str, BinaryIO]]]:
    """Open a backup for iteration over the names and contents of its files.

    Raises:
        InputError: The path is not a backup or cannot be read.
        OSError: No space is left on the restore target.
    """
    try:
        if path.is_dir():
            yield _files_of_folder(path)
            return
        with tarfile.open(path, mode="r:") as tar:
            yield _files_of_tar(tar, path)
    except tarfile.TarError as error:
        raise InputError(
            "is not a complete .tar file of 'motorid backup'", file=str(path)
        ) from error
    except OSError as error:
        if is_full(error):
            # The restore target is full; the backup is not at fault.
            raise
        raise InputError(
            f"cannot be read ({error.strerror}); expected a backup of 'motorid backup'",
            file=str(path),
        ) from error


def _files_of_folder(folder: Path) -> Iterator[tuple[str, BinaryIO]]:
    for path in sorted(folder.rglob("*")):
        if path.is_symlink() or not (path.is_file() or path.is_dir()):
            raise InputError("is no ordinary file; a backup contains no others", file=str(path))
        if path.is_file():
            with path.open("rb") as file:
                yield path.relative_to(folder).as_posix(), file


def _files_of_tar(tar: tarfile.TarFile, path: Path) -> Iterator[tuple[str, BinaryIO]]:
    for member in tar:
        file = tar.extractfile(member) if member.isreg() and not member.issparse() else None
        if file is None:
            raise InputError(
                f"{member.name[:200]!r} is no ordinary file; a backup contains no others",
                file=str(path),
            )
        with file:
            yield member.name, file  # type: ignore[misc]
