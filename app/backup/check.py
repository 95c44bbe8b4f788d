"""Whether a database that came from a backup may be used: its schema, its ids, its files.

A backup can be made by anyone, sums and all.  Ids become paths, of which retention removes some, so
none is believed; and a trigger or a view would make other things of later statements than they say.
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
    """See that a database is whole and names nothing but the files that came with it.

    Args:
        file: The database; the other files of the backup lie beside it.
        found: SHA-256 of each file of the backup by its name.
        backup: Where it came from, for messages.

    Raises:
        InputError: It is damaged, not one of motorid's, or does not fit the files.
    """
    try:
        with contextlib.closing(sqlite3.connect(file)) as database:
            # No function of SQLite that a schema names is called unless it is harmless.
            database.execute("PRAGMA trusted_schema=OFF")
            wrong = next(_faults(database, file.parent, found), None)
    except sqlite3.DatabaseError as error:
        raise InputError(f"{DATABASE} cannot be read ({error})", file=str(backup)) from error
    if wrong is not None:
        raise InputError(wrong, file=str(backup))


def _faults(
    database: sqlite3.Connection, directory: Path, found: Mapping[str, str]
) -> Iterator[str]:
    """What is wrong, the most basic first."""
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
        yield f"{wrong[0]} is not what the database says; take another backup"


def _strange_schema(database: sqlite3.Connection) -> Iterator[str]:
    tables = {"alembic_version", *Tables.metadata.tables}
    indexes = {str(i.name) for table in Tables.metadata.tables.values() for i in table.indexes}
    missing = set(tables)
    for kind, name in database.execute("SELECT type, name FROM sqlite_master"):
        # SQLite makes indexes for keys; an older version of motorid may have had fewer of its own.
        is_index = kind == "index" and (name in indexes or name.startswith("sqlite_autoindex_"))
        if not is_index and (kind != "table" or name not in missing):
            yield f"{DATABASE} has a {kind} {name[:100]!r} that motorid does not make"
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
                yield f"{DATABASE} has {_shown(value)} for the id of a {kind} in {table}"
    for (value,) in database.execute("SELECT attempt FROM fits"):
        if not (isinstance(value, int) and value >= 0):
            yield f"{DATABASE} has {_shown(value)} for the number of an attempt"


def _shown(value: object) -> str:
    return repr(value)[:100]
