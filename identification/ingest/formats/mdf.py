"""Reader of MDF files of versions 3 and 4 (CANape, INCA, MATLAB), with asammdf.

Each channel group has its own clock, and all of them count from the start of the measurement.
Channels are read one by one at their own times; samples marked as invalid are left out.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike

from identification.arrays import Array
from identification.ingest.clocks import Signal, SignalTable, joined
from identification.ingest.file import RunFile
from identification.ingest.formats.library import decoding, imported
from identification.ingest.reader import SourceTable, TableSet, refuse_large

if TYPE_CHECKING:
    from asammdf import MDF

__all__ = ["MdfReader"]

_WHAT: Final = "an MDF measurement file"
# Channels of the time; those of angle, distance and index are no clocks.
_TIME_MASTERS = (0, 1)
_TEMPORARY = "NamedTemporaryFile"


class MdfReader:
    """Reader of all channel groups of an MDF file."""

    def recognises(self, name: str, head: bytes) -> bool:
        """Return True for the signature of a finished or unfinished MDF file."""
        return head.startswith((b"MDF     ", b"UnFinMF "))

    def open(self, file: RunFile) -> TableSet:
        """Read the metadata of all groups with a clock."""
        library = imported("asammdf", _WHAT)
        faults = imported("asammdf.blocks.utils", _WHAT)
        groups: dict[str, list[Signal]] = {}
        with decoding(_WHAT, (faults.MdfException,)), _temporary_data_in_memory():
            opened = library.MDF(file.seekable())
            for index, group in enumerate(opened.groups):
                if not _is_time(opened, index):
                    continue
                refuse_large(file.limits, group.channel_group.cycles_nr, len(group.channels))
                name = _name(opened, index)
                groups[name if name not in groups else f"{name} {index + 1}"] = [
                    _signal(opened, index, k, channel.name)
                    for k, channel in enumerate(group.channels)
                    if k != opened.masters_db[index]
                ]
        tables: dict[str, SourceTable] = {
            name: SignalTable(signals, file.name) for name, signals in groups.items()
        }
        return TableSet("channel group", tables, joined(groups, file.name))


@contextmanager
def _temporary_data_in_memory() -> Iterator[None]:
    """Keep the temporary data of asammdf in memory; a process that reads uploads writes no file.

    asammdf opens a temporary file for every MDF file and writes the records of unsorted ones to it.
    """
    modules = [imported(f"asammdf.blocks.{name}", _WHAT) for name in ("mdf_v3", "mdf_v4")]
    files = [vars(module)[_TEMPORARY] for module in modules]
    try:
        for module in modules:
            vars(module)[_TEMPORARY] = lambda dir: io.BytesIO()
        yield
    finally:
        for module, file in zip(modules, files, strict=True):
            vars(module)[_TEMPORARY] = file


def _signal(opened: MDF, group: int, index: int, name: str) -> Signal:
    """One channel of an open file; its physical unit may stand with the conversion."""

    @cache
    def samples() -> tuple[Array, ArrayLike]:
        """Times [s] and physical values of the valid samples."""
        with decoding(_WHAT):
            for one in (opened.masters_db[group], index):
                _check_bounds(opened, group, one)
            read = opened.get(group=group, index=index)
            times = np.asarray(read.timestamps, dtype=np.float64)
            if read.invalidation_bits is None:
                return times, read.samples
            valid = ~np.asarray(read.invalidation_bits, dtype=bool)
            return times[valid], read.samples[valid]

    # Loggers append the device: "n_mot\\XCP:1".
    names = (name, name.partition("\\")[0])
    unit = str(opened.get_channel_unit(group=group, index=index) or "")
    return Signal(names, unit, lambda: samples()[0], lambda: samples()[1])


def _check_bounds(opened: MDF, group: int, index: int) -> None:
    """Reject a channel that lies outside of its record, at which asammdf crashes."""
    from asammdf.blocks.v4_blocks import Channel, ChannelGroup

    record = opened.groups[group].channel_group
    channel = opened.groups[group].channels[index]
    if not isinstance(channel, Channel) or not isinstance(record, ChannelGroup):
        return
    end = channel.byte_offset + -(-(channel.bit_offset + channel.bit_count) // 8)
    if end > record.samples_byte_nr:
        raise ValueError(f"a channel ends at byte {end} of a record of {record.samples_byte_nr}")


def _is_time(opened: MDF, index: int) -> bool:
    """Return True unless the clock of a group is an angle, a distance or an index."""
    from asammdf.blocks.v4_blocks import Channel

    if index not in opened.masters_db:
        return False
    master = opened.groups[index].channels[opened.masters_db[index]]
    return not isinstance(master, Channel) or master.sync_type in _TIME_MASTERS


def _name(opened: MDF, index: int) -> str:
    """Name of the acquisition, which MDF 3 does not have, or the comment."""
    from asammdf.blocks.v4_blocks import ChannelGroup

    group = opened.groups[index].channel_group
    name = group.acq_name if isinstance(group, ChannelGroup) else ""
    return " ".join(str(name or group.comment or "").split())[:60] or f"group {index + 1}"
