"""Tables with one signal per row, each signal at its own rate.

    time;signal name;value          as CANalyzer, CANoe, iba and databases export
    _time,_value,_field             as InfluxDB, perhaps with the header again above each field
    VarName;TimeString;VarValue     as WinCC archives, whose Time_ms counts 1e-6 days
    timestamp, tag, value, unit     as databases give in a DataFrame, in Parquet or in HDF5

The samples of each name are a channel with a clock of its own, as in TDMS or MDF.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.arrays import Array
from identification.errors import NoRows, NotANumber, RaggedRow
from identification.ingest.clocks import Signal, SignalTable
from identification.ingest.columns import Column, describe_column
from identification.ingest.display import plain, quoted
from identification.ingest.names import is_channel_name
from identification.ingest.reader import numbers
from identification.ingest.run import RunWarning
from identification.ingest.text.blocks import Block
from identification.ingest.text.cells import (
    ClockTimes,
    clock_of,
    is_whole_second,
    number_text,
    split_cells,
)

__all__ = ["Roles", "cut_line", "is_long", "long_table", "read_long", "roles_of"]

_NAMES = "signal,signal name,signalname,name,varname,variable,channel,tag,field".split(",")
_VALUES = ("value", "varvalue", "wert")
_UNITS = ("unit", "units", "einheit")
_ANNOTATIONS = ("#group", "#datatype", "#default")
_TITLES = 30
_WINCC_S = 86_400.0e-6
"""Seconds of one unit of Time_ms in a WinCC archive."""


@dataclass(frozen=True)
class Roles:
    """Columns of such a table by position."""

    name: int
    value: int
    unit: int | None
    times: tuple[int, ...]


def roles_of(titles: Sequence[str]) -> Roles | None:
    """Columns by their titles; None if there is no time, name or value."""
    words = [title.casefold().strip("_") for title in titles]
    name, value, unit = (
        next((k for k, word in enumerate(words) if word in known), None)
        for known in (_NAMES, _VALUES, _UNITS)
    )
    # Most tables end here, before the slow search for a time.
    if name is None or value is None:
        return None
    times = tuple(k for k, title in enumerate(titles) if _is_time(title))
    if not times or sum(map(is_channel_name, titles)) > 2:
        return None
    return Roles(name, value, unit, times)


def is_long(block: Block) -> bool:
    """Return True if one of the first lines is a header with a time, a name and a value."""
    return any(map(_header, block.head[:_TITLES]))


def read_long(every: Iterable[Block], file: str) -> SignalTable:
    """Read all rows into one signal for each name.

    Raises:
        NoRows: There is no row below the header.
        RaggedRow: A row has another number of cells than the header.
        NotANumber: A time is neither a number nor a time of day.
    """
    blocks = list(every)
    lines = (one for block in blocks for one in enumerate(block.lines, block.first_line))
    delimiter, titles, roles = next(filter(None, (_header(line) for _, line in lines)))
    rows = {
        number: cells
        for number, line in lines
        if line.strip()
        and not line.startswith(_ANNOTATIONS)
        # The header stands again above each field of InfluxDB.
        and (cells := split_cells(line, delimiter)) != titles
    }
    count = len(titles)
    warnings: tuple[RunWarning, ...] = ()
    if rows and not blocks[-1].terminated and len(rows[max(rows)]) < count:
        rows.pop(cut := max(rows))
        warnings = (cut_line(file, cut),)
    for number, cells in rows.items():
        if len(cells) < count or any(cells[count:]):
            raise RaggedRow(
                f"the row has {len(cells)} cells and the header {count}; remove it, or export "
                "with another delimiter if the comma is the decimal sign",
                row=number,
                value=f"{len(cells)} cells",
            )
    table = np.array([cells[:count] for cells in rows.values()], dtype=object)
    table = table.reshape(-1, count)
    columns = [describe_column(k, [title]) for k, title in enumerate(titles)]
    return long_table(columns, roles, lambda c: table[:, c.index], file, list(rows), warnings)


def cut_line(file: str, row: int) -> RunWarning:
    """Warning of a truncated last line, which is omitted."""
    text = "the last line is truncated, probably by a loss of power; it is omitted"
    return RunWarning("truncated_last_row", text, file, row)


def long_table(
    columns: Sequence[Column],
    roles: Roles,
    load: Callable[[Column], ArrayLike],
    file: str,
    rows: Sequence[int] | int,
    warnings: tuple[RunWarning, ...] = (),
) -> SignalTable:
    """One signal for each name in a table whose columns have the given roles.

    `load` gives the cells (n_row,) of a column: numbers, dates or texts.  `rows` are the rows in
    the file, or the first of them.

    Raises:
        NoRows: The table has no row.
        NotANumber: A time is neither a number nor a time of day.
    """
    names = np.asarray(load(columns[roles.name]))
    if not names.size:
        raise NoRows("no row below the header; expected one for each sample")
    numbered = range(rows, rows + names.size) if isinstance(rows, int) else rows
    times, unit = _times(columns, roles, load, numbered)
    values = np.asarray(load(columns[roles.value]))
    units = None if roles.unit is None else np.asarray(load(columns[roles.unit]))
    signals: dict[str, list[int]] = {}
    for row, name in enumerate(names):
        signals.setdefault(str(name), []).append(row)
    found = [
        Signal(
            (name,),
            "" if units is None else str(units[at[0]]),
            partial(np.take, times, at),
            partial(_loaded, name, values, at, numbered),
            rows=[numbered[row] for row in at].__getitem__,
        )
        for name, at in signals.items()
    ]
    return SignalTable(found, file, warnings, unit)


def _header(line: str) -> tuple[str, list[str], Roles] | None:
    """Delimiter, cells and roles of a header line; None for any other line."""
    for delimiter in ";,\t":
        cells = split_cells(line.lstrip("\ufeff"), delimiter)
        roles = roles_of(cells)
        if roles is not None:
            return delimiter, cells, roles
    return None


def _is_time(title: str) -> bool:
    return title.casefold() == "timestring" or describe_column(0, [title]).quantities == {"time"}


def _times(
    columns: Sequence[Column],
    roles: Roles,
    load: Callable[[Column], ArrayLike],
    rows: Sequence[int],
) -> tuple[Array, str]:
    """Time of each row (n_row,), and their unit, blank if the file does not give it.

    A number precedes a time of day without a fraction.
    """
    every = {k: np.asarray(load(columns[k])) for k in roles.times}
    at = min(roles.times, key=lambda k: is_whole_second(str(every[k][0])))
    column, cells = columns[at], every[at]
    unit = column.unit
    factor = 1.0 if unit is None else unit.factor
    clock = clock_of(str(cells[0]), factor) if cells.dtype.kind == "O" else None
    if clock is None:
        times = _loaded(column.title, cells, range(cells.size), rows)
    else:
        texts = dict(zip(rows, map(str, cells), strict=True))
        times = _numbers(column.title, texts, clock.seconds)
    if isinstance(clock, ClockTimes):
        return times, "s"
    if columns[roles.name].title.casefold() == "varname":
        times, factor = times - times[0], _WINCC_S
    return times * factor, "" if unit is None else "s"


def _loaded(name: str, cells: NDArray[np.generic], at: Sequence[int], rows: Sequence[int]) -> Array:
    """Numbers of some cells, or of texts with one decimal sign."""
    if cells.dtype.kind != "O":
        return numbers(cells[at], describe_column(0, [name]))
    texts = {rows[row]: str(cells[row]) for row in at}
    decimal = "," if any("," in text for text in texts.values()) else "."
    return _numbers(name, texts, lambda cell: number_text(cell, decimal))


def _numbers(
    name: str, cells: Mapping[int, str], read: Callable[[str], float | str | None]
) -> Array:
    """Numbers (n_cell,) of cells by line number; a cell that cannot be read is an error."""
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
    return np.array(found)
