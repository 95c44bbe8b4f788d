"""Sample intervals computed in parts, where the motor asks for it.

A step of third order over a whole sample interval is far below the noise almost everywhere.  The
exceptions are few and known beforehand: where friction changes sign, where current passes the knee
of the brushes, where a torque is periodic in a fast angle.  Only those intervals are divided, so
that a motor with sharp friction costs little more than a smooth one.

Parts are fixed while a fit goes on, which keeps its cost a smooth function; they are measured anew
with `divisions` where it ended.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from identification.model.composite import INPUTS, Hold
from identification.model.term import Expression

__all__ = ["MOST_PARTS", "Counts", "begins", "divided", "evenly", "halves", "more_parts"]

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

MOST_PARTS: Final = 64


def evenly(rows: Sequence[int], parts: int) -> tuple[Counts, ...]:
    """The same number of parts for every sample interval.

    Args:
        rows: Samples of each record.
        parts: Parts of each interval.
    """
    return tuple(np.full(n, parts, dtype=np.int64) for n in rows)


def begins(counts: Counts) -> NDArray[np.intp]:
    """(n_sample,) row of the divided inputs at which each sample interval begins."""
    return np.concatenate([[0], np.cumsum(counts)[:-1]])


def divided(inputs: Array, counts: Counts, hold: Hold) -> Array:
    """Inputs with a row for each part of each sample interval.

    Args:
        inputs: (n_sample, n_input), one part a sample.
        counts: (n_sample,) parts of each interval.
        hold: Behaviour of the voltage between samples.

    Returns:
        (n_row, n_input).
    """
    rows = np.repeat(inputs, counts, axis=0)
    parts = np.repeat(counts, counts).astype(np.float64)
    part = np.arange(rows.shape[0]) - np.repeat(begins(counts), counts)
    column = {name: k for k, name in enumerate(INPUTS)}
    whole = rows[:, column["interval"]].copy()
    rows[:, column["interval"]] = whole / parts
    rows[:, column["time"]] += whole * part / parts
    for name in _moving(hold):
        start = rows[:, column[name]].copy()
        change = rows[:, column[f"{name}_next"]] - start
        rows[:, column[name]] = start + change * part / parts
        rows[:, column[f"{name}_next"]] = start + change * (part + 1) / parts
    rows[:, column["part"]] = part
    rows[:, column["parts"]] = parts
    return rows


def halves(inputs: Expression, hold: Hold) -> tuple[Expression, Expression]:
    """Inputs of the two halves of an interval, as expressions.

    Args:
        inputs: (n_input,) symbols of the whole.
        hold: Behaviour of the voltage between samples.
    """
    found = []
    for half in range(2):
        row = {name: inputs[k] for k, name in enumerate(INPUTS)}
        whole = row["interval"]
        for name in _moving(hold):
            start, end = row[name], row[f"{name}_next"]
            row[name] = start + (end - start) * half / 2
            row[f"{name}_next"] = start + (end - start) * (half + 1) / 2
        row["time"] = row["time"] + whole * half / 2
        row["interval"] = whole / 2
        found.append(ca.vertcat(*[row[name] for name in INPUTS]))
    return found[0], found[1]


def _moving(hold: Hold) -> tuple[str, ...]:
    """Inputs that move along a straight line within an interval."""
    return ("temperature", "angle") if hold == "zoh" else ("voltage", "temperature", "angle")


def more_parts(counts: Counts, errors: Array, tolerance: Array) -> Counts:
    """Parts of each interval after a look at its error.

    Args:
        counts: (n_sample,) parts that the errors belong to.
        errors: (n_row, n_channel) error of each part.
        tolerance: (n_channel,) error that an interval may have.

    Returns:
        (n_sample,) as many as before or twice, four or eight times as many, `MOST_PARTS` at most.
    """
    summed = np.add.reduceat(np.abs(errors), begins(counts), axis=0)
    excess = np.max(np.where(np.isfinite(summed), summed / tolerance, np.inf), axis=1)
    # At a kink the error falls with the first power of the parts, elsewhere with the third: two
    # is between, and what is left over is seen at the next look.
    doublings = np.ceil(0.5 * np.log2(np.clip(excess, 1.0, 64.0))).astype(np.int64)
    return np.asarray(np.minimum(counts * 2**doublings, MOST_PARTS))
