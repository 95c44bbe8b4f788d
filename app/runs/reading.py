"""Reading of uploads by processes with resource limits, and the queue of uploads that wait for it.

See `app.runs.parser` for the side of the process.  If the queue is full, a caller gets a retry time
at once, instead of waiting for an unknown time with its file on disk.
"""

from __future__ import annotations

import math
import signal
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar, TypeVarTuple

from anyio import CapacityLimiter, to_thread

from app.errors import RunRefused, TooManyUploads, Unavailable
from app.fork_server.child import ProcessLimits
from app.fork_server.client import ForkServer

__all__ = ["ReadingQueue", "RunReader"]

Result = TypeVar("Result")
Arguments = TypeVarTuple("Arguments")

_NEWEST_SHARE = 0.1
_LONGEST_RETRY_S = 60.0


class RunReader:
    """Reader that parses runs in child processes of a fork server for `app.runs.parser`.

    Each method raises `RunRefused` if the file is no run or exceeds the limits, and `Unavailable`
    if it cannot be read now.
    """

    def __init__(self, fork_server: ForkServer, limits: ProcessLimits, max_rows: int) -> None:
        self._fork_server = fork_server
        self._limits = limits
        self._max_rows = max_rows

    def read(self, path: Path, name: str, mapping: Mapping[str, Any] | None) -> dict[str, Any]:
        """Rows, sample rate, duration, channels with their ranges, and warnings of a run file."""
        return self._ask("run", path, name, mapping)

    def pending(
        self, path: Path, name: str, mapping: Mapping[str, Any] | None, *, is_of_bench: bool
    ) -> dict[str, Any]:
        """Examine a run file for a user who corrects the mapping.

        An entry of the mapping of a bench whose column the file lacks is omitted.

        Returns:
            The mapping used, columns, suggested column of each channel, preview, summary (None if
            the file cannot be read) and plotted samples.
        """
        return self._ask("pending", path, name, mapping, is_of_bench=is_of_bench)

    def preview(self, *files: tuple[Path, str, Mapping[str, Any] | None]) -> dict[str, Any]:
        """Examine runs of one motor, given as path, name and mapping, as `motorid check` does."""
        further = [(str(path), name, mapping) for path, name, mapping in files[1:]]
        return self._ask("preview", *files[0], further=further)

    def _ask(
        self, kind: str, path: Path, name: str, mapping: Mapping[str, Any] | None, **more: object
    ) -> dict[str, Any]:
        """Run the parser on a file; return its answer of this kind."""
        task = {
            "kind": kind,
            "path": str(path),
            "name": name,
            "mapping": mapping,
            "max_rows": self._max_rows,
            **more,
        }
        found = self._fork_server.answer(task, self._limits)
        if kind in found:
            return dict(found[kind])
        if "message" in found.get("error", {}):
            raise RunRefused(**found["error"])
        raise self._refusal(name, found.get("error", {}).get("reason") or found.get("exit"))

    def _refusal(self, name: str, end: object) -> RunRefused | Unavailable:
        """Build the error for a parser that ended without a result."""
        if end is None:
            return Unavailable("the file could not be read; send it again")
        is_memory = end in ("reader_memory", -signal.SIGKILL)
        if limit := self._limits.exceeded(-signal.SIGKILL if is_memory else end):
            text = f"reading the file {'needs' if is_memory else 'takes'} more than {limit}"
            reason = "reader_memory" if is_memory else "reader_time"
        else:
            text, reason = "the reader crashed on the file", "reader_crash"
        return RunRefused(f"{name}: {text}; expected a table of samples", reason=reason, file=name)


class ReadingQueue:
    """Limiter of the uploads parsed in parallel and waiting; used by one event loop."""

    def __init__(self, readers: int, most_waiting: int) -> None:
        self._limiter = CapacityLimiter(readers)
        self._readers = readers
        self._most_waiting = most_waiting
        # Exponentially weighted mean of the parsing time [s].
        self._mean_s = 0.1

    def check(self) -> None:
        """Raise `TooManyUploads` if the queue is full."""
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
