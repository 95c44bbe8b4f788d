"""Composition root: the components of the service and their wiring."""

from __future__ import annotations

import threading

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


class Services:
    """Components that the endpoints use; nothing is opened or started yet.

    The fork server reads uploads; `reading` is their queue.  The engine computes the fits and is
    closed by the supervisor.  The watcher runs in the event loop, the housekeeper in its own
    thread.  `stopping` is set when the service is about to stop.
    """

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.database = database = Database(settings.sqlalchemy_url)
        self.storage = storage = Storage(settings.data_dir, settings.node)
        self.metrics = metrics = Metrics()
        self.fork_server = ForkServer("app.runs.parser", temporary=storage.incoming)
        limits = ProcessLimits(
            settings.read_memory_bytes, settings.read_cpu_s, settings.read_wall_s
        )
        reader = RunReader(self.fork_server, limits, settings.max_rows)
        # Most services predict nothing: the first prediction starts this fork server.
        self.predictors = ForkServer("app.analyses.predictor", temporary=storage.incoming)
        predictor = Predictor(self.predictors, limits, settings.max_rows)
        self.engine = _engine(settings, storage)
        self.supervisor = Supervisor(database, storage, self.engine, settings, metrics)
        self.access = AccessService(database)
        quotas = Quotas(settings.quota_bytes, settings.quota_runs, settings.quota_waiting_fits)
        self.runs = RunService(database, storage, reader, metrics, quotas)
        self.reading = ReadingQueue(settings.readers, settings.waiting_uploads)
        self.pending = PendingRuns(database, storage, reader, quotas)
        self.choice = RunChoice(database, storage, reader)
        self.fits = FitService(database, storage, self.supervisor, quotas)
        self.watcher = Watcher(database, self.access, settings.streams_per_key)
        self.batches = BatchService(database, storage, self.supervisor, quotas)
        self.analyses = AnalysisService(self.fits, self.runs, storage, predictor)
        self.health = HealthService(database, storage, self.supervisor, metrics)
        self.retention = Retention(database, storage, metrics, settings.retention_days)
        self.housekeeper = Housekeeper(self.access, self.retention, settings.sweep_s)
        self.stopping = threading.Event()

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
        """Open what is not open yet, and start the threads and processes."""
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
        self.predictors.stop()
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
