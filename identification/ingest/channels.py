"""Assignment of columns to channels, without guessing.

The user's mapping has priority, then exact canonical names, then names with a unit.  A missing or
ambiguous column, or a missing, unknown or wrong unit, is an error with examples of a mapping.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from identification.errors import (
    AmbiguousColumn,
    AmbiguousUnit,
    DuplicateColumn,
    MappingError,
    MissingColumn,
    RunFileError,
    UnknownUnit,
    WrongUnit,
)
from identification.examples import Example
from identification.ingest.columns import Column
from identification.ingest.display import listed, plain, quoted
from identification.ingest.faults import collected, refuse_all
from identification.ingest.mapping import OPTIONAL_CHANNELS, ChannelMapping
from identification.ingest.names import similar_to
from identification.ingest.units import (
    CHANNEL_QUANTITIES,
    Unit,
    accepted_spellings,
    canonical_unit,
    unit_in_another_case,
)

__all__ = ["Channel", "assign_channels", "similar_columns"]


@dataclass(frozen=True)
class Channel:
    """One channel and its source column.

    Args:
        name: Canonical name.
        column: Source column.
        unit: Unit of the cells after scale and offset.
        scale: Factor applied to the cell.
        offset: Offset added after the factor, in `unit`.
        period: Change of the cell after which an angle or a counter starts again, or None.
    """

    name: str
    column: Column
    unit: Unit
    scale: float = 1.0
    offset: float = 0.0
    period: float | None = None

    @property
    def may_be_blank(self) -> bool:
        """True if the channel is often logged at a lower rate, which leaves cells blank."""
        return self.name == "temperature_degC"


def assign_channels(
    columns: Sequence[Column], mapping: Mapping[str, ChannelMapping]
) -> dict[str, Channel]:
    """Find the column of every channel.

    Args:
        columns: All columns of the table.
        mapping: User-defined mapping by canonical name.

    Returns:
        Channels by canonical name, without the optional ones that have no column, and without the
        speed where only an angle is logged.

    Raises:
        MissingColumn: Required channels have no column; one message covers all of them.
        RunFileError: A column is duplicated or ambiguous, or its unit is missing, unknown or wrong;
            the errors of all other channels are its `further`.
    """
    found: dict[str, Channel] = {}
    errors: list[RunFileError] = []
    for name, entry in mapping.items():
        if entry.column is not None:
            with collected(errors):
                found[name] = _mapped(entry, columns)
    taken = {channel.column.index for channel in found.values()}
    free = [column for column in columns if column.index not in taken]
    missing = []
    for name in CHANNEL_QUANTITIES:
        if name in mapping:
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
    if missing:
        errors.append(_missing(missing, free, columns))
    refuse_all(errors)
    return {name: found[name] for name in CHANNEL_QUANTITIES if name in found}


def similar_columns(name: str, columns: Sequence[Column]) -> list[Column]:
    """Columns that resemble the channel; for messages only."""
    quantity = CHANNEL_QUANTITIES[name]
    return [
        column
        for column in columns
        if any(similar_to(text, quantity) for text in column.texts)
        or (column.unit is not None and column.unit.quantity == quantity and not column.texts)
    ]


def _mapped(entry: ChannelMapping, columns: Sequence[Column]) -> Channel:
    title = entry.column or ""
    matches = [column for column in columns if column.has_name(title)]
    if not matches:
        raise MappingError(
            f"there is no column {quoted(title)}, to which the mapping assigns {entry.channel}; "
            f"the file has {listed(column.title for column in columns)}",
            value=title,
        )
    if len(matches) > 1:
        raise _duplicate(matches)
    column = matches[0]
    unit = _mapped_unit(entry, column)
    return Channel(entry.channel, column, unit, entry.scale, entry.offset, entry.period)


def _mapped_unit(entry: ChannelMapping, column: Column) -> Unit:
    """Unit from the mapping, else from the header if the cell is not scaled, else SI."""
    si = canonical_unit(entry.channel)
    if entry.unit is not None:
        return entry.unit
    if not entry.scaled:
        return _unit(entry.channel, column) if column.unit_texts else si
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
                        "scale": entry.scale,
                        **({"offset": entry.offset} if entry.offset else {}),
                        "unit": unit.name,
                    }
                }
                for unit in (header, si)
            ],
        )
    return si


def _candidates(name: str, columns: Sequence[Column]) -> list[Column]:
    """Columns whose name matches the channel; an exact canonical name excludes all others."""
    exact = [column for column in columns if column.canonical == name]
    if len(exact) > 1:
        raise _duplicate(exact)
    if exact:
        return exact
    quantity = CHANNEL_QUANTITIES[name]
    named = [column for column in columns if quantity in column.quantities]
    # An ambiguous name counts only if no column has an unambiguous one.
    sure = [column for column in named if len(column.quantities) == 1]
    if name in OPTIONAL_CHANNELS and not sure:
        return [column for column in named if "time" not in column.quantities]
    return sure or named


def _unambiguous(name: str, candidates: list[Column]) -> Channel:
    if len(candidates) > 1:
        if len({column.title for column in candidates}) == 1:
            raise _duplicate(candidates)
        raise AmbiguousColumn(
            f"{listed(column.title for column in candidates)} are all possible for {name}; "
            "rename all except one",
            column=candidates[0].label,
            examples=[_example(name, candidates[0])],
        )
    return Channel(name, candidates[0], _unit(name, candidates[0]))


def _unit(name: str, column: Column) -> Unit:
    """Unit from the header of a column, checked against the quantity of the channel."""
    quantity = CHANNEL_QUANTITIES[name]
    accepted = accepted_spellings(quantity)
    if column.has_contradictory_units:
        raise AmbiguousUnit(
            f"the header gives two units, {listed(column.unit_texts)}; remove one",
            column=column.label,
            examples=[_example(name, column)],
        )
    if not column.unit_texts:
        raise AmbiguousUnit(
            f"the column may be {name}, but has no unit; write one of {accepted} in the header",
            column=column.label,
            examples=[_example(name, column)],
        )
    unit = column.unit
    if unit is None:
        raise _unknown_unit(name, column, accepted)
    if unit.quantity != quantity:
        raise WrongUnit(
            f"{unit.name} is a unit of {unit.quantity}, and {name} needs a unit of {quantity} "
            f"({accepted}) or the gain of a sensor in {canonical_unit(name).name} per "
            f"{unit.name}; correct the unit",
            column=column.label,
            value=column.unit_texts[0],
            examples=[_scaled(name, column)],
        )
    return unit


def _unknown_unit(name: str, column: Column, accepted: str) -> RunFileError:
    text = column.unit_texts[0]
    other_case = unit_in_another_case(text)
    hint = f" (case-sensitive; did you mean {other_case.name}?)" if other_case else ""
    return UnknownUnit(
        f"the unit {quoted(text)} is unknown{hint}; write one of {accepted} for {name}",
        column=column.label,
        value=text,
        examples=[_scaled(name, column), *([{name: None}] if name in OPTIONAL_CHANNELS else [])],
    )


def _missing(names: list[str], free: list[Column], columns: Sequence[Column]) -> RunFileError:
    """One error for all channels without a column, each with its similar columns."""
    similar = {name: similar_columns(name, free) for name in names}
    found = "; ".join(
        f"{name} may be {listed(c.title for c in columns)}" if columns else f"{name} has none"
        for name, columns in similar.items()
    )
    likely = [name for name in names if similar[name]] or names[:1]
    examples: list[Example] = [
        {
            channel: entry
            for name in likely
            for channel, entry in _example(name, next(iter(similar[name]), None)).items()
        }
    ]
    angles = similar_columns("position_rad", free) if "speed_rad_s" in names else []
    hint = ""
    if angles:
        hint = (
            " (the speed may be derived from an angle or encoder count, "
            f"{quoted(angles[0].title)} mapped to position_rad)"
        )
        examples.append(_scaled("position_rad", angles[0], "RAD_PER_COUNT"))
    return MissingColumn(
        f"no column for {', '.join(names)}; similar columns: {found}; the file has "
        f"{listed(column.title for column in columns)}; log the missing channel{hint}",
        column=names[0],
        examples=examples,
    )


def _duplicate(columns: Sequence[Column]) -> RunFileError:
    positions = ", ".join(str(column.index + 1) for column in columns)
    return DuplicateColumn(
        f"the columns {positions} have the same name; rename all except the one to use",
        column=columns[0].label,
    )


def _example(name: str, column: Column | None) -> Example:
    """Mapping of a channel to a column in its unit, else in the SI unit."""
    unit = canonical_unit(name)
    if column is not None and column.unit is not None and column.unit.quantity == unit.quantity:
        unit = column.unit
    title = plain(column.title, 80) if column else "HEADER TEXT"
    return {name: {"column": title, "unit": unit.name}}


def _scaled(name: str, column: Column, factor: str = "NUMBER") -> Example:
    """Mapping of a channel to a column that is multiplied by a factor only the user knows."""
    return {name: {"column": plain(column.title, 80), "scale": factor}}
