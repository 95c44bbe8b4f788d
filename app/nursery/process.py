"""A fork server: `python -m app.nursery.process SOCKET MODULE [MODULE...]`.

Starting an interpreter and loading the numerical libraries costs seconds of a core, so it is done
once, here, and each task gets a child by fork.  The first MODULE has the function

    handle(task, answer)     does a task in the child, writes lines of JSON to the pipe `answer`

and the others are only loaded.  The fork server has one thread, which is what makes forking sound.

The server holds the other end of SOCKET.  A message is one letter and the token of a task:

    F token     fork a child; with it come two descriptors, the file of the task and the pipe
    K token     kill the child of that task, with everything that it started

The task itself is a file of any size, which the child alone reads: whatever stands in it, the fork
server and the other children go on.  No message makes the fork server fail, and it never waits for
a reader of a pipe.  When a child has ended, all that it started is ended too, and how it ended is
written to its pipe.  When the server is gone the socket ends, and everything here with it.
"""

from __future__ import annotations

import gc
import importlib
import json
import os
import select
import signal
import socket
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from app.confine import die_with_parent, prefer_as_victim

__all__ = ["FORK", "KILL", "main"]

FORK: Final = b"F"
"""First letter of a message that asks for a child."""

KILL: Final = b"K"
"""First letter of a message that asks for the end of a child."""

_LONGEST_MESSAGE = 100
_HANDLES = 2

Handler = Callable[[dict[str, Any], int], None]


@dataclass(frozen=True)
class _Child:
    token: bytes
    answer: int


class _ForkServer:
    """Forks children and reaps them.

    Args:
        requests: The socket to the server.
        handle: What a child does.
    """

    def __init__(self, requests: socket.socket, handle: Handler) -> None:
        self._requests = requests
        self._handle = handle
        self._children: dict[int, _Child] = {}
        self._ends: dict[int, bytes] = {}

    def serve(self) -> None:
        """Answer requests until the server is gone."""
        woken, wake = os.pipe()
        os.set_blocking(wake, False)
        signal.set_wakeup_fd(wake)
        # With a handler of our own the signal wakes `poll`; its work is done in `_reap`.
        signal.signal(signal.SIGCHLD, lambda number, frame: None)
        while True:
            ready = self._ready(woken)
            if woken in ready:
                os.read(woken, 4096)
                self._reap()
            for answer in ready & self._ends.keys():
                _finish(answer, self._ends.pop(answer))
            if self._requests.fileno() in ready and not self._take():
                break
        for child in self._children:
            _kill_family(child)

    def _ready(self, woken: int) -> set[int]:
        """Wait for a request, for the end of a child, or for room in a pipe that lacks its end."""
        poll = select.poll()
        poll.register(self._requests, select.POLLIN)
        poll.register(woken, select.POLLIN)
        for answer in self._ends:
            poll.register(answer, select.POLLOUT)
        return {handle for handle, _ in poll.poll()}

    def _take(self) -> bool:
        """Do what the next message asks; False where the server is gone."""
        try:
            message, handles, _, _ = socket.recv_fds(self._requests, _LONGEST_MESSAGE, _HANDLES)
        except ConnectionResetError:
            return False
        verb, token = message[:1], message[1:]
        if verb == FORK and len(handles) == _HANDLES:
            self._fork(token, *handles)
            return True
        # Where descriptors were lost, for want of room here, the task ends as its pipe does.
        for handle in handles:
            os.close(handle)
        if verb == KILL:
            for child, known in self._children.items():
                if known.token == token:
                    _kill_family(child)
        return bool(message)

    def _fork(self, token: bytes, task: int, answer: int) -> None:
        parent = os.getpid()
        try:
            child = os.fork()
        except OSError as error:
            os.close(task)
            refused = json.dumps({"refused": f"no process to be had ({error.strerror})"})
            self._ends[answer] = f"{refused}\n".encode()
            return
        if child == 0:
            self._live(parent, task, answer)
        os.close(task)
        try:
            os.setpgid(child, child)
        except (PermissionError, ProcessLookupError):
            # The child has done it itself, or has ended.
            pass
        self._children[child] = _Child(token, answer)

    def _live(self, parent: int, task: int, answer: int) -> None:
        """The life of a child, which leaves by `_exit` alone: the parent's loop is not its own."""
        status = 1
        try:
            die_with_parent(parent)
            prefer_as_victim()
            os.setpgid(0, 0)
            signal.set_wakeup_fd(-1)
            for reset in (signal.SIGCHLD, signal.SIGTERM, signal.SIGHUP, signal.SIGINT):
                signal.signal(reset, signal.SIG_DFL)
            self._requests.close()
            for other in (*(known.answer for known in self._children.values()), *self._ends):
                os.close(other)
            os.set_inheritable(answer, False)
            with os.fdopen(task, "rb") as file:
                content = json.load(file)
            self._handle(content, answer)
            status = 0
        finally:
            try:
                if status:
                    sys.excepthook(*sys.exc_info())
                sys.stdout.flush()
                sys.stderr.flush()
            finally:
                # Also where nobody reads what is printed.
                os._exit(status)

    def _reap(self) -> None:
        """Have each child that ended say how it ended, after ending what it started."""
        options = os.WEXITED | os.WNOHANG | os.WNOWAIT
        while self._children and (ended := os.waitid(os.P_ALL, 0, options)) is not None:
            # Its number is given to no other process before it is waited for.
            _kill_family(ended.si_pid)
            _, status = os.waitpid(ended.si_pid, 0)
            # A library that was loaded may have left a process, which is none of the children.
            if (child := self._children.pop(ended.si_pid, None)) is not None:
                end = json.dumps({"exit": os.waitstatus_to_exitcode(status)})
                self._ends[child.answer] = f"\n{end}\n".encode()


def main(handle: int, module: str, *others: str) -> None:
    """Serve requests until the server is gone.

    Args:
        handle: File descriptor of the socket to the server.
        module: Module with the function that does a task.
        *others: Modules that tasks will need.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    work: Handler = importlib.import_module(module).handle
    for other in others:
        try:
            importlib.import_module(other)
        except ImportError:
            # Each task that needs it will say so where it can be read.
            continue
    # Until here the server may end this process at any moment; from here on it has children, and
    # ends when the socket does.
    for ignored in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(ignored, signal.SIG_IGN)
    # What is loaded stays shared with the children as long as no collector touches it.
    gc.freeze()
    with socket.socket(fileno=handle) as requests:
        _ForkServer(requests, work).serve()


def _finish(answer: int, end: bytes) -> None:
    """Write the last line to a pipe that has room for it, and close it."""
    try:
        os.write(answer, end)
    except OSError:
        # Nobody waits for it any more, or it was no pipe; the other children go on.
        pass
    os.close(answer)


def _kill_family(child: int) -> None:
    for end in (os.killpg, os.kill):
        try:
            end(child, signal.SIGKILL)
        except ProcessLookupError:
            # It has no group yet, or has ended already.
            continue


if __name__ == "__main__":
    main(int(sys.argv[1]), *sys.argv[2:])
