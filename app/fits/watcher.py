"""Change notification for fits: one database poll serves all listeners.

A poll reads the versions of all fits that have listeners and fetches only the rows that changed;
all listeners of a fit share its row.  The number of polls therefore depends neither on the number
of listeners nor on that of keys, and other requests find the threads and the database free.

A failed poll is repeated.  Meanwhile the listeners stay registered and receive nothing new.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field

import anyio
from anyio import CapacityLimiter, to_thread

from app.access.service import AccessService
from app.database import Database
from app.errors import TooManyStreams
from app.fits import repository
from app.tables import FitRow

__all__ = ["Listener", "Watcher"]

_LOOK_S = 0.3
_KEYS_S = 2.0
_log = logging.getLogger(__name__)


@dataclass
class _WatchedFit:
    """A fit with listeners: its row, or None once it is deleted."""

    row: FitRow | None
    listeners: int = 0
    change: anyio.Event = field(default_factory=anyio.Event)

    def tell(self, row: FitRow | None) -> None:
        """Store a newer row and wake the listeners; ignore a row that is not newer."""
        if self.row is None or (row is not None and row.version <= self.row.version):
            return
        self.row = row
        self.change.set()
        self.change = anyio.Event()


@dataclass
class _WatchedKey:
    listeners: int = 0
    is_open: bool = True


class Listener:
    """Subscription to one fit."""

    def __init__(self, fit: _WatchedFit, key: _WatchedKey) -> None:
        self._fit = fit
        self._key = key
        self._change = fit.change

    def look(self) -> FitRow | None:
        """Latest row of the fit; None if the fit is deleted or the key is invalid."""
        # Keep the event before reading the row, so that wait() notices any later change.
        self._change = self._fit.change
        return self._fit.row if self._key.is_open else None

    async def wait(self, seconds: float) -> None:
        """Wait until the fit differs from the last look."""
        with anyio.move_on_after(seconds):
            await self._change.wait()


class Watcher:
    """Poller of the database for all listeners; used only in the thread of the event loop.

    A listener whose key is revoked receives nothing more; 0 allows any number of streams.
    """

    def __init__(self, database: Database, access: AccessService, most_streams: int) -> None:
        self._database = database
        self._access = access
        self._most_streams = most_streams
        self._fits: dict[str, _WatchedFit] = {}
        self._keys: dict[str, _WatchedKey] = {}
        self._keys_due = 0.0
        self._is_failing = False
        # Use a dedicated thread, so that polls and requests do not wait for each other.
        self._limiter = CapacityLimiter(1)

    @contextmanager
    def listen(self, row: FitRow, key_id: str | None) -> Iterator[Listener]:
        """Subscribe to a fit, whose row was just read, for the duration of a `with` block.

        Raises:
            TooManyStreams: The key has the maximum number of listeners.
        """
        key = _WatchedKey() if key_id is None else self._keys.get(key_id, _WatchedKey())
        if self._most_streams and key.listeners >= self._most_streams:
            raise TooManyStreams(
                f"the key has {key.listeners} open event streams; expected at most "
                f"{self._most_streams}; close some, or ask the operator to raise "
                "MOTORID_STREAMS_PER_KEY"
            )
        fit = self._fits.setdefault(row.id, _WatchedFit(row))
        fit.tell(row)
        fit.listeners += 1
        key.listeners += 1
        if key_id is not None:
            self._keys[key_id] = key
        try:
            yield Listener(fit, key)
        finally:
            fit.listeners -= 1
            key.listeners -= 1
            if not fit.listeners:
                del self._fits[row.id]
            if key_id is not None and not key.listeners:
                del self._keys[key_id]

    async def run(self) -> None:
        """Poll at intervals while there are listeners, until cancelled."""
        while True:
            await anyio.sleep(_LOOK_S)
            if not self._fits:
                continue
            try:
                await self._look()
            except Exception:  # noqa: BLE001  an exception here would end the service
                # Log only the first of consecutive failures, since polls are frequent.
                if not self._is_failing:
                    _log.exception("event streams wait for the database")
                self._is_failing = True
            else:
                self._is_failing = False

    async def _look(self) -> None:
        versions = {i: fit.row.version for i, fit in self._fits.items() if fit.row is not None}
        keys: list[str] = []
        if time.monotonic() >= self._keys_due:
            self._keys_due = time.monotonic() + _KEYS_S
            keys = list(self._keys)
        changes, opening = await to_thread.run_sync(
            self._read, versions, keys, limiter=self._limiter
        )
        # Listeners may have come or gone during the read.
        for fit_id in changes.keys() & self._fits.keys():
            self._fits[fit_id].tell(changes[fit_id])
        for key_id in self._keys.keys() & keys:
            self._keys[key_id].is_open = key_id in opening

    def _read(
        self, versions: Mapping[str, int], keys: Collection[str]
    ) -> tuple[dict[str, FitRow | None], Collection[str]]:
        """Fits whose version differs from these, and the keys that are still valid."""
        with self._database.reading() as session:
            changes = repository.changes(session, versions)
        return changes, self._access.open_keys(keys) if keys else ()
