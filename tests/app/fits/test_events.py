"""Event streams of a fit, for given sequences of rows."""

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
    """Row of a fit in a given state."""
    made = new_row(Caller("default"), FitRequest(["run"], [], {"controllers": ["P:1"]}))
    made.status, made.version, made.fraction, made.stage = status, version, fraction, "fit"
    return made


class Told(Listener):
    """Listener that returns given rows without waiting."""

    def __init__(self, rows: list[FitRow | None]) -> None:
        self.left = iter(rows)

    def look(self) -> FitRow | None:
        """Return the next row, or None after the last one."""
        return next(self.left, None)

    async def wait(self, seconds: float) -> None:
        """Return at once."""


def heard(
    rows: list[FitRow | None],
    version: int = 0,
    *,
    keep_alive_s: float = 60.0,
    is_stopping: Callable[[], bool] = lambda: False,
) -> list[str]:
    """Complete stream of a fit that passes through given states."""

    async def listen() -> list[str]:
        """Collect all parts of the stream."""
        stream = events.stream(
            Told(rows), version=version, keep_alive_s=keep_alive_s, is_stopping=is_stopping
        )
        return [part async for part in stream]

    return asyncio.run(listen())


def test_each_version_is_sent_once_and_the_end_last() -> None:
    """A version that is read twice is sent once."""
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


def test_listener_receives_only_later_versions() -> None:
    """A listener with version 2 receives version 4 only."""
    parts = heard([row(version=2), row(version=4), None], version=2)

    assert [part.splitlines()[1] for part in parts[1:]] == ["id: 4"]


def test_stream_ends_when_the_fit_is_removed() -> None:
    """No event is sent for a removed fit."""
    assert len(heard([None])) == 1


def test_stream_ends_when_the_service_stops() -> None:
    """The stream of a running fit ends without an `end` event."""
    looks = iter([False, False, True])

    parts = heard([row(version=1), row(version=2), row(version=3)], is_stopping=lambda: next(looks))

    assert len(parts) == 3


def test_idle_stream_sends_comments() -> None:
    """A line that begins with a colon is ignored by event listeners."""
    parts = heard([row(version=1)] * 5, version=1, keep_alive_s=0.0)

    assert parts[1:] == [": keep-alive\n\n"] * 5


@pytest.mark.parametrize(
    ("header", "version"),
    [(None, 0), ("", 0), ("7", 7), (" 7 ", 7), ("-1", 0), ("x", 0), ("9" * 30, 0), ("٣", 0)],
)
def test_invalid_last_event_id_counts_as_none(header: str | None, version: int) -> None:
    """The header is untrusted input."""
    assert events.last_version(header) == version


def test_only_a_received_final_state_ends_reconnection() -> None:
    """A listener reconnects if it missed the final state or if the fit still runs."""
    assert events.has_heard_the_end(row("failed", 5), 5)
    assert not events.has_heard_the_end(row("failed", 5), 4)
    assert not events.has_heard_the_end(row("running", 5), 5)
