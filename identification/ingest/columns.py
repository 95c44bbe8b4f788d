"""Columns of a table: names, quantity and unit from the header rows; errors of faulty headers."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

from identification.errors import DuplicateColumn, Example, RunFileError, UnknownUnit
from identification.ingest.display import plain, quoted
from identification.ingest.mapping import OPTIONAL_CHANNELS
from identification.ingest.names import (
    is_setpoint,
    is_shunt,
    is_supply,
    is_units_row,
    read_header,
    similar_to,
    unbracketed,
)
from identification.ingest.units import (
    CHANNEL_QUANTITIES,
    Unit,
    canonical_unit,
    find_unit,
    unit_in_another_case,
    unit_since_1970,
)

__all__ = [
    "Column",
    "describe_column",
    "duplicate_columns",
    "example",
    "may_be_duty",
    "read_columns",
    "scaled_example",
    "similar_columns",
    "unknown_unit",
]

_SHOWN = 6
# Entries of a units row that mean no unit.
_NO_UNIT = ("", "-", "--", "1", "none", "n/a")


@dataclass(frozen=True)
class Column:
    """One column of a table as described by its header rows."""

    index: int
    """Position in the table, counted from 0."""
    texts: tuple[str, ...]
    """Non-blank cells of its name rows, from top to bottom."""
    quantities: frozenset[str]
    """Quantities that its names may stand for; if several, the unit decides."""
    unit_texts: tuple[str, ...]
    """Units as written in the names and in the units rows, without duplicates."""
    canonical: str | None = None
    """Canonical channel name if the header is exactly that name."""
    attenuation: float = 1.0
    """Probe attenuation that the device states, and has multiplied the cells by [-]."""
    first: float = math.nan
    """First cell of a column of times, for messages; NaN where it is not known."""

    @property
    def title(self) -> str:
        """Name of the column in messages and mappings."""
        return self.texts[0] if self.texts else f"column {self.index + 1}"

    @property
    def label(self) -> str:
        """Title, sanitised for one line of a message."""
        return plain(self.title)

    @property
    def unit(self) -> Unit | None:
        """Unit, or None if it is missing, unknown or contradictory."""
        units = {find_unit(text) for text in self.unit_texts}
        return units.pop() if len(units) == 1 else None

    @property
    def is_time(self) -> bool:
        """True for a column of times, by its name or its unit."""
        return "time" in self.quantities or (self.unit is not None and self.unit.quantity == "time")

    def has_name(self, title: str) -> bool:
        """Return True if `title` in a mapping refers to this column."""
        wanted = " ".join(title.split())
        return any(" ".join(text.split()) == wanted for text in (*self.texts, self.title))


def read_columns(header: tuple[tuple[str, ...], ...]) -> list[Column]:
    """Describe the columns of a table from its header rows, top to bottom and equally long.

    A header row below the first is a units row if at least half of its filled cells are units.  All
    other rows hold names, such as a long and a short one.
    """
    names = [row for at, row in enumerate(header) if at == 0 or not is_units_row(row)]
    units = [row for at, row in enumerate(header) if at > 0 and is_units_row(row)]
    columns = [
        describe_column(index, [row[index] for row in names], [row[index] for row in units])
        for index in range(len(header[0]))
    ]
    first = columns[0]
    is_in_time = units and first.unit is not None and first.unit.quantity == "time"
    if is_in_time and not any("time" in column.quantities for column in columns):
        # Siglent names the first column Source, above Second.
        columns[0] = dataclasses.replace(first, quantities=frozenset({"time"}))
    return columns


def describe_column(index: int, names: Sequence[str], units: Sequence[str] = ()) -> Column:
    """Describe one column; its unit decides between the quantities that its names may stand for.

    A column has names, such as a long and a short one, which may contain a unit, and units where
    the file gives them apart from the names.
    """
    texts = tuple(dict.fromkeys(name.strip() for name in names if name.strip()))
    parsed = [read_header(text) for text in texts]
    named = [header for header in parsed if header.quantities]
    quantities = frozenset.intersection(*(h.quantities for h in named)) if named else frozenset()
    below = [unbracketed(unit.strip()) for unit in units]
    # X(CH1) above Volt is a name, and CH1 no unit.
    is_known = any(find_unit(unit) for unit in below)
    written = [
        header.unit_text
        for header in parsed
        if header.unit_text and (header.quantities or not is_known or find_unit(header.unit_text))
    ]
    unit_texts = dict.fromkeys([*written, *(u for u in below if u.casefold() not in _NO_UNIT)])
    canonical = next((header.canonical for header in parsed if header.canonical), None)
    column = Column(index, texts, quantities, tuple(unit_texts), canonical)
    unit = column.unit
    if unit is None or unit.quantity not in quantities:
        return column
    return dataclasses.replace(column, quantities=frozenset({unit.quantity}))


def similar_columns(name: str, columns: Sequence[Column]) -> list[Column]:
    """Columns that resemble the channel; for messages only."""
    quantity = CHANNEL_QUANTITIES[name]
    kin = {quantity} if name != "voltage_V" else {quantity, "bus voltage"}
    near = [
        column
        for column in columns
        if quantity in column.quantities
        or (column.quantities <= kin and _resembles(column, quantity))
    ]
    if name != "voltage_V":
        return near
    near = [column for column in near if not any(map(is_shunt, column.texts))]
    supplies = [column for column in near if any(map(is_supply, column.texts))]
    at_motor = [column for column in near if column not in supplies]
    is_chopped = any(map(may_be_duty, columns))
    return at_motor or ([] if is_chopped else supplies)


def may_be_duty(column: Column) -> bool:
    """True if a column is named as a duty cycle, measured or commanded, and is no voltage."""
    is_volts = column.unit is not None and column.unit.quantity == "voltage"
    is_named = "duty" in column.quantities or any(similar_to(t, "duty") for t in column.texts)
    return is_named and not is_volts


def _resembles(column: Column, quantity: str) -> bool:
    """True if a column has a similar name, or no known name and a unit of the quantity."""
    if any(similar_to(text, quantity) for text in column.texts):
        return True
    is_of = column.unit is not None and column.unit.quantity == quantity
    # Keysight; the ADC of a board counts, so that only the user can say that it is amperes.
    is_of |= quantity == "current" and column.unit_texts == ("ADC",)
    return is_of and not column.quantities and not any(map(is_setpoint, column.texts))


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
            {name: {"column": plain(column.title, 80), "unit": other_case.name}}
            if other_case and other_case.quantity == canonical_unit(name).quantity
            else scaled_example(name, column),
            *([{name: None}] if name in OPTIONAL_CHANNELS else []),
        ],
    )


def duplicate_columns(columns: Sequence[Column]) -> RunFileError:
    """Error for columns with the same name."""
    positions = ", ".join(str(column.index + 1) for column in columns[:_SHOWN])
    more = f" and {len(columns) - _SHOWN} more" if len(columns) > _SHOWN else ""
    return DuplicateColumn(
        f"the columns {positions}{more} have the same name; rename all except the one to use",
        column=columns[0].label,
    )


def example(name: str, column: Column | None) -> Example:
    """Mapping of a channel to a column, with a unit or a factor unless the header gives a unit."""
    unit = canonical_unit(name)
    title = plain(column.title, 80) if column else "HEADER TEXT"
    if column is not None and name == "time_s" and (since_1970 := unit_since_1970(column.first)):
        return {name: {"column": title, "unit": since_1970}}
    if column is not None and column.unit is not None and column.unit.quantity == unit.quantity:
        return {name: {"column": title}}
    if name == "speed_rad_s" and "rpm" in title.casefold():
        # VESC logs the electrical speed, which has the pole pairs as a factor.
        scale = {"scale": "TURNS_PER_ELECTRICAL_TURN"} if "erpm" in title.casefold() else {}
        return {name: {"column": title, **scale, "unit": "rpm"}}
    if column is not None and column.unit_texts and column.unit is None:
        # The unit of the channel would be wrong for cells in another one, such as counts.
        return scaled_example(name, column)
    return {name: {"column": title, "unit": unit.name}}


def scaled_example(name: str, column: Column, factor: str = "NUMBER") -> Example:
    """Mapping of a channel to a column that is multiplied by a factor only the user knows."""
    return {name: {"column": plain(column.title, 80), "scale": factor}}
