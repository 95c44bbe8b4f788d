"""Choice among the tables of one file: sheets, groups or variables.

A table that the mapping names is read.  Otherwise the joined channels of all tables are used where
their clocks have a common origin, else the only table that has every required channel.
"""

from __future__ import annotations

from collections.abc import Mapping

from identification.errors import AmbiguousTable, MappingError, NoTable, RunFileError
from identification.ingest.channels import Channel, assign_channels
from identification.ingest.display import listed, plain, quoted
from identification.ingest.mapping import ChannelMapping, RunMapping
from identification.ingest.reader import SourceTable, TableSet
from identification.ingest.units import CHANNEL_QUANTITIES

__all__ = ["choose_table", "closest_table"]

Assigned = tuple[SourceTable, dict[str, Channel]]


def choose_table(opened: SourceTable | TableSet, mapping: RunMapping) -> Assigned:
    """Select the table that holds the run and assign its columns to channels.

    Raises:
        AmbiguousTable: Several tables hold a run.
        MappingError: The mapping names a table that the file does not have.
        RunFileError: No table has all required channels; the error is that of the closest one.
    """
    if not isinstance(opened, TableSet):
        if mapping.table is not None:
            raise MappingError(
                f"the mapping names the table {quoted(mapping.table)}, and the file has a single "
                'table without a name; remove "table"',
                value=mapping.table,
            )
        return opened, assign_channels(opened.columns, mapping.channels)
    tables = opened.tables
    if not tables:
        raise _no_table(opened)
    if mapping.table is not None:
        if mapping.table not in tables:
            raise MappingError(
                f"there is no {opened.kind} {quoted(mapping.table)}; expected one of "
                f"{listed(tables)}",
                value=mapping.table,
            )
        tables = {mapping.table: tables[mapping.table]}
    elif opened.joined is not None:
        return _joined(opened, opened.joined, mapping.channels)
    found, errors = _assigned(tables, mapping.channels)
    if not found:
        raise _closest(opened, tables, errors)
    # A logged speed precedes one derived from an angle.
    found = {name: one for name, one in found.items() if "speed_rad_s" in one[1]} or found
    if len(found) > 1:
        raise _ambiguous(opened.kind, list(found))
    return next(iter(found.values()))


def _joined(
    opened: TableSet, joined: SourceTable, mapping: Mapping[str, ChannelMapping]
) -> Assigned:
    """Channels of all tables together, or those of the only complete table."""
    try:
        return joined, assign_channels(joined.columns, mapping)
    except RunFileError as error:
        found, _ = _assigned(opened.tables, mapping)
        if len(found) > 1:
            raise _ambiguous(opened.kind, list(found)) from error
        if not found:
            error.message += opened.notes
            raise
        return next(iter(found.values()))


def _assigned(
    tables: Mapping[str, SourceTable], mapping: Mapping[str, ChannelMapping]
) -> tuple[dict[str, Assigned], dict[str, RunFileError]]:
    """Tables with all required channels, and the error of each other table."""
    found: dict[str, Assigned] = {}
    errors: dict[str, RunFileError] = {}
    for name, table in tables.items():
        try:
            found[name] = table, assign_channels(table.columns, mapping)
        except RunFileError as error:
            errors[name] = error
    return found, errors


def _ambiguous(kind: str, names: list[str]) -> AmbiguousTable:
    return AmbiguousTable(
        f"the {kind}s {listed(names)} all contain a run; keep one",
        value=names[0],
        examples=[{"table": plain(names[0])}],
    )


def _closest(
    opened: TableSet, tables: Mapping[str, SourceTable], errors: Mapping[str, RunFileError]
) -> RunFileError:
    """Error of the table with the most channels, with the names of the others."""
    name = max(tables, key=lambda name: _quantities(tables[name]))
    if len(opened.tables) > 1:
        others = listed(other for other in opened.tables if other != name)
        where = f"; this is the {opened.kind} {quoted(name)}, the file also has {others}"
        errors[name].message += where
    errors[name].message += opened.notes
    return errors[name]


def closest_table(opened: SourceTable | TableSet) -> SourceTable:
    """The table of a file that looks most like a run.

    Raises:
        NoTable: The file has no table.
    """
    if not isinstance(opened, TableSet):
        return opened
    if opened.joined is not None:
        return opened.joined
    if not opened.tables:
        raise _no_table(opened)
    return max(opened.tables.values(), key=_quantities)


def _quantities(table: SourceTable) -> int:
    """Number of channels for which the table has a column of the right quantity."""
    wanted = CHANNEL_QUANTITIES.values()
    return sum(any(q in c.quantities for c in table.columns) for q in wanted)


def _no_table(opened: TableSet) -> NoTable:
    return NoTable(
        f"the file has no {opened.kind} with columns of numbers{opened.notes}; expected one "
        "column for each channel"
    )
