"""Add the type of the motor of a fit in a batch."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

__all__ = ["branch_labels", "depends_on", "down_revision", "downgrade", "revision", "upgrade"]

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the column; motors of earlier batches have no type."""
    op.add_column("fits", sa.Column("motor_type", sa.String(200)))


def downgrade() -> None:
    """Drop the column."""
    with op.batch_alter_table("fits") as batch:
        batch.drop_column("motor_type")
