"""Regular files, directories and full disks.

Others can write to the data directory.  Opening a FIFO without a writer blocks forever, and a
directory can be opened; both raise an OSError here, like an unreadable file.
"""

from __future__ import annotations

import errno
import hashlib
import os
import shutil
import sqlite3
import stat
from contextlib import suppress
from io import BufferedReader
from pathlib import Path

__all__ = ["is_full", "open_regular", "remove_entry", "sha256_of"]

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_FULL_POSTGRESQL = "53100"


def open_regular(path: Path) -> BufferedReader:
    """Open a regular file for reading.

    Raises:
        OSError: The file is missing, unreadable or not a regular file.
    """
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
