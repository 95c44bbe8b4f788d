"""Add a count of server kills per fit, separate from the number of attempts."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

__all__ = ["branch_labels", "depends_on", "down_revision", "downgrade", "revision", "upgrade"]

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the column; earlier interruptions are not counted."""
    count = sa.Column("interruptions", sa.Integer, nullable=False, server_default="0")
    op.add_column("fits", count)


def downgrade() -> None:
    """Drop the column."""
    with op.batch_alter_table("fits") as batch:
        batch.drop_column("interruptions")
