"""Fits in the database.

Callers' queries stay within one workspace.  What the supervisor writes about a fit that runs
carries the number of the attempt, and changes nothing where that attempt is no longer the current
one: a process that was only slow, and not dead, cannot overwrite what came after it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from sqlalchemy import and_, delete, func, or_, select, tuple_, update
from sqlalchemy.orm import Session

from app.fits import roles
from app.fits.request import FitRequest
from app.portions import portions
from app.tables import FitRow

__all__ = [
    "ENDED",
    "add",
    "all_ids",
    "by_key",
    "cancel",
    "changes",
    "claim",
    "counts",
    "expired",
    "finish",
    "get",
    "has_ended",
    "held",
    "next_queued",
    "of_batch",
    "oldest_queued",
    "page",
    "put_back",
    "remove",
    "renew",
    "unclaim",
    "waiting",
]

ENDED = ("succeeded", "failed", "cancelled")
"""States that a fit does not leave."""


def add(session: Session, *fits: tuple[FitRow, FitRequest]) -> None:
    """Keep fits and which runs they take."""
    session.add_all(row for row, _ in fits)
    session.flush()
    roles.add(session, ((row.id, request) for row, request in fits))


def get(session: Session, workspace: str, fit_id: str) -> FitRow | None:
    """A fit, or None."""
    query = select(FitRow).where(FitRow.workspace == workspace, FitRow.id == fit_id)
    return session.scalars(query).one_or_none()


def changes(session: Session, versions: Mapping[str, int]) -> dict[str, FitRow | None]:
    """Those of some fits that are no longer in a version, by id; None for one that is gone.

    Args:
        session: Session of the database.
        versions: The version of each fit that is known already.
    """
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


def by_key(session: Session, workspace: str, idempotency_key: str) -> FitRow | None:
    """The fit that was asked for under an Idempotency-Key, or None."""
    query = select(FitRow).where(
        FitRow.workspace == workspace, FitRow.idempotency_key == idempotency_key
    )
    return session.scalars(query).one_or_none()


def page(
    session: Session,
    workspace: str,
    *,
    after: tuple[float, str] | None,
    limit: int,
    status: str | None = None,
    motor: str | None = None,
) -> Sequence[FitRow]:
    """Fits, newest first.

    Args:
        session: Session of the database.
        workspace: Workspace of the caller.
        after: Time of creation and id of the last fit of the page before.
        limit: Most fits of a page.
        status: Only fits in this state.
        motor: Only fits of this motor.
    """
    query = select(FitRow).where(FitRow.workspace == workspace)
    if status is not None:
        query = query.where(FitRow.status == status)
    if motor is not None:
        query = query.where(FitRow.motor == motor)
    if after is not None:
        query = query.where(tuple_(FitRow.created_at, FitRow.id) < tuple_(*after))
    return session.scalars(
        query.order_by(FitRow.created_at.desc(), FitRow.id.desc()).limit(limit)
    ).all()


def of_batch(session: Session, batch_id: str) -> Sequence[FitRow]:
    """The fits of a batch in its order."""
    query = select(FitRow).where(FitRow.batch_id == batch_id).order_by(FitRow.position)
    return session.scalars(query).all()


def cancel(session: Session, fit_id: str, now: float) -> bool:
    """End a fit that has not ended; False where it has."""
    return _changed(
        session,
        and_(FitRow.id == fit_id, FitRow.status.not_in(ENDED)),
        status="cancelled",
        ended_at=now,
        owner=None,
        lease_until=None,
    )


def remove(session: Session, fit_id: str) -> None:
    """Forget a fit."""
    session.execute(delete(FitRow).where(FitRow.id == fit_id))


def next_queued(
    session: Session, *, without: Collection[str] = (), lock: bool = False
) -> FitRow | None:
    """The fit that waits longest, or None.

    Args:
        session: Session of the database.
        without: Ids of fits to pass over; not more than a statement may have parameters.
        lock: Whether to pass over fits that another server is about to take, and to keep this one
            from the others until the session ends.
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
    """Begin the next attempt at a fit that waits; False where another was faster."""
    return _changed(
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


def held(session: Session, owner: str) -> dict[tuple[str, int], int]:
    """Fits and attempts that run under an owner, and how many attempts failed before."""
    query = select(FitRow.id, FitRow.attempt, FitRow.failures).where(
        FitRow.status == "running", FitRow.owner == owner
    )
    return {(fit_id, attempt): failures for fit_id, attempt, failures in session.execute(query)}


def has_ended(session: Session, fit_id: str) -> bool:
    """Whether a fit is in a state that it does not leave, or is not there any more."""
    query = select(FitRow.status).where(FitRow.id == fit_id)
    return session.scalars(query).one_or_none() in (None, *ENDED)


def renew(
    session: Session, fit_id: str, attempt: int, *, lease_until: float, progress: dict[str, Any]
) -> bool:
    """Write lease and progress of an attempt; False where it is no longer the current one."""
    step = 1 if progress else 0
    condition = _current(fit_id, attempt)
    return _changed(session, condition, step=step, lease_until=lease_until, **progress)


def finish(
    session: Session,
    fit_id: str,
    attempt: int,
    *,
    status: str,
    now: float,
    error: dict[str, Any] | None = None,
) -> bool:
    """End a fit with what an attempt came to; False where that is no longer the current one.

    Said twice it is true twice: a commit whose answer was lost is made again.
    """
    values: dict[str, Any] = {"stage": "done", "fraction": 1.0} if status == "succeeded" else {}
    is_done = _changed(
        session,
        _current(fit_id, attempt),
        status=status,
        error=error,
        ended_at=now,
        owner=None,
        lease_until=None,
        **values,
    )
    return is_done or _has_ended_so(session, fit_id, attempt, status)


def _has_ended_so(session: Session, fit_id: str, attempt: int, status: str) -> bool:
    query = select(FitRow.id).where(
        FitRow.id == fit_id, FitRow.attempt == attempt, FitRow.status == status
    )
    return session.scalars(query).one_or_none() is not None


def unclaim(session: Session, fit_id: str, attempt: int) -> bool:
    """Let a fit wait as if it had not been taken: nothing was begun, so nothing is counted."""
    return _changed(
        session,
        _current(fit_id, attempt),
        status="queued",
        stage="queued",
        attempt=attempt - 1,
        owner=None,
        lease_until=None,
    )


def put_back(
    session: Session, fit_id: str, attempt: int, *, failures: int, interruptions: int = 0
) -> bool:
    """Let a fit wait again after an attempt without a result.

    Args:
        session: Session of the database.
        fit_id: The fit.
        attempt: The attempt that ended.
        failures: How many attempts failed by themselves.
        interruptions: How many more ends of a server to count against the fit.
    """
    return _changed(
        session,
        _current(fit_id, attempt),
        status="queued",
        stage="queued",
        fraction=0.0,
        failures=failures,
        interruptions=FitRow.interruptions + interruptions,
        owner=None,
        lease_until=None,
    )


def expired(session: Session, *, place: str, owner: str, now: float) -> Sequence[FitRow]:
    """Fits that run under an owner who is gone.

    Args:
        session: Session of the database.
        place: Name of this place: it has one server, so that every other owner of it is gone.
        owner: This server.
        now: The time, past which a lease must reach [s since 1970].
    """
    query = select(FitRow).where(
        FitRow.status == "running",
        FitRow.owner != owner,
        or_(FitRow.lease_until < now, FitRow.owner.startswith(f"{place}/", autoescape=True)),
    )
    return session.scalars(query).all()


def waiting(session: Session, most: int) -> int:
    """How many fits wait, of all workspaces, counted up to a number."""
    query = select(FitRow.id).where(FitRow.status == "queued").limit(most)
    return len(session.scalars(query).all())


def counts(session: Session) -> dict[str, int]:
    """How many fits there are in each state, of all workspaces."""
    query = select(FitRow.status, func.count()).group_by(FitRow.status)
    return {status: number for status, number in session.execute(query)}


def oldest_queued(session: Session) -> float | None:
    """When the fit was made that waits longest, or None."""
    return session.scalars(
        select(func.min(FitRow.created_at)).where(FitRow.status == "queued")
    ).one_or_none()


def all_ids(session: Session) -> set[str]:
    """Ids of all fits of all workspaces."""
    return set(session.scalars(select(FitRow.id)))


def _current(fit_id: str, attempt: int) -> Any:
    return and_(FitRow.id == fit_id, FitRow.attempt == attempt, FitRow.status == "running")


def _changed(session: Session, condition: Any, *, step: int = 1, **values: Any) -> bool:
    """Change the one row that meets a condition; False where there is none."""
    statement = update(FitRow).where(condition).values(version=FitRow.version + step, **values)
    result = session.execute(
        statement.returning(FitRow.id), execution_options={"synchronize_session": False}
    )
    return result.scalar_one_or_none() is not None
