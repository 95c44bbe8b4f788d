"""Add whether a key may manage the keys of its workspace."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

__all__ = ["down_revision", "revision", "upgrade"]

revision = "0007"
down_revision = "0006"


def upgrade() -> None:
    """Add the column; existing keys, which could manage keys, remain owners."""
    op.add_column("keys", sa.Column("owner", sa.Boolean, nullable=False, server_default=sa.true()))
