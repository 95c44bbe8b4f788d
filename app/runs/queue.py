"""Bounded queue of uploads that wait to be parsed, which keeps waiting times short.

    queue = ReadingQueue(readers=2, most_waiting=16)
    queue.check()                              TooManyUploads if the queue is full
    await queue.run(service.store, caller, upload)

If the queue is full, a caller gets a retry time at once, instead of waiting for an unknown time
with its file on disk.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import TypeVar, TypeVarTuple

from anyio import CapacityLimiter, to_thread

from app.errors import TooManyUploads

__all__ = ["ReadingQueue"]

Result = TypeVar("Result")
Arguments = TypeVarTuple("Arguments")

_NEWEST_SHARE = 0.1
_LONGEST_RETRY_S = 60.0


class ReadingQueue:
    """Limits the number of uploads parsed in parallel and waiting; used by one event loop.

    Args:
        readers: Number of uploads parsed in parallel.
        most_waiting: Maximum number of further uploads that wait.
    """

    def __init__(self, readers: int, most_waiting: int) -> None:
        self._limiter = CapacityLimiter(readers)
        self._readers = readers
        self._most_waiting = most_waiting
        # Exponentially weighted mean of the parsing time [s].
        self._mean_s = 0.1

    def check(self) -> None:
        """Refuse another upload if the queue is full.

        Raises:
            TooManyUploads: The queue is full.
        """
        waiting = self._limiter.statistics().tasks_waiting
        if self._limiter.available_tokens >= 1 or waiting < self._most_waiting:
            return
        wait_s = min(_LONGEST_RETRY_S, max(1.0, waiting * self._mean_s / self._readers))
        raise TooManyUploads(
            f"{waiting} uploads are waiting to be read, which is the limit; send the run again in "
            f"{math.ceil(wait_s)} s, or ask the operator to raise MOTORID_READERS or "
            "MOTORID_WAITING_UPLOADS",
            retry_after_s=wait_s,
        )

    async def run(self, function: Callable[[*Arguments], Result], *arguments: *Arguments) -> Result:
        """Call a function in a thread as soon as a reader is free."""

        def timed() -> Result:
            began = time.monotonic()
            try:
                return function(*arguments)
            finally:
                self._mean_s += _NEWEST_SHARE * (time.monotonic() - began - self._mean_s)

        return await to_thread.run_sync(timed, limiter=self._limiter)
