"""Reader of sample lines: fast path for clean blocks, cell by cell for all others.

Cell by cell, it handles quoted cells, blank lines and comment lines, and collects the invalid lines
and cells with their line numbers.  That is much slower than the fast path: about 20 us per line.
"""

from __future__ import annotations

import bisect
import copy
import math
from array import array
from collections.abc import Iterator, Sequence

import numpy as np

from identification.arrays import Array
from identification.errors import (
    MissingValue,
    NotANumber,
    RaggedRow,
    RunFileError,
    UnclosedQuote,
    UnsupportedContent,
    WrongUnit,
)
from identification.ingest.channels import Channel
from identification.ingest.display import plain, quoted
from identification.ingest.faults import Faults
from identification.ingest.reader import blank_cell, not_finite
from identification.ingest.supplied import direction_of
from identification.ingest.text.blocks import Block
from identification.ingest.text.cells import (
    ClockTimes,
    LongTimes,
    clock_of,
    expected_instead,
    finer_unit,
    is_number_word,
    number_text,
    split_cells,
)
from identification.ingest.text.dialect import COMMENT_MARKS, Layout
from identification.ingest.text.fast import read_clean, read_times
from identification.ingest.text.header import KEYS

__all__ = ["SampleReader"]

# Lines before an unterminated last line that determine the usual length of its last cell.
_LINES_BEFORE = 20
_BYTES_BEFORE = 20_000
_PIECE_BYTES = 100_000
_OF_A_CUT_LINE = (RaggedRow, NotANumber, MissingValue, UnclosedQuote)


class SampleLines:
    """Line number of each sample, stored as ranges of consecutive lines."""

    def __init__(self) -> None:
        self.total = 0
        self._ranges: list[tuple[int, int]] = []
        """First sample and its line."""

    def extend(self, first_line: int, count: int) -> None:
        """Append `count` samples on consecutive lines, beginning at `first_line`."""
        if count and (not self.total or self.line(self.total - 1) + 1 != first_line):
            self._ranges.append((self.total, first_line))
        self.total += count

    def line(self, sample: int) -> int:
        """Line number, counted from 1, of a sample."""
        first, line = self._ranges[bisect.bisect(self._ranges, (sample, math.inf)) - 1]
        return line + sample - first


class SampleReader:
    """Reader of the blocks of one table, in order.

    Attributes:
        lines: Line number of each sample.
        cut_line: Line number of a truncated last line that was dropped, or None.
        faults: Invalid lines and cells of the file so far.
    """

    def __init__(self, layout: Layout, channels: Sequence[Channel]) -> None:
        self.lines = SampleLines()
        self.cut_line: int | None = None
        self.faults = Faults()
        self._decimal: str | None = None
        """Decimal sign of the file, or None until a number has shown it."""
        self._blank_line: int | None = None
        """Line number of the first row of the last blank rows, or None."""
        self._clocks = _clocks(channels, layout)
        self._layout = layout
        self._channels = channels
        self._parts: list[list[Array]] = [[] for _ in channels]

    def add(self, block: Block) -> None:
        """Read the next block of whole lines."""
        if block.terminated:
            self._add(block.text, block.first_line)
            return
        cut = block.text.rfind(b"\n") + 1
        before = block.text[max(0, cut - _BYTES_BEFORE) : cut].splitlines()[-_LINES_BEFORE:]
        if cut:
            self._add(block.text[:cut], block.first_line)
        line = block.first_line + block.text.count(b"\n")
        self._read_unterminated(block.text[cut:], line, before)

    def samples(self) -> dict[str, Array]:
        """All samples read so far, (n_sample,) for each channel; the reader gives up its copy."""
        found = {}
        for channel, parts in zip(self._channels, self._parts, strict=True):
            found[channel.name] = np.concatenate(parts)
            parts.clear()
        return found

    def _add(self, text: bytes, first_line: int) -> None:
        columns = self._clean(text)
        if columns is None and len(text) > _PIECE_BYTES:
            # One bad line must not slow down the whole block.
            for piece in _pieces(text):
                self._take(self._clean(piece), piece, first_line)
                first_line += piece.count(b"\n")
            return
        self._take(columns, text, first_line)

    def _take(self, columns: list[Array] | None, text: bytes, first_line: int) -> None:
        """Append parsed columns, or read the lines cell by cell if the fast path declined them."""
        if columns is None:
            columns = self.read(text, first_line)
        else:
            self._note_blank_above()
            self.lines.extend(first_line, columns[0].size)
        for parts, column in zip(self._parts, columns, strict=True):
            parts.append(column)

    def _clean(self, text: bytes) -> list[Array] | None:
        """Columns of a clean block; the first decimal sign found applies to the whole file."""
        clocks = {name: copy.copy(clock) for name, clock in self._clocks.items()}
        times: dict[str, Array] = {}
        for time in (c for c in self._channels if c.name in clocks):
            cells = read_times(text, self._layout, time, clocks[time.name])
            if cells is None:
                return None
            times[time.name] = cells
        numeric = [c for c in self._channels if c.name not in clocks]
        known = self._decimal
        is_comma_free = self._layout.delimiter != ","
        if known == "," and not is_comma_free:
            # Quoted decimal commas between commas are read cell by cell.
            return None
        for decimal in (known,) if known else (".", ",")[: 1 + is_comma_free]:
            columns = read_clean(text, self._layout, numeric, decimal)
            if columns is not None:
                is_seen = decimal.encode() in text
                if times:
                    # The times may have another decimal sign.
                    is_seen = any(np.any(cells % 1.0 > 0.0) for cells in columns)
                    self._clocks = clocks
                self._decimal = decimal if is_seen else known
                found = times | dict(zip((c.name for c in numeric), columns, strict=True))
                return [found[channel.name] for channel in self._channels]
        return None

    def _read_unterminated(self, text: bytes, line: int, before: list[bytes]) -> None:
        """Read a last line without line end; drop it if it is truncated.

        A number without its last digits is still a number.  The line therefore counts as truncated
        if its last cell is shorter than that of every compared line: losing one sample is better
        than using a wrong one.
        """
        cells = self._split(text)
        if len(cells[-1]) < min((len(self._split(other)[-1]) for other in before), default=0):
            self.cut_line = line
            return
        earlier, self.faults = self.faults, Faults()
        is_below_blank = self._blank_line is not None
        self._add(text, line)
        found, self.faults = self.faults.errors(), earlier
        # A complete line with an error must not pass as truncated.
        is_cut = all(isinstance(error, _OF_A_CUT_LINE) for error in found)
        if found and is_cut and not is_below_blank and not self._is_whole(cells):
            self.cut_line = line
            return
        for error in found:
            earlier.add(error)

    def _is_whole(self, cells: list[str]) -> bool:
        """Return True if a line has all its fields and its last cell, if used, is a number."""
        used = any(channel.column.index == len(cells) - 1 for channel in self._channels)
        number = number_text(cells[-1], self._decimal or ".") is not None
        return len(cells) == self._layout.fields and (number or not used)

    def read(self, text: bytes, first_line: int) -> list[Array]:
        """Read whole lines cell by cell; one with an invalid cell is a fault and no sample.

        Return (n_sample,) for each channel, NaN at a blank cell.

        Raises:
            UnsupportedContent: The samples are interrupted by a header.
            RunFileError: The file has too many faults to go on.
        """
        columns = [array("d") for _ in self._channels]
        # Not splitlines(), which also splits at form feeds and other Unicode separators.
        lines = text.decode("utf-8", "replace").removesuffix("\n").split("\n")
        for number, line in enumerate(lines, first_line):
            stripped = line.strip()
            if not stripped or stripped.startswith(COMMENT_MARKS):
                continue
            cells = self._split(line)
            if not any(cells):
                self._blank_line = self._blank_line or number
                continue
            self._note_blank_above()
            values = self._values(line, cells, number)
            if len(values) < len(columns):
                if cells[0].casefold() in KEYS:
                    raise UnsupportedContent(
                        f"a second header within the samples, at {quoted(cells[0])}; let the "
                        "device write one header only, or cut the file here",
                        row=number,
                        value=cells[0],
                    )
                continue
            for column, value in zip(columns, values, strict=True):
                column.append(value)
            self.lines.extend(number, 1)
        return [np.frombuffer(c, dtype=np.float64) if c else np.empty(0) for c in columns]

    def _split(self, line: bytes | str) -> list[str]:
        """Cells of a line, at least one."""
        text = line.decode("utf-8", "replace") if isinstance(line, bytes) else line
        return split_cells(text, self._layout.delimiter) or [""]

    def _values(self, line: str, cells: list[str], number: int) -> list[float]:
        """Values of the valid cells of a line; its faults are recorded."""
        if line.count('"') % 2:
            message = "a quotation mark is not closed on its line; remove it"
            self.faults.add(UnclosedQuote(message, row=number))
            return []
        if len(cells) != self._layout.fields:
            ragged = RaggedRow(
                f"the line has {len(cells)} fields, expected {self._layout.fields} as in the first "
                "sample; write one line for each sample with a cell for each column, or remove a "
                "damaged line, which leaves a gap",
                row=number,
                value=f"{len(cells)} fields",
            )
            self.faults.add(ragged)
            return []
        values: list[float] = []
        for channel in self._channels:
            try:
                values.append(self._number(cells[channel.column.index], channel, number))
            except RunFileError as error:
                self.faults.add(error)
        return values

    def _note_blank_above(self) -> None:
        """Record blank rows above a sample as a fault; they may only end the table."""
        if self._blank_line is not None:
            blank = MissingValue(
                "all cells are blank; expected a sample; remove the line or fill it",
                row=self._blank_line,
            )
            self._blank_line = None
            self.faults.add(blank)

    def _number(self, cell: str, channel: Channel, line: int) -> float:
        if not cell:
            if channel.may_lack:
                return math.nan
            raise blank_cell(channel, line)
        if channel.is_direction:
            return direction_of(cell, channel.column.label, line)
        if channel.name in self._clocks:
            seconds = self._clocks[channel.name].seconds(cell)
            if seconds is None:
                raise NotANumber(
                    f"{quoted(cell)} is no time like that of the first sample, "
                    f"{quoted(self._layout.sample[channel.column.index])}",
                    row=line,
                    column=channel.column.label,
                    value=cell,
                )
            return seconds
        signs = self._decimal or ".,"
        text = next(filter(None, (number_text(cell, sign) for sign in signs)), None)
        if text is None:
            if is_number_word(cell):
                raise not_finite(cell, channel, line)
            raise NotANumber(
                expected_instead(cell, channel.unit.name),
                row=line,
                column=channel.column.label,
                value=cell,
            )
        if self._decimal is None and ("," in cell or "." in cell):
            self._decimal = "," if "," in cell else "."
        value = float(text)
        if not math.isfinite(value):
            raise not_finite(cell, channel, line)
        return value


def _pieces(text: bytes) -> Iterator[bytes]:
    """Split whole lines into pieces of whole lines."""
    start = 0
    while start < len(text):
        end = text.find(b"\n", start + _PIECE_BYTES) + 1 or len(text)
        yield text[start:end]
        start = end


def _clocks(channels: Sequence[Channel], layout: Layout) -> dict[str, ClockTimes | LongTimes]:
    """Readers of times of day, or since 1970, by channel; all count from the same time.

    Raises:
        WrongUnit: The mapping scales times of day, or a time is absurd in its unit.
    """
    clocks: dict[str, ClockTimes | LongTimes] = {}
    first = ""
    for time in (channel for channel in channels if channel.unit.quantity == "time"):
        cell = layout.sample[time.column.index] if time.column.index < len(layout.sample) else ""
        seconds = 0.0 if time.offset else time.scale * time.unit.factor
        if finer := finer_unit(cell, seconds):
            raise WrongUnit(
                f"{cell} {time.unit.name} since 1970 is later than the year 5000; expected {finer}",
                column=time.column.label,
                examples=[{"time_s": {"column": plain(time.column.title, 80), "unit": finer}}],
            )
        clock = clock_of(cell, seconds, first)
        is_scaled = (time.unit.name, time.scale, time.offset) != ("s", 1.0, 0.0)
        if isinstance(clock, ClockTimes) and is_scaled:
            raise WrongUnit(
                "the cells are times of day, which are read in seconds; remove unit, scale and "
                "offset from the mapping",
                column=time.column.label,
            )
        if clock is not None:
            clocks[time.name] = clock
            first = first or cell
    return clocks
