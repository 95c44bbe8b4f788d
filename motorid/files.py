"""What is sent from files and what is written into them."""

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
"""A run: the path of a file, or its content."""


def opened(source: Source, name: str | None) -> tuple[str, Callable[[], IO[bytes]]]:
    """The name of a run and what opens it, from its beginning each time.

    Args:
        source: Path or content.
        name: What to call it; the name of the file where not given.
    """
    if isinstance(source, bytes):
        content = source
        return name or "run.csv", lambda: io.BytesIO(content)
    path = Path(source)
    return name or path.name, lambda: path.open("rb")


@contextmanager
def replacing(path: Path) -> Iterator[IO[bytes]]:
    """A file to write to, which takes the name of `path` in one step when all went well."""
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
