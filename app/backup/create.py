"""Online backup of the data directory while the service runs.

SQLite's backup API first copies the database at one consistent state; then the files that its rows
refer to are copied.  These files are written once and never changed, so a later copy still matches
its row.  Rows whose files were deleted meanwhile are removed from the database copy.  Browser
sessions are left out; keys are included as hashes.

Waiting and running fits are included and start again after a restore.
"""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path

from app.backup.archive import DATABASE, AbstractTarget, target
from app.damage import DamagedDatabase, check_present, is_damaged
from app.disk import open_regular
from app.fits.job import OUTPUT_SUMS, OUTPUTS
from app.fits.outputs import expected_outputs, sums_of
from app.settings import Settings
from app.storage import Storage
from identification.errors import InputError, OptionError

__all__ = ["back_up", "database_file", "summary_of"]

_BUSY_S = 60.0


def summary_of(names: Collection[str]) -> str:
    """Number of runs, of fits that have outputs, and of all files of a backup, in words."""
    runs = sum(name.startswith("runs/") for name in names)
    fits = len({name.split("/")[1] for name in names if name.startswith("fits/")})
    return f"{runs} runs and {fits} results in {len(names)} files"


def database_file(settings: Settings) -> Path:
    """SQLite file of a data directory.

    Raises:
        OptionError: Another database is configured, which needs its own backup tool.
    """
    if settings.database_url is not None:
        raise OptionError(
            "MOTORID_DATABASE_URL names a database outside of the data directory; back it up "
            "with its own tool (pg_dump), and after that the folders runs and fits of the data "
            "directory; docs/operations.md has the commands"
        )
    return settings.data_dir.absolute() / DATABASE


def back_up(settings: Settings, place: Path) -> str:
    """Write a backup to a directory that is missing or empty, or to a new file that ends with .tar.

    Return a summary of its content.

    Raises:
        OptionError: There is no database, or the target already exists.
        InputError: A file of the data directory is missing or was changed.
        DamagedDatabase: The database is damaged, or missing while stored files exist.
    """
    source = database_file(settings)
    storage = Storage(settings.data_dir, settings.node)
    check_present(source, storage.stored())
    if not source.is_file():
        raise OptionError(
            f"data_dir: there is no {DATABASE} in {settings.data_dir}; choose the directory that "
            "the service uses"
        )
    into = target(place)
    try:
        sums = _fill(into, source, storage)
    except BaseException:
        # Clean up, so that the same command can be repeated after the cause is fixed.
        into.discard()
        raise
    return summary_of(sums)


def _fill(into: AbstractTarget, source: Path, storage: Storage) -> dict[str, str]:
    with (
        storage.scratch() as folder,
        contextlib.closing(_copy_of(source, folder / DATABASE)) as copy,
    ):
        sums = _Files(source, copy, storage, into).add_all()
        copy.close()
        with (folder / DATABASE).open("rb") as database:
            sums[DATABASE] = into.add(DATABASE, database)
        into.finish("".join(f"{digest}  {name}\n" for name, digest in sorted(sums.items())))
    return sums


def _copy_of(source: Path, file: Path) -> sqlite3.Connection:
    """Consistent copy of a database while others write to it, without sessions and pending runs."""
    copy = sqlite3.connect(file)
    try:
        with contextlib.closing(sqlite3.connect(source, timeout=_BUSY_S)) as live:
            # The copy includes damaged pages, so check it now rather than at a restore.
            live.backup(copy)
        verdict = str(copy.execute("PRAGMA quick_check(1)").fetchone()[0])
    except sqlite3.DatabaseError as error:
        if not is_damaged(error):
            raise
        verdict = str(error)
    if verdict != "ok":
        copy.close()
        raise DamagedDatabase(source, f"is damaged ({' '.join(verdict.split())[:200]})")
    copy.execute("PRAGMA foreign_keys=ON")
    # Single file, independent of the journal mode of the service.
    copy.execute("PRAGMA journal_mode=DELETE")
    copy.execute("DELETE FROM sessions")
    # Uploads that no one has confirmed; their files are not saved.  An older database has none.
    if copy.execute("SELECT 1 FROM sqlite_master WHERE name = 'pending_runs'").fetchone():
        copy.execute("DELETE FROM pending_runs")
    copy.commit()
    return copy


@dataclass
class _Files:
    """Transfer of the files that a database copy refers to into a backup."""

    source: Path
    copy: sqlite3.Connection
    storage: Storage
    into: AbstractTarget
    sums: dict[str, str] = field(default_factory=dict)

    def add_all(self) -> dict[str, str]:
        for run_id, sha256 in self.copy.execute("SELECT id, sha256 FROM runs").fetchall():
            self._add_run(run_id, sha256)
        query = "SELECT id, attempt FROM fits WHERE status = 'succeeded'"
        for fit_id, attempt in self.copy.execute(query).fetchall():
            self._add_fit(fit_id, attempt)
        self.copy.commit()
        return self.sums

    def _add_run(self, run_id: str, sha256: str) -> None:
        path = self.storage.run(run_id)
        digest = self._add(f"runs/{run_id}", path)
        if digest is None:
            self._strike("runs", run_id, path)
            return
        if digest != sha256:
            raise InputError(
                "differs from the upload: its SHA-256 has changed; restore it by uploading the "
                f"same file again, or delete the run {run_id}",
                file=str(path),
            )
        self.sums[f"runs/{run_id}"] = digest

    def _add_fit(self, fit_id: str, attempt: int) -> None:
        directory = self.storage.attempt(fit_id, attempt)
        expected, written = expected_outputs(directory), sums_of(directory)
        for output in (*OUTPUTS, OUTPUT_SUMS):
            name, path = f"fits/{fit_id}/{attempt}/{output}", directory / output
            digest = self._add(name, path)
            if digest is not None:
                # If the fit was deleted meanwhile, its copied files have no row; a sweep after the
                # restore removes them.
                self.sums[name] = digest
            elif output in expected:
                self._strike("fits", fit_id, path)
            if digest is not None and written.get(output, digest) != digest:
                raise InputError(
                    "was changed: its SHA-256 differs; restore it from an older "
                    f"backup, or delete {fit_id} over HTTP and fit again",
                    file=str(path),
                )

    def _add(self, name: str, path: Path) -> str | None:
        """Copy a file, unless it is missing; return its SHA-256 or raise `InputError`."""
        try:
            source = open_regular(path)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            raise InputError(
                f"cannot be read ({error.strerror}); a run is restored by uploading the same file "
                "again, a fit is deleted over HTTP",
                file=str(path),
            ) from error
        with source:
            return self.into.add(name, source)

    def _strike(self, table: str, row_id: str, path: Path) -> None:
        """Delete a row from the copy, or raise `InputError` if the live database still has it."""
        query = f"SELECT 1 FROM {table} WHERE id = ?"  # noqa: S608  one of two names
        with contextlib.closing(sqlite3.connect(self.source, timeout=_BUSY_S)) as live:
            is_known = live.execute(query, (row_id,)).fetchone() is not None
        if is_known:
            raise InputError(
                f"is gone, and the database still has {row_id}; restore it from a backup, "
                "or delete it over HTTP (uploading the same file again restores a run)",
                file=str(path),
            )
        self.copy.execute(f"DELETE FROM {table} WHERE id = ?", (row_id,))  # noqa: S608
