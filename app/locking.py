"""Advisory lock of one machine on a data directory, with a random identifier."""

from __future__ import annotations

import fcntl
import functools
import os
import re
import secrets
import stat
from pathlib import Path
from typing import BinaryIO

from identification.errors import OptionError

__all__ = ["NodeLock"]

_NAME = re.compile(r"[0-9a-f]{16}")


class NodeLock:
    """Lock file, held by at most one process at a time (flock); it contains only the identifier."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._held: BinaryIO | None = None

    @property
    def is_held(self) -> bool:
        """True if this process holds the lock."""
        return self._held is not None

    def take(self) -> None:
        """Acquire the lock for the life of this process.

        Raises:
            OptionError: Another process on this machine holds the lock, or the path is not a
                regular file.
        """
        if self._held is not None:
            return
        try:
            handle = os.open(
                self._file, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_NONBLOCK, 0o666
            )
        except OSError as error:
            raise OptionError(
                f"data_dir: {self._file} cannot be opened ({error.strerror}); remove it, "
                "it holds no data"
            ) from error
        file = os.fdopen(handle, "ab")
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            file.close()
            raise OptionError(
                f"data_dir: {self._file} is not a regular file; remove it, it holds no data"
            )
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            file.close()
            raise OptionError(
                f"data_dir: another server already uses {self._file.parents[1]}; stop it or name "
                "another"
            ) from error
        self._held = file

    @functools.cached_property
    def name(self) -> str:
        """Identifier stored in the lock file, created if the file contains none.

        The holder of the lock may assume that every earlier process with this identifier has ended.
        The host name alone would not suffice: two servers on one machine, each with its own data
        directory, may share a database, and several machines may share a host name.
        """
        with self._file.open("a+", encoding="ascii", errors="replace") as file:
            file.seek(0)
            known = file.read(100).strip()
            if not _NAME.fullmatch(known):
                # New or damaged file: leases held under the old identifier simply expire.
                known = secrets.token_hex(8)
                file.truncate(0)
                file.write(known)
                file.flush()
                os.fsync(file.fileno())
        return known

    def release(self) -> None:
        """Release the lock."""
        if self._held is not None:
            self._held.close()
            self._held = None
