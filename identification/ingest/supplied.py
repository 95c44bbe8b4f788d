"""Cells that a mapping supplies: a constant, the number of the sample, or a sign.

    {"voltage_V": {"value": 12}}
    {"time_s": {"column": "row", "scale": 0.001}}
    {"voltage_V": {"column": "pwm", "scale": 0.24, "sign": "dir"}}

The sign multiplies the cell, before scale and offset.  It comes from a column of directions: 1, 0
and -1, or words of `directions`.  In a column of 0 and 1, as of a direction pin, 0 is reverse.
Which direction is positive cannot be known; the check of the signs reports a wrong one.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from identification.arrays import Array
from identification.errors import AbsurdValue
from identification.ingest.channels import Channel
from identification.ingest.columns import Column
from identification.ingest.reader import Samples
from identification.ingest.run import RunWarning, SourceLocator
from identification.ingest.units import canonical_unit

__all__ = ["requested", "supplied"]


def requested(channels: Mapping[str, Channel]) -> tuple[Channel, ...]:
    """Channels whose cells a table has to read, and one for the column of each sign."""
    logged = [channel for channel in channels.values() if channel.is_logged]
    signs = [_sign_channel(c.name, c.sign) for c in logged if c.sign is not None]
    return (*logged, *signs)


def _sign_channel(name: str, column: Column) -> Channel:
    return Channel(_sign_name(name), column, canonical_unit("duty"), is_direction=True)


def _sign_name(name: str) -> str:
    return f"sign of {name}"


def supplied(
    samples: Samples, channels: Mapping[str, Channel], locator: SourceLocator
) -> tuple[Samples, list[RunWarning]]:
    """Complete the cells that were read; return them with warnings of signs and rows.

    Raises:
        AbsurdValue: A direction is a number other than 1, 0 and -1.
    """
    rows = next(iter(samples.cells.values())).size
    cells = {name: samples.cells[name] for name in channels if name in samples.cells}
    notes: list[RunWarning] = []
    for name, channel in channels.items():
        if channel.value is not None:
            cells[name] = np.full(rows, channel.value)
        elif not channel.is_logged:
            cells[name] = np.arange(rows, dtype=np.float64)
            note = "the time is the number of the sample times its interval; a lost sample shows as"
            notes.append(locator.warning("time_from_rows", f"{note} no gap", name))
        elif channel.sign is not None:
            signs = samples.cells[_sign_name(name)]
            column = channel.sign.label
            at = dataclasses.replace(locator, columns={**locator.columns, name: column})
            signs, text = _signs(signs, name, at)
            cells[name] = cells[name] * signs
            notes.append(locator.warning("sign_from_direction", f"{text} of {column}", name))
    return dataclasses.replace(samples, cells=cells), notes


def _signs(cells: Array, name: str, locator: SourceLocator) -> tuple[Array, str]:
    """Signs (n_sample,) from the cells of a direction, and what the warning says of them."""
    wrong = np.flatnonzero(~np.isin(cells, (-1.0, 0.0, 1.0)))
    if wrong.size:
        sample = int(wrong[0])
        raise locator.error(
            AbsurdValue,
            f"{cells[sample]:.6g} is no direction; expected 1, 0 or -1 in each cell, or 1 and 0",
            name,
            sample,
            float(cells[sample]),
        )
    is_pin = not np.any(cells < 0.0) and bool(np.any(cells == 0.0))
    signs = np.where(cells > 0.0, 1.0, -1.0) if is_pin else cells
    reverse = int(np.count_nonzero(signs < 0.0))
    zero = " (0 is reverse)" if is_pin else ""
    return signs, f"the sign is negative in {reverse} of {signs.size} samples{zero}, by the column"
