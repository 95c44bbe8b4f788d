"""Database queries of fits.

Every update of a running fit is conditional on the attempt number (optimistic locking), so a slow
process whose attempt was replaced cannot overwrite the state of its successor.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from sqlalchemy import and_, delete, func, insert, or_, select, update
from sqlalchemy.orm import Session

from app.database import portions
from app.fits.request import FitRequest
from app.tables import FitRow, FitRunRow

__all__ = [
    "ENDED",
    "add",
    "cancel",
    "changes",
    "claim",
    "expired",
    "finish",
    "next_queued",
    "put_back",
    "remove",
    "renew",
    "run_ids",
]

ENDED = ("succeeded", "failed", "cancelled")
"""Final states of a fit."""

_RELEASED: dict[str, Any] = {
    "owner": None,
    "lease_until": None,
}  # columns of a fit that no server holds


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
    return _changed(
        session,
        and_(column == wanted, FitRow.status.not_in(ENDED)),
        status="cancelled",
        ended_at=now,
        **_RELEASED,
    )


def remove(session: Session, fit_id: str) -> None:
    """Delete a fit."""
    session.execute(delete(FitRow).where(FitRow.id == fit_id))


def next_queued(
    session: Session, *, without: Collection[str] = (), lock: bool = False
) -> FitRow | None:
    """Fit that has waited longest in the queue, or None.

    `without` has at most as many IDs as a statement may have parameters; `lock` locks the row and
    skips rows that another server has locked.
    """
    query = (
        select(FitRow)
        .where(FitRow.status == "queued", FitRow.id.not_in(without))
        .order_by(FitRow.created_at, FitRow.position, FitRow.id)
        .limit(1)
    )
    if lock:
        query = query.with_for_update(skip_locked=True)
    return session.scalars(query).one_or_none()


def claim(session: Session, row: FitRow, owner: str, now: float, lease_until: float) -> bool:
    """Start the next attempt at a queued fit; return False if another server was faster."""
    return 0 < _changed(
        session,
        and_(FitRow.id == row.id, FitRow.attempt == row.attempt, FitRow.status == "queued"),
        status="running",
        stage="starting",
        fraction=0.0,
        attempt=row.attempt + 1,
        owner=owner,
        lease_until=lease_until,
        started_at=func.coalesce(FitRow.started_at, now),
    )


def renew(
    session: Session, fit_id: str, attempt: int, *, lease_until: float, progress: dict[str, Any]
) -> bool:
    """Renew the lease of an attempt and store its progress; return False if it is not current."""
    step = 1 if progress else 0
    condition = _current(fit_id, attempt)
    return 0 < _changed(session, condition, step=step, lease_until=lease_until, **progress)


def finish(
    session: Session,
    fit_id: str,
    attempt: int,
    *,
    status: str,
    now: float,
    error: dict[str, Any] | None = None,
) -> bool:
    """End a fit with the outcome of an attempt; return False if the attempt is not current.

    The call is idempotent, so a commit whose confirmation was lost can be repeated.
    """
    values: dict[str, Any] = {"stage": "done", "fraction": 1.0} if status == "succeeded" else {}
    is_done = _changed(
        session,
        _current(fit_id, attempt),
        status=status,
        error=error,
        ended_at=now,
        **_RELEASED,
        **values,
    )
    same = select(FitRow.id).filter_by(id=fit_id, attempt=attempt, status=status)
    return bool(is_done) or session.scalars(same).one_or_none() is not None


def put_back(session: Session, fit_id: str, attempt: int, /, **changes: Any) -> bool:
    """Requeue a fit after an attempt without a result; `changes` are values of further columns."""
    return 0 < _changed(
        session,
        _current(fit_id, attempt),
        status="queued",
        stage="queued",
        fraction=0.0,
        **_RELEASED,
        **changes,
    )


def expired(session: Session, *, place: str, owner: str, now: float) -> Sequence[FitRow]:
    """Running fits whose owner is gone, or whose lease ended before now [s since 1970].

    A place is a machine with a data directory.  Only one server runs there at a time, so every
    other owner with the name of this place is gone.
    """
    query = select(FitRow).where(
        FitRow.status == "running",
        FitRow.owner != owner,
        or_(FitRow.lease_until < now, FitRow.owner.startswith(f"{place}/", autoescape=True)),
    )
    return session.scalars(query).all()


def _current(fit_id: str, attempt: int) -> Any:
    return and_(FitRow.id == fit_id, FitRow.attempt == attempt, FitRow.status == "running")


def _changed(session: Session, condition: Any, *, step: int = 1, **values: Any) -> int:
    """Update the rows that meet a condition and their versions; return the number of rows."""
    statement = update(FitRow).where(condition).values(version=FitRow.version + step, **values)
    result = session.execute(
        statement.returning(FitRow.id), execution_options={"synchronize_session": False}
    )
    return len(result.all())
