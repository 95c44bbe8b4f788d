"""Restore of a data directory from a backup: complete and verified, or not at all.

All files are extracted into a temporary directory and verified there: each file against its hash,
the database by SQLite's integrity check and by its schema and ids, and each run against the hash of
its upload.  The temporary directory is then renamed to the data directory.  An existing, empty data
directory may be a mount point, which cannot be replaced; in this case the temporary directory lies
inside it, and its content is moved up.

A backup may be forged, including its checksums.  Ids become paths, some of which retention deletes,
so every id is validated.  Triggers and views are rejected, because they could change the effect of
later statements.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import sqlite3
from collections.abc import Iterator, Mapping
from pathlib import Path

from app.backup.archive import DATABASE, SUMS, is_name, opened, stored
from app.backup.create import database_file, summary_of
from app.fits.outputs import expected_outputs
from app.identifiers import Kind, is_id
from app.settings import Settings
from app.storage import RESTORING
from app.tables import Tables
from identification.errors import InputError, OptionError
from identification.result.atomic import sync

__all__ = ["restore"]

_LONGEST_SUMS = 1 << 30
_OF_THE_VOLUME = ("lost+found",)  # at the root of an ext4 file system
_SUM = re.compile(r"([0-9a-f]{64})  (\S+)")
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


def restore(settings: Settings, backup: Path) -> str:
    """Create the data directory, which must be missing or empty, from a backup.

    Return a summary of its content.

    Raises:
        OptionError: The data directory is not empty or cannot be written.
        InputError: The backup is incomplete or was changed.
    """
    # Resolve symbolic links: restore to the directory that they point to.
    place = Path(os.path.realpath(database_file(settings).parent))
    is_there = place.exists()
    if is_there:
        _check_empty(place)
    partial = place / RESTORING if is_there else place.with_name(f"{place.name}.partial")
    try:
        partial.mkdir(parents=True, mode=0o700)
    except OSError as error:
        raise OptionError(
            f"{partial}: cannot be created ({error.strerror}); remove the rest of an interrupted "
            "restore, or choose another --data-dir"
        ) from error
    try:
        saved = _fill(partial, backup)
        if is_there:
            _move_up(partial, place)
        else:
            os.rename(partial, place)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise
    sync(place if is_there else place.parent)
    return saved


def _check_empty(place: Path, besides: Path | None = None) -> None:
    if not place.is_dir() or any(
        entry != besides and entry.name not in _OF_THE_VOLUME for entry in place.iterdir()
    ):
        state = "is not empty"
        if besides is None and (place / RESTORING).exists():
            state = f"holds what an interrupted restore left ({RESTORING} and other entries)"
        raise OptionError(
            f"data_dir: {place} {state}, and a restore overwrites nothing; choose another "
            "directory with --data-dir, or move its content away"
        )


def _move_up(partial: Path, place: Path) -> None:
    """Move the restored entries into the data directory, all or none."""
    _check_empty(place, besides=partial)
    moved = []
    try:
        for entry in list(partial.iterdir()):
            os.rename(entry, place / entry.name)
            moved.append(entry)
        sync(place)
        partial.rmdir()
    except BaseException:
        # Move back into the temporary directory, which is removed as a whole.
        for entry in moved:
            os.rename(place / entry.name, entry)
        raise


def _fill(directory: Path, backup: Path) -> str:
    found: dict[str, str] = {}
    sums: dict[str, str] | None = None
    with opened(backup) as files:
        for name, file in files:
            if not is_name(name) or name in found:
                raise InputError(f"{name[:200]!r} does not belong in a backup", file=str(backup))
            if name == SUMS:
                sums = _read_sums(file.read(_LONGEST_SUMS), backup)
                continue
            found[name] = stored(directory / name, file)
    if sums is None:
        raise InputError(
            f"has no {SUMS}, so it is incomplete; use another backup", file=str(backup)
        )
    _compare(found, sums, backup)
    _check_database(directory / DATABASE, found, backup)
    for part in ("incoming", "runs", "fits", "nodes"):
        (directory / part).mkdir(exist_ok=True, mode=0o700)
        sync(directory / part)
    sync(directory)
    return summary_of(found)


def _read_sums(content: bytes, backup: Path) -> dict[str, str]:
    lines = content.decode("ascii", "replace").splitlines()
    pairs = [_SUM.fullmatch(line) for line in lines]
    if None in pairs:
        raise InputError(
            f"has a malformed line in {SUMS}", file=str(backup), row=pairs.index(None) + 1
        )
    return {pair.group(2): pair.group(1) for pair in pairs if pair}


def _compare(found: dict[str, str], sums: dict[str, str], backup: Path) -> None:
    missing, strange = sorted(sums.keys() - found.keys()), sorted(found.keys() - sums.keys())
    if missing or strange or DATABASE not in found:
        name = (missing or strange or [DATABASE])[0]
        state = "lacks" if name not in found else f"contains, in addition to the files in {SUMS},"
        raise InputError(f"{state} {name}; use another backup", file=str(backup))
    changed = sorted(name for name, digest in found.items() if sums[name] != digest)
    if changed:
        raise InputError(
            f"{changed[0]} was changed: its SHA-256 differs; use another backup", file=str(backup)
        )


def _check_database(file: Path, found: Mapping[str, str], backup: Path) -> None:
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
