"""Database access through SQLAlchemy, with the same semantics on SQLite and PostgreSQL.

    database = Database("sqlite:////data/motorid.sqlite3")
    database.migrate()
    with database.writing() as session: ...      commits at the end, rolls back on an error
    with database.reading() as session: ...

PostgreSQL is accessed through psycopg.  Each connection is tested before use, so that a restart of
PostgreSQL fails only the calls in progress.

SQLite before 3.51.3 can corrupt a database in WAL mode when two connections write and checkpoint at
the same time, so these versions use a rollback journal.  The journal file keeps its space: without
it, no row could be deleted on a full disk.  Write transactions start with BEGIN IMMEDIATE: they
wait for the write lock at the start and never fail to get it midway.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import sqlalchemy
from sqlalchemy import event
from sqlalchemy.engine import Connection, Engine, ExceptionContext
from sqlalchemy.exc import ArgumentError, DatabaseError, InterfaceError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeout
from sqlalchemy.orm import Session

from app.damage import DamagedDatabase, corrupt, is_damaged
from app.disk import is_full
from app.migrations import NEWEST
from identification.errors import OptionError

__all__ = ["NO_ANSWER", "Database", "portions"]

NO_ANSWER = (OperationalError, InterfaceError, PoolTimeout)
"""Errors after which a retry of the call may succeed."""

_BUSY_S = 30.0
_CONNECT_S = 10
_FIRST_SAFE_WAL = (3, 51, 3)
_JOURNAL_BYTES = 1 << 20
"""Journal space kept between transactions, so that a full disk still permits deletions [bytes]."""

_IDS_PER_QUERY = 500
"""Ids per query; SQLite before 3.32 accepts at most 999 parameters."""

_MIGRATING = 6_032_011
"""Key of the PostgreSQL advisory lock that lets only one server migrate at a time."""


class Database:
    """Connections to one database, given by its URL in SQLAlchemy's form.

    Raises:
        OptionError: The URL is invalid, or a required package is not installed.
    """

    def __init__(self, url: str) -> None:
        self.url = _parsed(url)
        self.is_damaged = False
        if self.url.get_backend_name() == "sqlite":
            one, many = {"pool_size": 1, "max_overflow": 0}, {"pool_size": 8, "max_overflow": 32}
            json_of = self._from_json
            self._readers = _sqlite(self.url, begin="BEGIN", from_json=json_of, **many)
            self._writer = _sqlite(self.url, begin="BEGIN IMMEDIATE", from_json=json_of, **one)
        else:
            self._writer = _postgresql(self.url)
            # One snapshot for all queries of a session, as on SQLite.
            self._readers = self._writer.execution_options(
                isolation_level="REPEATABLE READ", postgresql_readonly=True
            )
        for engine in (self._readers, self._writer):
            event.listen(engine, "handle_error", self._note_damage)

    def migrate(self) -> None:
        """Upgrade the tables to the newest version, or create them in a new database.

        Raises:
            OptionError: The database does not respond, or a newer motorid created it.
            DamagedDatabase: The file is damaged or not a database.
            OperationalError: No space is left.
        """
        try:
            if self._version() != NEWEST:
                self._upgrade()
        except DatabaseError as error:
            if is_damaged(error):
                state = f"is damaged ({_first_line(error)})"
                raise DamagedDatabase(self.url.database, state) from error
            if is_full(error) or not isinstance(error, OperationalError):
                raise
            raise OptionError(
                f"database_url: {self._place} does not answer ({_first_line(error)}); start the "
                "database or choose another"
            ) from error

    @property
    def _place(self) -> str:
        """Database location for messages, without user and password."""
        if not self.url.host:
            return f"{self.url.get_backend_name()} database {self.url.database}"
        port = f":{self.url.port}" if self.url.port else ""
        return f"{self.url.get_backend_name()}://{self.url.host}{port}/{self.url.database or ''}"

    def _note_damage(self, context: ExceptionContext) -> None:
        """Record, for the life of the service, that a damaged page was found."""
        self.is_damaged = self.is_damaged or is_damaged(context.original_exception)

    def _from_json(self, text: str) -> Any:
        """Decode a JSON column; an overwritten page raises the same error as in other columns."""
        try:
            return json.loads(text)
        except ValueError as error:
            self.is_damaged = True
            reason = corrupt("a JSON column has other content")
            raise DatabaseError(None, None, reason) from error

    def _upgrade(self) -> None:
        # Local import: it takes a second, and most starts have nothing to migrate.
        import alembic.command
        import alembic.config
        import alembic.util

        config = alembic.config.Config()
        config.set_main_option("script_location", str(Path(__file__).parent / "migrations"))
        try:
            with self._writer.begin() as connection:
                if connection.dialect.name == "postgresql":
                    # If several servers start at once, the others wait here and find the work done.
                    # SQLite allows only one writer anyway.
                    lock = sqlalchemy.text(f"SELECT pg_advisory_xact_lock({_MIGRATING})")
                    connection.execute(lock)
                config.attributes["connection"] = connection
                alembic.command.upgrade(config, "head")
        except alembic.util.CommandError as error:
            raise OptionError(
                f"database_url: {self._place} has tables of a newer motorid (this one knows "
                f"version {NEWEST}); install that version, or choose another database"
            ) from error

    def _version(self) -> str | None:
        with self._readers.connect() as connection:
            if not sqlalchemy.inspect(connection).has_table("alembic_version"):
                return None
            query = sqlalchemy.text("SELECT version_num FROM alembic_version")
            return connection.scalars(query).one_or_none()

    @contextmanager
    def reading(self) -> Iterator[Session]:
        """Read-only session on one consistent snapshot."""
        with Session(self._readers, expire_on_commit=False) as session:
            yield session

    @contextmanager
    def writing(self) -> Iterator[Session]:
        """Write session: commits at the end, rolls back on an error."""
        with Session(self._writer, expire_on_commit=False) as session, session.begin():
            yield session

    def close(self) -> None:
        """Close all connections."""
        self._readers.dispose()
        self._writer.dispose()


def portions(ids: Sequence[str], most: int = _IDS_PER_QUERY) -> Iterator[Sequence[str]]:
    """Slices of a list of ids, in order; they keep parameter counts and transactions small."""
    for first in range(0, len(ids), most):
        yield ids[first : first + most]


def _parsed(address: str) -> sqlalchemy.URL:
    try:
        url = sqlalchemy.make_url(address)
    except ArgumentError:
        # SQLAlchemy's message may contain the URL and its password.
        raise OptionError(
            "database_url: no address of a database; expected postgresql://USER@HOST/NAME or "
            "sqlite:////PATH"
        ) from None
    kind = url.get_backend_name()
    if kind in ("postgresql", "postgres"):
        return url.set(drivername="postgresql+psycopg")
    if kind != "sqlite":
        raise OptionError(
            f"database_url: {kind} is no database that is known; expected postgresql or sqlite"
        )
    return url


def _postgresql(url: sqlalchemy.URL) -> Engine:
    try:
        return sqlalchemy.create_engine(
            url,
            pool_size=8,
            max_overflow=32,
            pool_timeout=_BUSY_S,
            pool_pre_ping=True,
            hide_parameters=True,
            connect_args={"connect_timeout": _CONNECT_S, "application_name": "motorid"},
        )
    except ImportError as error:
        raise OptionError(
            f"database_url: PostgreSQL needs a package that is not installed ({error.name}); "
            "install motorid[postgresql]"
        ) from error


def _first_line(error: DatabaseError) -> str:
    return str(error.orig).strip().splitlines()[0] if str(error.orig).strip() else "no reason given"


def _sqlite(
    url: sqlalchemy.URL,
    *,
    begin: str,
    from_json: Callable[[str], Any],
    pool_size: int,
    max_overflow: int,
) -> Engine:
    engine = sqlalchemy.create_engine(
        url,
        poolclass=sqlalchemy.QueuePool,
        pool_size=pool_size,
        max_overflow=max_overflow,
        pool_timeout=_BUSY_S,
        # Errors are logged, and the parameters include hashes of keys.
        hide_parameters=True,
        json_deserializer=from_json,
        connect_args={"check_same_thread": False, "timeout": _BUSY_S},
    )
    journal = "WAL" if sqlite3.sqlite_version_info >= _FIRST_SAFE_WAL else "PERSIST"

    @event.listens_for(engine, "connect")
    def prepare(connection: Any, record: object) -> None:
        # SQLAlchemy manages the transactions, not the driver.
        connection.isolation_level = None
        for pragma in (
            f"journal_mode={journal}",
            f"journal_size_limit={_JOURNAL_BYTES}",
            "synchronous=FULL",
            "foreign_keys=ON",
        ):
            connection.execute(f"PRAGMA {pragma}")

    @event.listens_for(engine, "begin")
    def start(connection: Connection) -> None:
        connection.exec_driver_sql(begin)

    return engine
