"""Whether no space is left, whoever says so: the system, SQLite or PostgreSQL.

Knows the errors of databases by their codes alone, so that nothing has to be imported for it.
"""

from __future__ import annotations

import errno
import sqlite3

__all__ = ["is_full"]

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_FULL_POSTGRESQL = "53100"


def is_full(error: BaseException) -> bool:
    """Whether an error says that no space is left, or that no more is allowed.

    Args:
        error: Of the system, of a database's driver, or of SQLAlchemy around the driver's.
    """
    if isinstance(error, OSError):
        return error.errno in _FULL
    original = getattr(error, "orig", None) or error
    return (
        getattr(original, "sqlite_errorcode", None) == sqlite3.SQLITE_FULL
        or getattr(original, "sqlstate", None) == _FULL_POSTGRESQL
    )
