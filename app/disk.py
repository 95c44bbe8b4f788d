"""Regular files, directories, full disks, and the lock of one machine on a data directory.

Others can write to the data directory.  Opening a FIFO without a writer blocks forever, and a
directory can be opened; both raise an OSError here, like an unreadable file.
"""

from __future__ import annotations

import errno
import fcntl
import functools
import hashlib
import os
import re
import secrets
import shutil
import sqlite3
import stat
from contextlib import suppress
from io import BufferedReader
from pathlib import Path
from typing import BinaryIO

from identification.errors import OptionError

__all__ = ["NodeLock", "is_full", "open_regular", "remove_entry", "sha256_of"]

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_FULL_POSTGRESQL = "53100"
_NAME = re.compile(r"[0-9a-f]{16}")


def open_regular(path: Path) -> BufferedReader:
    """Open a file for reading; raise `OSError` for one that is not a regular file, too."""
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    mode = os.fstat(handle).st_mode
    if not stat.S_ISREG(mode):
        os.close(handle)
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        raise OSError(errno.EINVAL, "Not a regular file", str(path))
    return os.fdopen(handle, "rb")


def sha256_of(file: BufferedReader) -> str:
    """SHA-256 of a whole file, in hexadecimal; afterwards the file is positioned at its start."""
    file.seek(0)
    digest = hashlib.file_digest(file, "sha256").hexdigest()
    file.seek(0)
    return digest


def remove_entry(path: Path) -> None:
    """Remove the file or directory tree at a path, if there is one."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
        return
    # NotADirectoryError: a parent is a file, so nothing exists at the path.
    with suppress(FileNotFoundError, NotADirectoryError):
        path.unlink()


def is_full(error: BaseException) -> bool:
    """Return True if an error means that a disk, a quota or a file size limit is exhausted.

    Database errors are recognised by their codes, so that no driver must be imported.
    """
    if isinstance(error, OSError):
        return error.errno in _FULL
    original = getattr(error, "orig", None) or error
    return (
        getattr(original, "sqlite_errorcode", None) == sqlite3.SQLITE_FULL
        or getattr(original, "sqlstate", None) == _FULL_POSTGRESQL
    )


class NodeLock:
    """Lock file, held by at most one process at a time (flock); it contains only the identifier."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._held: BinaryIO | None = None

    @property
    def is_held(self) -> bool:
        """True if this process holds the lock."""
        return self._held is not None

    def take(self) -> None:
        """Acquire the lock for the life of this process.

        Raises:
            OptionError: Another process on this machine holds the lock, or the path is not a
                regular file.
        """
        if self._held is not None:
            return
        try:
            handle = os.open(
                self._file, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_NONBLOCK, 0o666
            )
        except OSError as error:
            raise OptionError(
                f"data_dir: {self._file} cannot be opened ({error.strerror}); remove it, "
                "it holds no data"
            ) from error
        file = os.fdopen(handle, "ab")
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            file.close()
            raise OptionError(
                f"data_dir: {self._file} is not a regular file; remove it, it holds no data"
            )
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            file.close()
            raise OptionError(
                f"data_dir: another server already uses {self._file.parents[1]}; stop it or name "
                "another"
            ) from error
        self._held = file

    @functools.cached_property
    def name(self) -> str:
        """Identifier stored in the lock file, created if the file contains none.

        The holder of the lock may assume that every earlier process with this identifier has ended.
        The host name alone would not suffice: two servers on one machine, each with its own data
        directory, may share a database, and several machines may share a host name.
        """
        with self._file.open("a+", encoding="ascii", errors="replace") as file:
            file.seek(0)
            known = file.read(100).strip()
            if not _NAME.fullmatch(known):
                # New or damaged file: leases held under the old identifier simply expire.
                known = secrets.token_hex(8)
                file.truncate(0)
                file.write(known)
                file.flush()
                os.fsync(file.fileno())
        return known

    def release(self) -> None:
        """Release the lock."""
        if self._held is not None:
            self._held.close()
            self._held = None
