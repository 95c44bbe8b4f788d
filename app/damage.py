"""Detection of damaged SQLite databases, by error code and by a check before the service starts."""

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
    """Damaged database file; the message names the file and the recovery steps."""

    def __init__(self, file: str | Path | None, reason: str) -> None:
        place = Path(file or "")
        super().__init__(
            f"{place}: {reason}; expected the SQLite database of motorid. Stop the service, move "
            f"{place.parent} away and restore a backup with 'motorid restore BACKUP --data-dir "
            f"{place.parent}'"
        )


def is_damaged(error: BaseException) -> bool:
    """Return True if an error means that the database file is damaged or not a database."""
    original = getattr(error, "orig", None) or error
    code = getattr(original, "sqlite_errorcode", None)
    return isinstance(code, int) and code & _PRIMARY in _CODES


def corrupt(reason: str) -> sqlite3.DatabaseError:
    """SQLite's error for a damaged page, for damage that appears only when a value is decoded."""
    error = sqlite3.DatabaseError(reason)
    error.sqlite_errorcode = sqlite3.SQLITE_CORRUPT
    return error


def check_present(file: Path, stored: int) -> None:
    """Raise `DamagedDatabase` for a missing or empty file if `stored` runs and fits have files."""
    is_empty = not file.exists() or (file.is_file() and file.stat().st_size == 0)
    if is_empty and stored:
        state = "is empty" if file.exists() else "is missing"
        raise DamagedDatabase(file, f"{state} although the files of {stored} runs and fits exist")


def check_file(file: Path) -> None:
    """Check all pages of a database with ``PRAGMA quick_check``.

    A missing file passes.  Takes 0.5 s for 100,000 fits (188 MB) in the page cache.

    Raises:
        DamagedDatabase: A page is damaged, or the file is not a database.
    """
    if not file.exists():
        return
    try:
        with contextlib.closing(sqlite3.connect(file)) as database:
            verdict = str(database.execute("PRAGMA quick_check(1)").fetchone()[0])
    except sqlite3.DatabaseError as error:
        if not is_damaged(error):
            # Locked, or no space for its journal: the start reports the error.
            return
        verdict = str(error)
    if verdict != "ok":
        raise DamagedDatabase(file, f"is damaged ({' '.join(verdict.split())[:200]})")
