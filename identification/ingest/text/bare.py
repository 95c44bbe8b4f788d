"""Cells that hold more than a number, rewritten as plain cells before the samples are read.

    U:12.5 I:0.3            a label in front, as for the plotter of Arduino
    1.25 sec; 12.5 V        a unit behind, as MATLAB writes a duration
    1.234,5; 1'234.5        thousands separators, if the decimal sign shows which sign they are
    08:00:00, 125           a time of day whose milliseconds have a column of their own
    1772352000, 1000000     a time since 1970 with its nanoseconds, of ROS

The first sample shows labels and units; a cell that differs from it is no number.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from identification.ingest.columns import Column, read_columns
from identification.ingest.text.blocks import Block
from identification.ingest.text.cells import is_number, is_whole_second, split_cells
from identification.ingest.units import find_unit

__all__ = ["BareCells", "is_affixed", "is_grouped"]

_PARTS = re.compile(
    r"(?:(?P<label>[^\W\d][^:=]{0,40})[:=]\s?)?"
    r"(?P<number>[+-]?[\d.,'’\u00a0\u202f]*\d[.,]?(?:[eE][+-]?\d+)?) ?"
    r"(?P<unit>(?:1/)?[^\d\s.,].{0,9})?"
)
_GROUPS = re.compile(
    r"[+-]?\d{1,3}(?:(?:\.\d{3})+(?=,)|(?:,\d{3})+(?=\.)|(?:['’\u00a0\u202f]\d{3})+)(?:[.,]\d*)?"
)
# Columns that may hold the fraction of a time of day, with its digits.
_DIGITS = {"ms": 3, "us": 6, "ns": 9, "fraction": 0, "fraction of second": 0, "subsecond": 0}
_PARTS_OF_A_SECOND = ("milli", "micro", "mikro", "nano")
# Whole seconds since 1970 of this century.
_SINCE_1970 = re.compile(r"[1-9]\d{9}", re.ASCII)


def _parts(cell: str) -> tuple[str, str, str]:
    """Label, plain number and unit of a cell; all blank if it holds no number."""
    match = _PARTS.fullmatch(cell)
    if match is None:
        return "", "", ""
    number, unit = match["number"], match["unit"] or ""
    if _GROUPS.fullmatch(number):
        signs = re.sub(r"[^.,]", "", number)
        # The decimal sign comes last, and only once.
        number = re.sub(r"['’\u00a0\u202f]", "", number)
        number = number.replace(signs[0], "") if len(set(signs)) > 1 else number
    known = is_number(number) and (not unit or find_unit(unit) is not None)
    return (match["label"] or "", number, unit) if known else ("", "", "")


def is_affixed(cell: str) -> bool:
    """Return True for a number with or without label, unit and thousands separators."""
    return bool(_parts(cell)[1])


def is_grouped(cell: str) -> bool:
    """Return True for a number with thousands separators."""
    match = None if is_number(cell) else _PARTS.fullmatch(cell)
    return match is not None and _GROUPS.fullmatch(match["number"]) is not None


@dataclass(frozen=True)
class BareCells:
    """Rewriting of the lines of one table."""

    delimiter: str
    labels: tuple[str, ...]
    """Label of each cell of the first sample; blank where there is none."""
    units: tuple[str, ...]
    """Unit of each cell, likewise."""
    clock: int = -1
    """Index of the time of day that is completed by another cell; -1 for none."""
    part: int = -1
    """Index of this other cell."""
    digits: int = 0
    """Its digits after the decimal sign: 3 for milliseconds, 0 for a fraction such as 0.125."""

    @classmethod
    def of(cls, delimiter: str, sample: Sequence[str]) -> BareCells:
        """Rewriting for a table, by the cells of its first sample."""
        labels, _, units = zip(*map(_parts, sample), strict=True)
        # One cell such as mode:3 in a table with a header has no name.
        is_labelled = 2 * sum(map(bool, labels)) > len(labels)
        return cls(delimiter, labels if is_labelled else ("",) * len(labels), units)

    @property
    def header(self) -> tuple[tuple[str, ...], ...]:
        """Rows of names and of units for the header; none where no cell has one."""
        return tuple(row for row in (self.labels, self.units) if any(row))

    def with_clock(
        self, header: tuple[tuple[str, ...], ...], rows: Sequence[list[str]]
    ) -> BareCells | None:
        """Rewriting that completes a time by the column of its fraction; None if none does."""
        columns = read_columns(header)
        names = [c.unit.name if c.unit is not None else c.title.casefold() for c in columns]
        if _DIGITS.keys().isdisjoint(names):
            return None
        rows = [cells for cells in rows if len(cells) == len(self.labels)]
        times = [c for c in columns if _is_whole(c, rows[0][c.index])]
        for column, name in zip(columns, names, strict=True):
            if len(times) == 1 and name in _DIGITS and _is_part(column):
                [time] = times
                found = replace(self, clock=time.index, part=column.index, digits=_DIGITS[name])
                if all(map(found.fraction, rows)):
                    return found
        return None

    def line(self, text: str) -> str:
        """The line with plain cells, if it has as many as the first sample."""
        usual = self._usual.fullmatch(text)
        cells = split_cells(text, self.delimiter) if usual is None else list(usual.groups())
        if len(cells) != len(self.labels):
            return text
        if self.clock >= 0:
            cells[self.clock] += "." + (self.fraction(cells) or "?")
        if usual is not None:
            return self.delimiter.join(cells)
        return self.delimiter.join(map(self._cell, cells, self.labels, self.units))

    def fraction(self, cells: Sequence[str]) -> str:
        """Digits that complete a time of day; blank if the cell is no fraction of a second."""
        whole, _, rest = cells[self.part].replace(",", ".").partition(".")
        is_within = whole.isdigit() and len(whole) <= self.digits or whole in ("", "0")
        return whole.zfill(self.digits)[: self.digits] + rest if is_within else ""

    def block(self, block: Block) -> Block:
        """All lines of a block with plain cells."""
        return replace(block, text="\n".join(map(self.line, block.lines)).encode())

    @cached_property
    def _usual(self) -> re.Pattern[str]:
        """Pattern of most lines, whose groups are the plain numbers; other lines take longer."""
        number = r"([+-]?\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?)".replace(self.delimiter, "")
        gap = r"[ \t]+" if self.delimiter == " " else rf"[ \t]*{re.escape(self.delimiter)}[ \t]*"
        return re.compile(
            gap.join(
                (rf"{re.escape(label)}[:=]\s?" if label else "")
                + (number if at != self.clock else r"(\d[\d:./-]*)")
                + (f" ?{re.escape(unit)}" if unit else "")
                for at, (label, unit) in enumerate(zip(self.labels, self.units, strict=True))
            ),
            re.ASCII,
        )

    def _cell(self, cell: str, label: str, unit: str) -> str:
        found, number, of = _parts(cell)
        if number and (found, of) == (label, unit):
            cell = number
        elif number and unit and not of:
            cell += f" (without {unit})"
        return f'"{cell}"' if self.delimiter in cell else cell


def _is_whole(column: Column, cell: str) -> bool:
    """Return True for a column of times of whole seconds, of a day or since 1970."""
    is_long = column.unit is not None and column.unit.name == "s" and _SINCE_1970.fullmatch(cell)
    return "time" in column.quantities and (is_whole_second(cell) or bool(is_long))


def _is_part(column: Column) -> bool:
    """Return True for a column of times or named as a fraction; a latency in ms is none."""
    title = column.title.casefold()
    return "time" in column.quantities or title in _DIGITS or title.startswith(_PARTS_OF_A_SECOND)
