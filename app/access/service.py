"""API keys and browser sessions: create, list, revoke and authenticate.

    key, secret = access.create_key("bench", workspace="motors")
    access.caller_of_key(secret).workspace          "motors"

A key has 256 random bits and is shown once.  Only its SHA-256 is stored: a slow hash adds no
protection to a secret that cannot be guessed, and would slow down each call.  A browser sends its
key once and then uses a session cookie, of which also only the hash is stored.
"""

from __future__ import annotations

import hashlib
import re
import secrets
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from sqlalchemy import ColumnElement, Select, and_, delete, or_, select, update

from app.database import Database
from app.errors import BadKey
from app.identifiers import is_id, new_id
from app.tables import KeyRow, SessionRow
from identification.errors import OptionError

__all__ = ["DEFAULT_WORKSPACE", "AccessService", "Caller"]

DEFAULT_WORKSPACE = "default"
_PREFIX = "motorid_"
_SESSION_PREFIX = "motorid_session_"
_MOST_DAYS = 36_500
_LONGEST_SECRET = 200
_WORKSPACE = re.compile(r"[a-z0-9][a-z0-9_-]{0,62}")


@dataclass(frozen=True)
class Caller:
    """Authenticated client."""

    workspace: str
    """Workspace that the client can access; it has access to no other."""
    key_id: str | None = None
    """Id of the key, or None if the service runs without keys."""
    is_owner: bool = True
    """True if the client may manage the keys of the workspace."""


class AccessService:
    """Keys and sessions of one database.

    `BadKey` is raised for a key or a session that is unknown or has ended.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        self._used: dict[str, float] = {}

    def create_key(
        self,
        name: str,
        workspace: str = DEFAULT_WORKSPACE,
        *,
        days: float | None = None,
        owner: bool = True,
        key_id: str | None = None,
    ) -> tuple[KeyRow, str]:
        """Create a key, and return it with its secret, which is not stored.

        The name labels it in the list of keys; an owner may manage the keys of its workspace;
        without `days` the key does not expire; `key_id` is its new identifier, by default a random
        one.

        Raises:
            OptionError: The name, the workspace or the number of days is not accepted, or another
                key has this identifier.
        """
        if not _WORKSPACE.fullmatch(workspace):
            raise OptionError(
                f"workspace is {workspace!r}; expected up to 63 lower-case letters, digits, "
                "- and _, the first a letter or digit"
            )
        if not 1 <= len(name) <= 200 or not name.isprintable():
            raise OptionError("name: expected 1 to 200 printable characters")
        if days is not None and not 0.0 < days <= _MOST_DAYS:
            raise OptionError(f"days is {days:g}; expected more than 0 and at most {_MOST_DAYS}")
        now = time.time()
        secret = _PREFIX + secrets.token_urlsafe(32)
        key = KeyRow(
            id=key_id or new_id("key"),
            workspace=workspace,
            name=name,
            digest=_digest(secret),
            created_at=now,
            expires_at=None if days is None else now + days * 86_400.0,
            owner=owner,
        )
        with self._database.writing() as session:
            if session.get(KeyRow, key.id) is not None or not is_id("key", key.id):
                raise OptionError("this form has created a key already; load the page again")
            session.add(key)
        return key, secret

    def list_keys(self, workspace: str | None = None) -> Sequence[KeyRow]:
        """Keys of a workspace, or of all, including revoked ones, oldest first."""
        with self._database.reading() as session:
            keys = session.scalars(select(KeyRow).order_by(KeyRow.created_at, KeyRow.id)).all()
        return [key for key in keys if workspace in (None, key.workspace)]

    def revoke_key(self, key_id: str, workspace: str | None = None) -> None:
        """Revoke a key, of this workspace if one is given, and thereby end its sessions.

        Raises:
            OptionError: There is no such key, or it is already revoked.
        """
        wanted = update(KeyRow).where(KeyRow.id == key_id, KeyRow.revoked_at.is_(None))
        if workspace is not None:
            wanted = wanted.where(KeyRow.workspace == workspace)
        revoked = None
        if is_id("key", key_id):
            with self._database.writing() as session:
                statement = wanted.values(revoked_at=time.time()).returning(KeyRow.id)
                revoked = session.execute(statement).scalar_one_or_none()
        if revoked is None:
            raise OptionError(
                f"{key_id!r} is no key that can be revoked; `motorid keys list` shows them"
            )

    def caller_of_key(self, secret: str) -> Caller:
        """Client authenticated by a key that is neither revoked nor expired."""
        query = select(KeyRow).where(KeyRow.digest == _digest(secret))
        refusal = (
            "the key is not valid, or it has expired or was revoked; the operator creates one with "
            "motorid keys create"
        )
        return self._caller(secret, query, refusal)

    def open_keys(self, key_ids: Collection[str]) -> set[str]:
        """Subset of the keys that are neither revoked nor expired."""
        query = select(KeyRow.id).where(KeyRow.id.in_(key_ids), _is_open(time.time()))
        with self._database.reading() as session:
            return set(session.scalars(query))

    def open_session(self, secret: str, lifetime_s: float) -> str:
        """Open a browser session with a key and return the value of its cookie."""
        caller = self.caller_of_key(secret)
        token = _SESSION_PREFIX + secrets.token_urlsafe(32)
        now = time.time()
        with self._database.writing() as session:
            session.execute(delete(SessionRow).where(SessionRow.expires_at <= now))
            key_id, expires_at = str(caller.key_id), now + lifetime_s
            session.add(SessionRow(digest=_digest(token), key_id=key_id, expires_at=expires_at))
        return token

    def close_session(self, token: str) -> None:
        """End a session."""
        with self._database.writing() as session:
            session.execute(delete(SessionRow).where(SessionRow.digest == _digest(token)))

    def caller_of_session(self, token: str) -> Caller:
        """Client authenticated by a session cookie, whose key is still valid."""
        query = select(KeyRow).join(SessionRow, SessionRow.key_id == KeyRow.id)
        query = query.where(
            SessionRow.digest == _digest(token), SessionRow.expires_at > time.time()
        )
        return self._caller(token, query, "the session has ended; sign in again with the key")

    def write_uses(self) -> None:
        """Store the times at which keys were last used.

        Calls record the time in memory only, so that no call waits for a write; the stored times
        may lag by some minutes.
        """
        used, self._used = self._used, {}
        if used:
            with self._database.writing() as session:
                for key_id, at in used.items():
                    session.execute(
                        update(KeyRow).where(KeyRow.id == key_id).values(last_used_at=at)
                    )

    def _caller(self, secret: str, query: Select[KeyRow], refusal: str) -> Caller:
        key = None
        if len(secret) <= _LONGEST_SECRET:
            with self._database.reading() as session:
                key = session.scalars(query.where(_is_open(time.time()))).one_or_none()
        if key is None:
            raise BadKey(refusal)
        self._used[key.id] = time.time()
        return Caller(key.workspace, key.id, key.owner)


def _is_open(now: float) -> ColumnElement[bool]:
    """SQL condition for a key that is neither revoked nor expired."""
    expires = or_(KeyRow.expires_at.is_(None), KeyRow.expires_at > now)
    return and_(KeyRow.revoked_at.is_(None), expires)


def _digest(secret: str) -> str:
    return hashlib.sha256(secret.encode("utf-8", "surrogateescape")).hexdigest()
