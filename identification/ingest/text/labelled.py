"""Header rows of the Simulation Data Inspector of Simulink: a label in each cell.

    time,voltage,current
    ,Type: double,Type: double
    ,Unit: V,Unit: A
    ,Interp: zoh,Interp: linear

The units become a row of units.  A column ``time`` is in seconds, as Simulink counts it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from identification.ingest.text.cells import split_cells

__all__ = ["Line", "without_labels"]

_LABELS = ("type:", "unit:", "interp:", "blockpath:", "portindex:", "enum:")
_UNIT = "unit:"


@dataclass(frozen=True)
class Line:
    """One line of the preview: its line number in the file and its text."""

    number: int
    text: str


def without_labels(lines: list[Line], delimiter: str) -> list[Line]:
    """Lines with one row of units in place of the rows of labels; as they are without such."""
    rows = {k: split_cells(line.text, delimiter) for k, line in enumerate(lines)}
    labelled = {k: cells for k, cells in rows.items() if _is_labelled(cells)}
    if not labelled or 0 in labelled:
        return lines
    first, last = min(labelled), max(labelled)
    names = rows[first - 1]
    stated = next((cells for cells in labelled.values() if _label(cells) == _UNIT), [])
    units = [cell[len(_UNIT) :].strip() for cell in stated] or [""] * len(names)
    for k, name in enumerate(names[: len(units)]):
        if name.casefold() == "time":
            units[k] = units[k] or "s"
    return [*lines[:first], Line(lines[last].number, delimiter.join(units)), *lines[last + 1 :]]


def _is_labelled(cells: Sequence[str]) -> bool:
    """True if all filled cells have the same label."""
    label = _label(cells)
    return label in _LABELS and all(cell.casefold().startswith(label) for cell in cells if cell)


def _label(cells: Sequence[str]) -> str:
    first = next(filter(None, cells), "")
    return first[: first.find(":") + 1].casefold()
