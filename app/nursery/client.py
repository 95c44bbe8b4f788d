"""Client of a fork server: has tasks done in children of a process that is loaded already.

    nursery = Nursery("app.runs.parser", temporary=directory)
    task = nursery.fork({"path": ...})
    for message in task.messages(): ...          what the child told, then {"exit": 0}
    task.kill()

See `app.nursery.process` for the other side.  A task is handed over as a file without a name, so
that it may have any size.  The process is started when it is needed, and again when it was killed;
what ran in it then is lost, which its tasks can tell from an end of their own.
"""

from __future__ import annotations

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
from pathlib import Path
from typing import Any

from app.confine import child_environment
from app.nursery.process import FORK, KILL

__all__ = ["Nursery", "Task"]

_LONGEST_LINE = 2_000_000
_BLOCK_BYTES = 65536
_MOST_BLOCKS = 64
_KILL_S = 10.0


class Nursery:
    """A fork server: a process that forks children for tasks.

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
        token = secrets.token_hex(8).encode()
        with tempfile.TemporaryFile(dir=self._temporary) as file:
            file.write(json.dumps(task).encode())
            # Flushes too; the child reads from where this descriptor stands.
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

    def kill(self, token: bytes) -> None:
        """End a task at once, with everything it started."""
        with self._lock:
            if self._socket is None:
                return
            try:
                self._socket.send(KILL + token)
            except (BrokenPipeError, ConnectionResetError, TimeoutError):
                # The process is gone or hangs; its children end with it.
                self._close()

    def _send(self, message: bytes, handles: list[int]) -> None:
        with self._lock:
            try:
                socket.send_fds(self._running(), [message], handles)
            except (BrokenPipeError, ConnectionResetError, TimeoutError):
                # The process was ended from outside, or hangs; a new one takes the request.
                self._close()
                socket.send_fds(self._running(), [message], handles)

    def _running(self) -> socket.socket:
        if self._socket is not None and self._process is not None and self._process.poll() is None:
            return self._socket
        self._close()
        # Message boundaries are kept, so that a request and its descriptors stay together.
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        # A process that hangs would otherwise have whoever sends wait for ever.
        ours.settimeout(_KILL_S)
        self._socket = ours
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
    """A task that was given to a fork server.

    Args:
        nursery: Client of the fork server.
        token: Its name there.
        incoming: Where its messages come; closed when the task is.
    """

    def __init__(self, nursery: Nursery, token: bytes, incoming: int) -> None:
        self._nursery = nursery
        self._token = token
        self._incoming = incoming
        self._rest = b""
        self._is_open = True
        self.has_ended = False
        os.set_blocking(incoming, False)
        # Unlike `select`, this takes descriptors of any number: a server may have thousands.
        self._poll = select.poll()
        self._poll.register(incoming, select.POLLIN)

    def messages(self, wait_s: float = 0.0) -> list[dict[str, Any]]:
        """Messages since the last call; `has_ended` is true once nothing more will come.

        The last message of a task that ended is ``{"exit": code}``.  Where it is missing, the fork
        server itself was ended, or could not fork and said so by ``{"refused": reason}``.

        Args:
            wait_s: Time to wait for something to come [s].
        """
        if self._is_open and wait_s > 0.0:
            self._poll.poll(wait_s * 1e3)
        blocks = [self._rest]
        # A task that writes without an end keeps nobody here.
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


def _message(line: bytes) -> dict[str, Any] | None:
    """A line as a message, or None: a child that is killed may leave half a line behind."""
    try:
        message = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return message if isinstance(message, dict) else None
