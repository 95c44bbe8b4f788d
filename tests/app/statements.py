"""What a database is asked."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from sqlalchemy import event

from app.database import Database


@contextmanager
def statements(database: Database, *, written: bool) -> Iterator[list[str]]:
    """The SQL that is executed within a block, one entry for many rows of one statement.

    Args:
        database: The database.
        written: Whether that of sessions that write, or else of those that read.
    """
    engine = database._writer if written else database._readers
    seen: list[str] = []

    def note(_connection: Any, _cursor: Any, statement: str, *_: Any) -> None:
        seen.append(statement)

    event.listen(engine, "before_cursor_execute", note)
    try:
        yield seen
    finally:
        event.remove(engine, "before_cursor_execute", note)
