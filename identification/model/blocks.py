"""Passes over records in blocks of rows, so that memory does not grow with their substeps.

A sample interval has up to 64 substeps, each with a row of inputs and of outputs.  Only the outputs
at samples are kept.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Final

import casadi as ca
import numpy as np

from identification.arrays import Array, Index
from identification.model.composite import MotorModel
from identification.model.scan import LANES, Effort, Scan, scan_of
from identification.model.step import advance, step_function
from identification.model.step_plan import StepPlan

__all__ = ["BLOCK", "blocks", "logged_scan", "sampled", "single", "states_scan", "stretch"]


BLOCK: Final = 65_536
"""Rows of a block, over all records; derivatives of as many take tens of megabytes."""


def blocks(
    lengths: Sequence[int], rows: int, lead: int = 0, most: int = BLOCK
) -> Iterator[tuple[list[int], list[slice]]]:
    """Iterate over blocks: the records that extend into each, and their samples in it.

    `lengths` are the samples of each record, `rows` the rows of all; a block has at least `lead`
    samples and at most `most` rows.
    """
    each = max(most * sum(lengths) // (rows * len(lengths)), lead, 1)
    for first in range(0, max(lengths), each):
        going = [k for k, length in enumerate(lengths) if length > first]
        yield going, [slice(first, min(first + each, lengths[k])) for k in going]


def stretch(inputs: Array, first_rows: Index | None, samples: slice) -> tuple[Array, Index | None]:
    """Inputs (n_row, n_input) of some samples of one record, and the row index of each sample.

    The row indices (n_sample,), given and returned, are None if every row is a sample.
    """
    if first_rows is None:
        return inputs[samples], None
    begin = first_rows[samples.start]
    end = first_rows[samples.stop] if samples.stop < first_rows.size else inputs.shape[0]
    return inputs[begin:end], first_rows[samples] - begin


def sampled(
    scan: Scan,
    inputs: Sequence[Array],
    first_rows: Sequence[Index] | None,
    values: Array,
    carries: Sequence[Array],
) -> list[Array]:
    """Outputs of a loop at the samples of each record, (n_sample, n_output, n_lane).

    Each record has inputs (n_row, n_input), the row index of each sample (n_sample,), unless every
    row is a sample, and a carry before the first row (n_carry, n_lane); `values` is (n_parameter,
    n_lane).
    """
    if first_rows is None:
        return scan(inputs, values, carries)[1]
    carries = list(carries)
    found = [np.empty((at.size, scan.n_output, values.shape[1])) for at in first_rows]
    lengths = [at.size for at in first_rows]
    for going, parts in blocks(lengths, sum(rows.shape[0] for rows in inputs)):
        pairs = [
            stretch(inputs[k], first_rows[k], part) for k, part in zip(going, parts, strict=True)
        ]
        ends, outputs = scan([rows for rows, _ in pairs], values, [carries[k] for k in going])
        for k, part, end, output, (_, at) in zip(going, parts, ends, outputs, pairs, strict=True):
            carries[k], found[k][part] = end, output[at]
    return found


def single(scan: Scan, inputs: Array, values: Array, carry: Array) -> Array:
    """Outputs of a loop of one lane, (n_row, n_output), of one record.

    A pass writes whole blocks of lanes, so the rows are passed in short blocks.  Inputs are (n_row,
    n_input), values (n_parameter, 1), the carry before the first row (n_carry, 1).
    """
    found = np.empty((inputs.shape[0], scan.n_output))
    for first in range(0, inputs.shape[0], BLOCK // LANES):
        rows = slice(first, first + BLOCK // LANES)
        (carry,), (output,) = scan([inputs[rows]], values, [carry])
        found[rows] = output[:, :, 0]
    return found


@lru_cache
def logged_scan(model: MotorModel, plan: StepPlan, effort: Effort) -> Scan:
    """Loop that outputs the sensor readings (2,) at each row [A, rad/s]."""
    return scan_of(step_function(model, plan), effort=effort)


@lru_cache
def states_scan(model: MotorModel, plan: StepPlan) -> Scan:
    """Loop that outputs the state (n_state,) at the begin of each row."""
    x, u, p = model.symbols()
    return scan_of(
        ca.Function("states", [x, u, p], [advance(model, plan, x, u, p), x]), effort="once"
    )
