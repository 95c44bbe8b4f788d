"""Columns of a run file, listed without assigning them to channels."""

from __future__ import annotations

import os
from pathlib import Path

from identification.ingest.columns import Column
from identification.ingest.display import plain
from identification.ingest.file import Limits, naming, open_run_file, unpacked
from identification.ingest.read import READERS
from identification.ingest.tables import closest_table

__all__ = ["list_columns"]


def list_columns(
    path: str | os.PathLike[str], *, name: str | None = None, limits: Limits | None = None
) -> tuple[Column, ...]:
    """Columns of a run file from left to right, among which a user selects the channels.

    Raises:
        RunFileError: The file contains no table.
    """
    shown = plain(name if name is not None else os.path.basename(os.fspath(path)), 200)
    with naming(shown), open_run_file(Path(path), shown, limits or Limits()) as file:
        content = unpacked(file)
        reader = next(r for r in READERS if r.recognises(content.name, content.head))
        return tuple(closest_table(reader.open(content)).columns)
