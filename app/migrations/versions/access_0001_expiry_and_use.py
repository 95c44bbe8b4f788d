"""Add expiry and last use of keys, and the time of repeated uploads of runs."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

__all__ = ["down_revision", "revision", "upgrade"]

revision = "access_0001"
down_revision = "0001"

_COLUMNS = (("keys", "expires_at"), ("keys", "last_used_at"), ("runs", "sent_at"))


def upgrade() -> None:
    """Add the columns, empty."""
    for table, column in _COLUMNS:
        op.add_column(table, sa.Column(column, sa.Double))
