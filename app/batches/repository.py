"""Batches in the database, each query within one workspace."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import func, select, tuple_
from sqlalchemy.orm import Session

from app.tables import BatchRow, FitRow

__all__ = ["add", "by_key", "counts", "get", "page"]


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
