"""Readiness checks and metrics of the service."""

from __future__ import annotations

import time

from prometheus_client import generate_latest
from sqlalchemy import func, select
from sqlalchemy.exc import SQLAlchemyError

from app.database import Database
from app.fits.supervisor import Supervisor
from app.metrics import Metrics
from app.storage import Storage
from app.tables import FitRow, RunRow

__all__ = ["HealthService"]

_STATES = ("queued", "running", "succeeded", "failed", "cancelled")


class HealthService:
    """Readiness checks of the database, the storage and the supervisor, and all metrics."""

    def __init__(
        self, database: Database, storage: Storage, supervisor: Supervisor, metrics: Metrics
    ) -> None:
        self._database = database
        self._storage = storage
        self._supervisor = supervisor
        self._metrics = metrics

    def checks(self) -> dict[str, bool]:
        """Outcome of each readiness check, by name."""
        return {
            "database": self._answers(),
            "storage": self._storage.is_writable(),
            "supervisor": self._supervisor.is_alive,
        }

    def metrics(self) -> bytes:
        """Metrics in the text format of Prometheus; the gauges are updated first."""
        with self._database.reading() as session:
            query = select(FitRow.status, func.count(), func.min(FitRow.created_at))
            fits = {row[0]: row for row in session.execute(query.group_by(FitRow.status))}
            number, stored = session.execute(select(func.count(), func.sum(RunRow.bytes))).one()
        for status in _STATES:
            self._metrics.fits.labels(status).set(fits[status][1] if status in fits else 0)
        self._metrics.stored_runs.set(number)
        self._metrics.stored_bytes.set(stored or 0)
        self._metrics.free_bytes.set(self._storage.free_bytes())
        age = max(0.0, time.time() - fits["queued"][2]) if "queued" in fits else 0.0
        self._metrics.oldest_queued_seconds.set(age)
        return generate_latest(self._metrics.registry)

    def _answers(self) -> bool:
        try:
            with self._database.reading() as session:
                session.execute(select(1))
        except SQLAlchemyError:
            return False
        return not self._database.is_damaged
