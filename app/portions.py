"""Ids in portions: a query takes many values, but not any number, and writers do not wait long."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

__all__ = ["portions"]

_OF_A_QUERY: Final = 500
"""SQLite before 3.32 takes 999 values."""


def portions(ids: Sequence[str], most: int = _OF_A_QUERY) -> Iterator[Sequence[str]]:
    """Slices of a sequence, in order.

    Args:
        ids: What is portioned.
        most: Length of a slice; as many as a query takes where not given.
    """
    for first in range(0, len(ids), most):
        yield ids[first : first + most]
