"""Columns of a table: names, quantity and unit from the header rows; errors of unusable columns."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from identification.errors import (
    DuplicateColumn,
    Example,
    MissingColumn,
    NoHeader,
    RunFileError,
    UnknownUnit,
)
from identification.ingest.display import listed, plain, quoted
from identification.ingest.mapping import OPTIONAL_CHANNELS, ROW
from identification.ingest.names import (
    is_sample_number,
    is_setpoint,
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
)

__all__ = [
    "Column",
    "describe_column",
    "duplicate_columns",
    "example",
    "missing_columns",
    "read_columns",
    "scaled_example",
    "similar_columns",
    "unknown_unit",
]

_GAINS = {"voltage_V": "V_PER_V", "current_A": "A_PER_V", "speed_rad_s": "RAD_S_PER_V"}
"""Gains that stand in examples for those of probes and sensors, which give volts."""

_MEASURED = frozenset(_GAINS)

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
    def has_contradictory_units(self) -> bool:
        """True if the name and the units row give different units."""
        return len({find_unit(text) for text in self.unit_texts}) > 1

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
    return [
        describe_column(index, [row[index] for row in names], [row[index] for row in units])
        for index in range(len(header[0]))
    ]


def describe_column(index: int, names: Sequence[str], units: Sequence[str] = ()) -> Column:
    """Describe one column; its unit decides between the quantities that its names may stand for.

    A column has names, such as a long and a short one, which may contain a unit, and units where
    the file gives them apart from the names.
    """
    texts = tuple(dict.fromkeys(name.strip() for name in names if name.strip()))
    parsed = [read_header(text) for text in texts]
    named = [header for header in parsed if header.quantities]
    quantities = frozenset.intersection(*(h.quantities for h in named)) if named else frozenset()
    written = [header.unit_text for header in parsed if header.unit_text]
    below = [unbracketed(unit.strip()) for unit in units]
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
    is_chopped = any("duty" in column.quantities for column in columns)
    kin = {quantity} if name != "voltage_V" or is_chopped else {quantity, "bus voltage"}
    return [
        column
        for column in columns
        if quantity in column.quantities
        or (column.quantities <= kin and _resembles(column, quantity))
    ]


def _resembles(column: Column, quantity: str) -> bool:
    """True if a column has a similar name, or no known name and a unit of the quantity."""
    if any(similar_to(text, quantity) for text in column.texts):
        return True
    is_of = column.unit is not None and column.unit.quantity == quantity
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
            scaled_example(name, column),
            *([{name: None}] if name in OPTIONAL_CHANNELS else []),
        ],
    )


def missing_columns(
    names: list[str], free: list[Column], columns: Sequence[Column], found: Mapping[str, str]
) -> RunFileError:
    """One error for all channels without a column, each with its similar columns.

    Args:
        names: The channels.
        free: Columns that the user's mapping does not use.
        columns: All columns of the file.
        found: Titles of the columns of the other channels.
    """
    if not any(column.texts for column in columns):
        return _without_header(names, len(columns))
    if unnamed := _unnamed(free, names):
        return _unnamed_columns(names, unnamed, found)
    similar = {name: similar_columns(name, free) for name in names}
    nearest = "".join(
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
    hint, derived = _derivations(names, free)
    if similar.get("voltage_V") == [] and not any("voltage_V" in each for each in derived):
        hint += " (a voltage that was constant during the whole run is a number)"
        derived.append({"voltage_V": {"value": "VOLTS"}})
    signals = [column for column in free if "time" not in column.quantities]
    if 1 in (len(_in_volts(free)), len(signals)) and len(_MEASURED.intersection(names)) > 1:
        hint += (
            "; join the files of a device that writes one for each channel with `motorid join FILE "
            "FILE FILE --out run.csv`"
        )
    is_needed = similar.get("current_A") == [] and "speed_rad_s" not in names
    needed = _NO_CURRENT if is_needed else ""
    absent = ", ".join(name for name in names if not similar[name])
    remedy = f"log {absent}, which no column resembles" if absent else "name them in the header"
    return MissingColumn(
        f"no column for {', '.join(names)}{nearest}{needed}; the file has "
        f"{listed(column.title for column in columns)}; {remedy}{hint}",
        column=names[0],
        examples=[*examples, *derived],
    )


_NO_CURRENT = (
    " (without a current, voltage and speed determine only the gain and the time constant "
    "between them, not Ra25, Kt25, J and b)"
)


def _derivations(names: Sequence[str], free: Sequence[Column]) -> tuple[str, list[Example]]:
    """Hint and examples of mappings that derive missing channels from other columns."""
    hint = ""
    examples: list[Example] = []
    counters = [c for c in free if any(map(is_sample_number, c.texts))] if "time_s" in names else []
    if counters:
        hint += f" (the time may be {quoted(counters[0].title)} times the sampling interval)"
        examples.append(scaled_example("time_s", counters[0], "SECONDS_PER_SAMPLE"))
    elif "time_s" in names:
        hint += " (samples at a fixed rate have the time row / rate)"
        examples.append({"time_s": {"column": ROW, "scale": "SECONDS_PER_SAMPLE"}})
    duties = [c for c in free if _may_be_duty(c)] if "voltage_V" in names else []
    if duties:
        hint += (
            f" (the voltage may be {quoted(duties[0].title)} times a column of the bus voltage, "
            "or, where that is constant, times a scale)"
        )
        examples.append(scaled_example("voltage_V", duties[0], "VOLT_PER_DUTY"))
    angles = similar_columns("position_rad", free) if "speed_rad_s" in names else []
    if angles:
        hint += (
            " (the speed may be derived from an angle or encoder count, "
            f"{quoted(angles[0].title)} mapped to position_rad)"
        )
        examples.append(scaled_example("position_rad", angles[0], "RAD_PER_COUNT"))
    return hint, examples


def _without_header(names: Sequence[str], count: int) -> RunFileError:
    """Error for the missing channels of a file whose columns have numbers alone."""
    units = {name: canonical_unit(name).name for name in names}
    entries = {name: {"column": "column NUMBER", "unit": unit} for name, unit in units.items()}
    return NoHeader(
        f"no column for {', '.join(names)}: the samples have no header that names their {count} "
        f"columns, which are 'column 1' to 'column {count}'; write a header such as "
        "time_s,voltage_V,current_A,speed_rad_s above them",
        examples=[entries],
    )


def _unnamed(columns: Sequence[Column], names: Sequence[str]) -> list[Column]:
    """Columns in volts without the name of a channel, as an oscilloscope writes them.

    Empty if fewer than two could be the missing channels.
    """
    found = _in_volts(columns)
    return found if min(len(found), len(_MEASURED.intersection(names))) > 1 else []


def _in_volts(columns: Sequence[Column]) -> list[Column]:
    return [
        column
        for column in columns
        if column.unit is not None
        and column.unit.quantity == "voltage"
        and not column.quantities
        and not any(map(is_setpoint, column.texts))
    ]


def _unnamed_columns(
    names: Sequence[str], unnamed: Sequence[Column], found: Mapping[str, str]
) -> RunFileError:
    """Error for the missing channels of a file of an oscilloscope.

    The examples take the columns in their order; the user knows the order and the gains.
    """
    entries: dict[str, object] = {}
    free = iter(unnamed)
    for name in names:
        column = next(free, None) if name in _GAINS else None
        gain = _GAINS.get(name)
        one = scaled_example(name, column, gain) if column and gain else example(name, column)
        entries |= one
    known = "".join(f"{name} is {quoted(title)}; " for name, title in found.items())
    lacking = sum(name in _GAINS for name in names) - len(unnamed)
    more = f"; record {lacking} more, as the file has too few" if lacking > 0 else ""
    return MissingColumn(
        f"no column for {', '.join(names)}; {known}{listed(c.title for c in unnamed)} in "
        f"{unnamed[0].unit_texts[0]} have no name of a channel{more}; the file does not say which "
        "is which, nor the gain of a probe or sensor: write names and units in the header",
        column=names[0],
        examples=[entries],
    )


def _may_be_duty(column: Column) -> bool:
    return "duty" in column.quantities or any(similar_to(text, "duty") for text in column.texts)


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
