"""Database queries of batches."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import case, delete, func, select, update
from sqlalchemy.orm import Session

from app.database import portions
from app.fits.repository import ENDED, RELEASED
from app.tables import BatchRow, FitRow

__all__ = ["add", "cancel", "counts", "earlier", "fit_ids", "fractions", "remove"]


def add(session: Session, row: BatchRow) -> None:
    """Insert a batch."""
    session.add(row)
    session.flush()


def counts(session: Session, batch_ids: Sequence[str]) -> dict[str, dict[str, int]]:
    """Number of fits in each state, by batch ID."""
    query = (
        select(FitRow.batch_id, FitRow.status, func.count())
        .where(FitRow.batch_id.in_(batch_ids))
        .group_by(FitRow.batch_id, FitRow.status)
    )
    found: dict[str, dict[str, int]] = {batch_id: {} for batch_id in batch_ids}
    for batch_id, status, number in session.execute(query):
        found[str(batch_id)][status] = number
    return found


def fractions(session: Session, batch_ids: Sequence[str]) -> dict[str, float]:
    """Completed fraction of each batch by ID; an ended fit counts as 1 in any final state."""
    done = case((FitRow.status.in_(ENDED), 1.0), else_=FitRow.fraction)
    query = (
        select(FitRow.batch_id, func.avg(done))
        .where(FitRow.batch_id.in_(batch_ids))
        .group_by(FitRow.batch_id)
    )
    found = {str(batch_id): float(share) for batch_id, share in session.execute(query)}
    return {batch_id: found.get(batch_id, 1.0) for batch_id in batch_ids}


def cancel(session: Session, batch_id: str, now: float) -> int:
    """Cancel the unfinished fits of a batch; return their number."""
    statement = (
        update(FitRow)
        .where(FitRow.batch_id == batch_id, FitRow.status.not_in(ENDED))
        .values(version=FitRow.version + 1, status="cancelled", ended_at=now, **RELEASED)
        .returning(FitRow.id)
    )
    options = {"synchronize_session": False}
    return len(session.scalars(statement, execution_options=options).all())


def fit_ids(session: Session, batch_id: str) -> Sequence[str]:
    """IDs of the fits of a batch."""
    return session.scalars(select(FitRow.id).where(FitRow.batch_id == batch_id)).all()


def remove(session: Session, batch_id: str) -> None:
    """Delete a batch and its fits."""
    session.execute(delete(FitRow).where(FitRow.batch_id == batch_id))
    session.execute(delete(BatchRow).where(BatchRow.id == batch_id))


def earlier(
    session: Session, workspace: str, motors: Sequence[str], before: float
) -> dict[str, FitRow]:
    """Newest succeeded fit of each motor that was requested before a given time, by motor."""
    found: dict[str, FitRow] = {}
    for some in portions(motors):
        newest = (
            select(FitRow.motor, func.max(FitRow.created_at).label("created_at"))
            .where(
                FitRow.workspace == workspace,
                FitRow.motor.in_(some),
                FitRow.status == "succeeded",
                FitRow.created_at < before,
            )
            .group_by(FitRow.motor)
            .subquery()
        )
        query = (
            select(FitRow)
            .join(
                newest,
                (FitRow.motor == newest.c.motor) & (FitRow.created_at == newest.c.created_at),
            )
            .where(FitRow.workspace == workspace, FitRow.status == "succeeded")
            # Fits of one batch share their creation time; the last one of a motor counts.
            .order_by(FitRow.position)
        )
        found |= {str(row.motor): row for row in session.scalars(query)}
    return found
