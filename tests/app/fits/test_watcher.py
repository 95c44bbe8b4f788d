"""Watcher of fits: notifications to listeners, and the number of queries."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from contextlib import ExitStack
from functools import partial
from typing import Any

import pytest
from sqlalchemy import update
from sqlalchemy.exc import OperationalError

from app.access.service import AccessService
from app.database import Database, portions
from app.errors import TooManyStreams
from app.fits import repository, watcher
from app.fits.watcher import Listener, Watcher
from app.tables import FitRow
from tests.app.rows import fit_row
from tests.app.statements import statements


def stored(database: Database, number: int = 1) -> list[FitRow]:
    """Some running fits."""
    rows = [fit_row("default", "running") for _ in range(number)]
    with database.writing() as session:
        session.add_all(rows)
    return rows


def advance(database: Database, row: FitRow) -> None:
    """Increase the version of a fit."""
    with database.writing() as session:
        statement = update(FitRow).where(FitRow.id == row.id)
        session.execute(statement.values(version=FitRow.version + 1, fraction=0.5))


def watched(made: Watcher, scenario: Callable[[], Awaitable[None]]) -> None:
    """Run a scenario concurrently with the watcher."""

    async def both() -> None:
        """Run the watcher during the scenario."""
        running = asyncio.create_task(made.run())
        try:
            await scenario()
            assert not running.done()
        finally:
            # Wait for a poll in progress, which still uses the database.
            running.cancel()
            await asyncio.wait([running])

    asyncio.run(both())


async def until(listener: Listener, condition: Callable[[FitRow | None], bool]) -> FitRow | None:
    """Wait until a row of a listener meets a condition; return the row."""
    deadline = time.monotonic() + 10
    while not condition(row := listener.look()):
        assert time.monotonic() < deadline, "it was not told"
        await listener.wait(0.2)
    return row


@pytest.fixture
def access(database: Database) -> AccessService:
    """Access service of the test database."""
    return AccessService(database)


@pytest.fixture
def made(database: Database, access: AccessService) -> Watcher:
    """Watcher that permits three listeners per key."""
    return Watcher(database, access, most_streams=3)


def test_a_hundred_listeners_cost_as_many_queries_as_one(
    database: Database, access: AccessService
) -> None:
    """A poll every 0.3 s sends one query, plus at most two per second for keys."""
    rows = stored(database, 50)
    keys = [access.create_key(f"bench {number}")[0].id for number in range(10)]
    made = Watcher(database, access, most_streams=64)

    async def listen() -> None:
        """Register two listeners per fit, with ten keys."""
        with ExitStack() as stack, statements(database) as sent:
            for number in range(100):
                stack.enter_context(made.listen(rows[number % 50], keys[number % 10]))
            await asyncio.sleep(1.0)
        asked = [statement for statement in sent if not statement.startswith("BEGIN")]
        assert 1 <= len(asked) <= 6

    watched(made, listen)


def test_no_listener_means_no_query(made: Watcher, database: Database) -> None:
    """After the last listener has left, no query is sent."""
    (row,) = stored(database)

    async def leave() -> None:
        """Register a listener and remove it."""
        with made.listen(row, None):
            pass
        with statements(database) as sent:
            await asyncio.sleep(0.7)
        assert sent == []

    watched(made, leave)


def test_listeners_of_one_fit_share_its_row(made: Watcher, database: Database) -> None:
    """Both receive the next version; a listener of another fit is not woken."""
    row, other = stored(database, 2)

    async def change() -> None:
        """Listen while the fit changes."""
        with (
            made.listen(row, None) as one,
            made.listen(row, None) as two,
            made.listen(other, None) as third,
        ):
            advance(database, row)
            seen = await until(one, lambda found: found is not None and found.version == 2)
            assert two.look() is seen
            assert third.look() is other

    watched(made, change)


def test_change_between_look_and_wait_ends_the_wait(made: Watcher, database: Database) -> None:
    """The fit changes while the listener is busy sending."""
    (row,) = stored(database)

    async def change() -> None:
        """Listen while the fit changes."""
        with made.listen(row, None) as slow, made.listen(row, None) as quick:
            assert slow.look() is row
            advance(database, row)
            await until(quick, lambda found: found is not None and found.version == 2)
            began = time.monotonic()
            await slow.wait(30.0)
            assert time.monotonic() - began < 10

    watched(made, change)


def test_removed_fit_gives_none(made: Watcher, database: Database) -> None:
    """The listener then ends its stream."""
    (row,) = stored(database)

    async def remove() -> None:
        """Listen while the fit is removed."""
        with made.listen(row, None) as listener:
            with database.writing() as session:
                repository.remove(session, row.id)
            await until(listener, lambda found: found is None)

    watched(made, remove)


def test_listener_with_a_revoked_key_receives_none(
    made: Watcher, database: Database, access: AccessService
) -> None:
    """A listener of the same fit with another key is not affected."""
    (row,) = stored(database)
    lost, kept = (access.create_key(name)[0].id for name in ("lost", "kept"))

    async def revoke() -> None:
        """Listen while the key is revoked."""
        with made.listen(row, lost) as out, made.listen(row, kept) as on:
            access.revoke_key(lost)
            await until(out, lambda found: found is None)
            assert on.look() is row

    watched(made, revoke)


def test_listener_survives_failed_polls(
    made: Watcher, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After three failed polls the fourth reports the change."""
    (row,) = stored(database)
    failures = iter([OperationalError("", {}, Exception("away"))] * 3)
    changes = repository.changes

    def fail_first(*arguments: Any) -> Any:
        if (failure := next(failures, None)) is not None:
            raise failure
        return changes(*arguments)

    monkeypatch.setattr(watcher, "_LOOK_S", 0.01)
    monkeypatch.setattr(repository, "changes", fail_first)

    async def fail() -> None:
        """Listen while the database fails."""
        with made.listen(row, None) as listener:
            advance(database, row)
            await until(listener, lambda found: found is not None and found.version == 2)

    watched(made, fail)


def test_listeners_per_key_are_limited(made: Watcher) -> None:
    """The fourth listener is rejected until one leaves; other keys are not affected."""
    row = fit_row("default", "running")

    async def listen() -> None:
        """Register listeners and check the result."""
        with ExitStack() as stack:
            streams = [ExitStack() for _ in range(3)]
            for stream in streams:
                stack.enter_context(stream).enter_context(made.listen(row, "key"))
            with pytest.raises(TooManyStreams, match="3 open event streams; expected at most 3"):
                stack.enter_context(made.listen(row, "key"))
            stack.enter_context(made.listen(row, "other key"))
            streams[0].close()
            stack.enter_context(made.listen(row, "key"))

    asyncio.run(listen())


def test_listeners_without_a_key_are_not_counted(made: Watcher) -> None:
    """A service without keys has no limit of listeners."""
    row = fit_row("default", "running")

    async def listen() -> None:
        """Register listeners and check the result."""
        with ExitStack() as stack:
            seen = [stack.enter_context(made.listen(row, None)).look() for _ in range(100)]
        assert seen == [row] * 100

    asyncio.run(listen())


def test_newer_row_of_a_new_listener_is_shared(made: Watcher) -> None:
    """A new listener supplies the row that it has read; an older row is ignored."""
    known, newer = fit_row("default", "running"), fit_row("default", "running")
    newer.id, newer.version = known.id, 2

    async def listen() -> None:
        """Register listeners and check the result."""
        with made.listen(known, None) as first, made.listen(newer, None):
            assert first.look() is newer
            with made.listen(known, None) as late:
                assert late.look() is newer

    asyncio.run(listen())


def test_changes_of_many_fits_are_read_in_portions(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only the changed and the removed fit of five are returned, with two fits per query."""
    monkeypatch.setattr(repository, "portions", partial(portions, most=2))
    rows = stored(database, 5)
    advance(database, rows[1])
    with database.writing() as session:
        repository.remove(session, rows[4].id)

    with database.reading() as session:
        found = repository.changes(session, {row.id: 1 for row in rows})

    assert found.keys() == {rows[1].id, rows[4].id}
    assert found[rows[4].id] is None
    changed = found[rows[1].id]
    assert changed is not None
    assert (changed.version, changed.fraction) == (2, 0.5)
