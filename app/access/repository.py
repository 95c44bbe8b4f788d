"""Database queries for keys and sessions."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from sqlalchemy import ColumnElement, and_, delete, or_, select, update
from sqlalchemy.orm import Session

from app.tables import KeyRow, SessionRow

__all__ = [
    "add_key",
    "add_session",
    "all_keys",
    "key_by_digest",
    "key_by_session",
    "note_use",
    "open_keys",
    "remove_expired_sessions",
    "remove_session",
    "revoke",
]


def add_key(session: Session, key: KeyRow) -> None:
    """Store a key."""
    session.add(key)


def all_keys(session: Session) -> Sequence[KeyRow]:
    """All keys, oldest first."""
    return session.scalars(select(KeyRow).order_by(KeyRow.created_at, KeyRow.id)).all()


def key_by_digest(session: Session, digest: str, now: float) -> KeyRow | None:
    """Key with this hash, unless revoked or expired."""
    query = select(KeyRow).where(KeyRow.digest == digest, _is_open(now))
    return session.scalars(query).one_or_none()


def open_keys(session: Session, key_ids: Collection[str], now: float) -> set[str]:
    """Subset of the keys that are neither revoked nor expired."""
    query = select(KeyRow.id).where(KeyRow.id.in_(key_ids), _is_open(now))
    return set(session.scalars(query))


def revoke(session: Session, key_id: str, now: float, workspace: str | None = None) -> bool:
    """Revoke a key; False if it does not exist, is already revoked or of another workspace."""
    of_workspace = [] if workspace is None else [KeyRow.workspace == workspace]
    changed = session.execute(
        update(KeyRow)
        .where(KeyRow.id == key_id, KeyRow.revoked_at.is_(None), *of_workspace)
        .values(revoked_at=now)
        .returning(KeyRow.id)
    )
    return changed.scalar_one_or_none() is not None


def note_use(session: Session, key_id: str, at: float) -> None:
    """Store the time at which a key was last used."""
    session.execute(update(KeyRow).where(KeyRow.id == key_id).values(last_used_at=at))


def add_session(session: Session, row: SessionRow) -> None:
    """Store a browser session."""
    session.add(row)


def key_by_session(session: Session, digest: str, now: float) -> KeyRow | None:
    """Key of a session, unless the session has ended or the key is revoked or expired."""
    query = (
        select(KeyRow)
        .join(SessionRow, SessionRow.key_id == KeyRow.id)
        .where(SessionRow.digest == digest, SessionRow.expires_at > now, _is_open(now))
    )
    return session.scalars(query).one_or_none()


def remove_session(session: Session, digest: str) -> None:
    """Delete a session."""
    session.execute(delete(SessionRow).where(SessionRow.digest == digest))


def remove_expired_sessions(session: Session, now: float) -> None:
    """Delete expired sessions."""
    session.execute(delete(SessionRow).where(SessionRow.expires_at <= now))


def _is_open(now: float) -> ColumnElement[bool]:
    """SQL condition for a key that is neither revoked nor expired."""
    expires = or_(KeyRow.expires_at.is_(None), KeyRow.expires_at > now)
    return and_(KeyRow.revoked_at.is_(None), expires)
