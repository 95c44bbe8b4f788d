"""Numbers as people write them in options.

`float` and `int` alone also take ``1_0`` and digits of other scripts, which a reader takes for
something else than the number that comes out.
"""

from __future__ import annotations

__all__ = ["decimal_of", "whole_of"]


def decimal_of(text: str) -> float:
    """The number that a text stands for; ``nan`` and ``inf`` are left to who asks for a range.

    Raises:
        ValueError: It is no number in ASCII digits.
    """
    return float(_plain(text))


def whole_of(text: str) -> int:
    """The whole number that a text stands for.

    Raises:
        ValueError: It is no whole number in ASCII digits.
    """
    return int(_plain(text))


def _plain(text: str) -> str:
    if not text.isascii() or "_" in text:
        raise ValueError(f"{text[:60]!r} is not a number in ASCII digits")
    return text
