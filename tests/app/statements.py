"""Recording of SQL statements."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from sqlalchemy import Engine, event

from app.database import Database


@contextmanager
def statements(database: Database, *, written: bool | None = None) -> Iterator[list[str]]:
    """SQL statements sent while the block runs; a statement for many rows counts once.

    Args:
        database: The database.
        written: True for the statements of write sessions, False for those of read sessions, None
            for those of all databases.
    """
    engines = {True: database._writer, False: database._readers, None: Engine}
    engine = engines[written]
    seen: list[str] = []

    def note(_connection: Any, _cursor: Any, statement: str, *_: Any) -> None:
        seen.append(statement)

    event.listen(engine, "before_cursor_execute", note)
    try:
        yield seen
    finally:
        event.remove(engine, "before_cursor_execute", note)
