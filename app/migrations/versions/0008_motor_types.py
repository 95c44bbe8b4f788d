"""Add the type of the motor of a fit in a batch."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

__all__ = ["down_revision", "revision", "upgrade"]

revision = "0008"
down_revision = "0007"


def upgrade() -> None:
    """Add the column; motors of earlier batches have no type."""
    op.add_column("fits", sa.Column("motor_type", sa.String(200)))
