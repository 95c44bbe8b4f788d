"""Local substepping: integration of selected sample intervals in several equal substeps.

One third-order step per sample interval has an error far below the noise almost everywhere.  The
exceptions are few: intervals in which friction changes sign, the current passes the knee of the
brush drop, or a torque is periodic in a fast angle.  Only those intervals are divided, so a motor
with sharp friction costs little more than a smooth one.

The substep counts stay fixed during a fit, which keeps its cost a smooth function of the
parameters.  `Simulator.divided_for` determines them again at the end of the fit.
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
    """Equal substep counts for all sample intervals.

    Args:
        rows: Number of samples of each record.
        parts: Substeps of each sample interval.
    """
    return tuple(np.full(n, parts, dtype=np.int64) for n in rows)


def begins(counts: Counts) -> NDArray[np.intp]:
    """Row of the divided inputs at which each sample interval begins, (n_sample,)."""
    return np.concatenate([[0], np.cumsum(counts)[:-1]])


def divided(inputs: Array, counts: Counts, hold: Hold) -> Array:
    """Inputs with one row per substep.

    Args:
        inputs: (n_sample, n_input), one row per sample.
        counts: (n_sample,) substeps of each sample interval.
        hold: Inter-sample behaviour of the voltage.

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
        inputs: (n_input,) symbols of the whole interval.
        hold: Inter-sample behaviour of the voltage.
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
    """Inputs that vary linearly within an interval."""
    return ("temperature", "angle") if hold == "zoh" else ("voltage", "temperature", "angle")


def more_parts(counts: Counts, errors: Array, tolerance: Array) -> Counts:
    """Refine the substep counts from the measured integration errors.

    Args:
        counts: (n_sample,) substep counts at which the errors were measured.
        errors: (n_row, n_channel) error of each substep.
        tolerance: (n_channel,) allowed error of one sample interval.

    Returns:
        (n_sample,) counts multiplied by 1, 2, 4 or 8, at most `MOST_PARTS`.
    """
    summed = np.add.reduceat(np.abs(errors), begins(counts), axis=0)
    excess = np.max(np.where(np.isfinite(summed), summed / tolerance, np.inf), axis=1)
    # With n substeps the error falls as 1/n at a kink and as 1/n^3 elsewhere.  The exponent 2 is
    # a compromise; the next error measurement corrects it.
    doublings = np.ceil(0.5 * np.log2(np.clip(excess, 1.0, 64.0))).astype(np.int64)
    return np.asarray(np.minimum(counts * 2**doublings, MOST_PARTS))
