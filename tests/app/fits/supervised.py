"""A supervisor with an engine that does what the test says, in place of processes."""

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
    """A job of which the test says what it tells and how it ends."""

    job: FitJob
    told: list[dict[str, Any]] = field(default_factory=list)
    end: str | None = None
    is_killed: bool = False

    def messages(self) -> list[dict[str, Any]]:
        """What the test put in."""
        told, self.told = self.told, []
        return told

    def exit(self) -> str | None:
        """What the test said."""
        return self.end

    def log_tail(self) -> str:
        """Nothing was printed."""
        return ""

    def kill(self) -> None:
        """Remember it."""
        self.is_killed = True

    def succeed(self) -> None:
        """Leave a result and end."""
        (Path(self.job.directory) / "result.json").write_text("{}")
        self.told.append({"done": True})
        self.end = "exit status 0"


class Engine(AbstractEngine):
    """Remembers what was started; may refuse to start."""

    def __init__(self) -> None:
        self.started: list[Running] = []
        self.refusals = 0
        self.refused: dict[str, Exception] = {}
        self.most = 2

    def open(self) -> None:
        """There is nothing to begin."""

    def close(self) -> None:
        """There is nothing to end."""

    def capacity(self) -> int:
        """What the test said."""
        return self.most

    def threads(self, jobs: int) -> int:
        """A share of eight."""
        return 8 // max(1, min(jobs, self.most))

    def start(self, job: FitJob) -> AbstractRunning:
        """Start nothing."""
        if self.refusals:
            self.refusals -= 1
            raise OSError(11, "no process to be had")
        if job.fit_id in self.refused:
            raise self.refused[job.fit_id]
        self.started.append(Running(job))
        return self.started[-1]


class Bench:
    """A supervisor with what it needs."""

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
        """Name of a server that was here before."""
        return f"{self.storage.place}/former"

    def queue(self, **changes: object) -> str:
        """Let a fit wait."""
        request = FitRequest(["run"], [], {"controllers": ["P:1"]})
        row = new_row(Caller("default"), request)
        for name, value in changes.items():
            setattr(row, name, value)
        with self.database.writing() as session:
            repository.add(session, (row, request))
        self.supervisor.wake()
        return row.id

    def state(self, fit_id: str) -> FitRow:
        """A fit as it is now."""
        with self.database.reading() as session:
            row = session.get(FitRow, fit_id)
        assert row is not None
        return row

    def started(self, number: int) -> Running:
        """The job that was started last, once there are so many."""
        until(lambda: len(self.engine.started) >= number)
        return self.engine.started[number - 1]

    def ended(self, fit_id: str) -> FitRow:
        """A fit once it has ended."""
        until(lambda: self.state(fit_id).status in repository.ENDED)
        return self.state(fit_id)


def until(condition: Callable[[], bool]) -> None:
    """Wait for something that the supervisor's thread does."""
    deadline = time.monotonic() + 10
    while not condition():
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.005)
