"""Versions of the tables, oldest first; Alembic brings a database to the newest."""

from __future__ import annotations

__all__ = ["NEWEST"]

NEWEST = "0004"
"""The version that the code needs; a test compares it with the files beside this one."""
