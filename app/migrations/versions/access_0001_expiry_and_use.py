"""Add expiry and last use of keys, and the time of repeated uploads of runs."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

__all__ = ["branch_labels", "depends_on", "down_revision", "downgrade", "revision", "upgrade"]

revision = "access_0001"
down_revision = "0001"
branch_labels = None
depends_on = None

_COLUMNS = (("keys", "expires_at"), ("keys", "last_used_at"), ("runs", "sent_at"))


def upgrade() -> None:
    """Add the columns, empty."""
    for table, column in _COLUMNS:
        op.add_column(table, sa.Column(column, sa.Double))


def downgrade() -> None:
    """Drop the columns."""
    for table, column in reversed(_COLUMNS):
        with op.batch_alter_table(table) as batch:
            batch.drop_column(column)
