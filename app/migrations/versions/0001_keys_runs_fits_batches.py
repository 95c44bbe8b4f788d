"""Create the tables of keys, sessions, runs, batches and fits.

Written out and not taken from `app.tables`: a released version must not change with the tables.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

__all__ = ["down_revision", "revision", "upgrade"]

revision = "0001"
down_revision = None


def upgrade() -> None:
    """Create all tables."""
    _keys_and_sessions()
    _runs()
    _batches()
    _fits()


def _keys_and_sessions() -> None:
    op.create_table(
        "keys",
        sa.Column("id", sa.String(40), primary_key=True),
        sa.Column("workspace", sa.String(100), nullable=False),
        sa.Column("name", sa.String(200), nullable=False),
        sa.Column("digest", sa.String(64), nullable=False, unique=True),
        sa.Column("created_at", sa.Double, nullable=False),
        sa.Column("revoked_at", sa.Double),
    )
    op.create_table(
        "sessions",
        sa.Column("digest", sa.String(64), primary_key=True),
        sa.Column(
            "key_id", sa.String(40), sa.ForeignKey("keys.id", ondelete="CASCADE"), nullable=False
        ),
        sa.Column("expires_at", sa.Double, nullable=False),
    )


def _runs() -> None:
    op.create_table(
        "runs",
        sa.Column("id", sa.String(40), primary_key=True),
        sa.Column("workspace", sa.String(100), nullable=False),
        sa.Column("sha256", sa.String(64), nullable=False),
        sa.Column("mapping_sha256", sa.String(64), nullable=False),
        sa.Column("mapping", sa.JSON),
        sa.Column("file", sa.String(255), nullable=False),
        sa.Column("motor", sa.String(200)),
        sa.Column("bytes", sa.BigInteger, nullable=False),
        sa.Column("rows", sa.Integer, nullable=False),
        sa.Column("sample_rate_hz", sa.Double, nullable=False),
        sa.Column("duration_s", sa.Double, nullable=False),
        sa.Column("channels", sa.JSON, nullable=False),
        sa.Column("warnings", sa.JSON, nullable=False),
        sa.Column("created_at", sa.Double, nullable=False),
        sa.UniqueConstraint("workspace", "sha256", "mapping_sha256", name="uq_runs_content"),
    )
    op.create_index("ix_runs_workspace_created", "runs", ["workspace", "created_at"])


def _batches() -> None:
    op.create_table(
        "batches",
        sa.Column("id", sa.String(40), primary_key=True),
        sa.Column("workspace", sa.String(100), nullable=False),
        sa.Column("name", sa.String(200)),
        sa.Column("created_at", sa.Double, nullable=False),
        sa.Column("idempotency_key", sa.String(255)),
        sa.Column("request_sha256", sa.String(64), nullable=False),
        sa.UniqueConstraint("workspace", "idempotency_key", name="uq_batches_idempotency"),
    )
    op.create_index("ix_batches_workspace_created", "batches", ["workspace", "created_at"])


def _fits() -> None:
    op.create_table(
        "fits",
        sa.Column("id", sa.String(40), primary_key=True),
        sa.Column("workspace", sa.String(100), nullable=False),
        sa.Column("motor", sa.String(200)),
        sa.Column("options", sa.JSON, nullable=False),
        sa.Column("status", sa.String(10), nullable=False),
        sa.Column("stage", sa.String(100), nullable=False),
        sa.Column("fraction", sa.Double, nullable=False),
        sa.Column("version", sa.Integer, nullable=False),
        sa.Column("attempt", sa.Integer, nullable=False),
        sa.Column("failures", sa.Integer, nullable=False),
        sa.Column("owner", sa.String(200)),
        sa.Column("lease_until", sa.Double),
        sa.Column("error", sa.JSON),
        sa.Column("created_at", sa.Double, nullable=False),
        sa.Column("started_at", sa.Double),
        sa.Column("ended_at", sa.Double),
        sa.Column("idempotency_key", sa.String(255)),
        sa.Column("request_sha256", sa.String(64), nullable=False),
        sa.Column("batch_id", sa.String(40), sa.ForeignKey("batches.id", ondelete="CASCADE")),
        sa.Column("position", sa.Integer, nullable=False),
        sa.UniqueConstraint("workspace", "idempotency_key", name="uq_fits_idempotency"),
    )
    op.create_index("ix_fits_workspace_created", "fits", ["workspace", "created_at"])
    op.create_index("ix_fits_queue", "fits", ["status", "created_at", "position"])
    op.create_index("ix_fits_batch", "fits", ["batch_id", "position"])
    op.create_table(
        "fit_runs",
        sa.Column(
            "fit_id",
            sa.String(40),
            sa.ForeignKey("fits.id", ondelete="CASCADE"),
            primary_key=True,
        ),
        sa.Column("role", sa.String(10), primary_key=True),
        sa.Column("position", sa.Integer, primary_key=True),
        sa.Column("run_id", sa.String(40), nullable=False),
    )
    op.create_index("ix_fit_runs_run_id", "fit_runs", ["run_id"])
