"""The lock of a machine on a data directory, and the name that it has there."""

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
    """A lock file, held by one process at a time.

    Args:
        file: The file, in a directory of the data directory; it holds nothing but its name.
    """

    def __init__(self, file: Path) -> None:
        self._file = file
        self._held: BinaryIO | None = None

    @property
    def is_held(self) -> bool:
        """Whether this process has it."""
        return self._held is not None

    def take(self) -> None:
        """Take it for this process, until it ends.

        Raises:
            OptionError: Another process on this machine has it, or it is no file.
        """
        if self._held is not None:
            return
        try:
            handle = os.open(
                self._file, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_NONBLOCK, 0o666
            )
        except OSError as error:
            raise OptionError(
                f"data_dir: {self._file} cannot be opened ({error.strerror}); remove what stands "
                "there, it holds no data"
            ) from error
        file = os.fdopen(handle, "ab")
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            file.close()
            raise OptionError(
                f"data_dir: {self._file} is no regular file; remove it, it holds no data"
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
        """The name that the file holds; a new one where it holds none.

        Whoever holds the lock may take it that all who were called so before are gone.  The name of
        the machine alone would not do: two servers of a machine, each with a directory of its own,
        may share a database, and machines may share a name.
        """
        with self._file.open("a+", encoding="ascii", errors="replace") as file:
            file.seek(0)
            known = file.read(100).strip()
            if not _NAME.fullmatch(known):
                # A new file or a damaged one; what was held under the old name waits for its lease.
                known = secrets.token_hex(8)
                file.truncate(0)
                file.write(known)
                file.flush()
                os.fsync(file.fileno())
        return known

    def release(self) -> None:
        """Give it back."""
        if self._held is not None:
            self._held.close()
            self._held = None
