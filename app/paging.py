"""Pages of a list that grows at its head: newest first, each page begins where the last one ended.

A position is the time and the id of an entry, so that entries that come in meanwhile shift nothing.
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
    """What a list is made of."""

    @property
    def id(self) -> str:
        """Its id."""

    @property
    def created_at(self) -> float:
        """When it was made [s since 1970]."""


def cursor_of(rows: Sequence[Entry], limit: int) -> str | None:
    """Where the next page begins, or None on the last page.

    Args:
        rows: Entries, one more than a page holds if there are more.
        limit: Entries of a page.
    """
    if len(rows) <= limit:
        return None
    last = rows[limit - 1]
    text = f"{float(last.created_at).hex()} {last.id}"
    return base64.urlsafe_b64encode(text.encode()).decode().rstrip("=")


def position_of(cursor: str | None) -> tuple[float, str] | None:
    """Time and id that a cursor stands for.

    Raises:
        FieldRefused: It is no cursor that was given before.
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
