"""The server's side of a nursery: has tasks done in children of a process that is loaded already.

    nursery = Nursery("app.runs.parser", temporary=directory)
    task = nursery.fork({"path": ...})
    for message in task.messages(): ...          what the child told, then {"exit": 0}
    task.kill()

See `app.nursery.process` for the other side.  The process is started when it is needed, and again
when it was killed; what ran in it then is lost, which its tasks can tell from an end of their own.
"""

from __future__ import annotations

import json
import os
import secrets
import select
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

from app.confine import child_environment

__all__ = ["Nursery", "Task"]

_LONGEST_LINE = 2_000_000
_KILL_S = 10.0


class Nursery:
    """A process that forks children for tasks.

    Args:
        module: Module whose function `handle` does a task.
        others: Modules that tasks will need, loaded in advance.
        temporary: Directory for temporary files.
    """

    def __init__(self, module: str, *others: str, temporary: Path) -> None:
        self._modules = (module, *others)
        self._temporary = temporary
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._socket: socket.socket | None = None

    @property
    def pid(self) -> int | None:
        """The process, or None where none was started."""
        return None if self._process is None else self._process.pid

    def start(self) -> None:
        """Start the process, so that the first task need not wait for it."""
        with self._lock:
            self._running()

    def stop(self) -> None:
        """End the process and all its children."""
        with self._lock:
            self._close()

    def fork(self, task: dict[str, Any]) -> Task:
        """Have a task done.

        Raises:
            OSError: The process cannot be started, or does not take the task.
        """
        token = secrets.token_hex(8)
        incoming, outgoing = os.pipe()
        try:
            self._send({"token": token, "task": task}, [outgoing])
        except OSError:
            os.close(incoming)
            raise
        finally:
            os.close(outgoing)
        return Task(self, token, incoming)

    def kill(self, token: str) -> None:
        """End a task at once, with everything it started."""
        with self._lock:
            if self._socket is None:
                return
            try:
                self._socket.send(json.dumps({"kill": token}).encode())
            except (BrokenPipeError, ConnectionResetError):
                # The process is gone, and its children with it.
                self._close()

    def _send(self, request: dict[str, Any], handles: list[int]) -> None:
        message = json.dumps(request).encode()
        with self._lock:
            try:
                socket.send_fds(self._running(), [message], handles)
            except (BrokenPipeError, ConnectionResetError):
                # The process was ended from outside; a new one takes the request.
                self._close()
                socket.send_fds(self._running(), [message], handles)

    def _running(self) -> socket.socket:
        if self._socket is not None and self._process is not None and self._process.poll() is None:
            return self._socket
        self._close()
        # Message boundaries are kept, so that a request and its pipe stay together.
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            handle = theirs.fileno()
            words = ("-P", "-m", "app.nursery.process", str(handle), *self._modules)
            self._process = subprocess.Popen(
                [sys.executable, *words],
                pass_fds=[handle],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                env=child_environment(self._temporary),
                cwd="/",
                start_new_session=True,
            )
        self._socket = ours
        return ours

    def _close(self) -> None:
        if self._socket is not None:
            # The process ends when it sees this, and its children before it.
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
    """A task that was given to a nursery.

    Args:
        nursery: Who has it.
        token: Its name there.
        incoming: Where its messages come; closed when the task is.
    """

    def __init__(self, nursery: Nursery, token: str, incoming: int) -> None:
        self._nursery = nursery
        self._token = token
        self._incoming = incoming
        self._rest = b""
        self._is_open = True
        self.has_ended = False
        os.set_blocking(incoming, False)

    def messages(self, wait_s: float = 0.0) -> list[dict[str, Any]]:
        """What came since the last call; `has_ended` is true once nothing more will come.

        The last message of a task that ended is ``{"exit": code}``; where it is missing, the
        nursery itself was ended.

        Args:
            wait_s: Time to wait for something to come [s].
        """
        if self._is_open and wait_s > 0.0:
            select.select([self._incoming], [], [], wait_s)
        blocks = [self._rest]
        while self._is_open:
            try:
                block = os.read(self._incoming, 65536)
            except BlockingIOError:
                break
            if not block:
                self._close()
            blocks.append(block)
        *lines, self._rest = b"".join(blocks).split(b"\n")
        if len(self._rest) > _LONGEST_LINE:
            self._rest = b""
        # A child that is killed may leave half a line behind.
        return [json.loads(line) for line in lines if line[:1] == b"{" and line[-1:] == b"}"]

    def kill(self) -> None:
        """End the task with everything it started; returns when it has ended."""
        deadline = time.monotonic() + _KILL_S
        if self._is_open:
            self._nursery.kill(self._token)
        while self._is_open and time.monotonic() < deadline:
            self.messages(wait_s=deadline - time.monotonic())
        self._close()

    def _close(self) -> None:
        if self._is_open:
            os.close(self._incoming)
            self._is_open = False
        self.has_ended = True
