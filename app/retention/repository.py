"""What of the tables is old, and its removal; each function in one transaction of the caller.

What is old is looked for by reading, which keeps nobody from writing, and removed in portions.

A fit is old when it ended before a moment; in a batch, when the whole batch did, so that a batch
goes at once.  A run is old when it came, and came last again, before that moment and no fit names
it.
"""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import ColumnElement, delete, exists, func, or_, select
from sqlalchemy.orm import Session

from app.fits.repository import ENDED
from app.tables import BatchRow, FitRow, FitRunRow, RunRow

__all__ = ["old_fits", "old_runs", "remove_fits", "remove_old_batches", "remove_old_runs"]


def old_fits(session: Session, before: float) -> Sequence[str]:
    """Ids of the fits that ended before a moment, the first that ended first.

    An ended fit is not begun again, and no batch gets fits later, so that they are old for good.
    """
    # Found once for all of them: asked for each fit, the others of its batch are read a thousand
    # times over.
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
    """Forget some fits."""
    session.execute(delete(FitRow).where(FitRow.id.in_(fit_ids)))


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


def old_runs(session: Session, before: float) -> Sequence[str]:
    """Ids of the runs that came before a moment and that no fit names, the oldest first."""
    query = select(RunRow.id).where(*_is_old(before)).order_by(RunRow.created_at)
    return session.scalars(query).all()


def remove_old_runs(session: Session, run_ids: Sequence[str], before: float) -> Sequence[str]:
    """Forget those of some runs that still came before a moment and that still no fit names.

    Args:
        session: A session that writes.
        run_ids: The runs.
        before: The moment [s since 1970].

    Returns:
        Ids of those that were removed.
    """
    query = select(RunRow.id).where(RunRow.id.in_(run_ids)).with_for_update(skip_locked=True)
    ids = session.scalars(query).all()
    # Asked again, now that the runs are held: a fit may have taken one of them meanwhile.
    removed = session.scalars(
        delete(RunRow)
        .where(RunRow.id.in_(ids), *_is_old(before))
        .returning(RunRow.id)
        .execution_options(synchronize_session=False)
    )
    return removed.all()


def _is_old(before: float) -> tuple[ColumnElement[bool], ...]:
    is_named = exists().where(FitRunRow.run_id == RunRow.id)
    return func.coalesce(RunRow.sent_at, RunRow.created_at) < before, ~is_named
