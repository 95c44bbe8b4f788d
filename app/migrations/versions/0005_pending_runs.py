"""Create the tables of uploads that are not yet runs, and of the mappings of test benches."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

__all__ = ["down_revision", "revision", "upgrade"]

revision = "0005"
down_revision = "0004"

_INDEX = "ix_pending_runs_workspace_created"


def upgrade() -> None:
    """Create the tables."""
    op.create_table(
        "pending_runs",
        sa.Column("id", sa.String(40), primary_key=True),
        sa.Column("workspace", sa.String(100), nullable=False),
        sa.Column("sha256", sa.String(64), nullable=False),
        sa.Column("bytes", sa.BigInteger, nullable=False),
        sa.Column("file", sa.String(255), nullable=False),
        sa.Column("motor", sa.String(200)),
        sa.Column("bench", sa.String(200)),
        sa.Column("mapping", sa.JSON),
        sa.Column("found", sa.JSON, nullable=False),
        sa.Column("created_at", sa.Double, nullable=False),
    )
    op.create_index(_INDEX, "pending_runs", ["workspace", "created_at"])
    op.create_table(
        "benches",
        sa.Column("workspace", sa.String(100), primary_key=True),
        sa.Column("name", sa.String(200), primary_key=True),
        sa.Column("mapping", sa.JSON, nullable=False),
        sa.Column("changed_at", sa.Double, nullable=False),
    )
