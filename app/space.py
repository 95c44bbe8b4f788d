"""Detection of a full disk from errors of the operating system, SQLite or PostgreSQL.

Database errors are recognised by their codes, so that no driver must be imported.
"""

from __future__ import annotations

import errno
import sqlite3

__all__ = ["is_full"]

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_FULL_POSTGRESQL = "53100"


def is_full(error: BaseException) -> bool:
    """Return True if an error means that a disk, a quota or a file size limit is exhausted.

    Args:
        error: Error of the operating system, a database driver or SQLAlchemy.
    """
    if isinstance(error, OSError):
        return error.errno in _FULL
    original = getattr(error, "orig", None) or error
    return (
        getattr(original, "sqlite_errorcode", None) == sqlite3.SQLITE_FULL
        or getattr(original, "sqlstate", None) == _FULL_POSTGRESQL
    )
