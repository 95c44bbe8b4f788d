"""Files that appear complete or not at all.

A reader who polls a directory, or a power cut in the middle, never meets half a file: the content
goes to a neighbour first, is forced to the disk, and takes its name in one step.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

__all__ = ["replacing", "write_text"]


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a neighbour of `path` to write to; it takes the name of `path` when all went well.

    On an exception the neighbour is removed and what stood at `path` before stays.

    Args:
        path: File to create or to replace; its directory must exist.

    Yields:
        An existing empty file in the same directory, hence on the same file system.
    """
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
    os.close(handle)
    neighbour = Path(name)
    try:
        yield neighbour
        # mkstemp makes files that only their owner can read; a result is an ordinary file.
        neighbour.chmod(0o666 & ~_umask())
        _force_to_disk(neighbour)
        neighbour.replace(path)
        _force_to_disk(path.parent)
    finally:
        with suppress(FileNotFoundError):
            neighbour.unlink()


def write_text(path: Path, text: str) -> None:
    """Write `text` as UTF-8 with plain line feeds to `path`, complete or not at all."""
    with replacing(path) as neighbour:
        neighbour.write_text(text, encoding="utf-8", newline="\n")


def _force_to_disk(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _umask() -> int:
    """The process's mask; there is no way to read it but to set it and set it back."""
    mask = os.umask(0o077)
    os.umask(mask)
    return mask
