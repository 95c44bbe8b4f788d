"""The data directory: what lies where, and nothing in it named by a caller.

    DATA/motorid.sqlite3              the database, unless another is named
    DATA/incoming/NODE/XXXX           uploads that are coming in; swept at each start
    DATA/incoming/.backup-XXXX/       the copy of the database of a backup that is being made
    DATA/runs/RUN_ID                  the bytes of a run that was accepted
    DATA/fits/FIT_ID/ATTEMPT/         result.json, report.html, posterior.nc, log of an attempt
    DATA/fits/FIT_ID/checkpoints/     what attempts had so far, until the fit has ended
    DATA/nodes/NODE.lock              held by the server of this machine; holds an id of its own

The database says what there is.  A file without a row is the rest of something that was interrupted
between the two; `sweep` removes it once it is too old to belong to a request that still runs.
"""

from __future__ import annotations

import fcntl
import os
import re
import secrets
import shutil
import tempfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from app.errors import StorageFull
from app.fits.job import CHECKPOINTS
from app.identifiers import Kind, is_id
from app.locking import NodeLock
from app.regular import open_regular, remove_entry, sha256_of
from app.space import is_full
from identification.errors import OptionError

__all__ = ["RESTORING", "Storage", "refused_when_full", "sync_directory"]

RESTORING = ".restoring"
"""Name of the directory in a data directory in which a restore has not come to its end."""

_OLD_S = 3600.0
_SCRATCH = ".backup-"  # no machine's name begins with a dot
_HELD = "held"
_TRIED_BYTES = 1 << 16


class Storage:
    """Paths of one data directory, and the lock on it.

    Args:
        directory: The data directory; it is made if it is not there.
        node: Name of this machine.
    """

    def __init__(self, directory: Path, node: str) -> None:
        self.directory = directory.absolute()
        self.node = re.sub(r"[^A-Za-z0-9.-]", "_", node).lstrip(".") or "node"
        self._lock = NodeLock(self.directory / "nodes" / f"{self.node}.lock")

    @property
    def incoming(self) -> Path:
        """Directory of the uploads that are coming in on this machine."""
        return self.directory / "incoming" / self.node

    def prepare(self) -> None:
        """Make the directories, readable by the owner alone.

        Raises:
            OptionError: The directory cannot be made or written, or is being restored.
        """
        if os.path.exists(self.directory / RESTORING):
            raise OptionError(
                f"data_dir: a restore into {self.directory} has not come to its end; wait for it, "
                "or, where it was interrupted, remove all that is in there and restore again"
            )
        try:
            self.directory.mkdir(parents=True, exist_ok=True, mode=0o700)
            names = ("incoming", "runs", "fits", "nodes")
            for part in (*(self.directory / name for name in names), self.incoming):
                part.mkdir(exist_ok=True, mode=0o700)
        except OSError as error:
            raise OptionError(
                f"data_dir: {error.filename or self.directory} cannot be used ({error.strerror}); "
                "name a directory that can be written"
            ) from error

    @property
    def is_locked(self) -> bool:
        """Whether this process has the data directory."""
        return self._lock.is_held

    def lock(self) -> None:
        """Take the data directory for this process, until it ends.

        Raises:
            OptionError: Another server on this machine has it, or the lock file is no file.
        """
        self._lock.take()

    @property
    def place(self) -> str:
        """Name of this machine's part of this data directory, the same at each start."""
        return f"{self.node}-{self._lock.name}"

    def unlock(self) -> None:
        """Give the data directory back."""
        self._lock.release()

    def is_writable(self) -> bool:
        """Whether a file of some kilobytes can be written, as the journal of a transaction is."""
        try:
            with tempfile.TemporaryFile(dir=self.incoming, buffering=0) as file:
                return file.write(bytes(_TRIED_BYTES)) == _TRIED_BYTES
        except OSError:
            return False

    def stored(self) -> int:
        """Number of runs and fits that have files."""
        runs, fits = (_entries(self.directory / name) for name in ("runs", "fits"))
        return sum(is_id("run", entry.name) for entry in runs) + sum(
            is_id("fit", entry.name) for entry in fits
        )

    def new_incoming(self) -> Path:
        """A path for an upload, where no file is yet."""
        return self.incoming / secrets.token_hex(16)

    def run(self, run_id: str) -> Path:
        """Where the bytes of a run lie.

        Raises:
            ValueError: It is no id of a run, and could lead anywhere.
        """
        return self.directory / "runs" / _checked("run", run_id)

    def keep_run(self, incoming: Path, run_id: str) -> None:
        """Move an upload that was accepted to its place, so that a loss of power keeps it."""
        if self.run(run_id).is_dir():
            # A file system that was repaired may have left one; a file does not replace it.
            remove_entry(self.run(run_id))
        os.replace(incoming, self.run(run_id))
        sync_directory(self.directory / "runs")

    def has_run(self, run_id: str, size: int, sha256: str) -> bool:
        """Whether the bytes of a run are there as they were uploaded.

        Args:
            run_id: Id of the run.
            size: Number of the bytes.
            sha256: Their hash, in hexadecimal.
        """
        try:
            with open_regular(self.run(run_id)) as file:
                return os.fstat(file.fileno()).st_size == size and sha256_of(file) == sha256
        except OSError:
            return False

    def remove_run(self, run_id: str) -> None:
        """Remove the bytes of a run."""
        remove_entry(self.run(run_id))

    def fit(self, fit_id: str) -> Path:
        """Directory of all attempts of a fit.

        Raises:
            ValueError: It is no id of a fit, and could lead anywhere.
        """
        return self.directory / "fits" / _checked("fit", fit_id)

    def attempt(self, fit_id: str, attempt: int) -> Path:
        """Directory of one attempt of a fit.

        Raises:
            ValueError: It is no id of a fit, or no number of an attempt.
        """
        if not str(attempt).isdecimal():
            raise ValueError(f"{attempt!r} is no number of an attempt")
        return self.fit(fit_id) / str(attempt)

    def remove_fit(self, fit_id: str) -> None:
        """Remove everything that was computed for a fit."""
        remove_entry(self.fit(fit_id))

    def remove_attempt(self, fit_id: str, attempt: int) -> None:
        """Remove what one attempt left."""
        remove_entry(self.attempt(fit_id, attempt))

    def remove_checkpoints(self, fit_id: str) -> None:
        """Remove what attempts at a fit had so far."""
        remove_entry(self.fit(fit_id) / CHECKPOINTS)
        with suppress(OSError):
            # Of a fit that was cancelled nothing else is left.
            self.fit(fit_id).rmdir()

    def keep_attempt(self, fit_id: str, attempt: int) -> None:
        """Remove what all other attempts of a fit left."""
        for entry in _entries(self.fit(fit_id)):
            if entry.name != str(attempt):
                remove_entry(entry)

    def sweep_incoming(self) -> None:
        """Remove the uploads of a server that is gone; at a start there are no others."""
        for entry in _entries(self.incoming):
            remove_entry(entry)

    @contextmanager
    def scratch(self) -> Iterator[Path]:
        """A directory for the copy of a database: beside the data is space for it if anywhere.

        It is locked as long as its process lives, so that a sweep knows what was left.
        """
        incoming = self.directory / "incoming"
        with (
            tempfile.TemporaryDirectory(prefix=_SCRATCH, dir=incoming) as folder,
            (Path(folder) / _HELD).open("ab") as lock,
        ):
            fcntl.flock(lock, fcntl.LOCK_EX)
            yield Path(folder)

    def free_bytes(self) -> int:
        """Space that is left [bytes]."""
        return shutil.disk_usage(self.directory).free

    def sweep(self, runs: Collection[str], fits: Collection[str], now: float) -> int:
        """Remove what no row of the database names.

        Args:
            runs: Ids of the runs that there are.
            fits: Ids of the fits that there are.
            now: The time [s since 1970].

        Returns:
            Number of files and directories that were removed.
        """
        removed = self._sweep_scratch(now) + self._sweep_uploads(now)
        if not runs and not fits:
            # An empty database beside files is more likely a wrong address than a reason.
            return removed
        for entry in _entries(self.directory / "runs"):
            if is_id("run", entry.name) and entry.name not in runs and _is_old(entry, now):
                remove_entry(entry)
                removed += 1
        for entry in _entries(self.directory / "fits"):
            if is_id("fit", entry.name) and entry.name not in fits and _is_old(entry, now):
                remove_entry(entry)
                removed += 1
        return removed

    def _sweep_scratch(self, now: float) -> int:
        left = [
            entry
            for entry in _entries(self.directory / "incoming")
            if entry.name.startswith(_SCRATCH)
            and _is_old(entry, now)
            and not _is_held(entry / _HELD)
        ]
        for entry in left:
            remove_entry(entry)
        return len(left)

    def _sweep_uploads(self, now: float) -> int:
        """Remove what was sent to servers that are gone: each new container has another name."""
        left = [
            entry
            for folder in _entries(self.directory / "incoming")
            if folder != self.incoming
            and not folder.name.startswith(_SCRATCH)
            and not _is_held(self.directory / "nodes" / f"{folder.name}.lock")
            for entry in _entries(folder)
            if _is_old(entry, now)
        ]
        for entry in left:
            entry.unlink(missing_ok=True)
        return len(left)


@contextmanager
def refused_when_full(what: str) -> Iterator[None]:
    """Turn the system's errors that no space is left into a refusal.

    Args:
        what: For what there was none.

    Raises:
        StorageFull: No space is left.
    """
    try:
        yield
    except OSError as error:
        if not is_full(error):
            raise
        raise StorageFull(
            f"no space is left for the {what}; have some made, then send it again"
        ) from error


def sync_directory(directory: Path) -> None:
    """Have the entries of a directory survive a loss of power."""
    handle = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _checked(kind: Kind, text: str) -> str:
    # Ids are checked where they come in; this is for one that came another way, as by a backup.
    if not is_id(kind, text):
        raise ValueError(f"{text!r} is no id of a {kind}")
    return text


def _entries(directory: Path) -> list[Path]:
    return list(directory.iterdir()) if directory.is_dir() else []


def _is_held(file: Path) -> bool:
    try:
        with file.open("rb+") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except OSError:
        return True
    return False


def _is_old(path: Path, now: float) -> bool:
    # Another server on the same directory may be between moving a file and writing its row.
    try:
        return now - path.stat().st_mtime > _OLD_S
    except FileNotFoundError:
        return False
