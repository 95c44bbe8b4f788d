"""Fork server: `python -m app.fork_server.process SOCKET MODULE [MODULE...]`.

Starting an interpreter and importing the numerical libraries costs seconds of CPU time.  The fork
server does this once, and each task gets a child by fork.  The first MODULE has the function

    handle(task, answer)     run a task in the child; write JSON lines to the pipe `answer`

and the others are only imported in advance.  The fork server has a single thread, which
makes forking safe.

The client holds the other end of SOCKET.  A message is one letter and the token of a task:

    F token     fork a child; comes with two descriptors, the task file and the message pipe
    K token     kill the child of that task with all its child processes

The task is a file of any size that only the child reads, so its content cannot affect the fork
server or other children.  No message makes the fork server fail, and it never waits for the reader
of a pipe.  When a child has ended, the fork server kills the rest of its process group and writes
its exit code to its pipe.  When the client ends, the socket closes, and the fork server ends with
all its children.
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

from app.fork_server.child import die_with_parent, prefer_as_victim

__all__ = ["FORK", "KILL", "main"]

FORK: Final = b"F"
"""First letter of a message that requests a child."""

KILL: Final = b"K"
"""First letter of a message that kills a child."""

_LONGEST_MESSAGE = 100
_HANDLES = 2

Handler = Callable[[dict[str, Any], int], None]


@dataclass(frozen=True)
class _Child:
    token: bytes
    answer: int


class _RequestLoop:
    """Event loop that processes requests, forks children and reaps them."""

    def __init__(self, requests: socket.socket, handle: Handler) -> None:
        self._requests = requests
        self._handle = handle
        self._children: dict[int, _Child] = {}
        self._ends: dict[int, bytes] = {}

    def serve(self) -> None:
        """Process requests until the client has ended."""
        woken, wake = os.pipe()
        os.set_blocking(wake, False)
        signal.set_wakeup_fd(wake)
        # The empty handler lets SIGCHLD wake `poll`; `_reap` does the work.
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
        """Wait for a request, the end of a child, or space in a pipe for a pending exit message."""
        poll = select.poll()
        poll.register(self._requests, select.POLLIN)
        poll.register(woken, select.POLLIN)
        for answer in self._ends:
            poll.register(answer, select.POLLOUT)
        return {handle for handle, _ in poll.poll()}

    def _take(self) -> bool:
        """Process the next message; return False if the client has ended."""
        try:
            message, handles, _, _ = socket.recv_fds(self._requests, _LONGEST_MESSAGE, _HANDLES)
        except ConnectionResetError:
            return False
        verb, token = message[:1], message[1:]
        if verb == FORK and len(handles) == _HANDLES:
            self._fork(token, *handles)
            return True
        # If descriptors were lost (too many open files here), the task ends when its pipe closes.
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
            refused = json.dumps({"refused": f"no process available ({error.strerror})"})
            self._ends[answer] = f"{refused}\n".encode()
            return
        if child == 0:
            self._live(parent, task, answer)
        os.close(task)
        try:
            os.setpgid(child, child)
        except (PermissionError, ProcessLookupError):
            # The child has set its group itself, or has ended.
            pass
        self._children[child] = _Child(token, answer)

    def _live(self, parent: int, task: int, answer: int) -> None:
        """Run the task in the child; leave only by `_exit`, outside the event loop."""
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
                # Exit even if the output cannot be flushed.
                os._exit(status)

    def _reap(self) -> None:
        """For each ended child, kill the rest of its process group and queue its exit message."""
        options = os.WEXITED | os.WNOHANG | os.WNOWAIT
        while self._children and (ended := os.waitid(os.P_ALL, 0, options)) is not None:
            # The kernel does not reuse the process ID before `waitpid`.
            _kill_family(ended.si_pid)
            _, status = os.waitpid(ended.si_pid, 0)
            # An imported library may have started a process that is not one of the children.
            if (child := self._children.pop(ended.si_pid, None)) is not None:
                end = json.dumps({"exit": os.waitstatus_to_exitcode(status)})
                self._ends[child.answer] = f"\n{end}\n".encode()


def main(handle: int, module: str, *others: str) -> None:
    """Process requests on a socket until the client has ended; import the modules in advance."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    work: Handler = importlib.import_module(module).handle
    for other in others:
        try:
            importlib.import_module(other)
        except ImportError:
            # Each task that needs the module reports the error itself.
            continue
    # Before this line the client may terminate this process by a signal.  From here on the process
    # may have children, and ends only when the socket closes.
    for ignored in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(ignored, signal.SIG_IGN)
    # Memory pages of the imported modules stay shared with the children only if the garbage
    # collector leaves them alone.
    gc.freeze()
    with socket.socket(fileno=handle) as requests:
        _RequestLoop(requests, work).serve()


def _finish(answer: int, end: bytes) -> None:
    """Write the exit message to a pipe that has space for it, and close the pipe."""
    try:
        os.write(answer, end)
    except OSError:
        # The reader is gone, or the descriptor was no pipe; the other children are not affected.
        pass
    os.close(answer)


def _kill_family(child: int) -> None:
    for end in (os.killpg, os.kill):
        try:
            end(child, signal.SIGKILL)
        except ProcessLookupError:
            # The child has no process group yet, or has already ended.
            continue


if __name__ == "__main__":
    main(int(sys.argv[1]), *sys.argv[2:])
