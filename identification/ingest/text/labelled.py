"""Header rows with labels, of the Simulation Data Inspector of Simulink and of dSPACE ControlDesk.

    time,voltage,current                        path,,Motor/voltage,Motor/current
    ,Type: double,Type: double                  name,time,voltage,current
    ,Unit: V,Unit: A                            description,,,
    ,Interp: zoh,Interp: linear                 unit,s,V,A
    0.0,12.0,1.2                                trace_values,0.0,12.0,1.2
                                                ,0.001,12.0,1.2

The units of Simulink become a row of units, and its column ``time`` is in seconds.  Of ControlDesk,
the rows of names, paths and units count, wherever they stand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from identification.ingest.text.cells import split_cells

__all__ = ["TRACE", "Line", "without_labels"]

TRACE = "trace_values"
"""Text that ControlDesk writes in front of the first sample."""
_ROWS = ("name", "path", "unit")

_LABELS = ("type:", "unit:", "interp:", "blockpath:", "portindex:", "enum:")
_UNIT = "unit:"


@dataclass(frozen=True)
class Line:
    """One line of the preview: its line number in the file and its text."""

    number: int
    text: str


def without_labels(lines: list[Line], delimiter: str, sample: Sequence[str]) -> list[Line]:
    """Lines above a first sample with names and one row of units in place of rows with labels.

    Without such rows, the lines are as they were.
    """
    rows = {k: split_cells(line.text, delimiter) for k, line in enumerate(lines)}
    if lines and sample[0].casefold() == TRACE:
        keyed = {cells[0].casefold(): cells[1:] for cells in rows.values()}
        cells = [["", *keyed[key]] for key in _ROWS if any(keyed.get(key, []))]
        filled = [(row + [""] * len(sample))[: len(sample)] for row in cells]
        return [Line(lines[-1].number, _joined(row, delimiter)) for row in filled] or lines
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
    units_row = Line(lines[last].number, _joined(units, delimiter))
    return [*lines[:first], units_row, *lines[last + 1 :]]


def _joined(cells: Sequence[str], delimiter: str) -> str:
    """Line of cells, which may contain the delimiter or quotation marks."""
    return delimiter.join('"' + cell.replace('"', '""') + '"' for cell in cells)


def _is_labelled(cells: Sequence[str]) -> bool:
    """True if all filled cells of several have the same label; a title line is a single cell."""
    label = _label(cells)
    filled = [cell for cell in cells if cell]
    is_same = all(cell.casefold().startswith(label) for cell in filled)
    return len(cells) > 1 and label in _LABELS and is_same


def _label(cells: Sequence[str]) -> str:
    first = next(filter(None, cells), "")
    return first[: first.find(":") + 1].casefold()
