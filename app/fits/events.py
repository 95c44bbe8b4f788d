"""Progress of a fit as server-sent events.

    event: progress
    id: 7
    data: {"id": "fit_...", "status": "running", "progress": {"stage": "posterior", ...}, ...}

Each event is the whole state, so that whoever comes late or back again needs no history.  The id of
an event is the version of that state: a browser that lost its connection sends it back and hears
only what changed since.  After the event of a state that is not left comes one named `end`, and the
stream closes; a browser that comes back after it is told, by 204, to stay away.

The state is read from the database, by `app.fits.watcher` for all who listen, and not passed on
within the process, so that it is the same whichever server computes.
"""

from __future__ import annotations

import time
from collections.abc import AsyncIterator, Callable
from functools import partial

from starlette.responses import StreamingResponse
from starlette.types import Receive, Scope, Send

from app.fits.repository import ENDED
from app.fits.schemas import FitEvent
from app.fits.watcher import Listener, Watcher
from app.tables import FitRow

__all__ = ["EventStream", "has_heard_the_end", "last_version", "stream"]

_LONGEST_WAIT_S = 1.0
"""A stream that hears nothing looks this often whether the service stops [s]."""
_RETRY_MS = 2000


def last_version(header: str | None) -> int:
    """Version in a Last-Event-ID header; 0 where there is none that could be one of ours."""
    text = (header or "").strip()
    return int(text) if text.isascii() and text.isdigit() and len(text) < 10 else 0


def has_heard_the_end(row: FitRow, version: int) -> bool:
    """Whether a listener that comes back has missed nothing and will never hear more."""
    return row.status in ENDED and version >= row.version


class EventStream(StreamingResponse):
    """The answer to who listens to a fit; it counts as open for as long as it is sent.

    Args:
        watcher: Tells when the fit changes.
        row: The fit as it was just read.
        key_id: The key that was shown, or None where no key is asked for.
        version: Last version that the listener has.
        keep_alive_s: Longest silence [s].
        is_stopping: Whether the service wants to stop.

    Raises:
        TooManyStreams: The key has as many streams open as it may; raised before anything is sent.
    """

    def __init__(
        self,
        watcher: Watcher,
        row: FitRow,
        key_id: str | None,
        version: int,
        *,
        keep_alive_s: float,
        is_stopping: Callable[[], bool],
    ) -> None:
        super().__init__((), media_type="text/event-stream", headers={"X-Accel-Buffering": "no"})
        self._listening = watcher.listen(row, key_id)
        self._events = partial(
            stream, version=version, keep_alive_s=keep_alive_s, is_stopping=is_stopping
        )

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send events until there are no more, or the listener leaves."""
        with self._listening as listener:
            self.body_iterator = self._events(listener)
            await super().__call__(scope, receive, send)


async def stream(
    listener: Listener,
    *,
    version: int,
    keep_alive_s: float,
    is_stopping: Callable[[], bool],
) -> AsyncIterator[str]:
    """Events of a fit until it ends, is removed, or the service stops.

    Args:
        listener: Sees the fit, or None where there is nothing more to hear.
        version: Last version that the listener has.
        keep_alive_s: Longest silence [s].
        is_stopping: Whether the service wants to stop.
    """
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
