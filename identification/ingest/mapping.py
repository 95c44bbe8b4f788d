"""User-defined mapping of columns to channels and units.

    {"current_A": {"column": "current_sensor_V", "scale": 2.5},
     "speed_rad_s": {"column": "n_ist", "unit": "rpm"},
     "position_rad": null}

``cell * scale + offset`` is the value in the given unit; null omits an optional channel.  The
``period`` of a position, current or speed is the change of the cell after which it starts again.
The ``sign`` is a column of directions by which the cell is multiplied.  A ``value`` in place of a
column is a constant.  The column ``row`` of a time is the number of the sample, from 0.  The keys
``duty`` and ``bus_voltage_V`` together replace ``voltage_V``, which is then their product.  The key
``table`` selects a sheet, group or variable of a file that holds several tables.  The key ``files``
holds mappings of single files by name; they override the common mapping:

    {"files": {"run3.csv": {"current_A": {"column": "current_A", "scale": -1}},
               "run4.xlsx": {"table": "Sheet2"}}}

The whole mapping is validated, and an unknown key is an error: a misspelt ``scael`` would otherwise
silently drop a scale factor.
"""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from identification.errors import MappingError, UnknownUnit, WrongUnit
from identification.ingest.display import listed, plain, quoted
from identification.ingest.file import naming
from identification.ingest.units import (
    CHANNEL_QUANTITIES,
    FACTOR_QUANTITIES,
    Unit,
    accepted_spellings,
    canonical_unit,
    find_unit,
)

__all__ = [
    "CONSTANTS",
    "FILES",
    "OPTIONAL_CHANNELS",
    "ROW",
    "SIGNED",
    "TABLE",
    "ChannelMapping",
    "MappingLike",
    "RunMapping",
    "read_mapping",
]

OPTIONAL_CHANNELS = ("temperature_degC", "position_rad")

SIGNED = ("voltage_V", "current_A", "speed_rad_s", "duty")
"""Channels that a column of directions may sign."""

CONSTANTS = ("voltage_V", "temperature_degC", "bus_voltage_V")
"""Channels that may be a constant."""

ROW = "row"
"""Column of a mapped time that is the number of the sample, unless a column has this name."""

MappingLike = Mapping[str, object] | str | os.PathLike[str]
"""A mapping, or the path of a JSON file that contains one."""

FILES = "files"
"""Key of a mapping that holds the mappings of single files, by file name."""

TABLE = "table"
"""Key of a mapping that holds the name of the table to read."""

_KEYS = ("column", "unit", "scale", "offset")
_FURTHER_KEYS: dict[str, tuple[str, ...]] = {
    "voltage_V": ("sign",),
    "duty": ("sign",),
    "current_A": ("period", "sign"),
    "speed_rad_s": ("period", "sign"),
    "position_rad": ("period",),
}
_LARGEST_FILE = 1_000_000
_HUGE = 1e300


@dataclass(frozen=True)
class ChannelMapping:
    """Mapping of one channel."""

    channel: str
    """Canonical name."""
    column: str | None
    """Header text of the column, or None to omit the channel."""
    unit: Unit | None = None
    """Unit after scale and offset, or None if not given."""
    scale: float = 1.0
    """Factor applied to the cell."""
    offset: float = 0.0
    """Offset added after the factor, in `unit`."""
    scaled: bool = False
    """True if scale or offset was given."""
    period: float | None = None
    """Change of the cell after which an angle or a counter starts again, or None."""
    sign: str | None = None
    """Header text of the column of directions by which the cell is multiplied, or None."""
    value: float | None = None
    """Constant in `unit`, in place of a column, or None."""


@dataclass(frozen=True)
class RunMapping:
    """Mapping of one run file."""

    channels: Mapping[str, ChannelMapping] = field(default_factory=dict)
    """Mapping of each channel, by canonical name."""
    table: str | None = None
    """Name of the table to read, or None if the columns decide."""

    def __or__(self, other: RunMapping) -> RunMapping:
        """This mapping with the entries of another one, which takes precedence."""
        return RunMapping({**self.channels, **other.channels}, other.table or self.table)


def read_mapping(mapping: MappingLike | None, run: str | None = None) -> RunMapping:
    """Validate a mapping, read from a JSON file if it is a path.

    Args:
        mapping: The mapping, the path of a JSON file, or None.
        run: Name of the run file to be read; the entries of other files are validated, too.

    Raises:
        MappingError: A name, a key or a value is not accepted.
        UnknownUnit: A unit is not in the table.
        WrongUnit: A unit belongs to another quantity.
    """
    if mapping is None:
        return RunMapping()
    path = Path(mapping) if isinstance(mapping, (str, os.PathLike)) else None
    with naming(path.name if path else None):
        return _validated(_from_file(path) if path else mapping, run)


def _validated(content: object, run: str | None) -> RunMapping:
    if not isinstance(content, Mapping):
        raise MappingError(
            "the mapping is not a JSON object; expected for example "
            '{"speed_rad_s": {"column": "n", "unit": "rpm"}}'
        )
    shared = _entries({k: v for k, v in content.items() if k != FILES})
    files = content.get(FILES, {})
    if not isinstance(files, Mapping) or not all(isinstance(v, Mapping) for v in files.values()):
        raise MappingError(
            f"files is {_shown(files)}; expected a mapping for each file name, such as "
            '{"run3.csv": {"current_A": {"column": "current_A", "scale": -1}}}'
        )
    of_files = {str(name): _entries(entries) for name, entries in files.items()}
    for entries in of_files.values():
        _refuse_shared_columns((shared | entries).channels)
    _refuse_shared_columns(shared.channels)
    return shared | of_files.get(run or "", RunMapping())


def _entries(content: Mapping[object, object]) -> RunMapping:
    channels = {str(k): _channel(k, entry) for k, entry in content.items() if k != TABLE}
    table = content.get(TABLE)
    if TABLE in content and (not isinstance(table, str) or not table.strip()):
        raise MappingError(
            f"table is {_shown(table)}; expected the name of a sheet, group or variable",
            value=table,
        )
    return RunMapping(channels, table.strip() if isinstance(table, str) else None)


def _from_file(path: Path) -> object:
    try:
        if not path.is_file() and not path.is_dir() and path.exists():
            raise MappingError("the mapping is not a regular file")
        with path.open("rb") as file:
            raw = file.read(_LARGEST_FILE + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "the path is not valid"
        raise MappingError(f"the mapping cannot be opened ({reason})") from error
    if len(raw) > _LARGEST_FILE:
        raise MappingError(
            f"the mapping has more than {_LARGEST_FILE} bytes; map only the channels of the motor"
        )
    try:
        return json.loads(raw.decode("utf-8-sig"), object_pairs_hook=_object_without_repeats)
    except (ValueError, RecursionError) as error:
        row = getattr(error, "lineno", None)
        raise MappingError(f"the mapping is not JSON ({plain(str(error), 80)})", row=row) from error


def _object_without_repeats(pairs: list[tuple[str, object]]) -> dict[str, object]:
    """Make a JSON object, of whose repeated keys json would silently keep the last value."""
    found: dict[str, object] = {}
    for key, value in pairs:
        if key in found:
            raise MappingError(f"the mapping has the key {quoted(key)} twice; keep one")
        found[key] = value
    return found


def _channel(channel: object, entry: object) -> ChannelMapping:
    known = (*CHANNEL_QUANTITIES, *FACTOR_QUANTITIES)
    if channel not in known:
        raise MappingError(
            f"{quoted(str(channel))} is no channel; expected {', '.join(known)}", value=channel
        )
    name = str(channel)
    if entry is None:
        if name not in (*OPTIONAL_CHANNELS, *FACTOR_QUANTITIES):
            raise MappingError(f"{name} is required and cannot be omitted")
        return ChannelMapping(name, None)
    if not isinstance(entry, Mapping):
        raise MappingError(
            f'{name} is mapped to {_shown(entry)}; expected {{"column": "header text"}}',
            value=entry,
        )
    if "value" in entry and name in CONSTANTS:
        return _constant(name, entry)
    keys = (*_KEYS, *_FURTHER_KEYS.get(name, ()))
    unknown = [str(key) for key in entry if key not in keys]
    if unknown:
        raise MappingError(f"{name} has the key {listed(unknown)}; expected {', '.join(keys)}")
    return ChannelMapping(
        channel=name,
        column=_header(name, "column", entry.get("column")),
        unit=_unit(name, entry.get("unit")),
        scale=_number(name, "scale", entry.get("scale", 1.0)),
        offset=_number(name, "offset", entry.get("offset", 0.0)),
        scaled="scale" in entry or "offset" in entry,
        period=_number(name, "period", entry["period"]) if "period" in entry else None,
        sign=_header(name, "sign", entry["sign"]) if "sign" in entry else None,
    )


def _constant(name: str, entry: Mapping[object, object]) -> ChannelMapping:
    further = [str(key) for key in entry if key not in ("value", "unit")]
    if further:
        raise MappingError(
            f"{name} has a constant value and the key {listed(further)}; expected value and unit"
        )
    unit = _unit(name, entry.get("unit"))
    if entry["value"] is None:
        shown = (unit or canonical_unit(name)).name
        raise MappingError(
            f"{name} is a constant, but its value is missing; give it as a number in {shown}"
        )
    return ChannelMapping(name, None, unit, value=_number(name, "value", entry["value"]))


def _header(channel: str, key: str, text: object) -> str:
    if not isinstance(text, str) or not text.strip():
        raise MappingError(f'{channel} has no {key}; add "{key}" with the header text', value=text)
    return text.strip()


def _unit(channel: str, text: object) -> Unit | None:
    if text is None:
        return None
    quantity = canonical_unit(channel).quantity
    unit = find_unit(text) if isinstance(text, str) else None
    if unit is None:
        raise UnknownUnit(
            f"the mapping gives {channel} the unit {quoted(str(text))}; "
            f"expected one of {accepted_spellings(quantity)}",
            value=text,
        )
    if unit.quantity != quantity:
        raise WrongUnit(
            f"the mapping gives {channel} the unit {unit.name} of {unit.quantity}; "
            f"expected one of {accepted_spellings(quantity)}, or no unit and a scale "
            f"to {canonical_unit(channel).name}",
            value=text,
        )
    return unit


def _number(channel: str, key: str, value: object) -> float:
    number = math.nan
    if isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < _HUGE:
        number = float(value)
    # Subnormal numbers lose digits: the scaled column would be quantised.
    is_denormal = 0.0 < abs(number) < sys.float_info.min
    is_absurd = (key == "scale" and number == 0.0) or (key == "period" and number <= 0.0)
    if not math.isfinite(number) or is_denormal or is_absurd:
        wanted = {"scale": "a finite number other than 0", "period": "a positive number"}.get(
            key, "a finite number"
        )
        wanted += ", of at least 2.2e-308 in magnitude" if is_denormal else ""
        is_huge = isinstance(value, (int, float)) and _HUGE <= abs(value) < math.inf
        wanted += f", below {_HUGE:g} in magnitude" if is_huge else ""
        raise MappingError(
            f"{channel} has the {key} {_shown(value)}; expected {wanted}", value=value
        )
    return number


def _shown(value: object) -> str:
    if isinstance(value, str):
        return f'"{plain(value)}"'
    # Python refuses to print integers of thousands of digits.
    huge = isinstance(value, int) and abs(value) >= _HUGE
    return "(a huge integer)" if huge else quoted(repr(value))


def _refuse_shared_columns(mapping: Mapping[str, ChannelMapping]) -> None:
    """Reject a mapping of one column to two channels."""
    used: dict[str, str] = {}
    for channel, entry in mapping.items():
        if entry.column is None:
            continue
        if entry.column in used:
            raise MappingError(
                f"{used[entry.column]} and {channel} both map to the column "
                f"{quoted(entry.column)}; map each channel to a column of its own",
                column=plain(entry.column),
            )
        used[entry.column] = channel
