"""Progress of a fit as Server-Sent Events.

    event: progress
    id: 7
    data: {"id": "fit_...", "status": "running", "progress": {"stage": "posterior", ...}, ...}

Each event carries the complete state, so a client that connects late or again needs no history.
The ID of an event is the version of the state.  A browser that reconnects sends this ID and
receives only later versions.  After a final state, an event named `end` follows and the stream
closes; a browser that reconnects after that is stopped by status 204.

`app.fits.watcher` reads the state from the database for all listeners.  The state is not passed
within the process, so the events do not depend on which server computes the fit.
"""

from __future__ import annotations

import time
from collections.abc import AsyncIterator, Callable

from app.fits.repository import ENDED
from app.fits.schemas import FitEvent
from app.fits.watcher import Listener
from app.tables import FitRow

__all__ = ["has_heard_the_end", "last_version", "stream"]

_LONGEST_WAIT_S = 1.0
"""Interval at which an idle stream checks whether the service is stopping [s]."""
_RETRY_MS = 2000


def last_version(header: str | None) -> int:
    """Version in a Last-Event-ID header; 0 if the header is absent or invalid."""
    text = (header or "").strip()
    return int(text) if text.isascii() and text.isdigit() and len(text) < 10 else 0


def has_heard_the_end(row: FitRow, version: int) -> bool:
    """Return True if a reconnecting client has already received the final state."""
    return row.status in ENDED and 0 < row.version <= version


async def stream(
    listener: Listener, *, version: int, keep_alive_s: float, is_stopping: Callable[[], bool]
) -> AsyncIterator[str]:
    """Events of a fit until it ends, is deleted, or the service stops."""
    yield f"retry: {_RETRY_MS}\n\n"
    spoke = time.monotonic()
    while not is_stopping():
        row = listener.look()
        if row is None:
            return
        if row.version > version:
            version, spoke = row.version, time.monotonic()
            yield _event("progress", row)
        if row.status in ENDED:
            yield _event("end", row)
            return
        if time.monotonic() - spoke >= keep_alive_s:
            spoke = time.monotonic()
            yield ": keep-alive\n\n"
        await listener.wait(min(_LONGEST_WAIT_S, keep_alive_s))


def _event(name: str, row: FitRow) -> str:
    data = FitEvent.of(row).model_dump_json()
    return f"event: {name}\nid: {row.version}\ndata: {data}\n\n"
