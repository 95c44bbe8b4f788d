"""Cells of a column that gives the direction of rotation, as drives and logger scripts write it."""

from __future__ import annotations

import math

from identification.errors import NotANumber
from identification.ingest.display import quoted

__all__ = ["DIRECTIONS", "STOP", "direction_of"]

_FORWARD = "cw clockwise fwd forward forwards + pos positive right true vorwärts rechts"
_REVERSE = (
    "ccw counterclockwise counter-clockwise anticlockwise rev reverse backward backwards - neg "
    "negative left false rückwärts links"
)
_STOPPED = (
    "stop stopped halt brake braked braking coast coasting off idle neutral aus stillstand bremse "
    "bremsen freilauf"
)
STOP = math.ulp(0.0)
"""Stop in words: the smallest number in place of 0, since the 0 of a direction pin is reverse."""

DIRECTIONS = (
    dict.fromkeys(_FORWARD.split(), 1.0)
    | dict.fromkeys(_REVERSE.split(), -1.0)
    | dict.fromkeys(_STOPPED.split(), STOP)
)
"""Factor of each accepted word, in lower case; docs/run-files.md prints them."""


def direction_of(cell: str, column: str, row: int) -> float:
    """Factor of a word, or the number in the cell of a direction.

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
            f"{quoted(cell)} is no direction; expected 1, 0 or -1, or a word such as CW, CCW, fwd, "
            "rev or stop",
            row=row,
            column=column,
            value=cell,
        ) from None
