"""Cell-by-cell reader of sample lines, for blocks that the fast path declines.

Handles quoted cells, blank lines and comment lines, and collects the invalid lines and cells with
their line numbers.  Much slower than the fast path: about 20 us per line.
"""

from __future__ import annotations

import bisect
import itertools
import math
from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from identification.arrays import Array
from identification.errors import (
    MissingValue,
    NotANumber,
    RaggedRow,
    RunFileError,
    UnclosedQuote,
    WrongUnit,
)
from identification.ingest.channels import Channel
from identification.ingest.display import quoted
from identification.ingest.faults import Faults
from identification.ingest.reader import blank_cell, not_finite
from identification.ingest.text.cells import (
    expected_instead,
    is_number_word,
    number_text,
    split_cells,
)
from identification.ingest.text.clock import ClockTimes, is_time_of_day
from identification.ingest.text.dialect import COMMENT_MARKS, Layout

__all__ = ["CellReader", "SampleLines"]


@dataclass
class SampleLines:
    """Line number of each sample, stored as ranges of consecutive lines."""

    first_samples: list[int] = field(default_factory=list)
    first_lines: list[int] = field(default_factory=list)
    total: int = 0

    def extend(self, first_line: int, count: int) -> None:
        """Append `count` samples on consecutive lines, beginning at `first_line`."""
        if not count:
            return
        if not self.total or self.line(self.total - 1) + 1 != first_line:
            self.first_samples.append(self.total)
            self.first_lines.append(first_line)
        self.total += count

    def line(self, sample: int) -> int:
        """Line number, counted from 1, of a sample."""
        at = bisect.bisect_right(self.first_samples, sample) - 1
        return self.first_lines[at] + sample - self.first_samples[at]


class CellReader:
    """Cell-by-cell line reader, with the state shared by all blocks of a file.

    Attributes:
        decimal: Decimal sign of the file, or None until a number has shown it.
        blank_line: Line number of the first row of the last blank rows, or None.
        faults: Invalid lines and cells of the file so far.
        clock: Reader of the times if the first one is a time of day, else None.
    """

    def __init__(self, layout: Layout, channels: Sequence[Channel]) -> None:
        self.decimal: str | None = None
        self.blank_line: int | None = None
        self.faults = Faults()
        time = next((c for c in channels if c.name == "time_s"), None)
        self.clock = ClockTimes() if time is not None and _is_clock(time, layout) else None
        self._layout = layout
        self._channels = channels

    def read(self, text: bytes, first_line: int, lines: SampleLines) -> list[Array]:
        """Read whole lines; one with an invalid cell is added to `faults` and is no sample.

        Return (n_sample,) for each channel, NaN at a blank cell; `lines` receives their line
        numbers.

        Raises:
            RunFileError: The file has too many faults to go on.
        """
        columns = [array("d") for _ in self._channels]
        whole = text.decode("utf-8", "replace")
        numbers = itertools.count(first_line)
        # Not splitlines(), which also splits at form feeds and other Unicode separators.
        for number, line in zip(numbers, whole.removesuffix("\n").split("\n"), strict=False):
            stripped = line.strip()
            if not stripped or stripped.startswith(COMMENT_MARKS):
                continue
            cells = self.split(line)
            if not any(cells):
                self.blank_line = self.blank_line or number
                continue
            self.note_blank_above()
            values = self._values(line, cells, number)
            if len(values) < len(columns):
                continue
            for column, value in zip(columns, values, strict=True):
                column.append(value)
            lines.extend(number, 1)
        return [np.frombuffer(c, dtype=np.float64) if c else np.empty(0) for c in columns]

    def split(self, line: str) -> list[str]:
        """Split a line into its cells, at least one."""
        return split_cells(line, self._layout.delimiter) or [""]

    def _values(self, line: str, cells: list[str], number: int) -> list[float]:
        """Values of the valid cells of a line; its faults are recorded."""
        fault = self._fields_error(line, cells, number)
        if fault is not None:
            self.faults.add(fault)
            return []
        values: list[float] = []
        for channel in self._channels:
            try:
                values.append(self._number(cells[channel.column.index], channel, number))
            except RunFileError as error:
                self.faults.add(error)
        return values

    def _fields_error(self, line: str, cells: list[str], number: int) -> RunFileError | None:
        if line.count('"') % 2:
            return UnclosedQuote(
                "a quotation mark is not closed on its line; remove it", row=number
            )
        if len(cells) != self._layout.fields:
            return RaggedRow(
                f"the line has {len(cells)} fields, expected {self._layout.fields} as in the first "
                "sample; write one line for each sample with a cell for each column",
                row=number,
                value=f"{len(cells)} fields",
            )
        return None

    def note_blank_above(self) -> None:
        """Record blank rows above a sample as a fault; they may only end the table."""
        if self.blank_line is not None:
            blank = MissingValue(
                "all cells are blank; expected a sample; remove the line or fill it",
                row=self.blank_line,
            )
            self.blank_line = None
            self.faults.add(blank)

    def _seconds(self, clock: ClockTimes, cell: str, channel: Channel, line: int) -> float:
        seconds = clock.seconds(cell)
        if seconds is None:
            raise NotANumber(
                f"{quoted(cell)} is no time of day like that of the first sample; expected one "
                "such as 08:00:00.125 or 2026-03-01T08:00:00.125",
                row=line,
                column=channel.column.label,
                value=cell,
            )
        return seconds

    def _number(self, cell: str, channel: Channel, line: int) -> float:
        if not cell:
            if channel.may_be_blank:
                return math.nan
            raise blank_cell(channel, line)
        if self.clock is not None and channel.name == "time_s":
            return self._seconds(self.clock, cell, channel, line)
        text = number_text(cell, self.decimal or ".")
        if text is None and self.decimal is None:
            text = number_text(cell, ",")
        if text is None:
            if is_number_word(cell):
                raise not_finite(cell, channel, line)
            raise NotANumber(
                expected_instead(cell, channel.unit.name),
                row=line,
                column=channel.column.label,
                value=cell,
            )
        if self.decimal is None and ("," in cell or "." in cell):
            self.decimal = "," if "," in cell else "."
        value = float(text)
        if not math.isfinite(value):
            raise not_finite(cell, channel, line)
        return value


def _is_clock(time: Channel, layout: Layout) -> bool:
    """Return True if the first time is a time of day, which the mapping must not scale."""
    index = time.column.index
    if index >= len(layout.sample) or not is_time_of_day(layout.sample[index]):
        return False
    if (time.unit.name, time.scale, time.offset) != ("s", 1.0, 0.0):
        raise WrongUnit(
            "the cells are times of day, which are read in seconds; remove unit, scale and offset "
            "from the mapping",
            column=time.column.label,
        )
    return True
