"""Error for channels without a column: the columns that resemble them, and mappings to copy."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from identification.errors import Example, MissingColumn, NoHeader, RunFileError
from identification.ingest.columns import (
    Column,
    example,
    may_be_duty,
    scaled_example,
    similar_columns,
)
from identification.ingest.display import listed, plain, quoted
from identification.ingest.mapping import ROW
from identification.ingest.names import (
    is_direction,
    is_sample_number,
    is_setpoint,
    is_supply,
    similar_to,
)
from identification.ingest.units import canonical_unit, find_unit

__all__ = ["missing_columns"]

_GAINS = {"voltage_V": "V_PER_V", "current_A": "A_PER_V", "speed_rad_s": "RAD_S_PER_V"}
"""Gains that stand in examples for those of probes and sensors, which give volts."""

_MEASURED = frozenset(_GAINS)

_NUMBER = re.compile(r".*\d(?:v|\.\w+/.*)?|(?:channel|kanal) [a-h]", re.IGNORECASE)
"""Names of numbered channels, or with a numbered file in front, such as ``C1.csv/Ampl``."""


_ALARM = re.compile(r"al(?:ar)?m\b|event|status", re.IGNORECASE)
"""Beginning of names of alarms and states beside numbered channels."""


def missing_columns(
    names: list[str], free: list[Column], columns: Sequence[Column], found: Mapping[str, str]
) -> RunFileError:
    """One error for all channels without a column, each with its similar columns.

    The mapping does not use the `free` columns; `found` are titles by name of the other channels.
    """
    if not any(column.texts for column in columns):
        return _without_header(names, len(columns))
    numbered = _numbered(free)
    if min(len(numbered), len(_MEASURED.intersection(names))) > 1:
        return _unnamed_columns(names, numbered, free, found)
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
    hint += _of_supply(similar.get("voltage_V", [])) + _of_speed(similar.get("speed_rad_s", []))
    if similar.get("voltage_V") == [] and not any("voltage_V" in each for each in derived):
        hint += " (a voltage that was constant during the whole run is a number)"
        derived.append({"voltage_V": {"value": "VOLTS"}})
    signals = [column for column in free if "time" not in column.quantities]
    lacking = [name for name in names if name in _MEASURED and not similar[name]]
    if 1 in (len(numbered), len(signals)) and len(lacking) > 1:
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


def _of_supply(near: Sequence[Column]) -> str:
    """Remark on the voltages of a supply that are proposed for want of one at the motor."""
    if not near or not all(any(map(is_supply, column.texts)) for column in near):
        return ""
    return f" ({quoted(near[0].title)} is that of the motor only without a chopper between them)"


def _of_speed(near: Sequence[Column]) -> str:
    """Remark on the unit of a speed that the header does not give: drives have several."""
    is_known = not near or near[0].unit_texts or "rpm" in near[0].title.casefold()
    return "" if is_known else f" (with the unit of {quoted(near[0].title)} in place of rad/s)"


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
    duties = [c for c in free if may_be_duty(c)] if "voltage_V" in names else []
    duties.sort(key=lambda column: "duty" not in column.quantities)
    if duties:
        hint += (
            f" (the voltage may be {quoted(duties[0].title)} times a column of the bus voltage, "
            "or, where that is constant, times a scale)"
        )
        entry = {"column": plain(duties[0].title, 80), "scale": "VOLT_PER_DUTY"}
        ways = [c for c in free if any(map(is_direction, c.texts))]
        if ways:
            hint += f" (the sign may be that of {quoted(ways[0].title)})"
            entry["sign"] = plain(ways[0].title, 80)
        examples.append({"voltage_V": entry})
    angles = similar_columns("position_rad", free) if "speed_rad_s" in names else []
    if angles and _is_in_volts(angles[0]):
        hint += (
            f" ({quoted(angles[0].title)} is a voltage: count the pulses of an encoder in the "
            "logger, or give the gain of a sensor of the speed)"
        )
        examples.append(scaled_example("speed_rad_s", angles[0], _GAINS["speed_rad_s"]))
    elif angles:
        hint += (
            " (the speed may be derived from an angle or encoder count, "
            f"{quoted(angles[0].title)} mapped to position_rad)"
        )
        examples.append(scaled_example("position_rad", angles[0], "RAD_PER_COUNT"))
    return hint, examples


def _is_in_volts(column: Column) -> bool:
    """True if a column has the unit of a voltage, also after a name that is no channel's."""
    ends = (find_unit(text.rpartition("_")[2]) for text in column.texts)
    return any(unit is not None and unit.quantity == "voltage" for unit in (column.unit, *ends))


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


def _numbered(columns: Sequence[Column]) -> list[Column]:
    """Columns in volts, or without a unit and with a number in the name, such as CH1.

    An oscilloscope or a logger writes them without the name of a channel.  Columns without a name
    have their number where no other column has one, except the time.  Alarms have numbers, too.
    """
    is_named = any(column.texts and "time" not in column.quantities for column in columns)
    return [
        column
        for column in columns
        if not column.quantities
        and not any(map(_ALARM.match, column.texts))
        and not any(is_setpoint(t) or similar_to(t, "temperature") for t in column.texts)
        and not any(similar_to(t, q) for t in column.texts for q in ("current", "speed"))
        and (
            column.unit.quantity == "voltage"
            if column.unit is not None
            else not column.unit_texts
            and any(map(_NUMBER.fullmatch, column.texts if is_named else (column.title,)))
        )
    ]


def _unnamed_columns(
    names: Sequence[str],
    unnamed: Sequence[Column],
    columns: Sequence[Column],
    found: Mapping[str, str],
) -> RunFileError:
    """Error for the missing channels of a file of an oscilloscope.

    The examples take the columns in their order; the user knows the order and the gains.
    """
    entries: dict[str, object] = {}
    free = iter(unnamed)
    # CH2 in A beside others in V is that of a current probe.
    others = [column for column in columns if column not in unnamed]
    near = {name: similar_columns(name, others)[:1] for name in names if name in _GAINS}
    hint, derived = _derivations([name for name in names if name == "time_s"], columns)
    for name in names:
        is_given = name not in _GAINS or bool(near[name])
        column = None if is_given else next(free, None)
        one = _with_gain(name, column) if column else example(name, *(near.get(name) or (None,)))
        entries |= derived[0] if name == "time_s" else one
    known = "".join(f"{name} is {quoted(title)}; " for name, title in found.items())
    known += "".join(
        f"{n} may be {quoted(c.title)}; " for n, near_n in near.items() for c in near_n
    )
    lacking = sum(not column for column in near.values()) - len(unnamed)
    more = f"; record {lacking} more, as the file has too few" if lacking > 0 else ""
    unit = "".join(f" in {text}" for text in unnamed[0].unit_texts[:1]) or " without a unit"
    probes = [f"{c.title} (by {c.attenuation:g})" for c in unnamed if c.attenuation != 1.0]
    more += f"; the probe attenuation is in the cells of {', '.join(probes)}" if probes else ""
    return MissingColumn(
        f"no column for {', '.join(names)}; {known}{listed(c.title for c in unnamed)}{unit} have "
        f"no name of a channel{more}; the file does not say which is which, nor the gain of a "
        f"sensor: write names and units in the header{hint}",
        column=names[0],
        examples=[entries],
    )


def _with_gain(name: str, column: Column) -> Example:
    """Mapping of a channel to a column with a gain per unit of its cells, such as A_PER_mV."""
    unit = column.unit.name if column.unit else "V"
    if name != "voltage_V":
        return scaled_example(name, column, _GAINS[name].removesuffix("V") + unit)
    stated = {} if unit == "V" else {"unit": unit}
    return {name: {"column": plain(column.title, 80), "scale": _GAINS[name], **stated}}
