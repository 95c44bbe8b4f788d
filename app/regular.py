"""Regular files of a directory that others can write to: opened without waiting, hashed.

A FIFO without a writer blocks `open` for good, and a directory can be opened; both are refused here
as the system refuses a file that it cannot read, by an OSError.
"""

from __future__ import annotations

import errno
import hashlib
import os
import shutil
import stat
from contextlib import suppress
from io import BufferedReader
from pathlib import Path

__all__ = ["open_regular", "remove_entry", "sha256_of"]


def open_regular(path: Path) -> BufferedReader:
    """Open a regular file to be read.

    Raises:
        OSError: It is missing, cannot be read, or is no regular file.
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
    """SHA-256 of a file from its first byte, in hexadecimal; the file stands at its begin again."""
    file.seek(0)
    digest = hashlib.file_digest(file, "sha256").hexdigest()
    file.seek(0)
    return digest


def remove_entry(path: Path) -> None:
    """Remove whatever stands at a path, a whole directory too; nothing where nothing stands."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
        return
    # Below a file that stands in the place of a directory there is nothing either.
    with suppress(FileNotFoundError, NotADirectoryError):
        path.unlink()
