"""Files to upload, and atomic writing of fetched files."""

from __future__ import annotations

import io
import os
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

__all__ = ["Source", "opened", "replacing"]

Source = str | os.PathLike[str] | bytes
"""Run as the path of a file or as its content."""


def opened(source: Source, name: str | None) -> tuple[str, Callable[[], IO[bytes]]]:
    """Name of a run, and a function that opens it at its start.

    Args:
        source: Path or content.
        name: Name of the run; default: the name of the file.
    """
    if isinstance(source, bytes):
        content = source
        return name or "run.csv", lambda: io.BytesIO(content)
    path = Path(source)
    return name or path.name, lambda: path.open("rb")


@contextmanager
def replacing(path: Path) -> Iterator[IO[bytes]]:
    """Temporary file that atomically replaces `path` at the end of a block without error."""
    path.parent.mkdir(parents=True, exist_ok=True)
    neighbour = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    try:
        with neighbour.open("xb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        neighbour.replace(path)
    finally:
        neighbour.unlink(missing_ok=True)
