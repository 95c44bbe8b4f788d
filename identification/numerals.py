"""Strict parsing of numbers in options.

`float` and `int` also accept ``1_0`` and digits of other scripts, which a reader may take for
another number.
"""

from __future__ import annotations

__all__ = ["decimal_of", "whole_of"]


def decimal_of(text: str) -> float:
    """The number that a text represents; the caller's range check rejects ``nan`` and ``inf``.

    Raises:
        ValueError: The text is not a number in ASCII digits.
    """
    return float(_plain(text))


def whole_of(text: str) -> int:
    """The integer that a text represents.

    Raises:
        ValueError: The text is not an integer in ASCII digits.
    """
    return int(_plain(text))


def _plain(text: str) -> str:
    if not text.isascii() or "_" in text:
        raise ValueError(f"{text[:60]!r} is not a number in ASCII digits")
    return text
