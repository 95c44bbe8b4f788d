"""Composition root: the components of the service and their wiring."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from typing import Self

from app.access.quotas import Quotas
from app.access.service import AccessService
from app.analyses.prediction import Predictor
from app.analyses.service import AnalysisService
from app.batches.service import BatchService
from app.damage import check_file, check_present
from app.database import Database
from app.fits.engine import AbstractEngine, LocalEngine
from app.fits.service import FitService
from app.fits.supervisor import Supervisor
from app.fits.watcher import Watcher
from app.fork_server.child import ProcessLimits
from app.fork_server.client import ForkServer
from app.health.service import HealthService
from app.housekeeping import Housekeeper, Retention
from app.metrics import Metrics
from app.runs.choice import RunChoice
from app.runs.pending import PendingRuns
from app.runs.reading import ReadingQueue, RunReader
from app.runs.service import RunService
from app.settings import Settings
from app.storage import Storage
from identification.errors import OptionError

__all__ = ["Services"]


@dataclass(frozen=True)
class Services:
    """Components that the endpoints use.

    The fork server reads uploads; `reading` is their queue.  The engine computes the fits and is
    closed by the supervisor.  The watcher runs in the event loop, the housekeeper in its own
    thread.  `stopping` is set when the service is about to stop.
    """

    settings: Settings
    database: Database
    storage: Storage
    metrics: Metrics
    access: AccessService
    runs: RunService
    pending: PendingRuns
    choice: RunChoice
    fits: FitService
    batches: BatchService
    analyses: AnalysisService
    predictor: Predictor
    health: HealthService
    fork_server: ForkServer
    engine: AbstractEngine
    supervisor: Supervisor
    watcher: Watcher
    retention: Retention
    housekeeper: Housekeeper
    reading: ReadingQueue
    stopping: threading.Event = field(default_factory=threading.Event)

    @classmethod
    def build(cls, settings: Settings) -> Self:
        """Create the components; nothing is opened or started yet."""
        database = Database(settings.sqlalchemy_url)
        storage = Storage(settings.data_dir, settings.node)
        metrics = Metrics()
        readers = ForkServer("app.runs.parser", temporary=storage.incoming)
        limits = ProcessLimits(
            settings.read_memory_bytes, settings.read_cpu_s, settings.read_wall_s
        )
        reader = RunReader(readers, limits, settings.max_rows)
        engine = _engine(settings, storage)
        access = AccessService(database)
        retention = Retention(database, storage, metrics, settings.retention_days)
        quotas = Quotas(settings.quota_bytes, settings.quota_runs, settings.quota_waiting_fits)
        supervisor = Supervisor(database, storage, engine, settings, metrics)
        fits = FitService(database, storage, supervisor, quotas)
        runs = RunService(database, storage, reader, metrics, quotas)
        # Most services predict nothing: the first prediction starts this fork server.
        predictor = Predictor(
            ForkServer("app.analyses.predictor", temporary=storage.incoming),
            limits,
            settings.max_rows,
        )
        return cls(
            settings=settings,
            database=database,
            storage=storage,
            metrics=metrics,
            access=access,
            runs=runs,
            pending=PendingRuns(database, storage, reader, quotas),
            choice=RunChoice(database, storage, reader),
            fits=fits,
            batches=BatchService(database, storage, supervisor, quotas),
            analyses=AnalysisService(fits, runs, storage, predictor),
            predictor=predictor,
            health=HealthService(database, storage, supervisor, metrics),
            fork_server=readers,
            engine=engine,
            supervisor=supervisor,
            watcher=Watcher(database, access, settings.streams_per_key),
            retention=retention,
            housekeeper=Housekeeper(access, retention, settings.sweep_s),
            reading=ReadingQueue(settings.readers, settings.waiting_uploads),
        )

    def open(self) -> None:
        """Open the data directory and the database, if not open yet.

        Raises:
            OptionError: The data directory is unusable or in use by another server, or the database
                does not respond.
            DamagedDatabase: The database file is damaged or missing.
        """
        if self.storage.lock.is_held:
            return
        self.storage.prepare()
        self.storage.lock.take()
        file = self.settings.sqlite_file
        try:
            if file is not None:
                check_present(file, self.storage.stored())
                check_file(file)
            self.database.migrate()
        except BaseException:
            self.database.close()
            self.storage.lock.release()
            raise

    def start(self) -> None:
        """Open what is not open yet, and start the threads and processes.

        Raises:
            OptionError: As for `open`.
            DamagedDatabase: As for `open`.
        """
        self.open()
        self.storage.sweep_incoming()
        self.retention.sweep()
        self.fork_server.start()
        self.engine.open()
        self.supervisor.start()
        self.housekeeper.start()

    def stop(self) -> None:
        """Stop all components; running fits wait for the next start."""
        self.stopping.set()
        self.housekeeper.stop()
        self.supervisor.stop()
        self.predictor.stop()
        self.fork_server.stop()
        self.database.close()
        self.storage.lock.release()


def _engine(settings: Settings, storage: Storage) -> AbstractEngine:
    if settings.engine == "dask":
        # Local import: the Dask packages take a second to load, and most services do not use them.
        try:
            from app.fits.dask_engine import DaskEngine
        except ImportError as error:
            raise OptionError(
                f"engine: dask needs a package that is not installed ({error.name}); install "
                "motorid[cluster]"
            ) from error

        return DaskEngine(settings, storage)
    pipeline = settings.pipeline.partition(":")[0]
    fork_server = ForkServer("app.fits.worker", pipeline, temporary=storage.incoming)
    return LocalEngine(fork_server, settings.workers, settings.fit_threads)
