"""What of the tables is old, and its removal; each function in one transaction of the caller.

A fit is old when it ended before a moment; in a batch, when the whole batch did, so that a batch
goes at once.  A run is old when it came, and came last again, before that moment and no fit names
it.
"""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import delete, exists, func, or_, select
from sqlalchemy.orm import Session, aliased

from app.fits.repository import ENDED
from app.tables import BatchRow, FitRow, FitRunRow, RunRow

__all__ = ["remove_old_batches", "remove_old_fits", "remove_old_runs"]


def remove_old_fits(session: Session, before: float, most: int) -> Sequence[str]:
    """Forget fits that ended before a moment.

    Args:
        session: A session that writes.
        before: The moment [s since 1970].
        most: Most fits that are removed in one transaction.

    Returns:
        Their ids.
    """
    other = aliased(FitRow)
    young = exists().where(
        other.batch_id == FitRow.batch_id, or_(other.ended_at.is_(None), other.ended_at >= before)
    )
    query = (
        select(FitRow.id)
        .where(FitRow.status.in_(ENDED), FitRow.ended_at < before, ~young)
        .order_by(FitRow.ended_at)
        .limit(most)
    )
    ids = session.scalars(query).all()
    # An ended fit is not begun again, so what was read is still true.
    session.execute(delete(FitRow).where(FitRow.id.in_(ids)))
    return ids


def remove_old_batches(session: Session, before: float) -> int:
    """Forget batches that were made before a moment and have no fit left; says how many."""
    has_fit = exists().where(FitRow.batch_id == BatchRow.id)
    removed = session.scalars(
        delete(BatchRow)
        .where(BatchRow.created_at < before, ~has_fit)
        .returning(BatchRow.id)
        .execution_options(synchronize_session=False)
    )
    return len(removed.all())


def remove_old_runs(session: Session, before: float, most: int) -> Sequence[str]:
    """Forget runs that came before a moment and that no fit names.

    Args:
        session: A session that writes.
        before: The moment [s since 1970].
        most: Most runs that are removed in one transaction.

    Returns:
        Their ids.
    """
    is_named = exists().where(FitRunRow.run_id == RunRow.id)
    is_old = func.coalesce(RunRow.sent_at, RunRow.created_at) < before
    query = (
        select(RunRow.id)
        .where(is_old, ~is_named)
        .order_by(RunRow.created_at)
        .limit(most)
        .with_for_update(skip_locked=True)
    )
    ids = session.scalars(query).all()
    # Asked again, now that the runs are held: a fit may have taken one of them meanwhile.
    removed = session.scalars(
        delete(RunRow)
        .where(RunRow.id.in_(ids), is_old, ~is_named)
        .returning(RunRow.id)
        .execution_options(synchronize_session=False)
    )
    return removed.all()
