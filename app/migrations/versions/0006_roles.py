"""Add the role of a run that the user chose on the page."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

__all__ = ["down_revision", "revision", "upgrade"]

revision = "0006"
down_revision = "0005"


def upgrade() -> None:
    """Add the column; no role is chosen."""
    op.add_column("runs", sa.Column("role", sa.String(10)))
