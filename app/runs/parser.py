"""The process that reads uploads: `python -m app.runs.parser FD`.

Reading what a stranger sent can crash an interpreter or ask for all memory, so it never happens in
the server.  Starting an interpreter with numpy and pandas for each upload would take seconds of a
core, so this process starts once, loads them, and forks for each upload a child that puts limits on
itself, reads, and ends.  It has one thread, which is what makes forking it sound.

The server holds the other end of the socket FD.  One message is one request, with a pipe for the
answer: one line of JSON from the child and, if the child ended badly, one from here that says how.
When the server is gone the socket ends, and so does this process.
"""

from __future__ import annotations

import gc
import json
import os
import select
import signal
import socket
import sys
from typing import Any

import numpy as np

from app.confine import Limits, confine, die_with_parent, prefer_as_victim
from identification.errors import RunFileError
from identification.ingest import Limits as FileLimits
from identification.ingest import Run, read_run

__all__ = ["LARGEST_REQUEST", "main"]

LARGEST_REQUEST = 150_000
"""Longest message of a request [bytes]."""


def main(handle: int) -> None:
    """Serve requests until the server is gone.

    Args:
        handle: File descriptor of the socket to the server.
    """
    requests = socket.socket(fileno=handle)
    woken, wake = os.pipe()
    os.set_blocking(wake, False)
    os.set_blocking(woken, False)
    signal.set_wakeup_fd(wake)
    signal.signal(signal.SIGCHLD, lambda number, frame: None)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # What is loaded stays shared with the children as long as no collector touches it.
    gc.freeze()
    answers: dict[int, int] = {}
    while True:
        ready, _, _ = select.select([requests.fileno(), woken], [], [])
        if woken in ready:
            os.read(woken, 1024)
            _reap(answers)
        if requests.fileno() in ready:
            message, handles, _, _ = socket.recv_fds(requests, LARGEST_REQUEST, 1)
            if not message:
                return
            answers[_fork(message, handles[0], requests)] = handles[0]


def _fork(message: bytes, answer: int, requests: socket.socket) -> int:
    parent = os.getpid()
    child = os.fork()
    if child:
        return child
    # From here on this is the child.  It leaves by `_exit` alone: the parent's loop is not its own.
    status = 1
    try:
        die_with_parent(parent)
        prefer_as_victim()
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        requests.close()
        os.write(answer, _answer(json.loads(message)) + b"\n")
        status = 0
    finally:
        if status:
            sys.excepthook(*sys.exc_info())
        os._exit(status)


def _reap(answers: dict[int, int]) -> None:
    """Say of each child that ended how it ended."""
    while answers:
        child, status = os.waitpid(-1, os.WNOHANG)
        if child == 0:
            return
        answer = answers.pop(child)
        code = os.waitstatus_to_exitcode(status)
        try:
            os.write(answer, json.dumps({"exit": code}).encode() + b"\n")
        except BrokenPipeError:
            # The server stopped waiting for it.
            pass
        os.close(answer)


def _answer(request: dict[str, Any]) -> bytes:
    confine(Limits(**request["limits"]))
    try:
        run = read_run(
            request["path"],
            name=request["name"],
            mapping=request["mapping"],
            limits=FileLimits(rows=request["max_rows"]),
        )
        found: dict[str, Any] = {"run": _summary(run)}
    except RunFileError as error:
        found = {
            "error": {
                "message": str(error),
                "reason": error.code,
                "file": error.file,
                "row": error.row,
                "column": error.column,
            }
        }
    except MemoryError:
        found = {"exit": "memory"}
    return json.dumps(found).encode()


def _summary(run: Run) -> dict[str, Any]:
    channels = {
        "voltage_V": run.voltage,
        "current_A": run.current,
        "speed_rad_s": run.speed,
        "temperature_degC": run.temperature,
        "position_rad": run.position,
    }
    return {
        "sha256": run.sha256,
        "rows": run.rows,
        "sample_rate_hz": run.sample_rate_hz,
        "duration_s": float(run.time[-1] - run.time[0]),
        "channels": {
            name: {"min": float(np.min(values)), "max": float(np.max(values))}
            for name, values in channels.items()
            if values is not None
        },
        "warnings": [
            {"code": w.code, "message": w.message, "row": w.row, "column": w.column}
            for w in run.warnings
        ],
    }


if __name__ == "__main__":
    main(int(sys.argv[1]))
