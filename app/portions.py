"""Slices of id lists, which keep SQL parameter counts and write transactions small."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

__all__ = ["portions"]

_OF_A_QUERY: Final = 500
"""Ids per query; SQLite before 3.32 accepts at most 999 parameters."""


def portions(ids: Sequence[str], most: int = _OF_A_QUERY) -> Iterator[Sequence[str]]:
    """Slices of a sequence, in order.

    Args:
        ids: Sequence to slice.
        most: Length of a slice; default: as many ids as one query takes.
    """
    for first in range(0, len(ids), most):
        yield ids[first : first + most]
