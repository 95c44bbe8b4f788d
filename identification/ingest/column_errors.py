"""Errors of columns that cannot be assigned to a channel, with examples of a mapping."""

from __future__ import annotations

from collections.abc import Sequence

from identification.errors import DuplicateColumn, MissingColumn, RunFileError, UnknownUnit
from identification.examples import Example
from identification.ingest.columns import Column
from identification.ingest.display import listed, plain, quoted
from identification.ingest.mapping import OPTIONAL_CHANNELS
from identification.ingest.names import similar_to
from identification.ingest.units import CHANNEL_QUANTITIES, canonical_unit, unit_in_another_case

__all__ = [
    "duplicate_columns",
    "example",
    "missing_columns",
    "scaled_example",
    "similar_columns",
    "unknown_unit",
]


def similar_columns(name: str, columns: Sequence[Column]) -> list[Column]:
    """Columns that resemble the channel; for messages only."""
    quantity = CHANNEL_QUANTITIES[name]
    is_chopped = name == "voltage_V" and any("duty" in column.quantities for column in columns)
    return [
        column
        for column in columns
        if not (is_chopped and "bus voltage" in column.quantities)
        and (
            any(similar_to(text, quantity) for text in column.texts)
            or (column.unit is not None and column.unit.quantity == quantity and not column.texts)
        )
    ]


def unknown_unit(name: str, column: Column, accepted: str) -> RunFileError:
    """Error for a unit that the table of units does not have."""
    text = column.unit_texts[0]
    other_case = unit_in_another_case(text)
    hint = f" (case-sensitive; did you mean {other_case.name}?)" if other_case else ""
    return UnknownUnit(
        f"the unit {quoted(text)} is unknown{hint}; write one of {accepted} for {name}",
        column=column.label,
        value=text,
        examples=[
            scaled_example(name, column),
            *([{name: None}] if name in OPTIONAL_CHANNELS else []),
        ],
    )


def missing_columns(
    names: list[str], free: list[Column], columns: Sequence[Column]
) -> RunFileError:
    """One error for all channels without a column, each with its similar columns."""
    similar = {name: similar_columns(name, free) for name in names}
    found = "".join(
        f"; {name} may be {listed(column.title for column in near)}"
        for name, near in similar.items()
        if near
    )
    examples: list[Example] = [
        {
            channel: entry
            for name in names
            for channel, entry in example(name, next(iter(similar[name]), None)).items()
        }
    ]
    angles = similar_columns("position_rad", free) if "speed_rad_s" in names else []
    hint = ""
    duties = [c for c in free if "duty" in c.quantities] if "voltage_V" in names else []
    if duties:
        hint = (
            f" (the voltage may be {quoted(duties[0].title)} times a column of the bus voltage, "
            "or, where that is constant, times a scale)"
        )
        examples.append(scaled_example("voltage_V", duties[0], "VOLT_PER_DUTY"))
    if angles:
        hint += (
            " (the speed may be derived from an angle or encoder count, "
            f"{quoted(angles[0].title)} mapped to position_rad)"
        )
        examples.append(scaled_example("position_rad", angles[0], "RAD_PER_COUNT"))
    absent = ", ".join(name for name in names if not similar[name])
    remedy = f"log {absent}, which no column resembles" if absent else "name them in the header"
    return MissingColumn(
        f"no column for {', '.join(names)}{found}; the file has "
        f"{listed(column.title for column in columns)}; {remedy}{hint}",
        column=names[0],
        examples=examples,
    )


def duplicate_columns(columns: Sequence[Column]) -> RunFileError:
    """Error for columns with the same name."""
    positions = ", ".join(str(column.index + 1) for column in columns)
    return DuplicateColumn(
        f"the columns {positions} have the same name; rename all except the one to use",
        column=columns[0].label,
    )


def example(name: str, column: Column | None) -> Example:
    """Mapping of a channel to a column in its unit, else in the SI unit."""
    unit = canonical_unit(name)
    if column is not None and column.unit is not None and column.unit.quantity == unit.quantity:
        unit = column.unit
    title = plain(column.title, 80) if column else "HEADER TEXT"
    return {name: {"column": title, "unit": unit.name}}


def scaled_example(name: str, column: Column, factor: str = "NUMBER") -> Example:
    """Mapping of a channel to a column that is multiplied by a factor only the user knows."""
    return {name: {"column": plain(column.title, 80), "scale": factor}}
