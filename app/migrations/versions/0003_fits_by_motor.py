"""Add an index to find the fits of one motor without scanning all fits."""

from __future__ import annotations

from alembic import op

__all__ = ["down_revision", "revision", "upgrade"]

revision = "0003"
down_revision = "access_0001"

_INDEX = "ix_fits_motor"


def upgrade() -> None:
    """Create the index."""
    op.create_index(_INDEX, "fits", ["workspace", "motor", "created_at"])
