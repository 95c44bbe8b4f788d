"""Header row detection: select the lines above the first sample that name its columns.

Header rows stand directly above the samples and have the same number of cells: column names,
optionally a row of units and a second row of names.  A line that contains numbers between names and
samples is a damaged sample and raises an error.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from identification.errors import HeaderTooLong, NoHeader, NotANumber, RaggedRow, RunFileError
from identification.ingest.display import plain, quoted
from identification.ingest.names import LONGEST_CELL, is_channel_name, is_units_row
from identification.ingest.text.cells import is_number, split_cells

__all__ = ["HeaderRows", "Line"]

_MOST_ROWS = 5
_WHOLE = re.compile(r"[+-]?\d+", re.ASCII)
# A whole number has no leading zero.
_FRACTION = re.compile(r"0\d+", re.ASCII)


@dataclass(frozen=True)
class Line:
    """One line of the preview: its line number in the file and its text."""

    number: int
    text: str


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
        """Find the header rows above the first sample, each with its cells, from top to bottom.

        Comments are searched if the lines hold no header; names from the preamble of a device stand
        for a missing one.

        Raises:
            RunFileError: No line above the samples names their columns, a header cell is too long,
                or a line between names and samples is a damaged sample.
        """
        rows = self._collect(lines)
        if not rows:
            before = [line for line in comments if line.number < self._sample.number]
            rows = self._collect(before)
        if not rows and names:
            return [(self._sample, [""] * self._fields)]
        if not rows:
            raise self._headless(lines)
        return rows

    def _collect(self, lines: list[Line]) -> list[tuple[Line, list[str]]]:
        rows: list[tuple[Line, list[str]]] = []
        named = False
        for line in reversed(lines[-_MOST_ROWS:]):
            cells = self._fitted(line)
            apart = bool(rows) and rows[0][0].number - line.number > 1
            if cells is None or (named and apart):
                break
            self._refuse_long(line, cells)
            if any(is_number(cell) for cell in cells):
                if named:
                    break
                self._refuse_damaged_sample(line, cells, lines)
            rows.insert(0, (line, cells))
            named = named or not is_units_row(cells)
        return rows

    def _refuse_long(self, line: Line, cells: list[str]) -> None:
        """Reject header cells that are too long to be repeated in messages and mappings."""
        for index, cell in enumerate(cells):
            if len(cell) > LONGEST_CELL:
                raise HeaderTooLong(
                    f"a header of {len(cell)} characters; expected at most {LONGEST_CELL}; "
                    "shorten the column name",
                    row=line.number,
                    column=str(index + 1),
                    value=len(cell),
                )

    def _fitted(self, line: Line) -> list[str] | None:
        """Cells of a header line that match the samples in number, or None.

        A trailing delimiter is tolerated.
        """
        delimiters = (self._delimiter,) if self._delimiter != " " else (" ", ",", ";", "\t")
        for delimiter in delimiters:
            cells = split_cells(line.text, delimiter, units_in_brackets=True)
            if len(cells) == self._fields:
                return cells
            # LabVIEW ends its header with a column Comment that the samples may lack.
            extra = cells[-1].casefold() if len(cells) == self._fields + 1 else None
            if extra in ("", "comment"):
                return cells[:-1]
            if len(cells) == self._fields - 1 and not self._sample_cells[-1]:
                return [*cells, ""]
        return None

    def _refuse_damaged_sample(self, line: Line, cells: list[str], lines: list[Line]) -> None:
        """Raise if a line with numbers directly below the names is a damaged sample."""
        above = [other for other in lines if other.number < line.number][-1:]
        names = self._fitted(above[0]) if above else None
        if names is None or is_units_row(cells) or any(map(self._is_number, names)):
            return
        at = next((k for k, cell in enumerate(cells) if not self._is_number(cell)), 0)
        raise NotANumber(
            f"{quoted(cells[at])} is not a number; expected a sample below the column names",
            row=line.number,
            column=plain(names[at]),
            value=cells[at],
        )

    def _is_number(self, cell: str) -> bool:
        return is_number(cell)

    def _headless(self, lines: list[Line]) -> RunFileError:
        """Error for samples that have no matching row of names above them."""
        last = split_cells(lines[-1].text, self._delimiter) if lines else []
        # Each of n numbers with a decimal comma has one or two fields.
        is_halved = self._delimiter == "," and len(last) < self._fields <= 2 * len(last)
        is_named = len(last) > 1 and any(map(is_channel_name, last))
        if (is_named and is_halved and self._are_whole()) or self._has_fractions():
            return RaggedRow(
                f"the comma is both the decimal sign and the delimiter, which makes {self._fields} "
                "fields of each sample; export with a decimal point, or with a semicolon or tab "
                "as the delimiter",
                row=self._sample.number,
                value=self._fields,
            )
        if len(last) < 2 or not any(map(is_channel_name, last)):
            return NoHeader(
                f"the samples have no header that names their {self._fields} columns; "
                "add a header such as time_s,voltage_V,current_A,speed_rad_s,temperature_degC",
                row=self._sample.number,
            )
        return RaggedRow(
            f"the samples have {self._fields} fields and the header has {len(last)}; write one "
            "name for each column",
            row=self._sample.number,
            value=self._fields,
        )

    def _are_whole(self) -> bool:
        return all(map(_WHOLE.fullmatch, self._sample_cells))

    def _has_fractions(self) -> bool:
        """Whether fields between commas are digits after a decimal comma, such as ``001``."""
        fractions = [cell for cell in self._sample_cells if _FRACTION.fullmatch(cell)]
        return self._delimiter == "," and self._are_whole() and bool(fractions)
