"""Cell-by-cell reader of sample lines, for blocks that the fast path declines.

Handles quoted cells, blank lines and comment lines, and reports the first invalid cell with its
line number.  Much slower than the fast path: about 20 us per line.
"""

from __future__ import annotations

import itertools
import math
from array import array
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from identification.errors import MissingValue, NotANumber, NotFinite, RaggedRow, UnclosedQuote
from identification.ingest.cells import expected_instead, is_number_word, number_text, split_cells
from identification.ingest.channels import Channel
from identification.ingest.dialect import COMMENT_MARKS, Layout
from identification.ingest.display import quoted
from identification.ingest.lines import SampleLines

__all__ = ["CellReader"]

Array = NDArray[np.float64]


class CellReader:
    """Cell-by-cell line reader, with the state shared by all blocks of a file.

    Args:
        layout: Layout of the table.
        channels: Channels to read.
        slow: Channels logged at a lower rate, whose cells may be blank.
        file: Name of the file in messages.

    Attributes:
        decimal: Decimal sign of the file, or None until a number has shown it.
        blank_line: Line number of the first row whose cells are all blank, or None.
    """

    def __init__(
        self, layout: Layout, channels: tuple[Channel, ...], slow: Iterable[str], file: str
    ) -> None:
        self.decimal: str | None = "." if layout.delimiter == "," else None
        self.blank_line: int | None = None
        self._layout = layout
        self._channels = channels
        self._slow = frozenset(slow)
        self._file = file

    def read(self, text: bytes, first_line: int, lines: SampleLines) -> list[Array]:
        """Read whole lines; the first invalid cell raises.

        Args:
            text: Encoded lines.
            first_line: Line number of the first of them.
            lines: Receives the line number of every sample.

        Returns:
            (n_sample,) for each channel, NaN at a blank cell of a slow channel.

        Raises:
            RunFileError: A line has the wrong number of fields or an unclosed quotation mark, or a
                cell is blank or not a finite number.
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
            self.refuse_blank_above()
            self._check_fields(line, cells, number)
            for column, channel in zip(columns, self._channels, strict=True):
                column.append(self._number(cells[channel.column.index], channel, number))
            lines.extend(number, 1)
        return [np.frombuffer(c, dtype=np.float64) if c else np.empty(0) for c in columns]

    def split(self, line: str) -> list[str]:
        """Split a line into its cells, at least one."""
        return split_cells(line, self._layout.delimiter) or [""]

    def _check_fields(self, line: str, cells: list[str], number: int) -> None:
        if line.count('"') % 2:
            raise UnclosedQuote(
                "a quotation mark is not closed on its line; remove it",
                file=self._file,
                row=number,
            )
        if len(cells) != self._layout.fields:
            raise RaggedRow(
                f"the line has {len(cells)} fields, expected {self._layout.fields} as in the first "
                "sample; write one line for each sample with a cell for each column",
                file=self._file,
                row=number,
                value=len(cells),
            )

    def refuse_blank_above(self) -> None:
        """Reject blank rows above a sample; they may only end the table."""
        if self.blank_line is not None:
            raise MissingValue(
                "all cells are blank; expected a sample; remove the line or fill it",
                file=self._file,
                row=self.blank_line,
            )

    def _number(self, cell: str, channel: Channel, line: int) -> float:
        if not cell:
            return self._blank(channel, line)
        text = number_text(cell, self.decimal or ".")
        if text is None and self.decimal is None:
            text = number_text(cell, ",")
        if text is None:
            raise self._no_number(cell, channel, line)
        if self.decimal is None and ("," in cell or "." in cell):
            self.decimal = "," if "," in cell else "."
        value = float(text)
        if not math.isfinite(value):
            raise self._not_finite(cell, channel, line)
        return value

    def _blank(self, channel: Channel, line: int) -> float:
        if channel.name in self._slow:
            return math.nan
        raise MissingValue(
            f"the cell is blank; expected a number in {channel.unit.name} (only a temperature "
            "that is logged at a lower rate may have blank cells)",
            file=self._file,
            row=line,
            column=channel.column.label,
        )

    def _no_number(self, cell: str, channel: Channel, line: int) -> NotANumber | NotFinite:
        if is_number_word(cell):
            return self._not_finite(cell, channel, line)
        return NotANumber(
            expected_instead(cell, channel.unit.name),
            file=self._file,
            row=line,
            column=channel.column.label,
            value=cell,
        )

    def _not_finite(self, cell: str, channel: Channel, line: int) -> NotFinite:
        return NotFinite(
            f"{quoted(cell)} is not a finite number; expected a number in {channel.unit.name}; "
            "cut the run before or after the invalid samples",
            file=self._file,
            row=line,
            column=channel.column.label,
            value=cell,
        )
