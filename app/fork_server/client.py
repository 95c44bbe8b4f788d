"""Client of the fork server: runs tasks in children forked from a preloaded process.

    fork_server = ForkServer("app.runs.parser", temporary=directory)
    task = fork_server.fork({"path": ...})
    for message in task.messages(): ...          messages of the child, then {"exit": 0}
    task.kill()

See `app.fork_server.process` for the other side.  A task is passed as an unnamed temporary file, so
it may have any size.  The fork server is started on demand, and again after it was killed.  Tasks
that were running in it are then lost; a lost task ends without an `exit` message.
"""

from __future__ import annotations

import dataclasses
import json
import os
import secrets
import select
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

from app.errors import BadRequest, Unavailable
from app.fork_server.child import ProcessLimits, child_environment
from app.fork_server.process import FORK, KILL

__all__ = ["ForkServer", "Task"]

_LONGEST_LINE = 2_000_000
_BLOCK_BYTES = 65536
_MOST_BLOCKS = 64
_KILL_S = 10.0
_START_S = 60.0
_LOOK_S = 0.5


class ForkServer:
    """Client of a fork server, which forks a child for each task that `handle` of a module runs.

    `others` are modules that tasks need, imported in advance.
    """

    def __init__(self, module: str, *others: str, temporary: Path) -> None:
        self._modules = (module, *others)
        self._temporary = temporary
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._socket: socket.socket | None = None

    @property
    def pid(self) -> int | None:
        """Process ID of the fork server, or None if it was not started."""
        return None if self._process is None else self._process.pid

    def start(self) -> None:
        """Start the fork server in advance, so that the first task need not wait for it."""
        with self._lock:
            self._running()

    def stop(self) -> None:
        """Stop the fork server and all its children."""
        with self._lock:
            self._close()

    def fork(self, task: dict[str, Any]) -> Task:
        """Start a task in a child process.

        Raises:
            OSError: The fork server cannot be started, or does not accept the task.
        """
        token = secrets.token_hex(8).encode()
        with tempfile.TemporaryFile(dir=self._temporary) as file:
            file.write(json.dumps(task).encode())
            # The seek also flushes; the child reads from the position of this descriptor.
            file.seek(0)
            incoming, outgoing = os.pipe()
            try:
                self._send(FORK + token, [file.fileno(), outgoing])
            except OSError:
                os.close(incoming)
                raise
            finally:
                os.close(outgoing)
        return Task(self, token, incoming)

    def answer(
        self,
        task: dict[str, Any],
        limits: ProcessLimits,
        table: BinaryIO | None = None,
        is_wanted: Callable[[], bool] = lambda: True,
    ) -> dict[str, Any]:
        """Merged messages of a task with limits, including its exit code; rows go to the table.

        Raises:
            BadRequest: The answer was no longer wanted, and the task was killed.
            Unavailable: The task cannot be started now.
        """
        deadline = time.monotonic() + _START_S + limits.wall_s
        try:
            child = self.fork(task | {"limits": dataclasses.asdict(limits)})
        except OSError as error:
            raise Unavailable(
                "runs cannot be read or computed at the moment; try again in a few seconds"
            ) from error
        found: dict[str, Any] = {}
        try:
            while not child.has_ended and time.monotonic() < deadline:
                if not is_wanted():
                    raise BadRequest("the client disconnected before the answer was complete")
                for message in child.messages(wait_s=min(_LOOK_S, deadline - time.monotonic())):
                    rows = message.pop("table", None)
                    if rows is not None and table is not None:
                        table.write(rows.encode())
                    found |= message
        finally:
            child.kill()
        return found

    def kill(self, token: bytes) -> None:
        """Kill a task with all its child processes."""
        with self._lock:
            if self._socket is None:
                return
            try:
                self._socket.send(KILL + token)
            except (BrokenPipeError, ConnectionResetError, TimeoutError):
                # The fork server is gone or hangs; its children end with it.
                self._close()

    def _send(self, message: bytes, handles: list[int]) -> None:
        with self._lock:
            try:
                socket.send_fds(self._running(), [message], handles)
            except (BrokenPipeError, ConnectionResetError, TimeoutError):
                # The fork server was killed or hangs; a new one takes the request.
                self._close()
                socket.send_fds(self._running(), [message], handles)

    def _running(self) -> socket.socket:
        if self._socket is not None and self._process is not None and self._process.poll() is None:
            return self._socket
        self._close()
        # This socket type keeps message boundaries, so a request and its descriptors stay together.
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        # Without a timeout, a fork server that hangs would block the sender forever.
        ours.settimeout(_KILL_S)
        self._socket = ours
        with theirs:
            handle = theirs.fileno()
            words = ("-P", "-m", "app.fork_server.process", str(handle), *self._modules)
            self._process = subprocess.Popen(
                [sys.executable, *words],
                pass_fds=[handle],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                env=child_environment(self._temporary),
                cwd="/",
                start_new_session=True,
            )
        return ours

    def _close(self) -> None:
        if self._socket is not None:
            # When the socket closes, the fork server kills its children and exits.
            self._socket.close()
        if self._process is not None:
            self._process.terminate()
            try:
                self._process.wait(timeout=_KILL_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._process = self._socket = None


class Task:
    """A task that was given to the fork server, with the read end of its pipe."""

    def __init__(self, fork_server: ForkServer, token: bytes, incoming: int) -> None:
        self._fork_server = fork_server
        self._token = token
        self._incoming = incoming
        self._rest = b""
        self._is_open = True
        self.has_ended = False
        os.set_blocking(incoming, False)
        # Unlike `select`, `poll` accepts descriptors of any number; a server may have thousands.
        self._poll = select.poll()
        self._poll.register(incoming, select.POLLIN)

    def messages(self, wait_s: float = 0.0) -> list[dict[str, Any]]:
        """Messages since the last call; `has_ended` is true once no more will come.

        The last message of a task that ended is ``{"exit": code}``.  If it is missing, the fork
        server itself has ended, or it could not fork and has sent ``{"refused": reason}``.
        """
        if self._is_open and wait_s > 0.0:
            self._poll.poll(wait_s * 1e3)
        blocks = [self._rest]
        # The number of blocks is limited, so that a task that never stops writing blocks no caller.
        while self._is_open and len(blocks) <= _MOST_BLOCKS:
            try:
                block = os.read(self._incoming, _BLOCK_BYTES)
            except BlockingIOError:
                break
            if not block:
                self._close()
            blocks.append(block)
        *lines, self._rest = b"".join(blocks).split(b"\n")
        if len(self._rest) > _LONGEST_LINE:
            self._rest = b""
        return [message for message in map(_message, lines) if message is not None]

    def kill(self) -> None:
        """Kill the task with all its child processes; return when it has ended."""
        deadline = time.monotonic() + _KILL_S
        if self._is_open:
            self._fork_server.kill(self._token)
        while self._is_open and time.monotonic() < deadline:
            self.messages(wait_s=deadline - time.monotonic())
        self._close()

    def _close(self) -> None:
        if self._is_open:
            os.close(self._incoming)
            self._is_open = False
        self.has_ended = True


def _message(line: bytes) -> dict[str, Any] | None:
    """Parse a line; return None if it is invalid, since a killed child may leave half a line."""
    try:
        message = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return message if isinstance(message, dict) else None
