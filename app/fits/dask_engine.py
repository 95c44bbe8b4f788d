"""Compute engine on a Dask cluster: each attempt is one task.

The database remains the record of the work.  Dask receives an attempt when it starts and loses it
with its scheduler.  If the scheduler or the worker of an attempt is gone, the attempt is lost and
its fit is requeued; the loss does not count against the fit.  See `app.fits.dask_task` for the
worker's side.

A separate thread maintains the connection, so the supervisor never waits for a cluster that does
not answer.  Without a connection the capacity is 0, and fits wait in the queue.  The workers share
the data directory, which holds runs and outputs; only job descriptions, progress and outcomes cross
the network of the cluster.
"""

from __future__ import annotations

import logging
import secrets
import threading
import time
from contextlib import suppress
from dataclasses import asdict
from typing import Any

from distributed import Client, Future, Security

from app.fits.dask_task import TOPIC, compute
from app.fits.engine import LOST, AbstractEngine, AbstractRunning
from app.fits.job import FitJob
from app.settings import Settings
from app.storage import Storage

__all__ = ["DaskEngine"]

_POLL_S = 1.0
_ANSWER_S = 5.0
_KILL_S = 1.0
_LONGEST_PAUSE_S = 30.0
_ABSENT_POLLS = 3
_REFUSED = (OSError, RuntimeError, TimeoutError)
_log = logging.getLogger(__name__)


class DaskEngine(AbstractEngine):
    """Engine that runs jobs as tasks of a Dask cluster, whose workers share the data directory."""

    def __init__(self, settings: Settings, storage: Storage) -> None:
        _log_like_the_rest()
        self._address = str(settings.dask_scheduler)
        self._security = _security(settings)
        self._data_dir = str(storage.directory)
        is_bounded = "workers" in settings.model_fields_set
        self._most = settings.workers if is_bounded else 2**31
        self._threads_of_one = settings.fit_threads or 1
        self._client: Client | None = None
        self._threads = 0
        self._running: dict[str, _DaskRunning] = {}
        self._losses = 0
        self._paused_until = 0.0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._look_after, name="dask", daemon=True)

    def open(self) -> None:
        """Start the thread that connects to the cluster."""
        self._thread.start()

    def close(self) -> None:
        """Close the connection, which ends all tasks."""
        self._stop.set()
        if self._thread.is_alive():
            # The thread may be waiting for an unreachable scheduler; that call times out by itself.
            self._thread.join(_KILL_S)
        self._disconnect()

    def capacity(self) -> int:
        """Number of the workers' threads, up to the configured limit; 0 if offline or paused."""
        if _line(self._client) is None or time.monotonic() < self._paused_until:
            return 0
        return min(self._threads, self._most)

    def threads(self, jobs: int) -> int:
        """Configured threads per fit, or one, because the cluster assigns one thread to a task."""
        return self._threads_of_one

    def start(self, job: FitJob) -> AbstractRunning:
        client = self._client
        line = _line(client)
        if client is None or line is None:
            raise OSError(f"no connection to the scheduler {self._address}")
        key = f"motorid-{job.fit_id}-{job.attempt}-{secrets.token_hex(4)}"
        running = _DaskRunning(self, job, key, line)
        self._running[key] = running
        try:
            running.future = client.submit(
                compute, asdict(job), self._data_dir, key=key, pure=False, retries=0
            )
        except RuntimeError as error:
            del self._running[key]
            raise OSError(f"the scheduler {self._address} accepts no task: {error}") from error
        return running

    def has_line(self, line: object) -> bool:
        """Return True if the connection over which a task was submitted still exists.

        Dask silently drops a task that is submitted while the connection breaks, and the
        earlier tasks end with the connection.
        """
        return _line(self._client) is line

    def forget(self, key: str) -> None:
        """Ignore further events of a task."""
        self._running.pop(key, None)

    def note(self, *, has_begun: bool) -> None:
        """Record how a task ended, and pause the engine while tasks are lost before they start.

        A cluster that cannot start any task (for example, a worker without the data directory)
        would otherwise take and lose the same fit many times a second.
        """
        if has_begun:
            self._losses = 0
        if has_begun or time.monotonic() < self._paused_until:
            return
        self._losses += 1
        pause = min(_LONGEST_PAUSE_S, _POLL_S * 2.0 ** min(self._losses - 1, 10))
        self._paused_until = time.monotonic() + pause

    def _look_after(self) -> None:
        """Maintain the connection and detect lost workers."""
        while not self._stop.is_set():
            try:
                client = self._client or self._connect()
                # Subscribe on every poll: Dask does not renew the subscription after a
                # reconnection.
                client.subscribe_topic(TOPIC, self._hear)
                workers: dict[str, int] = client.nthreads(callback_timeout=_ANSWER_S)
            except _REFUSED as error:
                if self._client is not None or self._threads == 0:
                    _log.warning("the cluster does not respond", extra={"reason": str(error)[:300]})
                self._disconnect()
            else:
                self._threads = sum(workers.values())
                for running in list(self._running.values()):
                    running.look_for_worker(workers)
            self._stop.wait(_POLL_S)

    def _connect(self) -> Client:
        client = Client(
            self._address,
            security=self._security,
            timeout=_ANSWER_S,
            name="motorid",
            set_as_default=False,
        )
        self._client = client
        if self._stop.is_set():
            self._disconnect()
        _log.info("connected to the cluster", extra={"scheduler": self._address})
        return client

    def _disconnect(self) -> None:
        client, self._client, self._threads = self._client, None, 0
        for running in list(self._running.values()):
            running.lose()
        if client is not None:
            with suppress(*_REFUSED):
                client.close(timeout=_ANSWER_S)

    def _hear(self, event: tuple[float, dict[str, Any]]) -> None:
        """Pass an event to its task; ignore events of other services' tasks."""
        _, told = event
        if running := self._running.get(told["key"]):
            running.hear(told)


class _DaskRunning(AbstractRunning):
    def __init__(self, engine: DaskEngine, job: FitJob, key: str, line: object) -> None:
        super().__init__(job)
        self._line = line
        self.future: Future[None] | None = None
        self._engine = engine
        self._key = key
        self._worker: str | None = None
        self._absent = 0
        self._is_lost = False
        self._has_ended = threading.Event()

    def exit(self) -> str | None:
        if self._has_ended.is_set():
            return self._end or LOST
        if self._is_lost or not self._engine.has_line(self._line):
            return LOST
        status = None if self.future is None else self.future.status
        if status in (None, "pending"):
            return None
        # The task has reported no exit, and its events would arrive before its result.
        if status == "error" and self.future is not None:
            with suppress(*_REFUSED):
                reason = str(self.future.exception(timeout=_KILL_S))[:300]
                _log.warning("a task failed", extra={"fit": self.job.fit_id, "reason": reason})
        return LOST

    def kill(self) -> None:
        future, self.future = self.future, None
        if future is None:
            return
        self._engine.note(has_begun=self._worker is not None or future.status == "pending")
        has_ended = self._has_ended.is_set() or future.done()
        with suppress(*_REFUSED):
            future.cancel(reason="motorid", msg="nobody waits for it any more")
        if self._worker is not None and not has_ended and not self._is_lost:
            self._has_ended.wait(_KILL_S)
        self.lose()
        self._engine.forget(self._key)

    def hear(self, told: dict[str, Any]) -> None:
        self._worker = told["worker"]
        self._take(told["messages"])
        if told["has_ended"]:
            self._has_ended.set()

    def lose(self) -> None:
        self._is_lost = True

    def look_for_worker(self, workers: dict[str, int]) -> None:
        """Declare the job lost if its worker is missing in several polls; one list may be late."""
        if self._worker is None or self._worker in workers:
            self._absent = 0
            return
        self._absent += 1
        if self._absent >= _ABSENT_POLLS:
            self.lose()


def _line(client: Client | None) -> object:
    """Connection of a client to its scheduler, or None; each reconnection makes a new object."""
    line = None if client is None else client.scheduler_comm
    return None if line is None or line.closed() else line


def _security(settings: Settings) -> Security | None:
    if not str(settings.dask_scheduler).startswith("tls://"):
        return None
    return Security(
        require_encryption=True,
        tls_ca_file=str(settings.dask_tls_ca_file),
        tls_client_cert=str(settings.dask_tls_cert_file),
        tls_client_key=str(settings.dask_tls_key_file),
    )


def _log_like_the_rest() -> None:
    """Send Dask's log to the log of the service, in place of Dask's own handlers."""
    for name in ("distributed", "distributed.client", "distributed.comm", "tornado"):
        logger = logging.getLogger(name)
        logger.handlers = []
        logger.propagate = True
        logger.setLevel(logging.WARNING)
