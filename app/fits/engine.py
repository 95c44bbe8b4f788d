"""What computes: an engine starts jobs, and each job that runs is asked how it is doing.

    running = engine.start(job)
    running.messages()        what it told since it was asked last
    running.exit()            None while it runs, else how it ended
    running.kill()            at once, with everything it started

`LocalEngine` has each job computed by one process on this machine.  The supervisor knows only the
two abstract classes, so that another engine changes nothing else; whatever computes may die at any
moment, since the tables and not the engine say what there is to do.
"""

from __future__ import annotations

import abc
import dataclasses
import os
import signal
from pathlib import Path
from typing import Any

from app.fits.job import LOG, Job
from app.nursery.client import Nursery, Task
from identification.threads import cores

__all__ = ["LOST", "AbstractEngine", "AbstractRunning", "LocalEngine", "in_words", "log_tail"]

LOST = "the end of its engine"
"""How a job ended that did not end by itself: it is no fault of the job."""

_LONGEST_LOG = 4_000


class AbstractRunning(abc.ABC):
    """A job that was started."""

    job: Job

    @abc.abstractmethod
    def messages(self) -> list[dict[str, Any]]:
        """What the job told since the last call, oldest first."""

    @abc.abstractmethod
    def exit(self) -> str | None:
        """None while the job runs, else in words how its process ended, or `LOST`."""

    @abc.abstractmethod
    def log_tail(self) -> str:
        """The end of what the job printed."""

    @abc.abstractmethod
    def kill(self) -> None:
        """End the job at once; returns when it has ended."""


class AbstractEngine(abc.ABC):
    """Starts jobs."""

    @abc.abstractmethod
    def open(self) -> None:
        """Begin to work; returns without waiting for others."""

    @abc.abstractmethod
    def close(self) -> None:
        """End, with all jobs that still run."""

    @abc.abstractmethod
    def capacity(self) -> int:
        """How many jobs may run at once now; 0 while none can be started."""

    @abc.abstractmethod
    def threads(self, jobs: int) -> int:
        """Threads that a job may use.

        Args:
            jobs: How many run or wait, with this one.
        """

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

    Args:
        nursery: Where they are forked, with `app.fits.worker` as its module.
        most: How many may run at once.
        threads: Threads of each, or None where they share the cores.
    """

    def __init__(self, nursery: Nursery, most: int, threads: int | None = None) -> None:
        self._nursery = nursery
        self._most = most
        self._threads = threads

    def open(self) -> None:
        """Start the process that forks the others."""
        self._nursery.start()

    def close(self) -> None:
        """End it, and the others with it."""
        self._nursery.stop()

    def capacity(self) -> int:
        """As many as were asked for."""
        return self._most

    def threads(self, jobs: int) -> int:
        """A job's share of the cores: all of them where it is alone, one where many wait."""
        return self._threads or max(1, cores() // min(jobs, self._most))

    def start(self, job: Job) -> AbstractRunning:
        """Start a process for a job."""
        return _LocalRunning(job, self._nursery.fork(dataclasses.asdict(job)))


class _LocalRunning(AbstractRunning):
    def __init__(self, job: Job, task: Task) -> None:
        self.job = job
        self._task = task
        self._told: list[dict[str, Any]] = []
        self._end: str | None = None

    def messages(self) -> list[dict[str, Any]]:
        self._hear()
        told, self._told = self._told, []
        return told

    def exit(self) -> str | None:
        self._hear()
        return self._end or (LOST if self._task.has_ended else None)

    def kill(self) -> None:
        self._task.kill()

    def log_tail(self) -> str:
        return log_tail(self.job)

    def _hear(self) -> None:
        for message in self._task.messages():
            if "exit" in message:
                self._end = in_words(message["exit"])
            else:
                self._told.append(message)


def log_tail(job: Job) -> str:
    """The end of what the process of a job printed."""
    try:
        with (Path(job.directory) / LOG).open("rb") as log:
            log.seek(max(0, log.seek(0, os.SEEK_END) - _LONGEST_LOG))
            return log.read().decode("utf-8", "replace")
    except OSError:
        return ""


def in_words(code: int) -> str:
    """How a process ended.

    Args:
        code: Its exit status, or less than zero the signal that ended it.
    """
    if code >= 0:
        return f"exit status {code}"
    try:
        return f"signal {-code} ({signal.Signals(-code).name})"
    except ValueError:
        return f"signal {-code}"
