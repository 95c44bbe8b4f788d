"""What computes: an engine starts jobs, and each job that runs is asked how it is doing.

    running = engine.start(job)
    running.messages()        what it told since it was asked last
    running.exit()            None while it runs, else how it ended
    running.kill()            at once, with everything it started

`LocalEngine` starts one process a job on this machine.  The supervisor knows only the two abstract
classes, so that another engine changes nothing else; whatever computes may die at any moment, since
the tables and not the engine say what there is to do.
"""

from __future__ import annotations

import abc
import json
import logging
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

from app.confine import child_environment
from app.fits.job import Job

__all__ = ["AbstractEngine", "AbstractRunning", "LocalEngine"]

_LONGEST_LINE = 1_000_000
_LONGEST_LOG = 4_000
_log = logging.getLogger(__name__)


class AbstractRunning(abc.ABC):
    """A job that was started."""

    job: Job

    @abc.abstractmethod
    def messages(self) -> list[dict[str, Any]]:
        """What the job told since the last call, oldest first."""

    @abc.abstractmethod
    def exit(self) -> str | None:
        """None while the job runs, else in words how its process ended."""

    @abc.abstractmethod
    def log_tail(self) -> str:
        """The end of what the job printed."""

    @abc.abstractmethod
    def kill(self) -> None:
        """End the job at once; returns when it has ended."""


class AbstractEngine(abc.ABC):
    """Starts jobs."""

    @abc.abstractmethod
    def start(self, job: Job) -> AbstractRunning:
        """Start a job.

        Args:
            job: What to compute; its directory is there and empty.

        Raises:
            OSError: It cannot be started now.
        """


class LocalEngine(AbstractEngine):
    """One process a job on this machine, each in a process group of its own.

    Jobs must be started from a thread that outlives them: the kernel ends a process when the
    *thread* that started it ends.

    Args:
        threads: Most threads of the numerical libraries in a process.
    """

    def __init__(self, threads: int) -> None:
        self._threads = threads

    def start(self, job: Job) -> AbstractRunning:
        """Start a process for a job."""
        directory = Path(job.directory)
        job.save(directory / "job.json")
        incoming, outgoing = os.pipe()
        os.set_blocking(incoming, False)
        try:
            with (directory / "worker.log").open("wb") as log:
                process = subprocess.Popen(
                    [
                        *(sys.executable, "-P", "-m", "app.fits.worker"),
                        *(str(directory / "job.json"), str(outgoing), str(os.getpid())),
                    ],
                    pass_fds=[outgoing],
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=subprocess.STDOUT,
                    env=child_environment(directory, self._threads),
                    cwd="/",
                    start_new_session=True,
                )
        except OSError:
            os.close(incoming)
            raise
        finally:
            os.close(outgoing)
        return _LocalRunning(job, process, incoming)


class _LocalRunning(AbstractRunning):
    def __init__(self, job: Job, process: subprocess.Popen[bytes], incoming: int) -> None:
        self.job = job
        self._process = process
        self._incoming = incoming
        self._rest = b""
        self._is_open = True

    def messages(self) -> list[dict[str, Any]]:
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
        self._rest = self._rest[:_LONGEST_LINE]
        return [json.loads(line) for line in lines if line]

    def exit(self) -> str | None:
        if self._process.returncode is None:
            options = os.WEXITED | os.WNOHANG | os.WNOWAIT
            if os.waitid(os.P_PID, self._process.pid, options) is None:
                return None
            # It has ended and nothing that it started may go on without it.  Its number is given
            # to no other process before it is waited for, so the group is still its own.
            os.killpg(self._process.pid, signal.SIGKILL)
        code = self._process.wait()
        if code >= 0:
            return f"exit status {code}"
        try:
            return f"signal {-code} ({signal.Signals(-code).name})"
        except ValueError:
            return f"signal {-code}"

    def kill(self) -> None:
        if self._process.returncode is None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        self._close()

    def log_tail(self) -> str:
        try:
            with (Path(self.job.directory) / "worker.log").open("rb") as log:
                log.seek(max(0, log.seek(0, os.SEEK_END) - _LONGEST_LOG))
                return log.read().decode("utf-8", "replace")
        except OSError:
            return ""

    def _close(self) -> None:
        if self._is_open:
            os.close(self._incoming)
            self._is_open = False
