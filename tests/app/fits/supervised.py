"""Supervisor on a mock engine whose jobs are controlled by the test."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from app.access.service import Caller
from app.database import Database
from app.fits import repository
from app.fits.engine import AbstractEngine, AbstractRunning
from app.fits.job import FitJob
from app.fits.request import FitRequest, new_row
from app.fits.supervisor import Supervisor
from app.metrics import Metrics
from app.settings import load_settings
from app.storage import Storage
from app.tables import FitRow


@dataclass
class Running(AbstractRunning):
    """Mock job whose messages and end are set by the test."""

    job: FitJob
    told: list[dict[str, Any]] = field(default_factory=list)
    end: str | None = None
    is_killed: bool = False

    def messages(self) -> list[dict[str, Any]]:
        """Return the messages set by the test, once."""
        told, self.told = self.told, []
        return told

    def exit(self) -> str | None:
        """Return the end set by the test."""
        return self.end

    def log_tail(self) -> str:
        """Return an empty log."""
        return ""

    def kill(self) -> None:
        """Record the kill."""
        self.is_killed = True

    def succeed(self) -> None:
        """Write a result and end successfully."""
        (Path(self.job.directory) / "result.json").write_text("{}")
        self.told.append({"done": True})
        self.end = "exit status 0"


class Engine(AbstractEngine):
    """Mock engine that records started jobs and can refuse to start."""

    def __init__(self) -> None:
        self.started: list[Running] = []
        self.refusals = 0
        self.refused: dict[str, Exception] = {}
        self.most = 2

    def open(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""

    def capacity(self) -> int:
        """Return the capacity set by the test."""
        return self.most

    def threads(self, jobs: int) -> int:
        """Return an equal share of eight cores."""
        return 8 // max(1, min(jobs, self.most))

    def start(self, job: FitJob) -> AbstractRunning:
        """Record the job without a process, or refuse to start it."""
        if self.refusals:
            self.refusals -= 1
            raise OSError(11, "no process to be had")
        if job.fit_id in self.refused:
            raise self.refused[job.fit_id]
        self.started.append(Running(job))
        return self.started[-1]


class Bench:
    """Supervisor with a database, a data directory and a mock engine."""

    def __init__(self, database: Database, directory: Path, **settings: object) -> None:
        self.database = database
        self.storage = Storage(directory, "bench")
        self.storage.prepare()
        self.engine = Engine()
        self.metrics = Metrics()
        chosen = {"heartbeat_s": 0.05, "lease_s": 1.0} | settings
        self.supervisor = Supervisor(
            database, self.storage, self.engine, load_settings(**chosen), self.metrics
        )
        self.supervisor.start()

    @property
    def owner(self) -> str:
        """Name under which the server holds fits."""
        return self.supervisor._queue._owner

    @property
    def former(self) -> str:
        """Name of an earlier server at the same place."""
        return f"{self.storage.place}/former"

    def queue(self, **changes: object) -> str:
        """Store a queued fit and return its ID."""
        request = FitRequest(["run"], [], {"controllers": ["P:1"]})
        row = new_row(Caller("default"), request)
        for name, value in changes.items():
            setattr(row, name, value)
        with self.database.writing() as session:
            repository.add(session, (row, request))
        self.supervisor.wake()
        return row.id

    def state(self, fit_id: str) -> FitRow:
        """Current row of a fit."""
        with self.database.reading() as session:
            row = session.get(FitRow, fit_id)
        assert row is not None
        return row

    def started(self, number: int) -> Running:
        """Job number `number` of the engine; waits until it is started."""
        until(lambda: len(self.engine.started) >= number)
        return self.engine.started[number - 1]

    def ended(self, fit_id: str) -> FitRow:
        """Row of a fit after it has ended."""
        until(lambda: self.state(fit_id).status in repository.ENDED)
        return self.state(fit_id)


def until(condition: Callable[[], bool]) -> None:
    """Wait until a condition holds, which the supervisor's thread brings about."""
    deadline = time.monotonic() + 10
    while not condition():
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.005)
