"""Channels one below another, each with title lines above its values.

#CHANNEL:CH1        as Hantek and OWON export them; a value has no time, and the
#CLOCK=20.0uS       channels have the sample interval of their titles
#UNITS:V
0.040
"""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np

from identification.errors import UnsupportedContent
from identification.ingest.columns import describe_column
from identification.ingest.display import plain, quoted
from identification.ingest.reader import ColumnTable
from identification.ingest.text.blocks import Block
from identification.ingest.text.cells import number_text
from identification.ingest.text.interval import interval_warning, stated_interval

__all__ = ["is_stacked", "stacked_table"]

_NAME = re.compile(r"\W*(?:channel|source|trace)(?: name)? ?[:=,;\t]\W*(\S.{0,99})", re.I)
_UNIT = re.compile(r"\W*(?:vertical )?units? ?[:=,;\t]\W*([^\s,;\])]{1,20})", re.I)
_FEWEST = 3


def is_stacked(block: Block) -> bool:
    """Return True if lines of a single number stand below titles that name a channel."""
    lines = [line for line in block.head[:-1] if line.strip()]
    at = next((k for k, line in enumerate(lines) if _number(line)), 0)
    first = list(map(_number, lines[at : at + _FEWEST]))
    return any(map(_NAME.match, lines[:at])) and len(first) == _FEWEST and all(first)


def stacked_table(blocks: Iterable[Block], file: str) -> ColumnTable:
    """Read all channels.

    Raises:
        UnsupportedContent: A channel has no name, or not as many values as the others in the same
            interval, so that a line may be lost or damaged.
    """
    channels: list[tuple[list[str], list[float]]] = [([], [])]
    for line in (line for block in blocks for line in block.lines if line.strip()):
        if number := _number(line):
            channels[-1][1].append(float(number))
            continue
        if channels[-1][1]:
            channels.append(([], []))
        channels[-1][0].append(line)
    channels = [channel for channel in channels if channel[1]]
    names, units = (
        [next((m[1].strip(" \"',;)]") for m in map(key.match, t) if m), "") for t, _ in channels]
        for key in (_NAME, _UNIT)
    )
    steps = [stated_interval(titles) for titles, _ in channels]
    # The first titles may give the interval of all.
    steps = [steps[0] if np.isnan(step) else step for step in steps]
    counts = [len(values) for _, values in channels]
    if not all(names) or not steps[0] > 0.0 or len({*zip(counts, steps, strict=True)}) > 1:
        shown = [plain(n) or quoted(t[0]) for n, (t, _) in zip(names, channels, strict=True)]
        each = zip(shown, counts, steps, strict=True)
        found = ", ".join(
            f"{name} ({count} values, {f'{step:g} s' if step > 0.0 else 'no interval'})"
            for name, count, step in each
        )
        raise UnsupportedContent(
            f"the channels below one another are {found}; expected above each a title line with "
            "its name and one with its sample interval, such as CHANNEL:CH2 and CLOCK=1.0mS, and "
            "as many values of each at one interval"
        )
    columns = [
        describe_column(k, [n], [u]) for k, (n, u) in enumerate(zip(names, units, strict=True))
    ]
    columns.append(describe_column(len(columns), ["time"], ["s"]))
    cells = [values for _, values in channels] + [(np.arange(counts[0]) * steps[0]).tolist()]
    warning = interval_warning(steps[0], file)
    return ColumnTable(columns, lambda column: np.array(cells[column.index]), (warning,))


def _number(line: str) -> str | None:
    """Number that is alone on its line, or None."""
    return number_text(line.strip(" \t,;"), ".")
