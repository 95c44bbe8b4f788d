"""The server's side of reading an upload: hands the file to a process with limits, and waits.

    reader = RunReader(limits, max_rows=10_000_000)
    reader.start()
    summary = reader.read(path, "run1.csv", mapping)     or RunRefused: file, row, column

See `app.runs.parser` for the other side.
"""

from __future__ import annotations

import dataclasses
import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from app.confine import Limits, child_environment
from app.errors import RunRefused, Unavailable

__all__ = ["RunReader"]

_LARGEST_ANSWER = 2_000_000
_GRACE_S = 5.0
_START_S = 60.0


class RunReader:
    """A process that reads runs, started when it is needed.

    Args:
        limits: What one reading may use.
        max_rows: Most samples of a run.
        temporary: Directory for temporary files; the readings may write none.
    """

    def __init__(self, limits: Limits, max_rows: int, temporary: Path) -> None:
        self._limits = limits
        self._max_rows = max_rows
        self._temporary = temporary
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._socket: socket.socket | None = None

    def start(self) -> None:
        """Start the process, so that the first upload need not wait for it."""
        with self._lock:
            self._running()

    def stop(self) -> None:
        """End the process; readings that are under way end with it."""
        with self._lock:
            if self._process is not None:
                self._close()

    def read(self, path: Path, name: str, mapping: Mapping[str, Any] | None) -> dict[str, Any]:
        """Read a run and say what is in it.

        Args:
            path: Where its bytes are.
            name: What messages call it.
            mapping: Which column is which channel, or None.

        Returns:
            Rows, rate, duration, channels with their ranges, and warnings.

        Raises:
            RunRefused: The file is no run, or reading it took more than the limits allow.
            Unavailable: The process could not be started.
        """
        request = json.dumps(
            {
                "path": str(path),
                "name": name,
                "mapping": mapping,
                "max_rows": self._max_rows,
                "limits": dataclasses.asdict(self._limits),
            }
        ).encode()
        answer = self._ask(request)
        lines = [json.loads(line) for line in answer.splitlines() if line.endswith(b"}")]
        found: dict[str, Any] = {}
        for line in lines:
            found |= line
        if "run" in found:
            return dict(found["run"])
        if "error" in found:
            raise RunRefused(**found["error"])
        raise self._ended(name, found.get("exit"))

    def _ask(self, request: bytes) -> bytes:
        incoming, outgoing = os.pipe()
        try:
            try:
                self._send(request, outgoing)
            finally:
                os.close(outgoing)
            return self._collect(incoming)
        finally:
            os.close(incoming)

    def _send(self, request: bytes, outgoing: int) -> None:
        with self._lock:
            for _ in range(2):
                connection = self._running()
                try:
                    socket.send_fds(connection, [request], [outgoing])
                except (BrokenPipeError, ConnectionResetError):
                    # The process was ended from outside; a new one takes the request.
                    self._close()
                else:
                    return
        raise Unavailable("runs cannot be read now; try again in some seconds")

    def _collect(self, incoming: int) -> bytes:
        """All that comes until the other side closes."""
        deadline = time.monotonic() + _START_S + self._limits.wall_s + _GRACE_S
        answer = bytearray()
        while len(answer) <= _LARGEST_ANSWER:
            left = deadline - time.monotonic()
            if left <= 0 or not select.select([incoming], [], [], left)[0]:
                break
            block = os.read(incoming, 65536)
            if not block:
                break
            answer += block
        return bytes(answer)

    def _running(self) -> socket.socket:
        if self._process is not None and self._socket is not None:
            if self._process.poll() is None:
                return self._socket
            self._close()
        # Message boundaries are kept, so that a request and its pipe stay together.
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "app.runs.parser", str(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                env=child_environment(self._temporary, threads=1),
                cwd="/",
                start_new_session=True,
            )
        self._socket = ours
        return ours

    def _close(self) -> None:
        if self._socket is not None:
            self._socket.close()
        if self._process is not None:
            self._process.kill()
            self._process.wait()
        self._process = self._socket = None

    def _ended(self, name: str, end: object) -> RunRefused | Unavailable:
        """What it means that a reading ended without an answer."""
        limits = self._limits
        if end is None:
            return Unavailable("the file could not be read now; send it again")
        if end in ("memory", -signal.SIGKILL):
            text = f"reading it takes more than {limits.memory_bytes / 1e9:g} GB"
            reason = "reader_memory"
        elif end in (-signal.SIGXCPU, -signal.SIGALRM):
            text = f"reading it takes more than {limits.cpu_s} s"
            reason = "reader_time"
        else:
            text = "it makes its reader fail"
            reason = "reader_crash"
        return RunRefused(
            f"{name}: {text}; expected a table of samples as text", reason=reason, file=name
        )
