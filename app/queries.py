"""Queries that runs, fits and batches share: lookup in a workspace, idempotent requests, pages.

Pages use keyset pagination, newest entries first: a cursor holds the creation time and id of the
last entry, so that new entries do not shift later pages.
"""

from __future__ import annotations

import base64
import binascii
import math
from collections.abc import Callable, Sequence
from typing import TypeVar

from sqlalchemy import select, tuple_
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from app.database import Database
from app.errors import FieldRefused, KeyReused, NotFound
from app.identifiers import Kind, is_id
from app.tables import BatchRow, FitRow, PendingRow, RunRow

__all__ = ["cursor_of", "known", "page", "position_of", "requested_once"]

_Stored = TypeVar("_Stored", RunRow, PendingRow, FitRow, BatchRow)
_Requested = TypeVar("_Requested", FitRow, BatchRow)
_KINDS: dict[str, Kind] = {
    "runs": "run", "pending_runs": "run", "fits": "fit", "batches": "batch",
}  # fmt: skip


def known(
    session: Session, table: type[_Stored], workspace: str, row_id: str, *, lock: bool = False
) -> _Stored:
    """Row by id within a workspace; `lock` keeps it from being changed until the session ends.

    Raises:
        NotFound: The workspace has no such row.
    """
    name = table.__tablename__
    found = None
    if is_id(_KINDS[name], row_id):
        query = select(table).where(table.workspace == workspace, table.id == row_id)
        found = session.scalars(query.with_for_update() if lock else query).one_or_none()
    if found is None:
        where = "the start page" if name == "pending_runs" else f"GET /api/v1/{name}"
        raise NotFound(f"there is no such {_KINDS[name]}; {where} lists them")
    return found


def requested_once(
    database: Database, row: _Requested, add: Callable[[Session], None]
) -> _Requested:
    """Store a request, unless the same one was stored with its Idempotency-Key; return its row.

    `add` checks the request and stores the row with all that belongs to it.

    Raises:
        KeyReused: The key was used before with a different request.
    """
    try:
        with database.writing() as session:
            earlier = _by_key(session, row)
            if earlier is None:
                add(session)
    except IntegrityError:
        # A concurrent request with the same key was committed first.
        with database.reading() as session:
            earlier = _by_key(session, row)
        if earlier is None:
            raise
    if earlier is None:
        return row
    if earlier.request_sha256 != row.request_sha256:
        raise KeyReused("this Idempotency-Key was used with another request; use a new key")
    return earlier


def page(
    session: Session,
    table: type[_Stored],
    workspace: str,
    *,
    after: str | None,
    limit: int,
    **equal: str | None,
) -> tuple[Sequence[_Stored], str | None]:
    """Page of rows, newest first, and the cursor of the next page, if any.

    `after` is the cursor of the page; `equal` are values of columns, of which None selects all.
    """
    given = {name: value for name, value in equal.items() if value is not None}
    query = select(table).filter_by(workspace=workspace, **given)
    if (position := position_of(after)) is not None:
        query = query.where(tuple_(table.created_at, table.id) < tuple_(*position))
    query = query.order_by(table.created_at.desc(), table.id.desc()).limit(limit + 1)
    rows = session.scalars(query).all()
    return rows[:limit], cursor_of(rows, limit)


def _by_key(session: Session, row: _Requested) -> _Requested | None:
    if row.idempotency_key is None:
        return None
    table = type(row)
    query = select(table).where(
        table.workspace == row.workspace, table.idempotency_key == row.idempotency_key
    )
    return session.scalars(query).one_or_none()


def cursor_of(rows: Sequence[RunRow | PendingRow | FitRow | BatchRow], limit: int) -> str | None:
    """Cursor of the next page, or None on the last page."""
    if len(rows) <= limit:
        return None
    last = rows[limit - 1]
    text = f"{float(last.created_at).hex()} {last.id}"
    return base64.urlsafe_b64encode(text.encode()).decode().rstrip("=")


def position_of(cursor: str | None) -> tuple[float, str] | None:
    """Creation time and id in a cursor; raise `FieldRefused` if this service has not issued it."""
    if cursor is None:
        return None
    try:
        raw = base64.b64decode(cursor + "=" * (-len(cursor) % 4), altchars=b"-_", validate=True)
        moment, _, entry = raw.decode("ascii").partition(" ")
        created_at = float.fromhex(moment)
    except (binascii.Error, ValueError, OverflowError) as error:
        raise _refused() from error
    if not math.isfinite(created_at) or not entry.isprintable() or len(entry) > 40:
        raise _refused()
    return created_at, entry


def _refused() -> FieldRefused:
    return FieldRefused("after: expected the `next` of the page before, as it is", "after")
