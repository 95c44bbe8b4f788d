"""Text table reader: its layout from the first block, its samples block by block."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from identification.errors import NoRows
from identification.ingest.channels import Channel
from identification.ingest.clocks import is_apart
from identification.ingest.columns import Column, describe_column, read_columns
from identification.ingest.file import Limits, RunFile
from identification.ingest.reader import Samples, SourceTable, refuse_not_finite
from identification.ingest.run import RunWarning
from identification.ingest.text.blocks import Block, Splitter, plain_lines
from identification.ingest.text.cells import is_number, is_time_of_day
from identification.ingest.text.dialect import Layout, detect_layout
from identification.ingest.text.interval import interval_warning
from identification.ingest.text.labview import as_one_table
from identification.ingest.text.long import cut_line, is_long, read_long
from identification.ingest.text.samples import SampleReader
from identification.ingest.text.stacked import is_stacked, stacked_table
from identification.ingest.units import unit_since_1970

__all__ = ["TextReader", "TextTable", "open_text"]

_LONGEST_COUNT = 16
"""Digits of a whole number from which a time counts 100 ns since 1601, as in Windows."""


class TextReader:
    """Reader of text tables and of all files that no other reader recognises.

    Its errors say which other format a file has.
    """

    def recognises(self, name: str, head: bytes) -> bool:
        """Return True: this reader is the last to be asked."""
        return True

    def open(self, file: RunFile) -> SourceTable:
        """Detect the layout of the table."""
        return open_text(file.chunks(), file.limits, file.name)


def open_text(chunks: Iterator[bytes], limits: Limits, file: str) -> SourceTable:
    """Detect the layout of a text table in any encoding.

    A table with one signal per row, or with one below another, is read completely.

    Raises:
        RunFileError: The text holds no table.
    """
    blocks = as_one_table(plain_lines(Splitter(limits).split(chunks)))
    first = next(blocks)
    for is_of_kind, table in ((is_long, read_long), (is_stacked, stacked_table)):
        if is_of_kind(first):
            return table(itertools.chain(iter([first]), blocks), file)
    layout = detect_layout(first, limits)
    # The iterator, unlike the list, frees the first block once it has been read.
    rest = iter([first.from_line(layout.first_line)])
    return TextTable(layout, itertools.chain(rest, blocks), file)


class TextTable:
    """Text table, read block by block from the first sample on."""

    def __init__(self, layout: Layout, blocks: Iterable[Block], file: str) -> None:
        columns = read_columns(layout.header)
        if layout.preamble.implied is not None:
            # Rigol leaves the cells of the time blank.
            columns = [
                describe_column(c.index, [])
                if "time" in c.quantities and not layout.sample[c.index]
                else c
                for c in columns
            ]
        columns = layout.preamble.columns(columns)
        at = layout.first_field
        columns = [dataclasses.replace(column, index=column.index + at) for column in columns]
        # A delimiter at the end of each line makes a column without name and cells.
        named = [c for c in columns if c.texts or c.unit_texts or layout.sample[c.index]]
        is_named = any("time" in column.quantities for column in named)
        self.columns = [_with_clock(column, layout.sample, is_named) for column in named]
        if layout.bare is not None and layout.bare.clock >= 0:
            (part,) = (c for c in self.columns if c.index == layout.bare.part)
            self.columns = [
                dataclasses.replace(c, texts=(f"{c.title}, {part.title}", *c.texts))
                if c.index == layout.bare.clock
                else c
                for c in self.columns
                if c is not part
            ]
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
        reader = SampleReader(self._layout, cells)
        bare = self._layout.bare
        for block in self._blocks:
            reader.add(bare.block(block) if bare else block)
        found = reader.samples() if reader.lines.total else {}
        # Blank cells are faults, too, except where a row has some channels only.
        whole = [] if any(map(is_apart, found.values())) or not found else cells
        refuse_not_finite(whole, found, reader.lines.line, reader.faults)
        if not found:
            raise NoRows(
                "no sample below the header; expected one line for each sample",
                row=self._layout.header_line,
            )
        warnings = []
        if reader.cut_line is not None:
            warnings.append(cut_line(self._file, reader.cut_line))
        rows, stated = reader.lines.total, self._layout.preamble.samples
        if rows < stated:
            text = (
                f"{rows} samples, and the header states {stated}: the end is missing, probably by "
                "a loss of power or an interrupted copy; the samples that are there are read"
            )
            warnings.append(RunWarning("incomplete_file", text, self._file))
        for column in (c.column for c in channels if c.column.attenuation != 1.0):
            text = (
                f"the file states a probe attenuation of {column.attenuation:g}, by which the "
                "device has multiplied the cells; the scale of a mapping must not include it"
            )
            warning = RunWarning("probe_attenuation", text, self._file, column=column.label)
            warnings.append(warning)
        clock = self._layout.preamble.implied
        for channel in channels:
            if channel.name not in found and clock is not None:
                # The time that the preamble implies is no column of the table.
                found[channel.name] = clock[0] + np.arange(rows, dtype=np.float64) * clock[1]
                if self._layout.preamble.clock is None:
                    warnings.append(interval_warning(clock[1], self._file))
        return Samples(found, reader.lines.line, tuple(warnings))


def _with_clock(column: Column, sample: Sequence[str], is_named: bool) -> Column:
    """The column in seconds if its cells are times of day, and no other is named as the time."""
    cell = sample[column.index] if column.index < len(sample) else ""
    if "time" in column.quantities and is_number(cell):
        column = dataclasses.replace(column, first=float(cell.replace(",", ".")))
    is_long = cell.isdigit() and len(cell) > _LONGEST_COUNT
    if "time" in column.quantities and is_long and not unit_since_1970(column.first):
        # Ticks of a calendar are in no unit of the table, whatever the header says.
        return dataclasses.replace(column, unit_texts=())
    is_time = "time" in column.quantities or not (is_named or column.quantities)
    if not is_time or not is_time_of_day(cell):
        return column
    return dataclasses.replace(column, quantities=frozenset({"time"}), unit_texts=("s",))
