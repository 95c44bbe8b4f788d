"""The database: one writer at a time, any number of readers, the same on SQLite and PostgreSQL.

    database = Database("sqlite:////data/motorid.sqlite3")
    database.migrate()
    with database.writing() as session: ...      committed at the end, rolled back on an error
    with database.reading() as session: ...

SQLite before 3.51.3 can corrupt a database in WAL mode when two connections write and checkpoint at
once, so such versions keep a rollback journal.  A write begins with BEGIN IMMEDIATE: it waits for
its turn at the start, where waiting is harmless, and never fails in the middle.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import sqlalchemy
from sqlalchemy import event
from sqlalchemy.engine import Connection, Engine
from sqlalchemy.exc import OperationalError
from sqlalchemy.orm import Session

from app.migrations import NEWEST

__all__ = ["Database", "is_full"]

_BUSY_S = 30.0
_DISK_FULL = "53100"  # of PostgreSQL
_FIRST_SAFE_WAL = (3, 51, 3)


class Database:
    """Connections to one database.

    Args:
        url: Address in SQLAlchemy's form.
    """

    def __init__(self, url: str) -> None:
        self.url = sqlalchemy.make_url(url)
        if self.url.get_backend_name() == "sqlite":
            self._readers = _sqlite(self.url, begin="BEGIN", pool_size=8, max_overflow=32)
            self._writer = _sqlite(self.url, begin="BEGIN IMMEDIATE", pool_size=1, max_overflow=0)
        else:
            self._readers = self._writer = sqlalchemy.create_engine(
                self.url, pool_size=8, max_overflow=32, pool_pre_ping=True
            )

    def migrate(self) -> None:
        """Bring the tables to the newest version; a new database gets them all."""
        if self._version() == NEWEST:
            return
        # Imported where it is needed: it costs each start a second, and most find nothing to do.
        import alembic.command
        import alembic.config

        config = alembic.config.Config()
        config.set_main_option("script_location", str(Path(__file__).parent / "migrations"))
        with self._writer.begin() as connection:
            config.attributes["connection"] = connection
            alembic.command.upgrade(config, "head")

    def _version(self) -> str | None:
        with self._readers.connect() as connection:
            if not sqlalchemy.inspect(connection).has_table("alembic_version"):
                return None
            query = sqlalchemy.text("SELECT version_num FROM alembic_version")
            return connection.scalars(query).one_or_none()

    @contextmanager
    def reading(self) -> Iterator[Session]:
        """A session that only reads, at one consistent state."""
        with Session(self._readers, expire_on_commit=False) as session:
            yield session

    @contextmanager
    def writing(self) -> Iterator[Session]:
        """A session whose changes are all kept at the end, or none on an error."""
        with Session(self._writer, expire_on_commit=False) as session, session.begin():
            yield session

    def ping(self) -> None:
        """Ask for a constant.

        Raises:
            sqlalchemy.exc.SQLAlchemyError: The database does not answer.
        """
        with self._readers.connect() as connection:
            connection.execute(sqlalchemy.text("SELECT 1"))

    def close(self) -> None:
        """Give all connections back."""
        self._readers.dispose()
        self._writer.dispose()


def is_full(error: OperationalError) -> bool:
    """Whether the database has said that no space is left; nothing was kept then."""
    original = error.orig
    full = getattr(original, "sqlite_errorcode", None) == sqlite3.SQLITE_FULL
    return full or getattr(original, "sqlstate", None) == _DISK_FULL


def _sqlite(url: sqlalchemy.URL, *, begin: str, pool_size: int, max_overflow: int) -> Engine:
    engine = sqlalchemy.create_engine(
        url,
        poolclass=sqlalchemy.QueuePool,
        pool_size=pool_size,
        max_overflow=max_overflow,
        pool_timeout=_BUSY_S,
        connect_args={"check_same_thread": False, "timeout": _BUSY_S},
    )
    journal = "WAL" if sqlite3.sqlite_version_info >= _FIRST_SAFE_WAL else "TRUNCATE"

    @event.listens_for(engine, "connect")
    def prepare(connection: Any, record: object) -> None:
        # SQLAlchemy begins and ends the transactions, not the driver.
        connection.isolation_level = None
        for pragma in (f"journal_mode={journal}", "synchronous=FULL", "foreign_keys=ON"):
            connection.execute(f"PRAGMA {pragma}")

    @event.listens_for(engine, "begin")
    def start(connection: Connection) -> None:
        connection.exec_driver_sql(begin)

    return engine
