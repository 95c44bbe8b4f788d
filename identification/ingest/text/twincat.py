"""Rows of keys above the samples of TwinCAT Scope, whose channels stand in groups of one clock.

Name            Voltage  Current  Name            Temperature    the key is repeated above the
SampleTime[ms]  1        1        SampleTime[ms]  10             times of each group; "Timelines:
Unit            V (..)   A (..)   Unit            (None)         All" has a group per channel
0               11.98    1.204    0               24.8
"""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["scope_rows"]

_CLOCK = "sampletime[ms]"


def scope_rows(rows: Sequence[list[str]]) -> tuple[range, list[str], list[str]]:
    """Rows of keys among the cells of title lines, and names and units of the columns.

    The times are in milliseconds and have one name, which `side_by_side` expects; all are empty
    without a row of sample times.
    """
    at = next((k for k, cells in enumerate(rows) if cells[0].casefold() == _CLOCK), -1)
    if at < 0:
        return range(0), [], []
    first = last = at
    while first > 0 and len(rows[first - 1]) == len(rows[at]):
        first -= 1
    while last + 1 < len(rows) and len(rows[last + 1]) == len(rows[at]):
        last += 1
    is_time = [cell == rows[at][0] for cell in rows[at]]
    keyed = {cells[0].casefold(): cells for cells in rows[first : last + 1]}
    blank = [""] * len(is_time)
    names, units = keyed.get("name", blank), keyed.get("unit", blank)
    return (
        range(first, last + 1),
        ["time" if of else cell for of, cell in zip(is_time, names, strict=True)],
        # V (Voltage), (None)
        ["ms" if of else cell.partition("(")[0] for of, cell in zip(is_time, units, strict=True)],
    )
