"""A process that forks: `python -m app.nursery.process SOCKET MODULE [MODULE...]`.

Starting an interpreter and loading the numerical libraries costs seconds of a core, so it is done
once, here, and each task gets a child by fork.  The first MODULE has the function

    handle(task, answer)     does a task in the child, writes lines of JSON to the pipe `answer`

and the others are only loaded.  This process has one thread, which is what makes forking it sound.

The server holds the other end of SOCKET.  One message is one request: to fork, with the pipe for
the answer, or to kill.  When a child has ended, all that it started is ended too, and how it ended
is written to its pipe.  When the server is gone the socket ends, and everything here with it.
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
from typing import Any

from app.confine import die_with_parent, prefer_as_victim

__all__ = ["LARGEST_REQUEST", "main"]

LARGEST_REQUEST = 190_000
"""Longest message of a request [bytes]; the system takes little more in one."""

Handler = Callable[[dict[str, Any], int], None]


@dataclass(frozen=True)
class _Child:
    token: str
    answer: int


class _Nursery:
    """Forks children and reaps them.

    Args:
        requests: The socket to the server.
        handle: What a child does.
    """

    def __init__(self, requests: socket.socket, handle: Handler) -> None:
        self._requests = requests
        self._handle = handle
        self._children: dict[int, _Child] = {}

    def serve(self) -> None:
        """Answer requests until the server is gone."""
        woken, wake = os.pipe()
        os.set_blocking(wake, False)
        signal.set_wakeup_fd(wake)
        # With a handler of our own the signal wakes `select`; its work is done in `_reap`.
        signal.signal(signal.SIGCHLD, lambda number, frame: None)
        while True:
            ready, _, _ = select.select([self._requests.fileno(), woken], [], [])
            if woken in ready:
                os.read(woken, 4096)
                self._reap()
            if self._requests.fileno() in ready and not self._take():
                break
        for child in self._children:
            _kill_family(child)

    def _take(self) -> bool:
        """Do what the next message asks; False where the server is gone."""
        message, handles, _, _ = socket.recv_fds(self._requests, LARGEST_REQUEST, 1)
        if not message:
            return False
        request = json.loads(message)
        if "kill" in request:
            for child, known in self._children.items():
                if known.token == request["kill"]:
                    _kill_family(child)
        else:
            self._fork(request, handles[0])
        return True

    def _fork(self, request: dict[str, Any], answer: int) -> None:
        parent = os.getpid()
        child = os.fork()
        if child == 0:
            self._live(parent, request["task"], answer)
        try:
            os.setpgid(child, child)
        except (PermissionError, ProcessLookupError):
            # The child has done it itself, or has ended.
            pass
        self._children[child] = _Child(request["token"], answer)

    def _live(self, parent: int, task: dict[str, Any], answer: int) -> None:
        """The life of a child, which leaves by `_exit` alone: the parent's loop is not its own."""
        status = 1
        try:
            die_with_parent(parent)
            prefer_as_victim()
            os.setpgid(0, 0)
            signal.set_wakeup_fd(-1)
            for reset in (signal.SIGCHLD, signal.SIGTERM, signal.SIGINT):
                signal.signal(reset, signal.SIG_DFL)
            self._requests.close()
            for other in self._children.values():
                os.close(other.answer)
            os.set_inheritable(answer, False)
            self._handle(task, answer)
            status = 0
        finally:
            if status:
                sys.excepthook(*sys.exc_info())
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(status)

    def _reap(self) -> None:
        """Say of each child that ended how it ended, after ending what it started."""
        options = os.WEXITED | os.WNOHANG | os.WNOWAIT
        while self._children and (ended := os.waitid(os.P_ALL, 0, options)) is not None:
            # Its number is given to no other process before it is waited for.
            _kill_family(ended.si_pid)
            _, status = os.waitpid(ended.si_pid, 0)
            child = self._children.pop(ended.si_pid)
            end = json.dumps({"exit": os.waitstatus_to_exitcode(status)})
            try:
                os.write(child.answer, f"\n{end}\n".encode())
            except (BrokenPipeError, BlockingIOError):
                # Nobody waits for it any more.
                pass
            os.close(child.answer)


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
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    # What is loaded stays shared with the children as long as no collector touches it.
    gc.freeze()
    with socket.socket(fileno=handle) as requests:
        _Nursery(requests, work).serve()


def _kill_family(child: int) -> None:
    for end in (os.killpg, os.kill):
        try:
            end(child, signal.SIGKILL)
        except ProcessLookupError:
            # It has no group yet, or has ended already.
            continue


if __name__ == "__main__":
    main(int(sys.argv[1]), *sys.argv[2:])
