"""Tables with one signal per row, each signal at its own rate.

    time;signal name;value          as CANalyzer, CANoe, iba and databases export
    _time,_value,_field             as InfluxDB, perhaps with the header again above each field
    VarName;TimeString;VarValue     as WinCC archives, whose Time_ms counts 1e-6 days

The samples of each name are a channel with a clock of its own, as in TDMS or MDF.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from identification.arrays import Array
from identification.errors import NoRows, NotANumber, RaggedRow
from identification.ingest.clocks import Signal, SignalTable
from identification.ingest.columns import describe_column
from identification.ingest.display import plain, quoted
from identification.ingest.names import is_channel_name
from identification.ingest.run import RunWarning
from identification.ingest.text.blocks import Block
from identification.ingest.text.cells import (
    ClockTimes,
    is_time_of_day,
    is_whole_second,
    number_text,
    split_cells,
)

__all__ = ["is_long", "long_table", "values_of"]

_NAMES = "signal,signal name,signalname,name,varname,variable,channel,tag,field".split(",")
_VALUES = ("value", "varvalue", "wert")
_UNITS = ("unit", "units", "einheit")
_ANNOTATIONS = ("#group", "#datatype", "#default")
_TITLES = 30
_WINCC_S = 86_400.0e-6
"""Seconds of one unit of Time_ms in a WinCC archive."""


@dataclass(frozen=True)
class _Header:
    """Header of such a table: its delimiter, its cells, and the columns of name, value and unit."""

    delimiter: str
    cells: list[str]
    name: int
    value: int
    unit: int | None


def is_long(block: Block) -> bool:
    """Return True if one of the first lines is a header with a time, a name and a value."""
    return any(map(_header, block.head[:_TITLES]))


def long_table(every: Iterable[Block], file: str) -> SignalTable:
    """Read all rows into one signal for each name.

    Raises:
        NoRows: There is no row below the header.
        RaggedRow: A row has another number of cells than the header.
        NotANumber: A time is neither a number nor a time of day.
    """
    blocks = list(every)
    lines = (one for block in blocks for one in enumerate(block.lines, block.first_line))
    header = next(filter(None, (_header(line) for _, line in lines)))
    rows = {
        number: cells
        for number, line in lines
        if line.strip()
        and not line.startswith(_ANNOTATIONS)
        # The header stands again above each field of InfluxDB.
        and (cells := split_cells(line, header.delimiter)) != header.cells
    }
    if not rows:
        raise NoRows("no row below the header; expected one for each sample")
    count = len(header.cells)
    warnings: tuple[RunWarning, ...] = ()
    if not blocks[-1].terminated and len(rows[max(rows)]) < count:
        rows.pop(cut := max(rows))
        text = "the last line is truncated, probably by a loss of power; it is omitted"
        warnings = (RunWarning("truncated_last_row", text, file, cut),)
    for number, cells in rows.items():
        if len(cells) < count or any(cells[count:]):
            raise RaggedRow(
                f"the row has {len(cells)} cells and the header {count}; remove it, or export "
                "with another delimiter if the comma is the decimal sign",
                row=number,
                value=f"{len(cells)} cells",
            )
    times, unit = _times(header, rows)
    signals: dict[str, dict[int, str]] = {}
    for number, cells in rows.items():
        signals.setdefault(cells[header.name], {})[number] = cells[header.value]
    found = [
        Signal(
            (name,),
            "" if header.unit is None else rows[next(iter(values))][header.unit],
            partial(np.array, [times[number] for number in values]),
            partial(values_of, name, values),
            rows=list(values).__getitem__,
        )
        for name, values in signals.items()
    ]
    return SignalTable(found, file, warnings, unit)


def _header(line: str) -> _Header | None:
    """Header in a line; None if one of time, name and value is missing."""
    for delimiter in ";,\t":
        cells = split_cells(line.lstrip("\ufeff"), delimiter)
        words = [cell.casefold().strip("_") for cell in cells]
        name, value, unit = (
            next((k for k, word in enumerate(words) if word in known), None)
            for known in (_NAMES, _VALUES, _UNITS)
        )
        if name is None or value is None or not any(map(_is_time, cells)):
            continue
        if sum(map(is_channel_name, cells)) <= 2:
            return _Header(delimiter, cells, name, value, unit)
    return None


def _is_time(title: str) -> bool:
    return title.casefold() == "timestring" or describe_column(0, [title]).quantities == {"time"}


def _times(header: _Header, rows: Mapping[int, list[str]]) -> tuple[dict[int, float], str]:
    """Time of each row by its line number, and their unit, blank if the file does not give it.

    A number precedes a time of day without a fraction.
    """
    first = next(iter(rows.values()))
    candidates = [k for k, title in enumerate(header.cells) if _is_time(title)]
    at = min(candidates, key=lambda k: is_whole_second(first[k]))
    title, cells = header.cells[at], {number: row[at] for number, row in rows.items()}
    if is_time_of_day(first[at]):
        clock = ClockTimes()
        return dict(zip(cells, _numbers(title, cells, clock.seconds), strict=True)), "s"
    times, unit = values_of(title, cells), describe_column(0, [title]).unit
    factor = 1.0 if unit is None else unit.factor
    if header.cells[header.name].casefold() == "varname":
        times, factor = times - times[0], _WINCC_S
    return dict(zip(cells, (times * factor).tolist(), strict=True)), "" if unit is None else "s"


def values_of(name: str, cells: Mapping[int, str]) -> Array:
    """Numbers (n_sample,) of cells by line number, all with one decimal sign."""
    decimal = "," if any("," in cell for cell in cells.values()) else "."
    return np.array(
        _numbers(name, cells, lambda cell: number_text(cell, decimal)), dtype=np.float64
    )


def _numbers(
    name: str, cells: Mapping[int, str], read: Callable[[str], float | str | None]
) -> list[float]:
    """Numbers of cells by line number; a cell that cannot be read is an error."""
    found: list[float] = []
    for number, cell in cells.items():
        value = read(cell)
        if value is None:
            raise NotANumber(
                f"{quoted(cell)} is neither a number with the decimal sign of the others nor, in a "
                "column of times of day, one like the first",
                row=number,
                column=plain(name),
                value=cell,
            )
        found.append(float(value))
    return found
