"""The tables as made by the versions, and what writing to them guarantees."""

from __future__ import annotations

import sqlite3
import threading
from pathlib import Path

import alembic.config
import alembic.script
import pytest
import sqlalchemy
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import text

import app.migrations
from app.database import Database
from app.tables import Tables


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


def test_versions_can_be_undone(tmp_path: Path) -> None:
    """Down to nothing and up again."""
    import alembic.command

    engine = sqlalchemy.create_engine(f"sqlite:///{tmp_path / 'x.sqlite3'}")
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


def test_journal_is_safe_for_this_version_of_sqlite(database: Database) -> None:
    """WAL can corrupt a database before SQLite 3.51.3."""
    with database.reading() as session:
        journal = session.scalar(text("PRAGMA journal_mode"))
        keys = session.scalar(text("PRAGMA foreign_keys"))
        synchronous = session.scalar(text("PRAGMA synchronous"))

    expected = "wal" if sqlite3.sqlite_version_info >= (3, 51, 3) else "truncate"
    assert (journal, keys, synchronous) == (expected, 1, 2)


def test_write_that_fails_leaves_nothing(database: Database) -> None:
    """All or nothing, also where the first statement was in order."""
    insert = text("INSERT INTO keys VALUES (:id, 'default', 'name', 'same', 1.0, NULL, NULL, NULL)")

    def write() -> None:
        with database.writing() as session:
            session.execute(insert, {"id": "a"})
            session.execute(insert, {"id": "b"})

    with pytest.raises(sqlalchemy.exc.IntegrityError, match="UNIQUE"):
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
                value = session.scalar(text("SELECT created_at FROM keys"))
                session.execute(text("UPDATE keys SET created_at = :v"), {"v": value + 1})

    threads = [threading.Thread(target=count) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()

    with database.reading() as session:
        assert session.scalar(text("SELECT created_at FROM keys")) == 200.0
