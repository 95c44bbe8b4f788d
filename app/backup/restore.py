"""Restore of a data directory from a backup: complete and verified, or not at all.

All files are extracted into a temporary directory and verified there: each file against its hash,
the database by SQLite's integrity check and by its schema and ids, and each run against the hash of
its upload.  The temporary directory is then renamed to the data directory.  An existing, empty data
directory may be a mount point, which cannot be replaced; in this case the temporary directory lies
inside it, and its content is moved up.
"""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

from app.backup.archive import DATABASE, SUMS, copied, is_name, opened
from app.backup.check import check_database
from app.backup.create import database_file, summary_of
from app.settings import Settings
from app.storage import RESTORING
from identification.errors import InputError, OptionError
from identification.result.atomic import sync

__all__ = ["restore"]

_LONGEST_SUMS = 1 << 30
_OF_THE_VOLUME = ("lost+found",)  # at the root of an ext4 file system
_SUM = re.compile(r"([0-9a-f]{64})  (\S+)")


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
            "restore, or choose another --data-dir",
            value=str(partial),
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
            "directory with --data-dir, or move its content away",
            value=str(place),
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
            path = directory / name
            path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            with open(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as write:
                found[name] = copied(file, write)
                write.flush()
                os.fsync(write.fileno())
    if sums is None:
        raise InputError(
            f"has no {SUMS}, so it is incomplete; use another backup", file=str(backup)
        )
    _compare(found, sums, backup)
    check_database(directory / DATABASE, found, backup)
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
