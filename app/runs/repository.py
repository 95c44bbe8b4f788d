"""Database queries of runs."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import delete, func, select, update
from sqlalchemy.orm import Session

from app.database import portions
from app.tables import FitRow, FitRunRow, PendingRow, RunRow

__all__ = [
    "MEASURED",
    "add",
    "all_ids",
    "by_content",
    "hashes",
    "note_sent",
    "remove",
    "totals",
    "waiting_fit",
]

MEASURED = ("rows", "sample_rate_hz", "duration_s", "channels", "warnings")
"""Columns of a run that the reader finds in its file."""


def add(session: Session, row: RunRow) -> None:
    """Insert a run."""
    session.add(row)


def hashes(session: Session, workspace: str, run_ids: Sequence[str]) -> dict[str, str]:
    """SHA-256 of those runs that exist, by ID.

    The rows stay locked against deletion until the session ends.
    """
    # SQLite rates an index on the workspace as more selective than 500 IDs and would read all runs
    # of the workspace in each query.  No index applies to an expression.
    is_theirs = RunRow.workspace.concat("") == workspace
    found: dict[str, str] = {}
    for some in portions(run_ids):
        query = select(RunRow.id, RunRow.sha256).where(RunRow.id.in_(some), is_theirs)
        rows = session.execute(query.with_for_update(read=True))
        found.update((run_id, sha256) for run_id, sha256 in rows)
    return found


def by_content(session: Session, workspace: str, sha256: str, mapping_sha256: str) -> RunRow | None:
    """Run with these bytes and this mapping, or None."""
    query = select(RunRow).where(
        RunRow.workspace == workspace,
        RunRow.sha256 == sha256,
        RunRow.mapping_sha256 == mapping_sha256,
    )
    return session.scalars(query).one_or_none()


def waiting_fit(session: Session, run_id: str) -> str | None:
    """ID of an unfinished fit that needs the run, or None."""
    query = (
        select(FitRow.id)
        .join(FitRunRow, FitRunRow.fit_id == FitRow.id)
        .where(FitRunRow.run_id == run_id, FitRow.status.in_(("queued", "running")))
        .limit(1)
    )
    return session.scalars(query).one_or_none()


def note_sent(session: Session, run_id: str, now: float) -> None:
    """Record the time of a repeated upload."""
    session.execute(update(RunRow).where(RunRow.id == run_id).values(sent_at=now))


def totals(session: Session) -> tuple[int, int]:
    """Number of all runs of all workspaces, and total size of their files [bytes]."""
    query = select(func.count(), func.coalesce(func.sum(RunRow.bytes), 0)).select_from(RunRow)
    number, stored = session.execute(query).one()
    return int(number), int(stored)


def remove(session: Session, run_id: str) -> None:
    """Delete a run."""
    session.execute(delete(RunRow).where(RunRow.id == run_id))


def all_ids(session: Session) -> set[str]:
    """IDs of all runs of all workspaces, pending ones included."""
    return {*session.scalars(select(RunRow.id)), *session.scalars(select(PendingRow.id))}
