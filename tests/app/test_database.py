"""The tables as made by the versions, and what writing to them guarantees."""

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


def test_versions_make_the_tables_that_the_code_knows(database: Database) -> None:
    """Alembic's own comparison finds nothing to change."""
    engine = sqlalchemy.create_engine(database.url)
    with engine.connect() as connection:
        found = compare_metadata(MigrationContext.configure(connection), Tables.metadata)
    engine.dispose()

    assert found == []


def test_newest_version_is_the_one_the_code_asks_for() -> None:
    """The last file of the chain; a new version must move the constant."""
    config = alembic.config.Config()
    config.set_main_option("script_location", str(Path(app.migrations.__file__).parent))

    assert alembic.script.ScriptDirectory.from_config(config).get_heads() == [app.migrations.NEWEST]


def test_migrating_again_changes_nothing(database: Database) -> None:
    """Each start does it."""
    with database.writing() as session:
        session.execute(
            text("INSERT INTO keys VALUES ('k', 'w', 'name', 'digest', 1.0, NULL, NULL, NULL)")
        )

    database.migrate()

    with database.reading() as session:
        assert session.scalar(text("SELECT count(*) FROM keys")) == 1


def test_versions_can_be_undone(database_url: str) -> None:
    """Down to nothing and up again."""
    import alembic.command

    engine = sqlalchemy.create_engine(Database(database_url).url)
    config = alembic.config.Config()
    config.set_main_option("script_location", str(Path(app.migrations.__file__).parent))
    with engine.begin() as connection:
        config.attributes["connection"] = connection
        alembic.command.upgrade(config, "head")
        alembic.command.downgrade(config, "base")
        left = set(sqlalchemy.inspect(connection).get_table_names()) - {"alembic_version"}
        alembic.command.upgrade(config, "head")
    engine.dispose()

    assert left == set()


def test_journal_is_safe_for_this_version_of_sqlite(tmp_path: Path) -> None:
    """WAL can corrupt a database before SQLite 3.51.3."""
    database = Database(f"sqlite:///{tmp_path / 'x.sqlite3'}")
    with database.reading() as session:
        journal = session.scalar(text("PRAGMA journal_mode"))
        keys = session.scalar(text("PRAGMA foreign_keys"))
        synchronous = session.scalar(text("PRAGMA synchronous"))
    database.close()

    expected = "wal" if sqlite3.sqlite_version_info >= (3, 51, 3) else "persist"
    assert (journal, keys, synchronous) == (expected, 1, 2)


def test_write_that_fails_leaves_nothing(database: Database) -> None:
    """All or nothing, also where the first statement was in order."""
    insert = text("INSERT INTO keys VALUES (:id, 'default', 'name', 'same', 1.0, NULL, NULL, NULL)")

    def write() -> None:
        with database.writing() as session:
            session.execute(insert, {"id": "a"})
            session.execute(insert, {"id": "b"})

    with pytest.raises(sqlalchemy.exc.IntegrityError, match="(?i)unique"):
        write()

    with database.reading() as session:
        assert session.scalar(text("SELECT count(*) FROM keys")) == 0


def test_writers_take_turns_and_lose_nothing(database: Database) -> None:
    """Eight threads read and write the same number 25 times each: 200."""
    with database.writing() as session:
        session.execute(text("INSERT INTO keys VALUES ('k', 'w', 'n', 'd', 0.0, NULL, NULL, NULL)"))

    def count() -> None:
        for _ in range(25):
            with database.writing() as session:
                # Only the lock keeps writers of PostgreSQL apart; SQLite has one at a time.
                row = session.scalars(select(KeyRow).with_for_update()).one()
                row.created_at += 1.0

    threads = [threading.Thread(target=count) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()

    with database.reading() as session:
        assert session.scalar(text("SELECT created_at FROM keys")) == 200.0


def test_databases_are_known_by_plain_addresses() -> None:
    """What people write, and what hosting services hand out; PostgreSQL is reached by psycopg."""
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
def test_database_that_cannot_be_used_is_named_on_one_line_without_its_password(
    address: str, words: str
) -> None:
    """Nothing listens on port 1; the command line shows the words to a user."""
    with pytest.raises(OptionError, match=words) as caught:
        Database(address).migrate()

    assert "\n" not in str(caught.value)
    assert "pa55" not in str(caught.value)


def test_wrong_password_is_told_without_it(postgres: PostgresServer) -> None:
    """The server's own words, which name the user."""
    address = postgres.url().replace(postgres.password, "wr0ng")

    with pytest.raises(OptionError, match="password authentication failed") as caught:
        Database(address).migrate()

    assert "wr0ng" not in str(caught.value)


def test_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the extra `postgresql`, as Python says it of a module that is None."""
    monkeypatch.setitem(sys.modules, "psycopg", None)

    with pytest.raises(OptionError, match=r"not installed .*install motorid\[postgresql\]"):
        Database("postgresql://host/base")


def test_tables_of_a_newer_version_are_refused(database: Database) -> None:
    """A downgrade would otherwise write rows that the newer tables do not take."""
    with database.writing() as session:
        session.execute(text("UPDATE alembic_version SET version_num = '9999'"))

    with pytest.raises(OptionError, match="tables of a newer motorid"):
        database.migrate()


def test_servers_that_start_at_once_migrate_once(database_url: str) -> None:
    """Four of them on an empty database: none fails, and the tables are there."""
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
    """What was committed before a crash of the server is there; the next call finds it back.

    A transaction that the crash cuts off is told as an error of the kind that is worth another try.
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
