"""Data directory layout and file operations; no client-supplied name becomes a path.

    DATA/motorid.sqlite3              database, unless another one is configured
    DATA/incoming/NODE/XXXX           uploads in progress; removed at each start
    DATA/incoming/.backup-XXXX/       database copy of a backup in progress
    DATA/runs/RUN_ID                  bytes of an accepted run
    DATA/fits/FIT_ID/ATTEMPT/         result.json, report.html, posterior.nc, log of an attempt
    DATA/fits/FIT_ID/checkpoints/     checkpoints of the attempts, until the fit ends
    DATA/nodes/NODE.lock              held by the server of this machine; contains a random id

The database is authoritative.  A file without a row is left over from an operation interrupted
between file and row; `sweep` removes it once it is too old to belong to a running request.
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
from typing import Literal

from app.disk import NodeLock, is_full, open_regular, remove_entry, sha256_of
from app.errors import StorageFull
from app.identifiers import Kind, is_id
from identification.errors import OptionError
from identification.result.atomic import sync

__all__ = ["CHECKPOINTS", "RESTORING", "Storage", "refused_when_full"]

CHECKPOINTS = "checkpoints"
"""Directory next to the attempt directories, with one checkpoint file per attempt number."""

RESTORING = ".restoring"
"""Subdirectory of the data directory that exists while a restore is incomplete."""

_OLD_S = 3600.0
_SCRATCH = ".backup-"  # node names never begin with a dot
_HELD = "held"
_TRIED_BYTES = 1 << 16


class Storage:
    """Paths of one data directory, created if missing, and the lock that its server holds.

    `ValueError` is raised for a text that is not an ID and could point to any path.
    """

    def __init__(self, directory: Path, node: str) -> None:
        self.directory = directory.absolute()
        self.node = re.sub(r"[^A-Za-z0-9.-]", "_", node).lstrip(".") or "node"
        self.lock = NodeLock(self.directory / "nodes" / f"{self.node}.lock")

    @property
    def incoming(self) -> Path:
        """Directory of the uploads in progress on this machine."""
        return self.directory / "incoming" / self.node

    def prepare(self) -> None:
        """Create the directories, accessible to the owner only.

        Raises:
            OptionError: The directory cannot be created or written, or is being restored.
        """
        if os.path.exists(self.directory / RESTORING):
            raise OptionError(
                f"data_dir: a restore into {self.directory} has not come to its end; wait for it, "
                "or, if it was interrupted, remove the content of the directory and restore again"
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
    def place(self) -> str:
        """Identifier of this machine and data directory, the same at each start."""
        return f"{self.node}-{self.lock.name}"

    def is_writable(self) -> bool:
        """Return True if 64 KiB can be written, as the journal of a transaction requires."""
        try:
            with tempfile.TemporaryFile(dir=self.incoming, buffering=0) as file:
                return file.write(bytes(_TRIED_BYTES)) == _TRIED_BYTES
        except OSError:
            return False

    def stored(self) -> int:
        """Number of runs and fits that have files."""
        return len(self._stored("run")) + len(self._stored("fit"))

    def new_incoming(self) -> Path:
        """New unused path for an upload."""
        return self.incoming / secrets.token_hex(16)

    def run(self, run_id: str) -> Path:
        """Path of the bytes of a run."""
        return self.directory / "runs" / _checked("run", run_id)

    def keep_run(self, incoming: Path, run_id: str) -> None:
        """Move an accepted upload to its final path, durably."""
        if self.run(run_id).is_dir():
            # A file system repair may leave a directory here, which os.replace cannot overwrite.
            remove_entry(self.run(run_id))
        os.replace(incoming, self.run(run_id))
        sync(self.directory / "runs")

    def has_run(self, run_id: str, size: int, sha256: str) -> bool:
        """Return True if the stored bytes of a run are those that were uploaded."""
        try:
            with open_regular(self.run(run_id)) as file:
                return os.fstat(file.fileno()).st_size == size and sha256_of(file) == sha256
        except OSError:
            return False

    def remove_run(self, run_id: str) -> None:
        """Remove the bytes of a run."""
        remove_entry(self.run(run_id))

    def fit(self, fit_id: str) -> Path:
        """Directory of all attempts of a fit."""
        return self.directory / "fits" / _checked("fit", fit_id)

    def attempt(self, fit_id: str, attempt: int) -> Path:
        """Directory of one attempt of a fit."""
        if not str(attempt).isdecimal():
            raise ValueError(f"{attempt!r} is no number of an attempt")
        return self.fit(fit_id) / str(attempt)

    def remove_fit(self, fit_id: str) -> None:
        """Remove all files of a fit."""
        remove_entry(self.fit(fit_id))

    def remove_attempt(self, fit_id: str, attempt: int) -> None:
        """Remove the files of one attempt."""
        remove_entry(self.attempt(fit_id, attempt))

    def remove_checkpoints(self, fit_id: str) -> None:
        """Remove the checkpoints of a fit."""
        remove_entry(self.fit(fit_id) / CHECKPOINTS)
        with suppress(OSError):
            # A cancelled fit leaves an empty directory.
            self.fit(fit_id).rmdir()

    def keep_attempt(self, fit_id: str, attempt: int) -> None:
        """Remove the files of all other attempts of a fit."""
        for entry in _entries(self.fit(fit_id)):
            if entry.name != str(attempt):
                remove_entry(entry)

    def sweep_incoming(self) -> None:
        """Remove the uploads of an earlier server on this machine; call before serving."""
        for entry in _entries(self.incoming):
            remove_entry(entry)

    @contextmanager
    def scratch(self) -> Iterator[Path]:
        """Temporary directory for a database copy, in the data directory, which likely has space.

        The directory is locked for the life of the process, so that a sweep can recognise abandoned
        ones.
        """
        incoming = self.directory / "incoming"
        with (
            tempfile.TemporaryDirectory(prefix=_SCRATCH, dir=incoming) as folder,
            (Path(folder) / _HELD).open("ab") as lock,
        ):
            fcntl.flock(lock, fcntl.LOCK_EX)
            yield Path(folder)

    def free_bytes(self) -> int:
        """Free space [bytes]."""
        return shutil.disk_usage(self.directory).free

    def sweep(self, runs: Collection[str], fits: Collection[str], now: float) -> int:
        """Remove old files and directories that no database row refers to; return their number."""
        left = list(self._abandoned())
        # An empty database next to stored files indicates a wrong database URL.
        if runs or fits:
            left += [entry for entry in self._stored("run") if entry.name not in runs]
            left += [entry for entry in self._stored("fit") if entry.name not in fits]
        old = [entry for entry in left if _is_old(entry, now)]
        for entry in old:
            remove_entry(entry)
        return len(old)

    def _stored(self, kind: Literal["run", "fit"]) -> list[Path]:
        """Files of all runs, or directories of all fits."""
        return [e for e in _entries(self.directory / f"{kind}s") if is_id(kind, e.name)]

    def _abandoned(self) -> Iterator[Path]:
        """Scratch directories of ended processes, and uploads of ended servers.

        Each new container has another node name.
        """
        for folder in _entries(self.directory / "incoming"):
            if folder.name.startswith(_SCRATCH):
                if not _is_held(folder / _HELD):
                    yield folder
            elif folder != self.incoming:
                if not _is_held(self.directory / "nodes" / f"{folder.name}.lock"):
                    yield from _entries(folder)


@contextmanager
def refused_when_full(what: str) -> Iterator[None]:
    """Convert operating system errors for a full disk, on storing `what`, into `StorageFull`."""
    try:
        yield
    except OSError as error:
        if not is_full(error):
            raise
        raise StorageFull(
            f"no space is left for the {what}; ask the operator to free some, then send it again"
        ) from error


def _checked(kind: Kind, text: str) -> str:
    # Request ids are validated on entry; this covers ids from elsewhere, such as a backup.
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
    # Another server on this directory may have moved a file and not yet written its row.
    try:
        return now - path.stat().st_mtime > _OLD_S
    except FileNotFoundError:
        return False
