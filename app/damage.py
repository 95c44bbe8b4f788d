"""Damage of an SQLite file: recognised by SQLite's codes, looked for before the service starts."""

from __future__ import annotations

import contextlib
import sqlite3
from pathlib import Path
from typing import Final

from identification.errors import ComputationError

__all__ = ["DamagedDatabase", "check_file", "check_present", "corrupt", "is_damaged"]

_CODES: Final = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)
_PRIMARY: Final = 0xFF


class DamagedDatabase(ComputationError):
    """The file of a database is damaged; its message names the file and the way back.

    Args:
        file: The database.
        reason: What is wrong with it.
    """

    def __init__(self, file: str | Path | None, reason: str) -> None:
        place = Path(file or "")
        super().__init__(
            f"{place}: {reason}; expected the SQLite database of motorid. Stop the service, move "
            f"{place.parent} away and restore a backup with 'motorid restore BACKUP --data-dir "
            f"{place.parent}'"
        )


def is_damaged(error: BaseException) -> bool:
    """Whether an error says that the file of a database is damaged or is none.

    Args:
        error: Of the driver, or of SQLAlchemy around the driver's.
    """
    original = getattr(error, "orig", None) or error
    code = getattr(original, "sqlite_errorcode", None)
    return isinstance(code, int) and code & _PRIMARY in _CODES


def corrupt(reason: str) -> sqlite3.DatabaseError:
    """The error that SQLite raises for a damaged page, for damage that only its reader sees."""
    error = sqlite3.DatabaseError(reason)
    error.sqlite_errorcode = sqlite3.SQLITE_CORRUPT
    return error


def check_present(file: Path, stored: int) -> None:
    """Refuse to begin with a new database beside files of a former one.

    Args:
        file: The database.
        stored: Number of runs and fits that have files.

    Raises:
        DamagedDatabase: It is missing or has no byte, and there are files.
    """
    is_empty = not file.exists() or (file.is_file() and file.stat().st_size == 0)
    if is_empty and stored:
        state = "is empty" if file.exists() else "is missing"
        raise DamagedDatabase(file, f"{state} beside the files of {stored} runs and fits")


def check_file(file: Path) -> None:
    """Look through all pages of a database, by ``PRAGMA quick_check``.

    100,000 fits (188 MB) take half a second from the cache of the system.

    Args:
        file: The database; one that is missing has no damage.

    Raises:
        DamagedDatabase: A page is damaged, or the file is no database.
    """
    if not file.exists():
        return
    try:
        with contextlib.closing(sqlite3.connect(file)) as database:
            verdict = str(database.execute("PRAGMA quick_check(1)").fetchone()[0])
    except sqlite3.DatabaseError as error:
        if not is_damaged(error):
            # Locked, or no space for its journal: the start finds out and says so.
            return
        verdict = str(error)
    if verdict != "ok":
        raise DamagedDatabase(file, f"is damaged ({' '.join(verdict.split())[:200]})")
