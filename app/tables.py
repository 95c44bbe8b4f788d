"""SQLAlchemy tables: all persistent state of the service except files.

Times are seconds since 1970 (UTC), because leases are compared in SQL and both databases compare
numbers alike.  `app.migrations` creates the tables; a test checks that both agree.
"""

from __future__ import annotations

from typing import Any

from sqlalchemy import (
    JSON,
    BigInteger,
    Double,
    ForeignKey,
    Index,
    Integer,
    String,
    UniqueConstraint,
    true,
)
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

__all__ = [
    "BatchRow",
    "BenchRow",
    "FitRow",
    "FitRunRow",
    "KeyRow",
    "Owned",
    "PendingRow",
    "RunRow",
    "SessionRow",
    "Tables",
]


class Tables(DeclarativeBase):
    """Base class with the metadata of all tables."""

    type_annotation_map = {float: Double, dict[str, Any]: JSON, list[Any]: JSON}  # noqa: RUF012


class Owned:
    """Columns of everything that a workspace owns."""

    id: Mapped[str] = mapped_column(String(40), primary_key=True)
    workspace: Mapped[str] = mapped_column(String(100))
    created_at: Mapped[float]


class KeyRow(Owned, Tables):
    """API key, stored as its hash only.  `last_used_at` may lag by some minutes.

    An owner manages the keys of its workspace.
    """

    __tablename__ = "keys"

    name: Mapped[str] = mapped_column(String(200))
    digest: Mapped[str] = mapped_column(String(64), unique=True)
    revoked_at: Mapped[float | None]
    expires_at: Mapped[float | None]
    last_used_at: Mapped[float | None]
    owner: Mapped[bool] = mapped_column(server_default=true())


class SessionRow(Tables):
    """Browser session; only the hash of its cookie is stored."""

    __tablename__ = "sessions"

    digest: Mapped[str] = mapped_column(String(64), primary_key=True)
    key_id: Mapped[str] = mapped_column(ForeignKey("keys.id", ondelete="CASCADE"))
    expires_at: Mapped[float]


class RunRow(Owned, Tables):
    """Accepted run; its bytes are in the data directory under its id.

    `sent_at` is the time of a repeated upload of the same bytes, or None.  `role` is the role that
    the user chose on the page: "training", "validation", "" (unused), or None (not chosen yet).
    """

    __tablename__ = "runs"
    __table_args__ = (
        UniqueConstraint("workspace", "sha256", "mapping_sha256", name="uq_runs_content"),
        Index("ix_runs_workspace_created", "workspace", "created_at"),
    )

    sha256: Mapped[str] = mapped_column(String(64))
    mapping_sha256: Mapped[str] = mapped_column(String(64))
    mapping: Mapped[dict[str, Any] | None] = mapped_column(JSON)
    file: Mapped[str] = mapped_column(String(255))
    motor: Mapped[str | None] = mapped_column(String(200))
    bytes: Mapped[int] = mapped_column(BigInteger)
    rows: Mapped[int] = mapped_column(Integer)
    sample_rate_hz: Mapped[float]
    duration_s: Mapped[float]
    channels: Mapped[dict[str, Any]]
    warnings: Mapped[list[Any]]
    sent_at: Mapped[float | None]
    role: Mapped[str | None] = mapped_column(String(10))


class PendingRow(Owned, Tables):
    """Uploaded file that is not yet confirmed as a run; its bytes are stored under its id.

    `found` is what the reader found in the file with `mapping`.  A confirmed file becomes a run
    with the same id.
    """

    __tablename__ = "pending_runs"
    __table_args__ = (Index("ix_pending_runs_workspace_created", "workspace", "created_at"),)

    sha256: Mapped[str] = mapped_column(String(64))
    bytes: Mapped[int] = mapped_column(BigInteger)
    file: Mapped[str] = mapped_column(String(255))
    motor: Mapped[str | None] = mapped_column(String(200))
    bench: Mapped[str | None] = mapped_column(String(200))
    mapping: Mapped[dict[str, Any] | None] = mapped_column(JSON)
    found: Mapped[dict[str, Any]]


class BenchRow(Tables):
    """Mapping of the files of one test bench, for the next files from it."""

    __tablename__ = "benches"

    workspace: Mapped[str] = mapped_column(String(100), primary_key=True)
    name: Mapped[str] = mapped_column(String(200), primary_key=True)
    mapping: Mapped[dict[str, Any]]
    changed_at: Mapped[float]


class BatchRow(Owned, Tables):
    """Batch; its fits refer to it by `batch_id`."""

    __tablename__ = "batches"
    __table_args__ = (
        UniqueConstraint("workspace", "idempotency_key", name="uq_batches_idempotency"),
        Index("ix_batches_workspace_created", "workspace", "created_at"),
    )

    name: Mapped[str | None] = mapped_column(String(200))
    idempotency_key: Mapped[str | None] = mapped_column(String(255))
    request_sha256: Mapped[str] = mapped_column(String(64))


class FitRow(Owned, Tables):
    """Fit, from acceptance to end.

    `attempt` counts the starts of the fit.  Every write while the fit runs is conditional on it, so
    that an abandoned attempt cannot write.  `failures` counts attempts that ended by themselves
    without a result, `interruptions` those during which the server was killed.  `version` increases
    with each change.
    """

    __tablename__ = "fits"
    __table_args__ = (
        UniqueConstraint("workspace", "idempotency_key", name="uq_fits_idempotency"),
        Index("ix_fits_workspace_created", "workspace", "created_at"),
        Index("ix_fits_queue", "status", "created_at", "position"),
        Index("ix_fits_batch", "batch_id", "position"),
        Index("ix_fits_motor", "workspace", "motor", "created_at"),
    )

    motor: Mapped[str | None] = mapped_column(String(200))
    motor_type: Mapped[str | None] = mapped_column(String(200))
    options: Mapped[dict[str, Any]]
    status: Mapped[str] = mapped_column(String(10))
    stage: Mapped[str] = mapped_column(String(100))
    fraction: Mapped[float]
    version: Mapped[int] = mapped_column(Integer)
    attempt: Mapped[int] = mapped_column(Integer)
    failures: Mapped[int] = mapped_column(Integer)
    interruptions: Mapped[int] = mapped_column(Integer, server_default="0")
    owner: Mapped[str | None] = mapped_column(String(200))
    lease_until: Mapped[float | None]
    error: Mapped[dict[str, Any] | None] = mapped_column(JSON)
    started_at: Mapped[float | None]
    ended_at: Mapped[float | None]
    idempotency_key: Mapped[str | None] = mapped_column(String(255))
    request_sha256: Mapped[str] = mapped_column(String(64))
    batch_id: Mapped[str | None] = mapped_column(ForeignKey("batches.id", ondelete="CASCADE"))
    position: Mapped[int] = mapped_column(Integer)


class FitRunRow(Tables):
    """Run of a fit.  Its id is no foreign key, because the run may be deleted after the fit."""

    __tablename__ = "fit_runs"

    fit_id: Mapped[str] = mapped_column(ForeignKey("fits.id", ondelete="CASCADE"), primary_key=True)
    role: Mapped[str] = mapped_column(String(10), primary_key=True)
    position: Mapped[int] = mapped_column(Integer, primary_key=True)
    run_id: Mapped[str] = mapped_column(String(40), index=True)
