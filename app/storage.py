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
import functools
import os
import re
import secrets
import shutil
import tempfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from app.errors import StorageFull
from app.fits.job import CHECKPOINTS
from app.identifiers import Kind, is_id
from app.space import is_full
from identification.errors import OptionError

__all__ = ["RESTORING", "Storage", "refused_when_full", "sync_directory"]

RESTORING = ".restoring"
"""Name of the directory in a data directory in which a restore has not come to its end."""

_OLD_S = 3600.0
_SCRATCH = ".backup-"  # no machine's name begins with a dot
_HELD = "held"


class Storage:
    """Paths of one data directory, and the lock on it.

    Args:
        directory: The data directory; it is made if it is not there.
        node: Name of this machine.
    """

    def __init__(self, directory: Path, node: str) -> None:
        self.directory = directory.absolute()
        self.node = re.sub(r"[^A-Za-z0-9.-]", "_", node).lstrip(".") or "node"
        self._lock: BinaryIO | None = None

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
                f"data_dir: {self.directory} cannot be used ({error.strerror}); "
                "name a directory that can be written"
            ) from error

    def lock(self) -> None:
        """Take the data directory for this process, until it ends.

        Raises:
            OptionError: Another server on this machine has it.
        """
        if self._lock is not None:
            return
        file = self._lock_file.open("ab")
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            file.close()
            raise OptionError(
                f"data_dir: another server already uses {self.directory}; stop it or name another"
            ) from error
        self._lock = file

    @functools.cached_property
    def place(self) -> str:
        """Name of this machine's part of this data directory, the same at each start.

        Whoever holds the lock may take it that all who were called so before are gone.  The name of
        the machine alone would not do: two servers of a machine, each with a directory of its own,
        may share a database, and machines may share a name.
        """
        with self._lock_file.open("a+", encoding="ascii") as file:
            file.seek(0)
            known = file.read().strip()
            if not known:
                known = secrets.token_hex(8)
                file.write(known)
                file.flush()
                os.fsync(file.fileno())
        return f"{self.node}-{known}"

    @property
    def _lock_file(self) -> Path:
        return self.directory / "nodes" / f"{self.node}.lock"

    def unlock(self) -> None:
        """Give the data directory back."""
        if self._lock is not None:
            self._lock.close()
            self._lock = None

    def is_writable(self) -> bool:
        """Whether a file can be made."""
        return os.access(self.incoming, os.W_OK)

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
        os.replace(incoming, self.run(run_id))
        sync_directory(self.directory / "runs")

    def remove_run(self, run_id: str) -> None:
        """Remove the bytes of a run."""
        self.run(run_id).unlink(missing_ok=True)

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
        shutil.rmtree(self.fit(fit_id), ignore_errors=True)

    def remove_attempt(self, fit_id: str, attempt: int) -> None:
        """Remove what one attempt left."""
        shutil.rmtree(self.attempt(fit_id, attempt), ignore_errors=True)

    def remove_checkpoints(self, fit_id: str) -> None:
        """Remove what attempts at a fit had so far."""
        shutil.rmtree(self.fit(fit_id) / CHECKPOINTS, ignore_errors=True)
        with suppress(OSError):
            # Of a fit that was cancelled nothing else is left.
            self.fit(fit_id).rmdir()

    def keep_attempt(self, fit_id: str, attempt: int) -> None:
        """Remove what all other attempts of a fit left."""
        for entry in _entries(self.fit(fit_id)):
            if entry.name != str(attempt):
                shutil.rmtree(entry, ignore_errors=True)

    def sweep_incoming(self) -> None:
        """Remove the uploads of a server that is gone; at a start there are no others."""
        for entry in _entries(self.incoming):
            entry.unlink(missing_ok=True)

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
        removed = self._sweep_scratch(now)
        if not runs and not fits:
            # An empty database beside files is more likely a wrong address than a reason.
            return removed
        for entry in _entries(self.directory / "runs"):
            if is_id("run", entry.name) and entry.name not in runs and _is_old(entry, now):
                entry.unlink(missing_ok=True)
                removed += 1
        for entry in _entries(self.directory / "fits"):
            if is_id("fit", entry.name) and entry.name not in fits and _is_old(entry, now):
                shutil.rmtree(entry, ignore_errors=True)
                removed += 1
        return removed

    def _sweep_scratch(self, now: float) -> int:
        left = [
            entry
            for entry in _entries(self.directory / "incoming")
            if entry.name.startswith(_SCRATCH) and _is_old(entry, now) and not _is_held(entry)
        ]
        for entry in left:
            shutil.rmtree(entry, ignore_errors=True)
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


def _is_held(scratch: Path) -> bool:
    try:
        with (scratch / _HELD).open("rb+") as lock:
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
