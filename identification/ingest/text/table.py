"""Text table reader: fast path for clean blocks, cell by cell for all others."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from identification.arrays import Array
from identification.errors import MissingValue, NoRows, NotANumber, RaggedRow, UnclosedQuote
from identification.ingest.channels import Channel
from identification.ingest.columns import Column, read_columns
from identification.ingest.faults import Faults
from identification.ingest.file import Limits, RunFile
from identification.ingest.reader import Samples
from identification.ingest.run import RunWarning
from identification.ingest.text.blocks import Block, read_blocks
from identification.ingest.text.cell_reader import CellReader, SampleLines
from identification.ingest.text.cells import number_text
from identification.ingest.text.clock import is_time_of_day
from identification.ingest.text.dialect import Layout, detect_layout
from identification.ingest.text.fast import read_clean

__all__ = ["TextReader", "TextTable", "open_text"]


# Lines before an unterminated last line that determine the usual length of its last cell.
_LINES_BEFORE = 20
_BYTES_BEFORE = 20_000
_PIECE_BYTES = 100_000
_OF_A_CUT_LINE = (RaggedRow, NotANumber, MissingValue, UnclosedQuote)


class TextReader:
    """Reader of text tables and of all files that no other reader recognises.

    Its errors say which other format a file has.
    """

    def recognises(self, name: str, head: bytes) -> bool:
        """Return True: this reader is the last to be asked."""
        return True

    def open(self, file: RunFile) -> TextTable:
        """Detect the layout of the table."""
        return open_text(file.chunks(), file.limits, file.name)


def open_text(chunks: Iterator[bytes], limits: Limits, file: str) -> TextTable:
    """Detect the layout of a text table in any encoding.

    Raises:
        RunFileError: The text holds no table.
    """
    blocks = read_blocks(chunks, limits)
    first = next(blocks)
    layout = detect_layout(first, limits)
    # The iterator, unlike the list, frees the first block once it has been read.
    rest = iter([first.from_line(layout.first_line)])
    return TextTable(layout, itertools.chain(rest, blocks), file)


class TextTable:
    """Text table, read block by block from the first sample on."""

    def __init__(self, layout: Layout, blocks: Iterable[Block], file: str) -> None:
        columns = layout.preamble.columns(read_columns(layout.header))
        self.columns = [_with_clock(column, layout.sample) for column in columns]
        self._layout = layout
        self._blocks = blocks
        self._file = file

    def read(self, channels: Sequence[Channel]) -> Samples:
        """Read all blocks.

        Raises:
            NoRows: There is no sample.
            RunFileError: Lines or cells are faulty; the error reports all of them.
        """
        cells = [c for c in channels if c.column.index < self._layout.fields]
        reader = _BlockReader(self._layout, cells)
        for block in self._blocks:
            reader.add(block)
        reader.refuse_faults()
        if not reader.lines.total:
            raise NoRows(
                "no sample below the header; expected one line for each sample",
                row=self._layout.header_line,
            )
        cut = RunWarning(
            code="truncated_last_row",
            message="the last line is truncated, probably by a loss of power; it is omitted",
            file=self._file,
            row=reader.cut_line,
        )
        warnings = [] if cut.row is None else [cut]
        warnings += _missing_samples(reader.lines.total, self._layout.preamble.samples, self._file)
        found = reader.cells()
        clock = self._layout.preamble.clock
        for channel in channels:
            if channel.name not in found and clock is not None:
                # The time that the preamble implies is no column of the table.
                steps = np.arange(reader.lines.total, dtype=np.float64)
                found[channel.name] = clock[0] + steps * clock[1]
        return Samples(found, reader.lines.line, tuple(warnings))


def _missing_samples(rows: int, stated: int, file: str) -> Iterator[RunWarning]:
    """Warning if a table has fewer samples than the device states above it."""
    if rows < stated:
        text = (
            f"{rows} samples, and the header states {stated}: the end is missing, probably by a "
            "loss of power or an interrupted copy; the samples that are there are read"
        )
        yield RunWarning(code="incomplete_file", message=text, file=file)


def _with_clock(column: Column, sample: Sequence[str]) -> Column:
    """The column in seconds if it is a time and its cells are times of day."""
    cell = sample[column.index] if column.index < len(sample) else ""
    if "time" not in column.quantities or not is_time_of_day(cell):
        return column
    return dataclasses.replace(column, quantities=frozenset({"time"}), unit_texts=("s",))


class _BlockReader:
    """Reader of the blocks of one table, in order.

    Attributes:
        lines: Line number of each sample.
        cut_line: Line number of a truncated last line that was dropped, or None.
    """

    def __init__(self, layout: Layout, channels: Sequence[Channel]) -> None:
        self.lines = SampleLines()
        self.cut_line: int | None = None
        self._layout = layout
        self._channels = channels
        self._cells = CellReader(layout, channels)
        self._parts: list[list[Array]] = [[] for _ in channels]

    def add(self, block: Block) -> None:
        """Read the next block of whole lines."""
        if block.terminated:
            self._read(block.text, block.first_line)
            return
        cut = block.text.rfind(b"\n") + 1
        before = block.text[max(0, cut - _BYTES_BEFORE) : cut].splitlines()[-_LINES_BEFORE:]
        if cut:
            self._read(block.text[:cut], block.first_line)
        line = block.first_line + block.text.count(b"\n")
        self._read_unterminated(block.text[cut:], line, before)

    def refuse_faults(self) -> None:
        """Raise one error with all faulty lines and cells of the file, if there are any."""
        self._cells.faults.refuse()

    def cells(self) -> dict[str, Array]:
        """All samples read so far; the reader gives up its copy."""
        cells = {}
        for channel, parts in zip(self._channels, self._parts, strict=True):
            cells[channel.name] = np.concatenate(parts)
            parts.clear()
        return cells

    def _read(self, text: bytes, first_line: int) -> None:
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
            columns = self._cells.read(text, first_line, self.lines)
        else:
            self._cells.note_blank_above()
            self.lines.extend(first_line, columns[0].size)
        for parts, column in zip(self._parts, columns, strict=True):
            parts.append(column)

    def _clean(self, text: bytes) -> list[Array] | None:
        """Columns of a clean block; the first decimal sign found applies to the whole file."""
        if self._cells.clock is not None:
            return None
        known = self._cells.decimal
        is_comma_free = self._layout.delimiter != ","
        if known == "," and not is_comma_free:
            # Quoted decimal commas between commas are read cell by cell.
            return None
        for decimal in (known,) if known else (".", ",")[: 1 + is_comma_free]:
            columns = read_clean(text, self._layout, self._channels, decimal)
            if columns is not None:
                if decimal.encode() in text:
                    self._cells.decimal = decimal
                return columns
        return None

    def _read_unterminated(self, text: bytes, line: int, before: list[bytes]) -> None:
        """Read a last line without line end; drop it if it is truncated.

        A number without its last digits is still a number.  The line therefore counts as truncated
        if its last cell is shorter than that of every compared line: losing one sample is better
        than using a wrong one.
        """
        usual = min((len(self._last_cell(other)) for other in before), default=0)
        if len(self._last_cell(text)) < usual:
            self.cut_line = line
            return
        earlier, self._cells.faults = self._cells.faults, Faults()
        is_below_blank = self._cells.blank_line is not None
        self._read(text, line)
        found, self._cells.faults = self._cells.faults.errors(), earlier
        # A complete line with an error must not pass as truncated.
        is_cut = all(isinstance(error, _OF_A_CUT_LINE) for error in found)
        if found and is_cut and not is_below_blank and not self._is_whole(text):
            self.cut_line = line
            return
        for error in found:
            earlier.add(error)

    def _last_cell(self, text: bytes) -> str:
        return self._cells.split(text.decode("utf-8", "replace"))[-1]

    def _is_whole(self, text: bytes) -> bool:
        """Return True if a line has all its fields and its last cell, if used, is a number."""
        cells = self._cells.split(text.decode("utf-8", "replace"))
        last = len(cells) - 1
        used = any(channel.column.index == last for channel in self._channels)
        number = number_text(cells[last], self._cells.decimal or ".") is not None
        return len(cells) == self._layout.fields and (number or not used)


def _pieces(text: bytes) -> Iterator[bytes]:
    """Split whole lines into pieces of whole lines."""
    start = 0
    while start < len(text):
        end = text.find(b"\n", start + _PIECE_BYTES) + 1 or len(text)
        yield text[start:end]
        start = end
