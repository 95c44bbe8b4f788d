"""The samples of a file, block by block: fast where a block is clean, exact where it is not."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.errors import MissingValue, NotANumber, RaggedRow, UnclosedQuote
from identification.ingest.cells import number_text
from identification.ingest.channels import Channel
from identification.ingest.dialect import Layout
from identification.ingest.fast import read_clean
from identification.ingest.lines import SampleLines
from identification.ingest.scan import CellReader
from identification.ingest.source import Block

__all__ = ["Table", "TableReader"]

Array = NDArray[np.float64]

# Lines before an unterminated last one that show how long its last cell should be.
_LINES_BEFORE = 20
_BYTES_BEFORE = 20_000
_PIECE_BYTES = 100_000


@dataclass(frozen=True)
class Table:
    """What the sample lines hold.

    Args:
        cells: Channel name to (n_sample,), the numbers as written; NaN only where a channel that
            may be logged more slowly was left blank.
        lines: Line of the file of each sample.
        cut_line: Line that ends without a line end and was left out as cut off, or None.
    """

    cells: dict[str, Array]
    lines: SampleLines
    cut_line: int | None


class TableReader:
    """Reads the blocks of one table in order.

    Args:
        layout: How the table is written.
        channels: Channels to read, by canonical name.
        slow: Channels whose cells may be blank.
        file: What messages call the file.
    """

    def __init__(
        self, layout: Layout, channels: dict[str, Channel], slow: Iterable[str], file: str
    ) -> None:
        self._layout = layout
        self._channels = tuple(channels.values())
        self._slow = frozenset(slow)
        self._cells = CellReader(layout, self._channels, self._slow, file)
        self._lines = SampleLines()
        self._parts: list[list[Array]] = [[] for _ in self._channels]
        self._cut_line: int | None = None

    def add(self, block: Block) -> None:
        """Read one more block of whole lines."""
        if block.terminated:
            self._read(block.text, block.first_line)
            return
        cut = block.text.rfind(b"\n") + 1
        before = block.text[max(0, cut - _BYTES_BEFORE) : cut].splitlines()[-_LINES_BEFORE:]
        if cut:
            self._read(block.text[:cut], block.first_line)
        line = block.first_line + block.text.count(b"\n")
        self._read_unterminated(block.text[cut:], line, before)

    def table(self) -> Table:
        """All samples that were added."""
        cells = {}
        for channel, parts in zip(self._channels, self._parts, strict=True):
            cells[channel.name] = np.concatenate(parts) if parts else np.empty(0)
            parts.clear()
        return Table(cells, self._lines, self._cut_line)

    def _read(self, text: bytes, first_line: int) -> None:
        columns = self._clean(text)
        if columns is None and len(text) > _PIECE_BYTES:
            # One bad line must not make a whole block slow.
            for piece in _pieces(text):
                self._take(self._clean(piece), piece, first_line)
                first_line += piece.count(b"\n")
            return
        self._take(columns, text, first_line)

    def _take(self, columns: list[Array] | None, text: bytes, first_line: int) -> None:
        """Take the columns of clean lines, or read lines that are not clean cell by cell."""
        if columns is None:
            columns = self._cells.read(text, first_line, self._lines)
        else:
            self._cells.refuse_blank_above()
            self._lines.extend(first_line, columns[0].size)
        for parts, column in zip(self._parts, columns, strict=True):
            parts.append(column)

    def _clean(self, text: bytes) -> list[Array] | None:
        """Columns of a clean block; the first one with a decimal sign settles it for the file."""
        known = self._cells.decimal
        for decimal in (known,) if known else (".", ","):
            columns = read_clean(text, self._layout, self._channels, self._slow, decimal)
            if columns is not None:
                if decimal.encode() in text:
                    self._cells.decimal = decimal
                return columns
        return None

    def _read_unterminated(self, text: bytes, line: int, before: list[bytes]) -> None:
        """Read a last line without line end; one that was cut off is left out.

        A number whose last digits are missing still reads as a number, so a last cell shorter
        than all before it counts as cut off too: one sample lost is better than one wrong.
        """
        usual = min((len(self._last_cell(other)) for other in before), default=0)
        if len(self._last_cell(text)) < usual:
            self._cut_line = line
            return
        try:
            self._read(text, line)
        except (RaggedRow, NotANumber, MissingValue, UnclosedQuote):
            # Whole lines that are wrong must not pass as cut off.
            if self._cells.blank_line is not None or self._is_whole(text):
                raise
            self._cut_line = line

    def _last_cell(self, text: bytes) -> str:
        return self._cells.split(text.decode("utf-8", "replace"))[-1]

    def _is_whole(self, text: bytes) -> bool:
        """Whether a line has all its fields and its last number is one."""
        cells = self._cells.split(text.decode("utf-8", "replace"))
        last = len(cells) - 1
        used = any(channel.column.index == last for channel in self._channels)
        number = number_text(cells[last], self._cells.decimal or ".") is not None
        return len(cells) == self._layout.fields and (number or not used)


def _pieces(text: bytes) -> Iterator[bytes]:
    """Cut whole lines into pieces of whole lines."""
    start = 0
    while start < len(text):
        end = text.find(b"\n", start + _PIECE_BYTES) + 1 or len(text)
        yield text[start:end]
        start = end
