"""Progress of a fit as server-sent events.

    event: progress
    id: 7
    data: {"id": "fit_...", "status": "running", "progress": {"stage": "posterior", ...}, ...}

Each event is the whole state, so that whoever comes late or back again needs no history.  The id of
an event is the version of that state: a browser that lost its connection sends it back and hears
only what changed since.  After the event of a state that is not left comes one named `end`, and the
stream closes; a browser that comes back after it is told, by 204, to stay away.

The state is read from the database and not passed on within the process, so that it is the same
whichever server computes.
"""

from __future__ import annotations

import time
from collections.abc import AsyncIterator, Callable

import anyio
from anyio import to_thread

from app.fits.repository import ENDED
from app.fits.schemas import FitEvent
from app.tables import FitRow

__all__ = ["has_heard_the_end", "last_version", "stream"]

_LOOK_S = 0.3
_RETRY_MS = 2000


def last_version(header: str | None) -> int:
    """Version in a Last-Event-ID header; 0 where there is none that could be one of ours."""
    text = (header or "").strip()
    return int(text) if text.isascii() and text.isdigit() and len(text) < 10 else 0


def has_heard_the_end(row: FitRow, version: int) -> bool:
    """Whether a listener that comes back has missed nothing and will never hear more."""
    return row.status in ENDED and version >= row.version


async def stream(
    read: Callable[[], FitRow | None],
    version: int,
    *,
    keep_alive_s: float,
    is_stopping: Callable[[], bool],
) -> AsyncIterator[str]:
    """Events of a fit until it ends, is removed, or the service stops.

    Args:
        read: Reads the fit; None where it is gone.
        version: Last version that the listener has.
        keep_alive_s: Longest silence [s].
        is_stopping: Whether the service wants to stop.
    """
    yield f"retry: {_RETRY_MS}\n\n"
    spoke = time.monotonic()
    while not is_stopping():
        row = await to_thread.run_sync(read)
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
        await anyio.sleep(_LOOK_S)


def _event(name: str, row: FitRow) -> str:
    data = FitEvent.of(row).model_dump_json()
    return f"event: {name}\nid: {row.version}\ndata: {data}\n\n"
