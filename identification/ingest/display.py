"""Texts out of a stranger's file, made fit for one line of a message.

A cell may hold a megabyte, a line break or a terminal's escape sequence; none of that may reach
the reader of an error.
"""

from __future__ import annotations

from collections.abc import Iterable

__all__ = ["listed", "plain", "quoted"]

_LONGEST = 60


def plain(text: str, longest: int = _LONGEST) -> str:
    """Text without control characters, cut to `longest` characters."""
    cut = text if len(text) <= longest else text[: longest - 3] + "..."
    return "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in cut)


def quoted(text: str) -> str:
    """Text as `plain` gives it, between single quotation marks."""
    return f"'{plain(text)}'"


def listed(texts: Iterable[str], most: int = 12) -> str:
    """Quoted texts with commas between, the rest beyond `most` counted."""
    every = [quoted(text) for text in texts]
    if len(every) <= most:
        return ", ".join(every)
    return f"{', '.join(every[:most])} and {len(every) - most} more"
