"""What a database is asked."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from sqlalchemy import Engine, event

from app.database import Database


@contextmanager
def statements(database: Database, *, written: bool | None = None) -> Iterator[list[str]]:
    """The SQL that is executed within a block, one entry for many rows of one statement.

    Args:
        database: The database.
        written: Whether that of sessions that write, or that of those that read; None for
            whatever any database is sent.
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
