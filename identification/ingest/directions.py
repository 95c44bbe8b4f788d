"""Cells of a column that gives the direction of rotation, as drives and logger scripts write it."""

from __future__ import annotations

from identification.errors import NotANumber
from identification.ingest.display import quoted

__all__ = ["DIRECTIONS", "direction_of"]

_FORWARD = "cw clockwise fwd forward forwards + pos positive right true vorwärts rechts"
_REVERSE = (
    "ccw counterclockwise counter-clockwise anticlockwise rev reverse backward backwards - neg "
    "negative left false rückwärts links"
)
DIRECTIONS = dict.fromkeys(_FORWARD.split(), 1.0) | dict.fromkeys(_REVERSE.split(), -1.0)
"""Sign of each accepted word, in lower case; docs/run-files.md prints them."""


def direction_of(cell: str, column: str, row: int) -> float:
    """Sign of a word, or the number in the cell of a direction.

    Raises:
        NotANumber: The cell is neither.
    """
    word = DIRECTIONS.get(cell.strip().casefold())
    if word is not None:
        return word
    try:
        return float(cell.replace(",", "."))
    except ValueError:
        raise NotANumber(
            f"{quoted(cell)} is no direction; expected 1, 0 or -1, or a word such as CW, CCW, fwd "
            "or rev",
            row=row,
            column=column,
            value=cell,
        ) from None
