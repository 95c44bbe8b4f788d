"""Reader of TDMS files of LabVIEW and DIAdem, with npTDMS.

A channel is a waveform with an increment, or the group has a channel of the time.  Units come from
the property ``unit_string``.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike

from identification.arrays import Array
from identification.errors import UnsupportedContent
from identification.ingest.clocks import Signal, SignalTable, joined
from identification.ingest.columns import Column, describe_column
from identification.ingest.display import plain, quoted
from identification.ingest.file import RunFile
from identification.ingest.formats.library import decoding, imported
from identification.ingest.reader import ColumnTable, SourceTable, TableSet, numbers, refuse_large
from identification.ingest.run import RunWarning

if TYPE_CHECKING:
    from nptdms import TdmsChannel

__all__ = ["TdmsReader"]

_WHAT: Final = "a TDMS file"
_UNITS = ("unit_string", "NI_UnitDescription", "unit")
_STEP = "wf_increment"
# npTDMS returns raw values for any other scaling.
_SCALINGS = frozenset(
    "Polynomial Linear RTD Strain Table Thermistor Thermocouple Add Subtract AdvancedAPI".split()
)


class TdmsReader:
    """Reader of all groups of a TDMS file."""

    def recognises(self, name: str, head: bytes) -> bool:
        """Return True for the signature of a segment; an index file has another one."""
        return head.startswith(b"TDSm")

    def open(self, file: RunFile) -> TableSet:
        """Read the metadata of all groups.

        Raises:
            UnsupportedContent: A channel has a scaling that npTDMS does not apply.
        """
        library = imported("nptdms", _WHAT)
        tables: dict[str, SourceTable] = {}
        signals: dict[str, list[Signal]] = {}
        with decoding(_WHAT):
            opened = library.TdmsFile.open(file.seekable())
            text = "the end is missing, probably by a loss of power; the samples before it are read"
            warnings: tuple[RunWarning, ...] = ()
            if opened.file_status.incomplete_final_segment:
                warnings = (RunWarning("incomplete_file", text, file.name),)
            every = {
                g.name: [c for c in g.channels() if len(c) > 0 and c.dtype.kind in "biufM"]
                for g in opened.groups()
            }
            starts = [
                channel.properties.get("wf_start_time")
                for channel in itertools.chain(*every.values())
                if _is_waveform(channel)
            ]
            # The earliest start of all waveforms, if each of them has a date.
            origin = min(starts) if starts and all(s is not None for s in starts) else None
            for name, channels in every.items():
                if not channels:
                    continue
                refuse_large(file.limits, max(map(len, channels)), len(channels))
                for channel in channels:
                    for holder in (channel, opened[name], opened):
                        _refuse_scaling(channel.name, holder.properties)
                group = _Group(channels, origin)
                signals[name] = group.signals()
                tables[name] = (
                    ColumnTable(group.columns, group.load, warnings)
                    if group.time is not None or not signals[name]
                    else SignalTable(signals[name], file.name, warnings)
                )
        clocked = {name: found for name, found in signals.items() if found}
        notes = f"; {text}" if warnings else ""
        return TableSet("group", tables, joined(clocked, file.name, warnings), notes)


def _refuse_scaling(channel: str, properties: Mapping[str, object]) -> None:
    """Reject a scaling that would be left out silently."""
    for name, value in properties.items():
        if name.endswith("_Scale_Type") and value not in _SCALINGS:
            raise UnsupportedContent(
                f"the scaling {quoted(str(value))} is not supported, and the raw values are no "
                "measurement; let LabVIEW or DIAdem save scaled values",
                column=plain(channel),
                value=value,
            )


def _is_waveform(channel: TdmsChannel) -> bool:
    return float(channel.properties.get(_STEP, 0.0)) > 0.0


@dataclass(frozen=True)
class _Group:
    """Channels with numbers of one group."""

    channels: Sequence[TdmsChannel]
    origin: np.datetime64 | None
    """Date of the time 0 of waveforms, or None."""

    @cached_property
    def columns(self) -> list[Column]:
        """Columns of the channels."""
        return [
            describe_column(k, [c.name], ["s"] if c.dtype.kind == "M" else _units(c))
            for k, c in enumerate(self.channels)
        ]

    @cached_property
    def time(self) -> Column | None:
        """Channel of the time, if there is one with a unit."""
        times = [c for c in self.columns if c.unit is not None and c.quantities == {"time"}]
        return times[0] if len(times) == 1 else None

    def load(self, column: Column) -> ArrayLike:
        """Scaled samples of a channel."""
        with decoding(_WHAT):
            return np.asarray(self.channels[column.index][:])

    def signals(self) -> list[Signal]:
        """Signals of the group, none if their clock is not known."""
        if self.time is None and not all(map(_is_waveform, self.channels)):
            return []
        common = self.time and cache(partial(self._logged_time, self.time))
        return [
            Signal(
                (self.channels[column.index].name,),
                next(iter(column.unit_texts), ""),
                common or partial(self._implied_time, self.channels[column.index]),
                partial(self.load, column),
            )
            for column in self.columns
            if column is not self.time
        ]

    def _logged_time(self, column: Column) -> Array:
        factor = column.unit.factor if column.unit else 1.0
        return numbers(self.load(column), column) * factor

    def _implied_time(self, channel: TdmsChannel) -> Array:
        properties = channel.properties
        begin = float(properties.get("wf_start_offset", 0.0))
        if self.origin is not None:
            since = np.timedelta64(properties["wf_start_time"] - self.origin, "ns")
            begin += int(since.astype(np.int64)) / 1e9
        return begin + np.arange(len(channel), dtype=np.float64) * float(properties[_STEP])


def _units(channel: TdmsChannel) -> list[str]:
    return [str(channel.properties[key]) for key in _UNITS if key in channel.properties][:1]
