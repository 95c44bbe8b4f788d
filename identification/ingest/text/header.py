"""Lines above the samples of a text table: the header rows, and the preamble of a device.

Header rows stand directly above the samples and have the same number of cells: column names,
optionally a row of units and a second row of names.  A line that contains numbers between names and
samples is a damaged sample and raises an error.

The preamble gives names, units and the sample clock of the columns:

    LabVIEW (LVM)   Y_Unit_Label, X0, Delta_X, X_Columns, Samples
    Yokogawa        TraceName, VUnit, HUnit, HOffset, HResolution, BlockSize
    Tektronix       Label, Vertical Units, Horizontal Units, Sample Interval, Probe Attenuation;
                    beside the samples also Source and Probe Atten
    Keysight        XUnits, YUnits
    Rigol           Sequence, below the columns Start and Increment; t0 = and tInc = in the header
    HIOKI           Comment below Mode and Range, Title comment
    TwinCAT         Name, Unit and others above each group of channels (`twincat`)

The first cell of such a line is its key; the others stand above the columns that they describe.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from identification.errors import HeaderTooLong, NotANumber, RaggedRow, UnsupportedContent
from identification.ingest.columns import Column, describe_column
from identification.ingest.display import listed, plain, quoted
from identification.ingest.names import LONGEST_CELL, is_channel_name, is_units_row
from identification.ingest.text.cells import is_number, number_text, split_cells
from identification.ingest.text.labelled import Line, without_labels
from identification.ingest.text.twincat import scope_rows

__all__ = ["KEYS", "HeaderRows", "Line", "Preamble", "keyed_rows", "read_preamble"]

_MOST_ROWS = 5
_WHOLE = re.compile(r"[+-]?\d+", re.ASCII)
# A whole number has no leading zero.
_FRACTION = re.compile(r"0\d+", re.ASCII)

_NAMES = ("tracename", "label")
_UNITS = ("y_unit_label", "vunit", "vertical units", "vertical unit", "yunits")
_TIME_UNIT = ("hunit", "horizontal units", "horizontal unit", "xunits")
_START = ("x0", "hoffset")
_STEP = ("delta_x", "hresolution")
_COLUMNS = "x_columns"
_SEQUENCE = "sequence"
_COUNT = ("samples", "blocksize")
_SOURCE = "source"
_INTERVAL = "sample interval"
_PROBE = ("probe atten", "probe attenuation")
# HIOKI: the comment of a channel is its name, and the times are in seconds.
_SETTINGS = ("mode", "range", "comment")
_TITLE = "title comment"
_FURTHER = (*_COUNT, _SOURCE, _INTERVAL, *_PROBE, *_SETTINGS, _TITLE)
"""Keys of lines that may also be header rows."""
KEYS = frozenset((*_NAMES, *_UNITS, *_TIME_UNIT, *_START, *_STEP, _COLUMNS, _SEQUENCE))
"""Keys, in lower case, of the lines that are no header rows."""

_LABVIEW_TIME = "x_value"
# Columns and cells of a header that give the clock once, and have no cells in the samples.
_CLOCK = re.compile(r"|comment|start|increment|(?P<key>t0|tinc) *= *(?P<number>\S+?)s?", re.I)


class HeaderRows:
    """Search for the header rows above samples of known delimiter and number of cells."""

    def __init__(self, delimiter: str, fields: int, sample: Line) -> None:
        self._delimiter = delimiter
        self._fields = fields
        self._sample = sample
        self._sample_cells = split_cells(sample.text, delimiter)

    def above(
        self, lines: list[Line], comments: list[Line], names: Sequence[str] = ()
    ) -> list[tuple[Line, list[str]]]:
        """Find the header rows among the lines, each with its cells, from top to bottom.

        Comments above the first sample are searched if the lines hold no header.  Without any
        header the one row is blank: the columns have names from the preamble of a device, or
        numbers.

        Raises:
            RunFileError: The header has another number of cells than the samples, one of its cells
                is too long, or a line between names and samples is a damaged sample.
        """
        lines = without_labels(lines, self._delimiter, self._sample_cells)
        rows = self._collect(lines) or self._collect(comments)
        if not rows and not names:
            self._refuse_ragged(lines)
        return rows or [(self._sample, [""] * self._fields)]

    def _collect(self, lines: list[Line]) -> list[tuple[Line, list[str]]]:
        rows: list[tuple[Line, list[str]]] = []
        named = False
        for line in reversed(lines[-_MOST_ROWS:]):
            cells = self._fitted(line)
            apart = bool(rows) and rows[0][0].number - line.number > 1
            if cells is None or (named and apart) or _is_title(cells):
                break
            for number, cell in enumerate(cells, 1):
                if len(cell) > LONGEST_CELL:
                    raise HeaderTooLong(
                        f"a header of {len(cell)} characters; expected at most {LONGEST_CELL}; "
                        "shorten the column name",
                        row=line.number,
                        column=str(number),
                        value=len(cell),
                    )
            if any(map(is_number, cells)):
                if named:
                    break
                self._refuse_damaged_sample(line, cells, lines)
            rows.insert(0, (line, cells))
            named = named or not is_units_row(cells)
        return rows

    def _fitted(self, line: Line) -> list[str] | None:
        """Cells of a header line that match the samples in number, or None.

        A trailing delimiter is tolerated.
        """
        delimiters = (self._delimiter,) if self._delimiter != " " else (" ", ",", ";", "\t")
        for delimiter in delimiters:
            cells = split_cells(line.text, delimiter, units_in_brackets=True)
            # The clock in the header is no name of a column.
            clocks = map(_CLOCK.fullmatch, cells)
            cells = ["" if m and m["key"] else c for c, m in zip(cells, clocks, strict=True)]
            if len(cells) == self._fields:
                return cells
            # LabVIEW ends its header with a column Comment, Rigol with the clock.
            if len(cells) > self._fields and all(map(_CLOCK.fullmatch, cells[self._fields :])):
                return cells[: self._fields]
            if len(cells) == self._fields - 1 and not self._sample_cells[-1]:
                return [*cells, ""]
        return None

    def _refuse_damaged_sample(self, line: Line, cells: list[str], lines: list[Line]) -> None:
        """Raise if a line with numbers directly below the names is a damaged sample."""
        above = [other for other in lines if other.number < line.number][-1:]
        names = self._fitted(above[0]) if above else None
        if names is None or is_units_row(cells) or any(map(is_number, names)):
            return
        at = next((k for k, cell in enumerate(cells) if not is_number(cell)), 0)
        raise NotANumber(
            f"{quoted(cells[at])} is not a number; expected a sample below the column names",
            row=line.number,
            column=plain(names[at]),
            value=cells[at],
        )

    def _refuse_ragged(self, lines: list[Line]) -> None:
        """Raise if the line above the samples has names, but another number of cells."""
        last = split_cells(lines[-1].text, self._delimiter) if lines else []
        # Each of n numbers with a decimal comma has one or two fields.
        is_halved = self._delimiter == "," and len(last) < self._fields <= 2 * len(last)
        is_named = len(last) > 1 and any(map(is_channel_name, last))
        is_whole = all(map(_WHOLE.fullmatch, self._sample_cells))
        # Fields between commas may be digits after a decimal comma, such as 001.
        has_fractions = self._delimiter == "," and any(map(_FRACTION.fullmatch, self._sample_cells))
        if is_whole and ((is_named and is_halved) or has_fractions):
            raise RaggedRow(
                f"the comma is both the decimal sign and the delimiter, which makes {self._fields} "
                "fields of each sample; export with a decimal point, or with a semicolon or tab "
                "as the delimiter",
                row=self._sample.number,
                value=self._fields,
            )
        if is_named:
            raise RaggedRow(
                f"the samples have {self._fields} fields and the header has {len(last)}; write one "
                "name for each column",
                row=self._sample.number,
                value=self._fields,
            )


@dataclass(frozen=True)
class Preamble:
    """Cells of the lines with known keys; the last line of a key counts."""

    lines: dict[str, list[str]] = field(default_factory=dict)
    """Key to the cells of its line, the key included."""
    interval: float = math.nan
    """Sample interval that a title line states [s], or NaN."""

    def columns(self, columns: Sequence[Column]) -> list[Column]:
        """Columns of the table with the names and units of the preamble added.

        An implied time becomes an additional column behind the others.
        """
        self._refuse_different_clocks()
        # Without a cell for the keys in the samples, the first name is that of the first column.
        is_short = len(self.names()) == len(columns) + 1 and not any(c.texts for c in columns)
        shifted = [replace(c, index=c.index + is_short) for c in columns]
        described = [
            replace(self._described(other, len(columns)), index=column.index)
            for column, other in zip(columns, shifted, strict=True)
        ]
        if self.implied is not None and not any("time" in c.quantities for c in described):
            unit = next((self._cell(key, 1) for key in _TIME_UNIT if key in self.lines), "s")
            unit = unit if self.clock is not None else "s"
            described.append(describe_column(len(described), ["time"], [unit]))
        return described

    def names(self) -> list[str]:
        """Names of the columns, for a table that has no other header row; may be empty."""
        return next((cells for key, cells in self.lines.items() if key in _NAMES), [])

    @property
    def clock(self) -> tuple[float, float] | None:
        """Start and interval of the samples in the unit of the time, if no column holds times."""
        if _COLUMNS in self.lines and self._cell(_COLUMNS, 1).casefold() != "no":
            return None
        step, start = (
            next((_float(self._cell(key, 1)) for key in keys if key in self.lines), default)
            for keys, default in ((_STEP, math.nan), (_START, 0.0))
        )
        return (start, step) if step > 0.0 and math.isfinite(start) else None

    @property
    def implied(self) -> tuple[float, float] | None:
        """Clock for a table without times: that of the known keys, else that of a title line."""
        stated = (0.0, self.interval) if self.interval > 0.0 else None
        return self.clock or stated

    @property
    def samples(self) -> int:
        """Number of samples that the device states, in LabVIEW that of a packet; 0 for none."""
        key = _COUNT[0] if _COLUMNS in self.lines else _COUNT[1]
        cells = self.lines.get(key, [])[1:]
        return max((int(cell) for cell in cells if cell.isascii() and cell.isdigit()), default=0)

    def _refuse_different_clocks(self) -> None:
        """Reject channels with different starts or intervals in one table."""
        counts = self.lines.get(_COUNT[0], [])
        for key in (*_START[:1], *_STEP[:1]):
            cells = enumerate(self.lines.get(key, []))
            # A channel of LabVIEW without samples has any clock.
            values = {cell for k, cell in cells if k and cell and counts[k : k + 1] != ["0"]}
            if len(values) > 1:
                raise UnsupportedContent(
                    f"the channels have different clocks ({key} {listed(sorted(values), 6)}); "
                    "write TDMS, whose channels keep their own clocks, or resample them",
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
        keys = _NAMES if column.texts or _SOURCE not in self.lines else (*_NAMES, _SOURCE)
        names = [self._cell(key, column.index) for key in keys if key in self.lines]
        units = [self._unit(key, column.index, count) for key in _UNITS if key in self.lines]
        time_unit = [self._cell(key, 1) for key in _TIME_UNIT if key in self.lines][:1]
        time_unit = time_unit or [self._cell(_INTERVAL, 2)]
        if column.index == 0 and "time" in column.quantities:
            names, units = [], time_unit
        elif column.index == 0 and not column.texts and any(time_unit) and self.clock is None:
            # Without a header, the first column is that of the horizontal axis.
            names, units = ["time"], time_unit
        if not any((*names, *units)):
            return column
        # The label of a channel is its title, ahead of CH1.
        found = describe_column(column.index, [*names, *column.texts], [*units, *column.unit_texts])
        probe = next((self._cell(key, column.index) for key in _PROBE if key in self.lines), "")
        quantities = found.quantities or column.quantities
        factor = _float(probe)
        factor = factor if 0.0 < factor < math.inf else 1.0
        return replace(found, quantities=quantities, attenuation=factor)

    def _unit(self, key: str, index: int, count: int) -> str:
        """Unit of a column; each channel of X_Columns Multi has a column of times in front."""
        filled = [cell for cell in self.lines[key][1:] if cell]
        if self._cell(_COLUMNS, 1).casefold() == "multi" and len(filled) == count // 2:
            return filled[(index - 1) // 2] if index % 2 else ""
        # Siglent writes the units of all channels in one cell, and again below their names.
        return "" if ":" in self._cell(key, index) else self._cell(key, index)

    def _cell(self, key: str, index: int) -> str:
        cells = self.lines.get(key, [])
        return cells[index].strip() if 0 < index < len(cells) else ""


def read_preamble(rows: Sequence[list[str]]) -> Preamble:
    """Collect the lines with known keys, given the cells of each line."""
    found: dict[str, list[str]] = {}
    above: list[str] = []
    for cells in rows:
        key = _key(cells)
        if key in KEYS or key in _FURTHER:
            found[key] = cells
            if key == _SEQUENCE and above:
                found |= _sequence(above, cells)
        for given in filter(None, map(_CLOCK.fullmatch, cells)):
            if given["key"]:
                name = _START[0] if given["key"] in ("t0", "T0") else _STEP[0]
                found[name] = ["", given["number"]]
        above = [cell.casefold() for cell in cells]
    found |= _commented(found)
    _, names, units = scope_rows(rows)
    if names:
        found |= {_NAMES[0]: names, _UNITS[1]: units, _TIME_UNIT[0]: ["", "ms"]}
    return Preamble(found)


def _commented(lines: dict[str, list[str]]) -> dict[str, list[str]]:
    """Names, and the unit of the time, of a file of HIOKI; empty for any other file."""
    if _TITLE not in lines:
        return {}
    is_each = len({len(lines.get(key, [])) for key in _SETTINGS}) == 1
    return {_TIME_UNIT[0]: ["", "s"], _NAMES[1]: lines.get("comment", []) if is_each else []}


def _sequence(names: Sequence[str], cells: Sequence[str]) -> dict[str, list[str]]:
    """Clock and units of a table of Rigol, whose clock stands once in columns of its own."""
    found = {_UNITS[1]: list(cells)}
    for name, key in (("start", _START[0]), ("increment", _STEP[0])):
        if name in names[: len(cells)]:
            at = names.index(name)
            found |= {key: [key, cells[at]]}
            found[_UNITS[1]][at] = ""
    return found


def _float(text: str) -> float:
    """Number with a decimal point or comma; NaN for any other text."""
    number = number_text(text, "," if "," in text else ".")
    return float(number) if number is not None else math.nan


def keyed_rows(rows: Sequence[list[str]]) -> set[int]:
    """Indices of the lines that begin with a known key, given their cells: no header rows."""
    known = (k for k, cells in enumerate(rows) if _key(cells) in KEYS)
    return {*known, *scope_rows(rows)[0]}


def _is_title(cells: list[str]) -> bool:
    """Return True for one text in front of blank cells, such as ``Waveform Data`` of GW Instek."""
    return bool(cells[0]) and not any((*cells[1:], is_channel_name(cells[0]), is_units_row(cells)))


def _key(cells: Sequence[str]) -> str:
    return cells[0].casefold().rstrip(": ") if cells else ""
