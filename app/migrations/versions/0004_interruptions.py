"""Add a count of server kills per fit, separate from the number of attempts."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

__all__ = ["down_revision", "revision", "upgrade"]

revision = "0004"
down_revision = "0003"


def upgrade() -> None:
    """Add the column; earlier interruptions are not counted."""
    count = sa.Column("interruptions", sa.Integer, nullable=False, server_default="0")
    op.add_column("fits", count)
