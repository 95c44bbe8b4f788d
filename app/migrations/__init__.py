"""Schema versions, oldest first; Alembic upgrades a database to the newest."""

from __future__ import annotations

__all__ = ["NEWEST"]

NEWEST = "0008"
"""Schema version that the code requires; a test compares it with the files in versions/."""
