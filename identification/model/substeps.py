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

from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Any, Final

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
    part = _part(rows.T, hold, index, number) | {"substep": index, "substeps": number}
    return np.column_stack([part[name] for name in INPUTS])


def _part(
    inputs: Iterable[Any], hold: Hold, index: Any, number: Any
) -> dict[str, Array | Expression]:
    """Inputs of the substep with an index from zero, of so many; arrays or expressions."""
    row = dict(zip(INPUTS, inputs, strict=True))
    moving = ("voltage", "temperature", "angle") if hold == "foh" else ("temperature", "angle")
    for name in moving:
        start = row[name]
        change = row[f"{name}_next"] - start
        row[name] = start + change * index / number
        row[f"{name}_next"] = start + change * (index + 1) / number
    whole = row["interval"]
    row["time"] = row["time"] + whole * index / number
    row["interval"], row["turn"] = whole / number, row["turn"] / number
    return row


@lru_cache
def error_scan(model: MotorModel, plan: StepPlan) -> Scan:
    """Loop that advances in half steps and outputs their difference from the whole step, (2,)."""
    x, u, p = model.symbols()
    step = ca.Function("step", [x, u, p], [advance(model, plan, x, u, p)])
    parts = [_part(ca.vertsplit(u), model.held, half, 2) for half in range(2)]
    first, second = (ca.vertcat(*[part[name] for name in INPUTS]) for part in parts)
    end = step(step(x, first, p), second, p)
    return scan_of(
        ca.Function("errors", [x, u, p], [end, (end - step(x, u, p))[:2]]), effort="once"
    )


def refined(
    loop: tuple[MotorModel, StepPlan],
    inputs: Sequence[Array],
    substeps: Sequence[Counts],
    start: tuple[Array, Sequence[Array]],
    tolerance: Array,
    most: int = MOST_SUBSTEPS,
) -> tuple[Counts, ...]:
    """Substeps of all records after one measurement of the integration errors, block by block.

    For each record the inputs are (n_sample, n_input), the counts at which the errors are measured
    (n_sample,).  The start has physical values (n_parameter, 1), and an initial state (n_state, 1)
    of each record.  The tolerance is the allowed error of current and speed per sample interval
    (2,) [A, rad/s], `most` the largest count.
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
