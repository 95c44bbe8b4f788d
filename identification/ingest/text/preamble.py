"""Lines of a device above its table: names, units and sample clock of the columns.

    LabVIEW (LVM)   Y_Unit_Label, X0, Delta_X, X_Columns, Samples
    Yokogawa        TraceName, VUnit, HUnit, HOffset, HResolution, BlockSize
    Tektronix       Label, Vertical Units, Horizontal Units
    Rigol           Sequence, below the columns Start and Increment

The first cell of such a line is its key; the others stand above the columns that they describe.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from identification.errors import UnsupportedContent
from identification.ingest.columns import Column, describe_column
from identification.ingest.display import listed
from identification.ingest.text.cells import number_text, split_cells
from identification.ingest.text.header_rows import Line

__all__ = ["Preamble", "is_keyed", "read_preamble"]

_NAMES = ("tracename", "label")
_UNITS = ("y_unit_label", "vunit", "vertical units")
_TIME_UNIT = ("hunit", "horizontal units")
_START = ("x0", "hoffset")
_STEP = ("delta_x", "hresolution")
_COLUMNS = "x_columns"
_SEQUENCE = "sequence"
_COUNT = ("samples", "blocksize")
KEYS = frozenset((*_NAMES, *_UNITS, *_TIME_UNIT, *_START, *_STEP, _COLUMNS, _SEQUENCE))

_LABVIEW_TIME = "x_value"


@dataclass(frozen=True)
class Preamble:
    """Cells of the lines with known keys; the last line of a key counts."""

    lines: dict[str, list[str]] = field(default_factory=dict)
    """Key to the cells of its line, the key included."""

    def columns(self, columns: Sequence[Column]) -> list[Column]:
        """Columns of the table with the names and units of the preamble added.

        An implied time becomes an additional column behind the others.
        """
        self._refuse_different_clocks()
        described = [self._described(column, len(columns)) for column in columns]
        if self.clock is not None and not any("time" in c.quantities for c in described):
            described.append(describe_column(len(described), ["time"], [self._time_unit]))
        return described

    def names(self) -> list[str]:
        """Names of the columns, for a table that has no other header row; may be empty."""
        return next((cells for key, cells in self.lines.items() if key in _NAMES), [])

    @property
    def clock(self) -> tuple[float, float] | None:
        """Start and interval of the samples in the unit of the time, if no column holds times."""
        if _COLUMNS in self.lines and self._cell(_COLUMNS, 1).casefold() != "no":
            return None
        step = next((self._number(key) for key in _STEP if key in self.lines), math.nan)
        start = next((self._number(key) for key in _START if key in self.lines), 0.0)
        return (start, step) if step > 0.0 and math.isfinite(start) else None

    @property
    def samples(self) -> int:
        """Number of samples that the device states, in LabVIEW that of a packet; 0 for none."""
        key = _COUNT[0] if _COLUMNS in self.lines else _COUNT[1]
        cells = self.lines.get(key, [])[1:]
        return max((int(cell) for cell in cells if cell.isascii() and cell.isdigit()), default=0)

    @property
    def _time_unit(self) -> str:
        return next((self._cell(key, 1) for key in _TIME_UNIT if key in self.lines), "s")

    def _refuse_different_clocks(self) -> None:
        """Reject channels of LabVIEW with different starts or intervals in one table."""
        for key in (*_START[:1], *_STEP[:1]):
            values = {cell for cell in self.lines.get(key, [])[1:] if cell}
            if len(values) > 1:
                raise UnsupportedContent(
                    f"the channels have different clocks ({key} {listed(sorted(values), 6)}); let "
                    "LabVIEW write TDMS, whose channels keep their own clocks, or resample them",
                    value=key,
                )

    def _described(self, column: Column, count: int) -> Column:
        is_time = _LABVIEW_TIME in (text.casefold() for text in column.texts)
        if _COLUMNS in self.lines and is_time:
            # Without times in its cells, the column X_Value is not the time.
            # The columns of times in front of the other channels repeat the first one.
            is_first = self.clock is None and column.index == 0
            names, units = (["time"], ["s"]) if is_first else ([], [])
            return describe_column(column.index, names, units)
        names = [self._cell(key, column.index) for key in _NAMES if key in self.lines]
        units = [self._unit(key, column.index, count) for key in _UNITS if key in self.lines]
        if "time" in column.quantities and column.index == 0:
            names, units = [], [self._time_unit] if self._has(_TIME_UNIT) else []
        if not any((*names, *units)):
            return column
        # The label of a channel is its title, ahead of CH1.
        return describe_column(column.index, [*names, *column.texts], [*units, *column.unit_texts])

    def _unit(self, key: str, index: int, count: int) -> str:
        """Unit of a column; each channel of X_Columns Multi has a column of times in front."""
        filled = [cell for cell in self.lines[key][1:] if cell]
        if self._cell(_COLUMNS, 1).casefold() == "multi" and len(filled) == count // 2:
            return filled[(index - 1) // 2] if index % 2 else ""
        return self._cell(key, index)

    def _has(self, keys: Sequence[str]) -> bool:
        return any(key in self.lines for key in keys)

    def _cell(self, key: str, index: int) -> str:
        cells = self.lines.get(key, [])
        return cells[index].strip() if 0 < index < len(cells) else ""

    def _number(self, key: str) -> float:
        """First number of a line; NaN if there is none."""
        text = self._cell(key, 1)
        number = number_text(text, "," if "," in text else ".")
        return float(number) if number is not None else math.nan


def read_preamble(lines: Sequence[Line], delimiter: str) -> Preamble:
    """Collect the lines with known keys."""
    found: dict[str, list[str]] = {}
    above: list[str] = []
    for line in lines:
        cells = split_cells(line.text, delimiter)
        # A count is no reason to take a line for no header row: columns have such names too.
        if is_keyed(line, delimiter) or _key(cells) in _COUNT:
            found[_key(cells)] = cells
            if _key(cells) == _SEQUENCE and above:
                found |= _sequence(above, cells)
        above = [cell.casefold() for cell in cells]
    return Preamble(found)


def _sequence(names: Sequence[str], cells: Sequence[str]) -> dict[str, list[str]]:
    """Clock and units of a table of Rigol, whose clock stands once in columns of its own."""
    found = {_UNITS[1]: list(cells)}
    for name, key in (("start", _START[0]), ("increment", _STEP[0])):
        if name in names[: len(cells)]:
            at = names.index(name)
            found |= {key: [key, cells[at]]}
            found[_UNITS[1]][at] = ""
    return found


def is_keyed(line: Line, delimiter: str) -> bool:
    """Return True for a line that begins with a known key; it is no header row."""
    return _key(split_cells(line.text, delimiter)) in KEYS


def _key(cells: Sequence[str]) -> str:
    return cells[0].casefold().rstrip(": ") if cells else ""
