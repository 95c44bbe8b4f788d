"""Sanitised display of untrusted file content in one-line messages.

A cell may hold a megabyte, a line break or a terminal escape sequence; none of these may reach an
error message.
"""

from __future__ import annotations

from collections.abc import Iterable

__all__ = ["listed", "plain", "quoted"]

_LONGEST = 60


def plain(text: str, longest: int = _LONGEST) -> str:
    """Text with control characters escaped, truncated to `longest` characters."""
    cut = text if len(text) <= longest else text[: longest - 3] + "..."
    return "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in cut)


def quoted(text: str) -> str:
    """Text as `plain` returns it, in single quotation marks."""
    return f"'{plain(text)}'"


def listed(texts: Iterable[str], most: int = 12) -> str:
    """Comma-separated quoted texts; those beyond `most` are only counted."""
    every = [quoted(text) for text in texts]
    if len(every) <= most:
        return ", ".join(every)
    return f"{', '.join(every[:most])} and {len(every) - most} more"
