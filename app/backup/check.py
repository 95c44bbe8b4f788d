"""Validation of a database from a backup: schema, ids and files.

A backup may be forged, including its checksums.  Ids become paths, some of which retention deletes,
so every id is validated.  Triggers and views are rejected, because they could change the effect of
later statements.
"""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterator, Mapping
from pathlib import Path

from app.backup.archive import DATABASE
from app.fits.outputs import expected_outputs
from app.identifiers import Kind, is_id
from app.tables import Tables
from identification.errors import InputError

__all__ = ["check_database"]

_IDS: tuple[tuple[str, str, Kind], ...] = (
    ("runs", "id", "run"),
    ("fits", "id", "fit"),
    ("fits", "batch_id", "batch"),
    ("fit_runs", "fit_id", "fit"),
    ("fit_runs", "run_id", "run"),
    ("batches", "id", "batch"),
    ("keys", "id", "key"),
    ("sessions", "key_id", "key"),
)


def check_database(file: Path, found: Mapping[str, str], backup: Path) -> None:
    """Check that an extracted database is intact and refers only to the files of the backup.

    `found` has the SHA-256 of each file of the backup.

    Raises:
        InputError: The database is damaged, not a motorid database, or inconsistent with the files.
    """
    try:
        with contextlib.closing(sqlite3.connect(file)) as database:
            # With trusted_schema off, a schema can call only harmless SQL functions.
            database.execute("PRAGMA trusted_schema=OFF")
            wrong = next(_faults(database, file.parent, found), None)
    except sqlite3.DatabaseError as error:
        raise InputError(f"{DATABASE} cannot be read ({error})", file=str(backup)) from error
    if wrong is not None:
        raise InputError(wrong, file=str(backup))


def _faults(
    database: sqlite3.Connection, directory: Path, found: Mapping[str, str]
) -> Iterator[str]:
    """Faults found, the most basic first."""
    yield from _strange_schema(database)
    verdict = database.execute("PRAGMA integrity_check").fetchone()[0]
    if verdict != "ok":
        yield f"{DATABASE} is damaged ({verdict})"
    yield from _strange_values(database)
    runs = database.execute("SELECT id, sha256 FROM runs")
    wrong = [f"runs/{i}" for i, sha256 in runs if found.get(f"runs/{i}") != sha256]
    fits = database.execute("SELECT id, attempt FROM fits WHERE status = 'succeeded'")
    for fit_id, attempt in fits:
        own = f"fits/{fit_id}/{attempt}"
        outputs = expected_outputs(directory / own)
        wrong += [f"{own}/{name}" for name in sorted(outputs) if f"{own}/{name}" not in found]
    if wrong:
        yield f"{wrong[0]} is not what the database says; use another backup"


def _strange_schema(database: sqlite3.Connection) -> Iterator[str]:
    tables = {"alembic_version", *Tables.metadata.tables}
    indexes = {str(i.name) for table in Tables.metadata.tables.values() for i in table.indexes}
    missing = set(tables)
    for kind, name in database.execute("SELECT type, name FROM sqlite_master"):
        # SQLite creates indexes for keys; an older motorid may lack some of the others.
        is_index = kind == "index" and (name in indexes or name.startswith("sqlite_autoindex_"))
        if not is_index and (kind != "table" or name not in missing):
            yield f"{DATABASE} has an unexpected {kind} {name[:100]!r}"
        missing.discard(name)
    if missing:
        yield f"{DATABASE} has no table {min(missing)}"


def _strange_values(database: sqlite3.Connection) -> Iterator[str]:
    for table, column, kind in _IDS:
        query = f"SELECT {column} FROM {table}"  # noqa: S608  names of this module
        for (value,) in database.execute(query):
            if value is None and column == "batch_id":
                continue
            if not (isinstance(value, str) and is_id(kind, value)):
                yield f"{DATABASE} has {_shown(value)} as the id of a {kind} in {table}"
    for (value,) in database.execute("SELECT attempt FROM fits"):
        if not (isinstance(value, int) and value >= 0):
            yield f"{DATABASE} has {_shown(value)} as the number of an attempt"


def _shown(value: object) -> str:
    return repr(value)[:100]
