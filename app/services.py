"""The parts of the service and how they are put together, once, for one application."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from typing import Self

from anyio import CapacityLimiter

from app.access.service import AccessService
from app.batches.service import BatchService
from app.confine import Limits
from app.database import Database
from app.fits import repository as fits
from app.fits.engine import LocalEngine
from app.fits.service import FitService
from app.fits.supervisor import Supervisor
from app.health.service import HealthService
from app.metrics import Metrics
from app.nursery.client import Nursery
from app.runs import repository as runs
from app.runs.reading import RunReader
from app.runs.service import RunService
from app.settings import Settings
from app.storage import Storage

__all__ = ["Services"]


@dataclass(frozen=True)
class Services:
    """Everything that endpoints call.

    Args:
        settings: What the operator set.
        database: The tables.
        storage: The data directory.
        metrics: What is measured.
        access: Keys and sessions.
        runs: Calls about runs.
        fits: Calls about fits.
        batches: Calls about batches.
        health: Calls about health.
        nurseries: Processes that fork those that read uploads and those that compute fits.
        supervisor: The thread that has fits computed.
        reading: Bounds how many uploads are read at once.
        stopping: Set when the service wants to stop.
    """

    settings: Settings
    database: Database
    storage: Storage
    metrics: Metrics
    access: AccessService
    runs: RunService
    fits: FitService
    batches: BatchService
    health: HealthService
    nurseries: tuple[Nursery, ...]
    supervisor: Supervisor
    reading: CapacityLimiter
    stopping: threading.Event = field(default_factory=threading.Event)

    @classmethod
    def build(cls, settings: Settings) -> Self:
        """Put the parts together; nothing is opened or started yet."""
        database = Database(settings.sqlalchemy_url)
        storage = Storage(settings.data_dir, settings.node)
        metrics = Metrics()
        pipeline = settings.pipeline.partition(":")[0]
        readers = Nursery("app.runs.parser", temporary=storage.incoming)
        workers = Nursery("app.fits.worker", pipeline, temporary=storage.incoming)
        limits = Limits(settings.read_memory_bytes, settings.read_cpu_s, settings.read_wall_s)
        reader = RunReader(readers, limits, settings.max_rows)
        supervisor = Supervisor(database, storage, LocalEngine(workers), settings, metrics)
        return cls(
            settings=settings,
            database=database,
            storage=storage,
            metrics=metrics,
            access=AccessService(database),
            runs=RunService(database, storage, reader, metrics),
            fits=FitService(database, storage, supervisor),
            batches=BatchService(database, storage, supervisor),
            health=HealthService(database, storage, supervisor, metrics),
            nurseries=(readers, workers),
            supervisor=supervisor,
            reading=CapacityLimiter(settings.readers),
        )

    def start(self) -> None:
        """Open the data directory and the database, and begin to work.

        Raises:
            OptionError: The data directory cannot be used, or another server uses it.
        """
        self.storage.prepare()
        self.storage.lock()
        self.database.migrate()
        with self.database.reading() as session:
            self.storage.sweep(runs.all_ids(session), fits.all_ids(session))
        for nursery in self.nurseries:
            nursery.start()
        self.supervisor.start()

    def stop(self) -> None:
        """Stop working; fits that run wait for the next start."""
        self.stopping.set()
        self.supervisor.stop()
        for nursery in self.nurseries:
            nursery.stop()
        self.database.close()
        self.storage.unlock()
