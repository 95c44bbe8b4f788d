"""Keys: made, listed, revoked, and asked for at each call.

    key, secret = access.create_key("bench", workspace="motors")
    access.caller_of_key(secret).workspace          "motors"

A key is 256 random bits, shown once.  Only its SHA-256 is kept: against a secret that cannot be
guessed a slow hash protects nothing more, and each call would pay for it.  A browser shows its key
once and then carries a cookie, of which again only the hash is kept.
"""

from __future__ import annotations

import hashlib
import re
import secrets
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from app.access import repository
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
    """Who calls.

    Args:
        workspace: What the caller may see: everything in it and nothing else.
        key_id: Id of the key that was shown, or None where no key is asked for.
    """

    workspace: str
    key_id: str | None = None


class AccessService:
    """Keys and sessions of one database."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._used: dict[str, float] = {}

    def create_key(
        self, name: str, workspace: str = DEFAULT_WORKSPACE, *, days: float | None = None
    ) -> tuple[KeyRow, str]:
        """Make a key.

        Args:
            name: What the list shows, such as the bench that will use it.
            workspace: What the key opens.
            days: Days after which it opens nothing any more; None for never.

        Returns:
            The key, and its secret, which is not kept and cannot be shown again.

        Raises:
            OptionError: The name, the workspace or the number of days is not accepted.
        """
        if not _WORKSPACE.fullmatch(workspace):
            raise OptionError(
                f"workspace is {workspace!r}; expected up to 63 lower-case letters, digits, "
                "- and _, the first a letter or digit",
                value=workspace,
            )
        if not 1 <= len(name) <= 200 or not name.isprintable():
            raise OptionError("name: expected 1 to 200 printable characters", value=name)
        if days is not None and not 0.0 < days <= _MOST_DAYS:
            raise OptionError(
                f"days is {days:g}; expected more than 0 and at most {_MOST_DAYS}", value=days
            )
        now = time.time()
        secret = _PREFIX + secrets.token_urlsafe(32)
        key = KeyRow(
            id=new_id("key"),
            workspace=workspace,
            name=name,
            digest=_digest(secret),
            created_at=now,
            revoked_at=None,
            expires_at=None if days is None else now + days * 86_400.0,
            last_used_at=None,
        )
        with self._database.writing() as session:
            repository.add_key(session, key)
        return key, secret

    def list_keys(self) -> Sequence[KeyRow]:
        """Every key, revoked ones included, oldest first."""
        with self._database.reading() as session:
            return repository.all_keys(session)

    def revoke_key(self, key_id: str) -> None:
        """Have a key open nothing any more, and end the sessions it opened.

        Raises:
            OptionError: There is no such key, or it is revoked already.
        """
        with self._database.writing() as session:
            known = is_id("key", key_id) and repository.revoke(session, key_id, time.time())
        if not known:
            raise OptionError(
                f"{key_id!r} is no key that can be revoked; `motorid keys list` shows them",
                value=key_id,
            )

    def caller_of_key(self, secret: str) -> Caller:
        """Who a key stands for.

        Raises:
            BadKey: The key is not known, was revoked or has expired.
        """
        if len(secret) <= _LONGEST_SECRET:
            with self._database.reading() as session:
                key = repository.key_by_digest(session, _digest(secret), time.time())
            if key is not None:
                return self._caller(key)
        raise BadKey("the key is not valid; make one with `motorid keys create`")

    def open_keys(self, key_ids: Collection[str]) -> set[str]:
        """Those of some keys that open something still: neither revoked nor expired."""
        with self._database.reading() as session:
            return repository.open_keys(session, key_ids, time.time())

    def open_session(self, secret: str, lifetime_s: float) -> str:
        """Let a browser in that shows a key.

        Args:
            secret: The key.
            lifetime_s: Time after which the session ends [s].

        Returns:
            What the browser's cookie holds.

        Raises:
            BadKey: The key is not known, was revoked or has expired.
        """
        caller = self.caller_of_key(secret)
        token = _SESSION_PREFIX + secrets.token_urlsafe(32)
        now = time.time()
        with self._database.writing() as session:
            repository.remove_expired_sessions(session, now)
            repository.add_session(
                session,
                SessionRow(
                    digest=_digest(token), key_id=str(caller.key_id), expires_at=now + lifetime_s
                ),
            )
        return token

    def close_session(self, token: str) -> None:
        """End a session."""
        with self._database.writing() as session:
            repository.remove_session(session, _digest(token))

    def caller_of_session(self, token: str) -> Caller:
        """Who a browser's cookie stands for.

        Raises:
            BadKey: The session ended, or its key was revoked.
        """
        if len(token) <= _LONGEST_SECRET:
            with self._database.reading() as session:
                key = repository.key_by_session(session, _digest(token), time.time())
            if key is not None:
                return self._caller(key)
        raise BadKey("the session has ended; show the key again")

    def write_uses(self) -> None:
        """Write down when keys were last used.

        Calls only note it in memory: none of them waits for a write, and the list of keys may be
        some minutes late.
        """
        used, self._used = self._used, {}
        if used:
            with self._database.writing() as session:
                for key_id, at in used.items():
                    repository.note_use(session, key_id, at)

    def _caller(self, key: KeyRow) -> Caller:
        self._used[key.id] = time.time()
        return Caller(key.workspace, key.id)


def _digest(secret: str) -> str:
    return hashlib.sha256(secret.encode("utf-8", "surrogateescape")).hexdigest()
