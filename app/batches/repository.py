"""Batches in the database, each query within one workspace."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import case, delete, func, select, tuple_, update
from sqlalchemy.orm import Session

from app.fits.repository import ENDED
from app.portions import portions
from app.tables import BatchRow, FitRow

__all__ = [
    "add",
    "by_key",
    "cancel",
    "counts",
    "earlier",
    "fit_ids",
    "fractions",
    "get",
    "page",
    "remove",
]


def add(session: Session, row: BatchRow) -> None:
    """Keep a batch."""
    session.add(row)
    session.flush()


def get(session: Session, workspace: str, batch_id: str) -> BatchRow | None:
    """A batch, or None."""
    query = select(BatchRow).where(BatchRow.workspace == workspace, BatchRow.id == batch_id)
    return session.scalars(query).one_or_none()


def by_key(session: Session, workspace: str, idempotency_key: str) -> BatchRow | None:
    """The batch that was asked for under an Idempotency-Key, or None."""
    query = select(BatchRow).where(
        BatchRow.workspace == workspace, BatchRow.idempotency_key == idempotency_key
    )
    return session.scalars(query).one_or_none()


def page(
    session: Session, workspace: str, *, after: tuple[float, str] | None, limit: int
) -> Sequence[BatchRow]:
    """Batches, newest first; `after` is time and id of the last one of the page before."""
    query = select(BatchRow).where(BatchRow.workspace == workspace)
    if after is not None:
        query = query.where(tuple_(BatchRow.created_at, BatchRow.id) < tuple_(*after))
    return session.scalars(
        query.order_by(BatchRow.created_at.desc(), BatchRow.id.desc()).limit(limit)
    ).all()


def counts(session: Session, batch_ids: Sequence[str]) -> dict[str, dict[str, int]]:
    """How many fits of some batches are in each state, by batch."""
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
    """Share of some batches that is done, by batch; a fit that ended is done, however it ended."""
    done = case((FitRow.status.in_(ENDED), 1.0), else_=FitRow.fraction)
    query = (
        select(FitRow.batch_id, func.avg(done))
        .where(FitRow.batch_id.in_(batch_ids))
        .group_by(FitRow.batch_id)
    )
    found = {str(batch_id): float(share) for batch_id, share in session.execute(query)}
    return {batch_id: found.get(batch_id, 1.0) for batch_id in batch_ids}


def cancel(session: Session, batch_id: str, now: float) -> int:
    """End the fits of a batch that have not ended; gives their number."""
    statement = (
        update(FitRow)
        .where(FitRow.batch_id == batch_id, FitRow.status.not_in(ENDED))
        .values(
            version=FitRow.version + 1,
            status="cancelled",
            ended_at=now,
            owner=None,
            lease_until=None,
        )
        .returning(FitRow.id)
    )
    options = {"synchronize_session": False}
    return len(session.scalars(statement, execution_options=options).all())


def fit_ids(session: Session, batch_id: str) -> Sequence[str]:
    """Ids of the fits of a batch."""
    return session.scalars(select(FitRow.id).where(FitRow.batch_id == batch_id)).all()


def remove(session: Session, batch_id: str) -> None:
    """Forget a batch and its fits."""
    session.execute(delete(FitRow).where(FitRow.batch_id == batch_id))
    session.execute(delete(BatchRow).where(BatchRow.id == batch_id))


def earlier(
    session: Session, workspace: str, motors: Sequence[str], before: float
) -> dict[str, FitRow]:
    """The newest fit of each motor that succeeded and was asked for before a time, by motor.

    Args:
        session: Session of the database.
        workspace: Workspace of the caller.
        motors: Which motors.
        before: The time [s since 1970].
    """
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
            # Fits of one batch share their time; the last of a motor counts.
            .order_by(FitRow.position)
        )
        found |= {str(row.motor): row for row in session.scalars(query)}
    return found
