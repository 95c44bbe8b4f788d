"""Compute engines: start jobs and report on the running ones.

`LocalEngine` computes each job in one process on this machine.  The supervisor uses only the two
abstract classes, so engines are interchangeable.  An engine may fail at any moment: the pending
work is recorded in the database, not in the engine.
"""

from __future__ import annotations

import abc
import dataclasses
import os
import signal
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from app.fits.job import LOG, FitJob
from app.fork_server.client import ForkServer, Task
from identification.threads import cores

__all__ = ["LOST", "AbstractEngine", "AbstractRunning", "LocalEngine"]

LOST = "the end of its engine"
"""Outcome of a job whose engine ended; it does not count against the fit."""

_LONGEST_LOG = 4_000


class AbstractRunning(abc.ABC):
    """A job that was started."""

    def __init__(self, job: FitJob) -> None:
        self.job = job
        self._told: list[dict[str, Any]] = []
        self._end: str | None = None

    def messages(self) -> list[dict[str, Any]]:
        """Messages of the job since the last call, oldest first."""
        # Another thread may append meanwhile.
        count = len(self._told)
        told, self._told[:count] = self._told[:count], []
        return told

    @abc.abstractmethod
    def exit(self) -> str | None:
        """None while the job runs, else a description of how its process ended, or `LOST`."""

    @abc.abstractmethod
    def kill(self) -> None:
        """Kill the job; return when it has ended."""

    def _take(self, messages: Sequence[dict[str, Any]]) -> None:
        """Keep the messages of the process and the reason for its end."""
        for message in messages:
            if "exit" in message:
                self._end = _in_words(message["exit"])
            else:
                self._told.append(message)

    def log_tail(self) -> str:
        """End of the log that the process of the job has written."""
        try:
            with (Path(self.job.directory) / LOG).open("rb") as log:
                log.seek(max(0, log.seek(0, os.SEEK_END) - _LONGEST_LOG))
                return log.read().decode("utf-8", "replace")
        except OSError:
            return ""


class AbstractEngine(abc.ABC):
    """Compute engine: starts jobs and limits their number."""

    @abc.abstractmethod
    def open(self) -> None:
        """Start the engine; return without waiting for a connection."""

    @abc.abstractmethod
    def close(self) -> None:
        """Stop the engine and all jobs that still run."""

    @abc.abstractmethod
    def capacity(self) -> int:
        """Number of jobs that may run in parallel now; 0 while none can be started."""

    @abc.abstractmethod
    def threads(self, jobs: int) -> int:
        """Number of threads that a job may use if so many jobs run or wait, including this one."""

    @abc.abstractmethod
    def start(self, job: FitJob) -> AbstractRunning:
        """Start a job, whose directory exists and is empty.

        Raises:
            OSError: The job cannot be started now.
        """


class LocalEngine(AbstractEngine):
    """Engine that computes each job in a separate process group on this machine.

    The module of the fork server is `app.fits.worker`; without `threads` the jobs share the cores.
    """

    def __init__(self, fork_server: ForkServer, most: int, threads: int | None = None) -> None:
        self._fork_server = fork_server
        self._most = most
        self._threads = threads

    def open(self) -> None:
        self._fork_server.start()

    def close(self) -> None:
        self._fork_server.stop()

    def capacity(self) -> int:
        return self._most

    def threads(self, jobs: int) -> int:
        """Configured number of threads, or an equal share of the cores and at least one."""
        return self._threads or max(1, cores() // min(jobs, self._most))

    def start(self, job: FitJob) -> AbstractRunning:
        return _LocalRunning(job, self._fork_server.fork(dataclasses.asdict(job)))


class _LocalRunning(AbstractRunning):
    def __init__(self, job: FitJob, task: Task) -> None:
        super().__init__(job)
        self._task = task

    def messages(self) -> list[dict[str, Any]]:
        self._take(self._task.messages())
        return super().messages()

    def exit(self) -> str | None:
        self._take(self._task.messages())
        return self._end or (LOST if self._task.has_ended else None)

    def kill(self) -> None:
        self._task.kill()


def _in_words(code: int) -> str:
    """Describe how a process ended; a negative code is the number of the signal that ended it."""
    if code >= 0:
        return f"exit status {code}"
    try:
        return f"signal {-code} ({signal.Signals(-code).name})"
    except ValueError:
        return f"signal {-code}"
