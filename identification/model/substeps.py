"""Local substepping: integration of selected sample intervals in several equal substeps.

One third-order step per sample interval has an error far below the noise almost everywhere.  The
exceptions are few: intervals in which friction changes sign, the current passes the knee of the
brush drop, or a torque is periodic in a fast angle.  Only those intervals are divided, so a motor
with sharp friction costs little more than a smooth one.

The error of a substep is estimated by step doubling: it is the change of current and speed when the
substep is halved.  The counts stay fixed during a fit, which keeps its cost a smooth function of
the parameters.

Source: Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, 2nd edition, Springer
(1993), section II.4 (step doubling).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array
from identification.model.blocks import blocks
from identification.model.composite import INPUTS, Hold, MotorModel
from identification.model.scan import Scan, scan_of
from identification.model.step import advance
from identification.model.step_plan import StepPlan
from identification.model.term import Expression

__all__ = [
    "MOST_SUBSTEPS",
    "Counts",
    "divided",
    "error_scan",
    "evenly",
    "first_rows",
    "refined",
    "refined_counts",
]

Counts = NDArray[np.int64]

MOST_SUBSTEPS: Final = 64


def evenly(rows: Sequence[int], substeps: int) -> tuple[Counts, ...]:
    """Equal substep counts for all sample intervals of records with so many samples."""
    return tuple(np.full(n, substeps, dtype=np.int64) for n in rows)


def first_rows(counts: Counts) -> NDArray[np.intp]:
    """Row of the divided inputs at which each sample interval begins, (n_sample,)."""
    return np.concatenate([[0], np.cumsum(counts)[:-1]])


def divided(inputs: Array, counts: Counts, hold: Hold) -> Array:
    """Inputs (n_row, n_input) with one row per substep.

    The inputs are (n_sample, n_input), the counts (n_sample,).
    """
    rows = np.repeat(inputs, counts, axis=0)
    number = np.repeat(counts, counts).astype(np.float64)
    index = np.arange(rows.shape[0]) - np.repeat(first_rows(counts), counts)
    column = {name: k for k, name in enumerate(INPUTS)}
    whole = rows[:, column["interval"]].copy()
    rows[:, column["interval"]] = whole / number
    rows[:, column["time"]] += whole * index / number
    for name in _moving(hold):
        start = rows[:, column[name]].copy()
        change = rows[:, column[f"{name}_next"]] - start
        rows[:, column[name]] = start + change * index / number
        rows[:, column[f"{name}_next"]] = start + change * (index + 1) / number
    rows[:, column["turn"]] /= number
    rows[:, column["substep"]] = index
    rows[:, column["substeps"]] = number
    return rows


@lru_cache
def error_scan(model: MotorModel, plan: StepPlan) -> Scan:
    """Loop that advances in half steps and outputs their difference from the whole step, (2,)."""
    x, u, p = model.symbols()
    step = ca.Function("step", [x, u, p], [advance(model, plan, x, u, p)])
    first, second = _halves(u, model.held)
    end = step(step(x, first, p), second, p)
    return scan_of(
        ca.Function("errors", [x, u, p], [end, (end - step(x, u, p))[:2]]), effort="once"
    )


def _halves(inputs: Expression, hold: Hold) -> tuple[Expression, Expression]:
    """Inputs (n_input,) of the two halves of an interval, as expressions."""
    found = []
    for half in range(2):
        row = {name: inputs[k] for k, name in enumerate(INPUTS)}
        whole = row["interval"]
        for name in _moving(hold):
            start, end = row[name], row[f"{name}_next"]
            row[name] = start + (end - start) * half / 2
            row[f"{name}_next"] = start + (end - start) * (half + 1) / 2
        row["time"] = row["time"] + whole * half / 2
        row["interval"], row["turn"] = whole / 2, row["turn"] / 2
        found.append(ca.vertcat(*[row[name] for name in INPUTS]))
    return found[0], found[1]


def _moving(hold: Hold) -> tuple[str, ...]:
    """Inputs that vary linearly within an interval."""
    return ("temperature", "angle") if hold == "zoh" else ("voltage", "temperature", "angle")


def refined(
    loop: tuple[MotorModel, StepPlan],
    inputs: Sequence[Array],
    substeps: Sequence[Counts],
    start: tuple[Array, Sequence[Array]],
    tolerance: Array,
    most: int = MOST_SUBSTEPS,
) -> tuple[Counts, ...]:
    """Substeps of all records after one measurement of the integration errors, block by block.

    Args:
        loop: Model and step plan.
        inputs: For each record (n_sample, n_input).
        substeps: For each record (n_sample,) counts at which the errors are measured.
        start: (n_parameter, 1) physical values, and for each record the initial state (n_state, 1).
        tolerance: (2,) allowed error of current and speed per sample interval [A, rad/s].
        most: Largest count.
    """
    scan, values, carries = error_scan(*loop), start[0], list(start[1])
    found = tuple(counts.copy() for counts in substeps)
    rows = sum(int(counts.sum()) for counts in substeps)
    for going, parts in blocks([counts.size for counts in substeps], rows):
        counts = [substeps[k][part] for k, part in zip(going, parts, strict=True)]
        fine = [
            divided(inputs[k][part], each, loop[0].held)
            for k, part, each in zip(going, parts, counts, strict=True)
        ]
        ends, errors = scan(fine, values, [carries[k] for k in going])
        for k, part, each, end, error in zip(going, parts, counts, ends, errors, strict=True):
            carries[k] = end
            found[k][part] = refined_counts(each, error[:, :, 0], tolerance, most)
    return found


def refined_counts(
    counts: Counts, errors: Array, tolerance: Array, most: int = MOST_SUBSTEPS
) -> Counts:
    """Substep counts (n_sample,) multiplied by 1, 2, 4 or 8, at most `most`, for a tolerance.

    The errors (n_row, n_channel) of each substep were measured at `counts`; the tolerance
    (n_channel,) is that of one sample interval.
    """
    summed = np.add.reduceat(np.abs(errors), first_rows(counts), axis=0)
    excess = np.max(np.where(np.isfinite(summed), summed / tolerance, np.inf), axis=1)
    # With n substeps the error falls as 1/n at a kink and as 1/n^3 elsewhere.  The exponent 2 is
    # a compromise; the next error measurement corrects it.
    doublings = np.ceil(0.5 * np.log2(np.clip(excess, 1.0, 64.0))).astype(np.int64)
    return np.asarray(np.minimum(counts * 2**doublings, most))
