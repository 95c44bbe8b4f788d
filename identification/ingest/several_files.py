"""One run from several files of one channel each, as some oscilloscopes and loggers write them.

    join_files(["CH1.csv", "CH2.csv"], "run.csv", {"voltage_V": {"column": "CH1"}, ...})

Each file has a time and one or more signals.  The signals are channels with clocks of their own,
which `SignalTable` brings together, and the run has all checks of a file.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.errors import DuplicateColumn, InputError, MissingColumn, RunFileError
from identification.ingest.channels import Channel, assign_channels
from identification.ingest.clocks import Signal, SignalTable, is_apart, joined, refuse_shorter
from identification.ingest.columns import Column
from identification.ingest.display import listed, plain
from identification.ingest.faults import collected, refuse_all
from identification.ingest.file import Limits, RunFile, naming, open_run_file
from identification.ingest.mapping import FILES, ChannelMapping, read_mapping
from identification.ingest.names import is_sample_number
from identification.ingest.read import READERS, opened, read_run
from identification.ingest.run import Run, RunWarning, SourceLocator
from identification.ingest.supplied import requested, supplied
from identification.ingest.tables import closest_table
from identification.ingest.units import CHANNEL_QUANTITIES, canonical_unit

__all__ = ["join_files"]

_UNLIKE: Final = 0.05
"""Difference of durations or starts from which files are not of one recording, over the longest
duration [-]."""
_EXPECTED: Final = (
    "expected files of one recording: export the same span of each channel; if two devices were "
    "started separately, give the time of one with the offset to the other, --map "
    "'{}:time_s=HEADER + OFFSET in s'"
)


def join_files(
    paths: Sequence[Path], name: str, mapping: Mapping[str, object] | None = None
) -> Run:
    """Read the files of one recording as one run.

    Args:
        paths: Files, each with a time and signals.
        name: Name of the run in messages.
        mapping: Columns of the channels.  An entry of the time applies to each file, and one under
            ``files`` to that file, whose clock it aligns with the others.  A title that several
            files have is preceded by the name of its file, as in ``CH1.csv/Ampl``; a signal without
            a title has the name of its file without the ending.

    Raises:
        RunFileError: A file cannot be read, a channel is given twice, or the signals together are
            no run; what is missing in any file is reported at once.
        InputError: There is one file, or the files differ in duration.
    """
    read_mapping(mapping, name)
    files = (mapping or {}).get(FILES)
    given = {f: set(entries) for f, entries in files.items()} if isinstance(files, Mapping) else {}
    if wrong := [file for file, channels in given.items() if channels != {"time_s"}]:
        raise InputError(
            f"the mapping of {wrong[0]} has {listed(given[wrong[0]])}; expected time_s alone: the "
            f"column of another channel is given as {wrong[0]}/HEADER if its header is not unique"
        )
    clocks = {k: entry for k, entry in (mapping or {}).items() if k in ("time_s", FILES)}
    others = {k: entry for k, entry in (mapping or {}).items() if k not in clocks}
    reader = _Files(paths, clocks, frozenset(given), read_mapping(others, name).channels)
    return read_run(paths[0], name=name, mapping=others, readers=[reader])


@dataclass(frozen=True)
class _Content:
    """Signals of one file."""

    file: str
    sha256: str
    time: Array
    """(n_sample,) [s]."""
    signals: tuple[Signal, ...]
    warnings: tuple[RunWarning, ...]


@dataclass(frozen=True)
class _Files:
    """Reader that gives the signals of all files for any of them."""

    paths: Sequence[Path]
    clocks: Mapping[str, object]
    """Mapping of the time, of all files and of single ones."""
    aligned: frozenset[str]
    """Files with a time mapping of their own."""
    others: Mapping[str, ChannelMapping]

    def recognises(self, name: str, head: bytes) -> bool:
        """Return True: the run is not that of the first file alone."""
        return True

    def open(self, file: RunFile) -> SignalTable:
        """Read all files."""
        contents = []
        errors: list[RunFileError] = []
        for path in self.paths:
            shown = plain(path.name, 200)
            with collected(errors), naming(shown), open_run_file(path, shown, Limits()) as one:
                clock = read_mapping(self.clocks, shown).channels.get("time_s")
                contents.append(_content(one, clock, errors))
        if not errors:
            _refuse_repeated(contents)
            _refuse_unlike([one for one in contents if one.file not in self.aligned])
        warnings = tuple(itertools.chain.from_iterable(c.warnings for c in contents))
        names = [content.file for content in contents]
        groups = {
            name if names.count(name) == 1 else f"{number}/{name}": content.signals
            for number, (name, content) in enumerate(zip(names, contents, strict=True), 1)
        }
        table = joined(groups, file.name, warnings)
        if errors:
            if table is not None and len(contents) == len(self.paths):
                with collected(errors), naming(file.name):
                    assign_channels(table.columns, self.others)
            # An entry of the time applies to each file, so that one error is for all.
            refuse_all(list({error.message: error for error in reversed(errors)}.values())[::-1])
        if table is None:
            raise InputError("one file has nothing to be joined with; give those of all channels")
        return table


def _content(file: RunFile, clock: ChannelMapping | None, errors: list[RunFileError]) -> _Content:
    """Read the time and the signals of a file; without a time, the names of its signals."""
    table = closest_table(opened(file, READERS))
    times: list[Channel] = []
    with collected(errors), naming(file.name):
        times.append(_time_of(table.columns, clock))
    used = [time.column for time in times]
    columns = [c for c in table.columns if c not in used and "time" not in c.quantities]
    # The columns of an oscilloscope without a unit are its settings, such as Start and Increment.
    columns = (
        [c for c in columns if c.unit_texts]
        or [c for c in columns if c.texts and not any(map(is_sample_number, c.texts))]
        or columns
    )
    if not columns:
        raise MissingColumn("the file has no column of a signal; expected a time and a signal")
    if not times:
        named = tuple(_signal(column, file, np.empty(0), np.empty(0)) for column in columns)
        return _Content(file.name, file.sha256(), np.empty(0), named, ())
    (time,) = times
    values = [Channel(f"signal {c.index}", c, c.unit or canonical_unit("duty")) for c in columns]
    samples = table.read([*requested({"time_s": time}), *values])
    refuse_shorter(samples, [value for value in values if value.column.unit_texts])
    locator = SourceLocator(file.name, {"time_s": time.column.label}, samples.row)
    read, _ = supplied(samples, {"time_s": time}, locator)
    seconds = time.unit.factor * (read.cells["time_s"] * time.scale + time.offset)
    signals = tuple(_signal(v.column, file, seconds, samples.cells[v.name]) for v in values)
    return _Content(file.name, file.sha256(), seconds, signals, samples.warnings)


def _signal(column: Column, file: RunFile, time: Array, cells: Array) -> Signal:
    kept = ~np.isnan(cells) | (not is_apart(cells))
    return Signal(
        (column.title if column.texts else Path(file.name).stem,),
        next(iter(column.unit_texts), ""),
        partial(np.asarray, time[kept]),
        partial(np.asarray, cells[kept]),
        column.attenuation,
    )


def _time_of(columns: Sequence[Column], clock: ChannelMapping | None) -> Channel:
    """Channel of the time; the other channels are in other files."""
    elsewhere = {name: ChannelMapping(name, None, value=0.0) for name in CHANNEL_QUANTITIES}
    del elsewhere["time_s"]
    return assign_channels(columns, elsewhere | ({"time_s": clock} if clock else {}))["time_s"]


def _refuse_repeated(contents: Sequence[_Content]) -> None:
    """Refuse a file or a numbered channel that is given twice."""
    for one, other in itertools.combinations(contents, 2):
        if one.sha256 == other.sha256:
            raise DuplicateColumn(
                f"{one.file} and {other.file} have the same content; give each channel once",
                file=other.file,
            )
        titles = {signal.names[0] for signal in one.signals}
        # A number in a title is that of a channel, as in CH1; Ampl and Volt are of any.
        both = [
            title
            for signal in other.signals
            if (title := signal.names[0]) in titles and any(map(str.isdigit, title))
        ]
        if both:
            raise DuplicateColumn(
                f"{one.file} and {other.file} both have the channel {listed(both)}; give each "
                "channel once, from one recording",
                file=other.file,
                column=plain(both[0]),
            )


def _refuse_unlike(contents: Sequence[_Content]) -> None:
    """Refuse files of which one is much shorter than the longest, or begins at another time."""
    longest = max(contents, key=_duration)
    for one in contents:
        interval = _duration(one) / max(one.time.size - 1, 1)
        limit = max(_UNLIKE * _duration(longest), 2.0 * interval)
        if _duration(longest) - _duration(one) > limit:
            texts = [f"{_duration(content):.4g} s" for content in (one, longest)]
            raise InputError(
                f"lasts {texts[0]}, and {longest.file} {texts[1]}; {_EXPECTED.format(one.file)}",
                file=one.file,
            )
        starts = [
            float(content.time[0]) if content.time.size else 0.0 for content in (one, longest)
        ]
        if abs(starts[0] - starts[1]) > limit:
            raise InputError(
                f"begins at {starts[0]:.4g} s, and {longest.file} at {starts[1]:.4g} s; "
                f"{_EXPECTED.format(one.file)}",
                file=one.file,
            )


def _duration(content: _Content) -> float:
    return float(np.ptp(content.time)) if content.time.size else 0.0
