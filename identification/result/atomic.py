"""Atomic file writing: a file appears complete or not at all.

The content is written to a temporary file in the same directory, synced to disk and renamed in one
step.  Neither a process that polls the directory nor a power failure ever leaves half a file.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

__all__ = ["replacing", "sync", "write_text"]


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield an empty file in the directory of `path`, renamed to `path` if the block succeeds.

    On an exception it is removed, and the previous content of `path` stays.
    """
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
    os.close(handle)
    neighbour = Path(name)
    try:
        yield neighbour
        # mkstemp creates files that only the owner can read; a result has ordinary permissions.
        neighbour.chmod(0o666 & ~_umask())
        sync(neighbour)
        neighbour.replace(path)
        sync(path.parent)
    finally:
        with suppress(FileNotFoundError):
            neighbour.unlink()


def write_text(path: Path, text: str) -> None:
    """Write `text` to `path` atomically, as UTF-8 with plain line feeds."""
    with replacing(path) as neighbour:
        neighbour.write_text(text, encoding="utf-8", newline="\n")


def sync(path: Path) -> None:
    """Force a file, or the entries of a directory, to disk (fsync)."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _umask() -> int:
    """The umask of the process; reading it requires setting it and restoring it."""
    mask = os.umask(0o077)
    os.umask(mask)
    return mask
