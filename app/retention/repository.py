"""Database queries of retention; the caller owns the transaction.

Expired rows are searched for in read transactions, which block no writer, and are
deleted in portions.

A fit has expired if it ended before a cutoff time.  A fit of a batch has expired only if the whole
batch has, so that a batch is deleted as a whole.  A run has expired if its latest upload was before
the cutoff and no fit names it.
"""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import ColumnElement, delete, exists, func, or_, select
from sqlalchemy.orm import Session

from app.fits.repository import ENDED
from app.tables import BatchRow, FitRow, FitRunRow, PendingRow, RunRow

__all__ = [
    "old_fits",
    "old_runs",
    "remove_fits",
    "remove_old_batches",
    "remove_old_pending",
    "remove_old_runs",
]


def old_fits(session: Session, before: float) -> Sequence[str]:
    """IDs of the fits that have expired at a cutoff time, in order of their ends.

    An ended fit never starts again and a batch never gains fits, so an expired fit stays expired.
    """
    # Evaluate this subquery once.  A subquery per fit would read the other fits of its batch up to
    # a thousand times.
    young = select(FitRow.batch_id).where(
        FitRow.batch_id.is_not(None), or_(FitRow.ended_at.is_(None), FitRow.ended_at >= before)
    )
    query = (
        select(FitRow.id)
        .where(
            FitRow.status.in_(ENDED),
            FitRow.ended_at < before,
            or_(FitRow.batch_id.is_(None), FitRow.batch_id.not_in(young)),
        )
        .order_by(FitRow.ended_at)
    )
    return session.scalars(query).all()


def remove_fits(session: Session, fit_ids: Sequence[str]) -> None:
    """Delete fits."""
    session.execute(delete(FitRow).where(FitRow.id.in_(fit_ids)))


def remove_old_batches(session: Session, before: float) -> int:
    """Delete batches created before a cutoff that have no fit left; return their number."""
    has_fit = exists().where(FitRow.batch_id == BatchRow.id)
    removed = session.scalars(
        delete(BatchRow)
        .where(BatchRow.created_at < before, ~has_fit)
        .returning(BatchRow.id)
        .execution_options(synchronize_session=False)
    )
    return len(removed.all())


def old_runs(session: Session, before: float) -> Sequence[str]:
    """IDs of the runs that have expired at a cutoff time, in order of their first upload."""
    query = select(RunRow.id).where(*_is_old(before)).order_by(RunRow.created_at)
    return session.scalars(query).all()


def remove_old_runs(session: Session, run_ids: Sequence[str], before: float) -> Sequence[str]:
    """Delete those of the given runs that are still expired.

    Returns:
        IDs of the deleted runs.
    """
    query = select(RunRow.id).where(RunRow.id.in_(run_ids)).with_for_update(skip_locked=True)
    ids = session.scalars(query).all()
    # Check again now that the rows are locked: a new fit may have named one of the runs.
    removed = session.scalars(
        delete(RunRow)
        .where(RunRow.id.in_(ids), *_is_old(before))
        .returning(RunRow.id)
        .execution_options(synchronize_session=False)
    )
    return removed.all()


def remove_old_pending(session: Session, before: float) -> Sequence[str]:
    """Delete uploads before a cutoff that were never confirmed as runs; return their IDs."""
    removed = session.scalars(
        delete(PendingRow)
        .where(PendingRow.created_at < before)
        .returning(PendingRow.id)
        .execution_options(synchronize_session=False)
    )
    return removed.all()


def _is_old(before: float) -> tuple[ColumnElement[bool], ...]:
    is_named = exists().where(FitRunRow.run_id == RunRow.id)
    return func.coalesce(RunRow.sent_at, RunRow.created_at) < before, ~is_named
