"""Streams of events, read from rows that the test moves."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable

import pytest

from app.access.service import Caller
from app.fits import events
from app.fits.request import FitRequest, new_row
from app.fits.watcher import Listener
from app.tables import FitRow


def row(status: str = "running", version: int = 3, fraction: float = 0.5) -> FitRow:
    """A fit in some state."""
    made = new_row(Caller("default"), FitRequest(["run"], [], {"controllers": ["P:1"]}))
    made.status, made.version, made.fraction, made.stage = status, version, fraction, "fit"
    return made


class Told(Listener):
    """Sees one row after the other, without waiting."""

    def __init__(self, rows: list[FitRow | None]) -> None:
        self.left = iter(rows)

    def look(self) -> FitRow | None:
        """The next row; none where there is none left."""
        return next(self.left, None)

    async def wait(self, seconds: float) -> None:
        """The next row is there already."""


def heard(
    rows: list[FitRow | None],
    version: int = 0,
    *,
    keep_alive_s: float = 60.0,
    is_stopping: Callable[[], bool] = lambda: False,
) -> list[str]:
    """Everything that a listener gets while the fit goes through some states."""

    async def listen() -> list[str]:
        """All parts of the stream."""
        stream = events.stream(
            Told(rows), version=version, keep_alive_s=keep_alive_s, is_stopping=is_stopping
        )
        return [part async for part in stream]

    return asyncio.run(listen())


def test_each_change_is_told_once_and_the_end_last() -> None:
    """Three versions, one of them seen twice."""
    rows = [row(version=1), row(version=2), row(version=2), row("succeeded", 3, 1.0)]

    parts = heard([*rows])

    assert parts[0].startswith("retry: ")
    assert [part.splitlines()[0] for part in parts[1:]] == [
        *["event: progress"] * 3,
        "event: end",
    ]
    assert [part.splitlines()[1] for part in parts[1:]] == ["id: 1", "id: 2", "id: 3", "id: 3"]
    told = [json.loads(part.splitlines()[2].removeprefix("data: ")) for part in parts[1:]]
    assert [entry["progress"]["fraction"] for entry in told] == [0.5, 0.5, 1.0, 1.0]
    assert all(part.endswith("\n\n") for part in parts)


def test_listener_that_has_a_version_hears_later_ones_only() -> None:
    """Version 2 is known."""
    parts = heard([row(version=2), row(version=4), None], version=2)

    assert [part.splitlines()[1] for part in parts[1:]] == ["id: 4"]


def test_stream_ends_when_the_fit_is_removed() -> None:
    """Nothing is said about what is gone."""
    assert len(heard([None])) == 1


def test_stream_ends_when_the_service_stops() -> None:
    """In the middle of a fit."""
    looks = iter([False, False, True])

    parts = heard([row(version=1), row(version=2), row(version=3)], is_stopping=lambda: next(looks))

    assert len(parts) == 3


def test_silence_is_filled_with_comments() -> None:
    """A line that begins with a colon, which listeners leave out."""
    parts = heard([row(version=1)] * 5, version=1, keep_alive_s=0.0)

    assert parts[1:] == [": keep-alive\n\n"] * 5


@pytest.mark.parametrize(
    ("header", "version"),
    [(None, 0), ("", 0), ("7", 7), (" 7 ", 7), ("-1", 0), ("x", 0), ("9" * 30, 0), ("٣", 0)],
)
def test_last_event_id_of_another_form_counts_as_none(header: str | None, version: int) -> None:
    """The header comes from outside."""
    assert events.last_version(header) == version


def test_only_the_end_of_an_ended_fit_keeps_a_listener_away() -> None:
    """A listener that missed the last change, or whose fit runs, is welcome."""
    assert events.has_heard_the_end(row("failed", 5), 5)
    assert not events.has_heard_the_end(row("failed", 5), 4)
    assert not events.has_heard_the_end(row("running", 5), 5)
