"""Schema migrations, and guarantees of write transactions."""

from __future__ import annotations

import sqlite3
import sys
import threading
from pathlib import Path

import alembic.config
import alembic.script
import pytest
import sqlalchemy
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import select, text

import app.migrations
from app.database import NO_ANSWER, Database
from app.tables import KeyRow, Tables
from identification.errors import OptionError
from tests.app.postgresql import MISSING, PostgresServer


def test_migrations_create_the_declared_tables(database: Database) -> None:
    """Alembic's comparison of the database with the tables finds no difference."""
    engine = sqlalchemy.create_engine(database.url)
    with engine.connect() as connection:
        found = compare_metadata(MigrationContext.configure(connection), Tables.metadata)
    engine.dispose()

    assert found == []


def test_newest_migration_is_the_required_version() -> None:
    """A new migration requires a change of the constant."""
    config = alembic.config.Config()
    config.set_main_option("script_location", str(Path(app.migrations.__file__).parent))

    assert alembic.script.ScriptDirectory.from_config(config).get_heads() == [app.migrations.NEWEST]


def test_migrating_again_changes_nothing(database: Database) -> None:
    """Each start migrates, so a second migration must keep all rows."""
    with database.writing() as session:
        session.execute(
            text("INSERT INTO keys VALUES ('k', 'w', 'n', 'd', 1.0, NULL, NULL, NULL, TRUE)")
        )

    database.migrate()

    with database.reading() as session:
        assert session.scalar(text("SELECT count(*) FROM keys")) == 1


def test_keys_from_before_owners_are_those_of_owners(database_url: str) -> None:
    """Whoever could manage keys before version 0007 still can."""
    import alembic.command

    engine = sqlalchemy.create_engine(Database(database_url).url)
    config = alembic.config.Config()
    config.set_main_option("script_location", str(Path(app.migrations.__file__).parent))
    columns = "(id, workspace, name, digest, created_at)"
    with engine.begin() as connection:
        config.attributes["connection"] = connection
        alembic.command.upgrade(config, "0006")
        connection.execute(text(f"INSERT INTO keys {columns} VALUES ('a', 'w', 'n', 'd', 1.0)"))
        alembic.command.upgrade(config, "head")
        owner = connection.scalar(text("SELECT owner FROM keys"))
    engine.dispose()

    assert owner in (True, 1)


def test_journal_is_safe_for_this_version_of_sqlite(tmp_path: Path) -> None:
    """WAL mode can corrupt a database before SQLite 3.51.3."""
    database = Database(f"sqlite:///{tmp_path / 'x.sqlite3'}")
    with database.reading() as session:
        journal = session.scalar(text("PRAGMA journal_mode"))
        keys = session.scalar(text("PRAGMA foreign_keys"))
        synchronous = session.scalar(text("PRAGMA synchronous"))
    database.close()

    expected = "wal" if sqlite3.sqlite_version_info >= (3, 51, 3) else "persist"
    assert (journal, keys, synchronous) == (expected, 1, 2)


def test_failed_transaction_is_rolled_back(database: Database) -> None:
    """The first, valid statement is rolled back with the second."""
    insert = text(
        "INSERT INTO keys VALUES (:id, 'default', 'n', 'same', 1.0, NULL, NULL, NULL, TRUE)"
    )

    def write() -> None:
        with database.writing() as session:
            session.execute(insert, {"id": "a"})
            session.execute(insert, {"id": "b"})

    with pytest.raises(sqlalchemy.exc.IntegrityError, match="(?i)unique"):
        write()

    with database.reading() as session:
        assert session.scalar(text("SELECT count(*) FROM keys")) == 0


def test_concurrent_writers_lose_no_update(database: Database) -> None:
    """Eight threads increment a number 25 times each, to 200."""
    with database.writing() as session:
        session.execute(
            text("INSERT INTO keys VALUES ('k', 'w', 'n', 'd', 0.0, NULL, NULL, NULL, TRUE)")
        )

    def count() -> None:
        for _ in range(25):
            with database.writing() as session:
                # PostgreSQL needs the row lock; SQLite permits only one writer.
                row = session.scalars(select(KeyRow).with_for_update()).one()
                row.created_at += 1.0

    threads = [threading.Thread(target=count) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()

    with database.reading() as session:
        assert session.scalar(text("SELECT created_at FROM keys")) == 200.0


def test_common_postgresql_urls_select_psycopg() -> None:
    """Operators and hosting services use different URL schemes."""
    for address in ("postgresql://u:p@h/b", "postgres://u:p@h/b", "postgresql+psycopg2://u:p@h/b"):
        assert Database(address).url.drivername == "postgresql+psycopg"


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("mysql://user:pa55@host/base", "mysql is no database that is known"),
        ("user:pa55@host", "no address of a database"),
        ("postgresql://user:pa55@127.0.0.1:1/base", r"postgresql://127.0.0.1:1/base .*not answer"),
        ("sqlite:////no/such/folder/x.sqlite3", "sqlite database .*not answer.*unable to open"),
    ],
)
def test_unusable_database_is_named_without_its_password(address: str, words: str) -> None:
    """The message is one line for the user of the command line."""
    with pytest.raises(OptionError, match=words) as caught:
        Database(address).migrate()

    assert "\n" not in str(caught.value)
    assert "pa55" not in str(caught.value)


def test_wrong_password_is_reported_without_it(postgres: PostgresServer) -> None:
    """The message contains the server's reason."""
    address = postgres.url().replace(postgres.password, "wr0ng")

    with pytest.raises(OptionError, match="password authentication failed") as caught:
        Database(address).migrate()

    assert "wr0ng" not in str(caught.value)


def test_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """The message names the extra `postgresql`."""
    monkeypatch.setitem(sys.modules, "psycopg", None)

    with pytest.raises(OptionError, match=r"not installed .*install motorid\[postgresql\]"):
        Database("postgresql://host/base")


def test_tables_of_a_newer_version_are_refused(database: Database) -> None:
    """An older program would write rows that the newer tables reject."""
    with database.writing() as session:
        session.execute(text("UPDATE alembic_version SET version_num = '9999'"))

    with pytest.raises(OptionError, match="tables of a newer motorid"):
        database.migrate()


def test_concurrent_starts_migrate_once(database_url: str) -> None:
    """Four servers on an empty database all succeed."""
    databases = [Database(database_url) for _ in range(4)]
    failures: list[Exception] = []

    def migrate(database: Database) -> None:
        try:
            database.migrate()
        except (OptionError, sqlalchemy.exc.SQLAlchemyError) as error:
            failures.append(error)

    threads = [threading.Thread(target=migrate, args=(database,)) for database in databases]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    versions = {database._version() for database in databases}
    for database in databases:
        database.close()

    assert failures == []
    assert versions == {app.migrations.NEWEST}


@pytest.mark.skipif(MISSING is not None, reason=str(MISSING))
def test_restart_of_postgresql_costs_one_call_at_most() -> None:
    """Committed rows survive a crash of the server, and the next call reconnects.

    A transaction interrupted by the crash raises an error that permits a retry.
    """
    with PostgresServer.running() as server:
        database = Database(server.url())
        database.migrate()
        insert = text("INSERT INTO keys VALUES (:id, 'w', 'n', :id, 0.0, NULL)")

        def cut_off() -> None:
            with database.writing() as session:
                session.execute(insert, {"id": "lost"})
                server.restart("immediate")

        with database.writing() as session:
            session.execute(insert, {"id": "kept"})
        with pytest.raises(NO_ANSWER, match="terminat|closed"):
            cut_off()
        with database.reading() as session:
            kept = session.scalars(text("SELECT id FROM keys")).all()
        database.close()

    assert kept == ["kept"]
