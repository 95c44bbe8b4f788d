"""Assignment of columns to channels, without guessing.

The user's mapping has priority, then exact canonical names, then names with a unit.  A missing or
ambiguous column, or a missing, unknown or wrong unit, is an error with examples of a mapping.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from identification.errors import (
    AmbiguousColumn,
    AmbiguousUnit,
    MappingError,
    MissingColumn,
    RunFileError,
    WrongUnit,
)
from identification.ingest.absent import missing_columns
from identification.ingest.columns import (
    Column,
    duplicate_columns,
    example,
    scaled_example,
    unknown_unit,
)
from identification.ingest.display import listed, plain, quoted
from identification.ingest.faults import collected, refuse_all
from identification.ingest.mapping import OPTIONAL_CHANNELS, ROW, ChannelMapping
from identification.ingest.units import (
    CHANNEL_QUANTITIES,
    FACTOR_QUANTITIES,
    Unit,
    accepted_spellings,
    canonical_unit,
    find_unit,
)

__all__ = ["Channel", "assign_channels", "header_unit"]


@dataclass(frozen=True)
class Channel:
    """One channel and its source column."""

    name: str
    """Canonical name."""
    column: Column
    unit: Unit
    """Unit of the cells after scale and offset."""
    scale: float = 1.0
    """Factor applied to the cell."""
    offset: float = 0.0
    """Offset added after the factor, in `unit`."""
    period: float | None = None
    """Change of the cell after which an angle or a counter starts again, or None."""
    sign: Column | None = None
    """Column of the direction by which the cell is multiplied, or None."""
    value: float | None = None
    """Constant in place of cells, in `unit`, or None."""
    is_direction: bool = False
    """True if the cells are directions, which may be words."""
    may_end: bool = False
    """True if other columns of the table have more rows, below which the cells are blank."""

    @property
    def columns(self) -> tuple[Column, ...]:
        """The source column and that of the sign, if there is one."""
        return (self.column,) if self.sign is None else (self.column, self.sign)

    @property
    def is_logged(self) -> bool:
        """True if the channel has a column of the file."""
        return self.column.index >= 0

    @property
    def may_be_blank(self) -> bool:
        """True if the channel is often logged at a lower rate, which leaves cells blank."""
        return self.may_end or self.name == "temperature_degC"

    @property
    def may_lack(self) -> bool:
        """True if a row may have no value of the channel, as that of another message of a bus."""
        return self.may_end or (self.name != "time_s" and not self.is_direction)


def assign_channels(
    columns: Sequence[Column], mapping: Mapping[str, ChannelMapping]
) -> dict[str, Channel]:
    """Find the column of every channel, among all columns of the table.

    Returns:
        Channels by canonical name, without the optional ones that have no column, without the
        speed where only an angle is logged, and with duty and bus voltage in place of a voltage
        that is not logged.

    Raises:
        MissingColumn: Required channels have no column; one message covers all of them.
        RunFileError: A column is duplicated or ambiguous, or its unit is missing, unknown or wrong;
            the errors of all other channels are its `further`.
    """
    errors: list[RunFileError] = []
    found = _mapped_channels(columns, mapping, errors)
    taken = {column.index for channel in found.values() for column in channel.columns}
    free = _by_case([column for column in columns if column.index not in taken])
    missing = []
    is_product = _is_product(mapping)
    for name in CHANNEL_QUANTITIES:
        if name in mapping or (is_product and name == "voltage_V"):
            continue
        with collected(errors):
            candidates = _candidates(name, free)
            if candidates:
                found[name] = _unambiguous(name, candidates)
            elif name not in OPTIONAL_CHANNELS:
                missing.append(name)
    if "position_rad" in found and "speed_rad_s" in missing:
        # The speed is derived from the angle.
        missing.remove("speed_rad_s")
    if "voltage_V" in missing or is_product:
        earlier = len(errors)
        factors = _factors(mapping, found, free, errors)
        found |= factors
        if factors or len(errors) > earlier:
            missing = [name for name in missing if name != "voltage_V"]
    if missing:
        titles = {name: channel.column.title for name, channel in found.items()}
        errors.append(missing_columns(missing, free, columns, titles))
    refuse_all(errors)
    known = (*CHANNEL_QUANTITIES, *FACTOR_QUANTITIES)
    return {name: found[name] for name in known if name in found}


def _mapped_channels(
    columns: Sequence[Column], mapping: Mapping[str, ChannelMapping], errors: list[RunFileError]
) -> dict[str, Channel]:
    found: dict[str, Channel] = {}
    absent: list[str] = []
    for name, entry in mapping.items():
        if entry.value is not None:
            unit = entry.unit or canonical_unit(name)
            found[name] = Channel(
                name, _supplied_column(f"{entry.value:.12g}"), unit, value=entry.value
            )
        if entry.column is None:
            continue
        try:
            column = _column(columns, entry.column, name)
            sign = _column(columns, entry.sign, f"the sign of {name}") if entry.sign else None
        except _Absent as error:
            absent.append(str(error))
            continue
        except RunFileError as error:
            errors.append(error)
            continue
        with collected(errors):
            unit = _mapped_unit(entry, column)
            scaling = entry.scale, entry.offset, entry.period
            found[name] = Channel(name, column, unit, *scaling, sign)
    if absent:
        errors.append(
            MappingError(
                f"there is no column {', '.join(absent)}, as the mapping gives; "
                f"the file has {listed(column.title for column in columns)}",
                value=absent[0],
            )
        )
    return found


class _Absent(Exception):
    """A column of a mapping that the file does not have."""


def _column(columns: Sequence[Column], title: str, use: str) -> Column:
    """The column of a mapping; the sample number, if no column of the time has its name.

    Raises:
        DuplicateColumn: Several columns have the name.
        _Absent: No column has it.
    """
    matches = [column for column in columns if column.has_name(title)]
    if len(matches) > 1:
        raise duplicate_columns(matches)
    if matches:
        return matches[0]
    if use == "time_s" and title == ROW:
        return _supplied_column(ROW)
    raise _Absent(f"{quoted(title)} for {use}")


def _supplied_column(title: str) -> Column:
    """Column that no file has: the title of a constant or of the sample number."""
    return Column(-1, (title,), frozenset(), ())


def _is_product(mapping: Mapping[str, ChannelMapping]) -> bool:
    """True if a mapping gives the voltage as duty and bus voltage, without the voltage itself."""
    factors = [mapping[name] for name in FACTOR_QUANTITIES if name in mapping]
    given = [one.channel for one in factors if one.column is not None or one.value is not None]
    if given and "voltage_V" in mapping:
        raise MappingError(
            f"the mapping gives both voltage_V and {given[0]}; expected voltage_V alone, or duty "
            "and bus_voltage_V, whose product is the voltage"
        )
    return bool(given)


def _factors(
    mapping: Mapping[str, ChannelMapping],
    mapped: Mapping[str, Channel],
    free: Sequence[Column],
    errors: list[RunFileError],
) -> dict[str, Channel]:
    """Duty and bus voltage, whose product is the voltage; empty if one of them has no column.

    One that is ambiguous, or without a valid unit, and one that the mapping gives alone are errors.
    """
    free_names = [name for name in FACTOR_QUANTITIES if name not in mapping]
    candidates: dict[str, list[Column]] = {}
    for name in free_names:
        with collected(errors):
            candidates[name] = _candidates(name, free)
    absent = [name for name, columns in candidates.items() if not columns]
    if absent and _is_product(mapping):
        error = MissingColumn(
            f"no column for {absent[0]}, and the mapping gives the voltage as duty times bus "
            "voltage; map both",
            column=absent[0],
            examples=[example(absent[0], None)],
        )
        errors.append(error)
    found = {name: mapped[name] for name in FACTOR_QUANTITIES if name in mapped}
    for name, columns in candidates.items() if not absent else ():
        with collected(errors):
            found[name] = _unambiguous(name, columns)
    return found if len(found) == len(FACTOR_QUANTITIES) else {}


def _mapped_unit(entry: ChannelMapping, column: Column) -> Unit:
    """Unit from the mapping, else from the header if the cell is not scaled, else SI."""
    si = canonical_unit(entry.channel)
    if entry.unit is not None:
        return entry.unit
    if not entry.scaled:
        return header_unit(entry.channel, column) if column.unit_texts else si
    header = column.unit
    if header is not None and header.quantity == si.quantity and header != si:
        raise AmbiguousUnit(
            f"the mapping scales {entry.channel}, and the header gives {header.name}; "
            "remove the scale",
            column=column.label,
            examples=[
                {
                    entry.channel: {
                        "column": plain(column.title, 80),
                        **({"sign": entry.sign} if entry.sign else {}),
                        "scale": entry.scale,
                        **({"offset": entry.offset} if entry.offset else {}),
                        "unit": unit.name,
                    }
                }
                for unit in (header, si)
            ],
        )
    return si


def _by_case(columns: list[Column]) -> list[Column]:
    """Columns of which, as in textbooks, ``t`` is the time and ``T`` the temperature.

    Only for both side by side, without a unit that decides and without another time.
    """
    symbols = {"t": "time", "T": "temperature"}
    ambiguous = {c.title for c in columns if {"time", "temperature"} <= c.quantities}
    if not symbols.keys() <= ambiguous or any(c.quantities == {"time"} for c in columns):
        return columns
    return [
        replace(c, quantities=frozenset({symbols[c.title]})) if c.title in symbols else c
        for c in columns
    ]


def _candidates(name: str, columns: Sequence[Column]) -> list[Column]:
    """Columns whose name matches the channel; an exact canonical name excludes all others."""
    exact = [column for column in columns if column.canonical == name]
    if len(exact) > 1:
        raise duplicate_columns(exact)
    if exact:
        return exact
    quantity = (CHANNEL_QUANTITIES | FACTOR_QUANTITIES)[name]
    named = [column for column in columns if quantity in column.quantities]
    # An ambiguous name counts only if no column has an unambiguous one.
    sure = [column for column in named if len(column.quantities) == 1]
    if name in OPTIONAL_CHANNELS and not sure:
        return [column for column in named if "time" not in column.quantities]
    return sure or named


def _unambiguous(name: str, candidates: list[Column]) -> Channel:
    if len(candidates) > 1:
        if len({column.title for column in candidates}) == 1:
            raise duplicate_columns(candidates)
        raise AmbiguousColumn(
            f"{listed(column.title for column in candidates)} are all possible for {name}; "
            "rename all except one",
            column=candidates[0].label,
            examples=[example(name, candidates[0])],
        )
    return Channel(name, candidates[0], header_unit(name, candidates[0]))


def header_unit(name: str, column: Column) -> Unit:
    """Unit from the header of a column, checked against the quantity of the channel."""
    quantity = canonical_unit(name).quantity
    accepted = accepted_spellings(quantity)
    if len({find_unit(text) for text in column.unit_texts}) > 1:
        raise AmbiguousUnit(
            f"the header gives two units, {listed(column.unit_texts)}; remove one",
            column=column.label,
            examples=[example(name, column)],
        )
    if not column.unit_texts:
        # One message for a name of two optional channels, such as theta.
        both = [n for n in OPTIONAL_CHANNELS if CHANNEL_QUANTITIES[n] in column.quantities]
        possible = both if name in OPTIONAL_CHANNELS else [name]
        units = ", ".join(accepted_spellings(canonical_unit(n).quantity) for n in possible)
        raise AmbiguousUnit(
            f"the column may be {' or '.join(possible)}, but has no unit; write one of {units} in "
            "the header",
            column=column.label,
            examples=[
                *(example(n, column) for n in possible),
                *([{name: None}] if both == [name] else []),
            ],
        )
    unit = column.unit
    if unit is None:
        raise unknown_unit(name, column, accepted)
    if unit.quantity != quantity:
        raise WrongUnit(
            f"{unit.name} is a unit of {unit.quantity}, and {name} needs a unit of {quantity} "
            f"({accepted}) or the gain of a sensor in {canonical_unit(name).name} per "
            f"{unit.name}; correct the unit",
            column=column.label,
            value=column.unit_texts[0],
            examples=[scaled_example(name, column)],
        )
    return unit
