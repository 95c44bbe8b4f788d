"""Database queries of fits, except those of their queue (`app.fits.queue`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy import ColumnElement, delete, insert, select, update
from sqlalchemy.orm import Session

from app.database import portions
from app.fits.request import FitRequest
from app.tables import FitRow, FitRunRow

__all__ = ["ENDED", "RELEASED", "add", "cancel", "changed", "changes", "remove", "run_ids"]

ENDED = ("succeeded", "failed", "cancelled")
"""Final states of a fit."""

RELEASED: dict[str, Any] = {"owner": None, "lease_until": None}
"""Values of the columns of a fit that no server holds."""


def add(session: Session, *fits: tuple[FitRow, FitRequest]) -> None:
    """Insert fits with the assignment of their runs."""
    session.add_all(row for row, _ in fits)
    session.flush()
    # Use plain rows: ORM objects would hold the write lock many times as long.
    rows = [
        {"fit_id": row.id, "role": role, "position": position, "run_id": run_id}
        for row, request in fits
        for role, ids in (("training", request.training), ("validation", request.validation))
        for position, run_id in enumerate(ids)
    ]
    session.connection().execute(insert(FitRunRow), rows)


def run_ids(session: Session, fit_ids: Sequence[str]) -> dict[str, dict[str, list[str]]]:
    """IDs of the runs of several fits, in order, by fit and role."""
    found: dict[str, dict[str, list[str]]] = {
        fit_id: {"training": [], "validation": []} for fit_id in fit_ids
    }
    for some in portions(fit_ids):
        # Select columns: a page of fits can have 100,000 runs, too many for ORM objects.
        query = (
            select(FitRunRow.fit_id, FitRunRow.role, FitRunRow.run_id)
            .where(FitRunRow.fit_id.in_(some))
            .order_by(FitRunRow.fit_id, FitRunRow.role, FitRunRow.position)
        )
        for fit_id, role, run_id in session.execute(query):
            found[fit_id][role].append(run_id)
    return found


def changes(session: Session, versions: Mapping[str, int]) -> dict[str, FitRow | None]:
    """Fits whose version differs from the known one, by ID; None for a deleted fit."""
    found: dict[str, FitRow | None] = {}
    for asked in portions(list(versions)):
        query = select(FitRow.id, FitRow.version).where(FitRow.id.in_(asked))
        now = {fit_id: version for fit_id, version in session.execute(query)}
        changed = [fit_id for fit_id in now if now[fit_id] != versions[fit_id]]
        if changed:
            rows = session.scalars(select(FitRow).where(FitRow.id.in_(changed)))
            found |= {row.id: row for row in rows}
        found |= dict.fromkeys(fit_id for fit_id in asked if fit_id not in now)
    return found


def cancel(session: Session, wanted: str, now: float, *, of_batch: bool = False) -> int:
    """Cancel the unfinished fit, or fits of a batch, with an ID; return how many there are."""
    column = FitRow.batch_id if of_batch else FitRow.id
    is_unfinished = column == wanted, FitRow.status.not_in(ENDED)
    return changed(session, *is_unfinished, status="cancelled", ended_at=now, **RELEASED)


def remove(session: Session, fit_id: str) -> None:
    """Delete a fit."""
    session.execute(delete(FitRow).where(FitRow.id == fit_id))


def changed(
    session: Session, *conditions: ColumnElement[bool], step: int = 1, **values: Any
) -> int:
    """Update the fits that meet all conditions, and their versions; return their number."""
    statement = update(FitRow).where(*conditions).values(version=FitRow.version + step, **values)
    result = session.execute(
        statement.returning(FitRow.id), execution_options={"synchronize_session": False}
    )
    return len(result.all())
