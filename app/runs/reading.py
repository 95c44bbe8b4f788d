"""Server side of parsing an upload: passes the file to a process with limits, and waits.

    reader = RunReader(fork_server, limits, max_rows=10_000_000)
    summary = reader.read(path, "run1.csv", mapping)     or RunRefused: file, row, column

See `app.runs.parser` for the other side.
"""

from __future__ import annotations

import dataclasses
import signal
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from app.errors import RunRefused, Unavailable
from app.fork_server.child import ProcessLimits
from app.fork_server.client import ForkServer

__all__ = ["RunReader"]

_START_S = 60.0


class RunReader:
    """Parses runs in child processes.

    Args:
        fork_server: Fork server whose module is `app.runs.parser`.
        limits: Resource limits of one parser process.
        max_rows: Maximum number of samples of a run.
    """

    def __init__(self, fork_server: ForkServer, limits: ProcessLimits, max_rows: int) -> None:
        self._fork_server = fork_server
        self._limits = limits
        self._max_rows = max_rows

    def read(self, path: Path, name: str, mapping: Mapping[str, Any] | None) -> dict[str, Any]:
        """Parse a run file and return a summary of its content.

        Args:
            path: Path of the file.
            name: Name of the file in messages.
            mapping: Assignment of columns to channels, or None.

        Returns:
            Number of rows, sample rate, duration, channels with their ranges, and warnings.

        Raises:
            RunRefused: The file is not a valid run, or parsing it exceeds the limits.
            Unavailable: The file cannot be parsed now.
        """
        found = self._ask(
            {
                "path": str(path),
                "name": name,
                "mapping": mapping,
                "max_rows": self._max_rows,
                "limits": dataclasses.asdict(self._limits),
            }
        )
        if "run" in found:
            return dict(found["run"])
        if "message" in found.get("error", {}):
            raise RunRefused(**found["error"])
        raise self._refusal(name, found.get("error", {}).get("reason") or found.get("exit"))

    def _ask(self, task: dict[str, Any]) -> dict[str, Any]:
        """Run the parser; return its merged messages, including the exit code."""
        deadline = time.monotonic() + _START_S + self._limits.wall_s
        try:
            reading = self._fork_server.fork(task)
        except OSError as error:
            raise Unavailable(
                "runs cannot be read at the moment; try again in a few seconds"
            ) from error
        found: dict[str, Any] = {}
        while not reading.has_ended and time.monotonic() < deadline:
            for message in reading.messages(wait_s=deadline - time.monotonic()):
                found |= message
        reading.kill()
        return found

    def _refusal(self, name: str, end: object) -> RunRefused | Unavailable:
        """Build the error for a parser that ended without a result."""
        limits = self._limits
        if end is None:
            return Unavailable("the file could not be read; send it again")
        if end in ("reader_memory", -signal.SIGKILL):
            text = f"reading the file needs more than {limits.memory_bytes / 1e9:g} GB of memory"
            reason = "reader_memory"
        elif end in (-signal.SIGXCPU, -signal.SIGALRM):
            text = f"reading the file takes more than {limits.cpu_s} s"
            reason = "reader_time"
        else:
            text = "the reader crashed on the file"
            reason = "reader_crash"
        return RunRefused(
            f"{name}: {text}; expected a table of samples as text", reason=reason, file=name
        )
