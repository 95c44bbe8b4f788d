"""Watches the fits that someone listens to: one look at the database for all who listen.

    group.start_soon(watcher.run)
    with watcher.listen(row, caller.key_id) as listener:
        row = listener.look()           None once the fit is removed or the key opens nothing more
        await listener.wait(1.0)        until it changes, but not longer

A look asks for the versions of all fits that are listened to, and reads only those that changed;
listeners of one fit are told the same row.  So what listening costs grows with neither the number
of listeners nor that of keys, and other calls find the threads and the database free.

A look that fails is made again: the listeners stay, and hear nothing new until one succeeds.
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
class _Fit:
    """A fit that is listened to: its row, or None once it is gone."""

    row: FitRow | None
    listeners: int = 0
    change: anyio.Event = field(default_factory=anyio.Event)

    def tell(self, row: FitRow | None) -> None:
        """Wake the listeners, unless they know."""
        if self.row is None or (row is not None and row.version <= self.row.version):
            return
        self.row = row
        self.change.set()
        self.change = anyio.Event()


@dataclass
class _Key:
    """A key under which someone listens."""

    listeners: int = 0
    is_open: bool = True


class Listener:
    """One who listens to a fit."""

    def __init__(self, fit: _Fit, key: _Key) -> None:
        self._fit = fit
        self._key = key
        self._change = fit.change

    def look(self) -> FitRow | None:
        """The fit as it was last seen; None where it is gone or the key opens nothing any more."""
        # Kept from before the row is told, so that what changes meanwhile is not waited for.
        self._change = self._fit.change
        return self._fit.row if self._key.is_open else None

    async def wait(self, seconds: float) -> None:
        """Wait until the fit is another than at the last look.

        Args:
            seconds: Longest time [s].
        """
        with anyio.move_on_after(seconds):
            await self._change.wait()


class Watcher:
    """Looks at the database for all who listen; used in the thread of the event loop alone.

    Args:
        database: The tables.
        access: Keys; a listener whose key is revoked hears no more.
        most_streams: Listeners that a key may have at once; 0 for any number.
    """

    def __init__(self, database: Database, access: AccessService, most_streams: int) -> None:
        self._database = database
        self._access = access
        self._most_streams = most_streams
        self._fits: dict[str, _Fit] = {}
        self._keys: dict[str, _Key] = {}
        self._keys_due = 0.0
        self._is_failing = False
        # A thread of its own: a look waits for no call, and no call for a look.
        self._limiter = CapacityLimiter(1)

    @contextmanager
    def listen(self, row: FitRow, key_id: str | None) -> Iterator[Listener]:
        """Listen to a fit for the length of a block.

        Args:
            row: The fit as it was just read.
            key_id: The key that was shown, or None where none is asked for.

        Raises:
            TooManyStreams: The key has as many listeners as it may.
        """
        key = _Key() if key_id is None else self._keys.get(key_id, _Key())
        if self._most_streams and key.listeners >= self._most_streams:
            raise TooManyStreams(
                f"the key has {key.listeners} event streams open of {self._most_streams} that it "
                "may; close some, or have MOTORID_STREAMS_PER_KEY raised"
            )
        fit = self._fits.setdefault(row.id, _Fit(row))
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
        """Look, now and again, while someone listens; until it is cancelled."""
        while True:
            await anyio.sleep(_LOOK_S)
            if self._fits:
                await self._try()

    async def _try(self) -> None:
        try:
            await self._look()
        except Exception:  # noqa: BLE001  a task that ended here would end the service
            # Said once, since the next look is a moment away.
            if not self._is_failing:
                _log.exception("listeners have to wait for the database")
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
        # Who listens may have changed meanwhile.
        for fit_id in changes.keys() & self._fits.keys():
            self._fits[fit_id].tell(changes[fit_id])
        for key_id in self._keys.keys() & keys:
            self._keys[key_id].is_open = key_id in opening

    def _read(
        self, versions: Mapping[str, int], keys: Collection[str]
    ) -> tuple[dict[str, FitRow | None], Collection[str]]:
        """The fits that are not in these versions any more, and which keys open something."""
        with self._database.reading() as session:
            changes = repository.changes(session, versions)
        return changes, self._access.open_keys(keys) if keys else ()
