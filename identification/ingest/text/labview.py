"""Measurement files of LabVIEW (LVM), rewritten as one table before its layout is detected.

LabVIEW writes a header for each segment by default, with its own start, and its samples can end
with a comment:

    X_Columns       One        times in the first column; Multi: in front of each channel; No: none
    ***End_of_Header***
    Date, Time      2026/03/01      08:00:00.5      start of the segment
    X0, Delta_X     0.0        1e-3                 time of the first sample, interval
    ***End_of_Header***
    X_Value         Voltage    Current    Comment

Headers behind the first become blank lines, which keeps the line numbers.  Samples without times
get those of X0 and Delta_X.  Comments are dropped.

Source: National Instruments, "Specification for the LabVIEW Measurement File (.lvm)".
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from datetime import datetime
from decimal import Decimal

from identification.errors import UnsupportedContent
from identification.ingest.display import listed
from identification.ingest.text.blocks import Block
from identification.ingest.text.cells import number_text

__all__ = ["as_one_table"]

_TITLE = "LabVIEW Measurement"
_END = "***End_of_Header***"
_SAMPLE = re.compile(r"\s*[\d+\-.,]")
_STAMP = re.compile(r"(\d{4}/\d\d?/\d\d? \d\d?:\d\d:\d\d)(?:[.,](\d+))?")
_FORM = "%Y/%m/%d %H:%M:%S"


def as_one_table(blocks: Iterator[Block]) -> Iterator[Block]:
    """Blocks of lines with the segments of an LVM file joined; those of other files unchanged.

    Raises:
        UnsupportedContent: A segment has other columns than the first, or begins before the end of
            the one above it.
    """
    first = next(blocks)
    is_labview = first.text.startswith(_TITLE.encode())
    blocks = itertools.chain(iter([first]), blocks)
    del first
    if not is_labview:
        yield from blocks
        return
    table = _Table()
    for block in blocks:
        lines = itertools.starmap(table.line, enumerate(block.lines, block.first_line))
        yield replace(block, text="\n".join(lines).encode())


@dataclass
class _Segment:
    """Header of a segment, and how far its samples are read."""

    cells: dict[str, str] = field(default_factory=dict)
    """Key of each header line to its first cell."""
    rows: int = 0
    """Samples so far."""
    shift: float = 0.0
    """Time at which the times of this segment are zero [s]."""

    def cell_time(self) -> float | None:
        """Time of the next sample by start and interval of the segment [s]; None if unknown."""
        first, interval = (_number(self.cells.get(key, "")) for key in ("X0", "Delta_X"))
        if first is None or interval is None or not interval > 0.0:
            return None
        return first + self.rows * interval

    def after(self, other: _Segment) -> float | None:
        """Time from the start of another segment to that of this one [s]; None if not stated."""
        texts = (f"{each.cells.get('Date')} {each.cells.get('Time')}" for each in (other, self))
        begun = [match.groups() for match in map(_STAMP.match, texts) if match]
        try:
            # Only the difference counts, so no zone is needed.
            moments = [datetime.strptime(whole, _FORM) for whole, _ in begun]  # noqa: DTZ007
        except ValueError:
            return None
        if len(moments) < 2:
            return None
        # LabVIEW writes up to nineteen digits behind the second.
        parts = [Decimal(f"0.{part or 0}") for _, part in begun]
        return float(int((moments[1] - moments[0]).total_seconds()) + parts[1] - parts[0])


class _Table:
    """Lines of one file, rewritten in order."""

    def __init__(self) -> None:
        self._part = "title"
        """Part of the file that the next line belongs to: title, header, names or samples."""
        self._title: dict[str, str] = {}
        self._delimiter = "\t"
        self._first = self._segment = _Segment()
        self._names: list[str] = []
        """Column names of the first segment, with its key; empty until they are read."""
        self._fields = 0
        """Cells of a sample without its comment; 0 if the header does not give their number."""
        self._last = -math.inf
        """Time of the last sample [s]."""

    def line(self, number: int, line: str) -> str:
        """The line of this number as a line of the table; blank if the table does not need it."""
        if not line.strip():
            return line
        is_sample = _SAMPLE.match(line) is not None
        if self._part in ("header", "samples") and is_sample:
            self._part, self._names = "samples", self._names or [""]
            return self._sample(number, line)
        if self._part == "samples":
            self._part, self._segment = "header", _Segment()
        if self._part == "names":
            return self._named(number, line)
        return self._headed(line)

    def _headed(self, line: str) -> str:
        """A line of the title or of the header of a segment."""
        if line.startswith("Separator") and len(line) > len("Separator"):
            self._delimiter = line[len("Separator")]
        if line.startswith(_TITLE):
            self._part = "title"
        key, _, rest = line.partition(self._delimiter)
        cell = rest.partition(self._delimiter)[0].strip()
        if key.strip() == _END:
            self._part = "header" if self._part == "title" else "names"
        elif self._part == "title":
            self._title[key] = cell
            # The times of X0 and Delta_X are written into the first column.
            line = line.replace("No", "One", 1) if key == "X_Columns" else line
        else:
            self._segment.cells[key] = cell
        return "" if self._names else line

    def _named(self, number: int, line: str) -> str:
        """The line of the column names, below which the samples of a segment begin."""
        self._part = "samples"
        names = [cell.strip() for cell in line.rstrip().split(self._delimiter)]
        if self._names:
            if names != self._names:
                raise UnsupportedContent(
                    f"a segment with the columns {listed(names[1:], 6)}, and the first one has "
                    f"{listed(self._names[1:], 6)}; let the device write the same channels in "
                    "each segment, or cut the file here",
                    row=number,
                    value=line[:80],
                )
            return ""
        self._names = names
        count = self._segment.cells.get("Channels", "")
        if count.isdecimal():
            is_multi = self._title.get("X_Columns") == "Multi"
            self._fields = 2 * int(count) if is_multi else 1 + int(count)
        return self._cut(line)

    def _sample(self, number: int, line: str) -> str:
        """A sample without its comment, with the time since the start of the first segment."""
        line, segment = self._cut(line), self._segment
        cell, delimiter, rest = line.partition(self._delimiter)
        time = _number(cell) if cell.strip() else segment.cell_time()
        if time is None:
            return line
        if not segment.rows and time <= self._last:
            # The times of this segment count from its own start.
            segment.shift = segment.after(self._first) or 0.0
            if time + segment.shift <= self._last:
                raise UnsupportedContent(
                    f"a segment begins {time + segment.shift:.9g} s after the first one, which is "
                    f"before the end of the one above it ({self._last:.9g} s); let the device "
                    "write one header only, or cut the file here",
                    row=number,
                    value=line[:80],
                )
        segment.rows += 1
        self._last = time + segment.shift
        if not segment.shift and cell.strip():
            return line
        decimal = "," if self._title.get("Decimal_Separator") == "," else "."
        return repr(self._last).replace(".", decimal) + delimiter + rest

    def _cut(self, line: str) -> str:
        """The line without cells behind the channels."""
        if not self._fields or line.count(self._delimiter) < self._fields:
            return line
        return self._delimiter.join(line.split(self._delimiter, self._fields)[: self._fields])


def _number(text: str) -> float | None:
    """Number with a decimal point or comma; None for any other text."""
    number = number_text(text.strip(), "," if "," in text else ".")
    return float(number) if number is not None else None
