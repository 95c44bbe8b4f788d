"""Keyset pagination: newest entries first; a cursor holds the position of the last entry.

A position is the creation time and id of an entry, so that new entries do not shift later pages.
"""

from __future__ import annotations

import base64
import binascii
import math
from collections.abc import Sequence
from typing import Protocol

from app.errors import FieldRefused

__all__ = ["Entry", "cursor_of", "position_of"]


class Entry(Protocol):
    """Entry of a paginated list."""

    @property
    def id(self) -> str:
        """Id of the entry."""

    @property
    def created_at(self) -> float:
        """Creation time [s since 1970]."""


def cursor_of(rows: Sequence[Entry], limit: int) -> str | None:
    """Cursor of the next page, or None on the last page.

    Args:
        rows: Entries of the page, plus one if more follow.
        limit: Page size.
    """
    if len(rows) <= limit:
        return None
    last = rows[limit - 1]
    text = f"{float(last.created_at).hex()} {last.id}"
    return base64.urlsafe_b64encode(text.encode()).decode().rstrip("=")


def position_of(cursor: str | None) -> tuple[float, str] | None:
    """Creation time and id encoded in a cursor.

    Raises:
        FieldRefused: The cursor was not issued by this service.
    """
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
