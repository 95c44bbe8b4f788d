"""Loop over time of a step and its tangents, which share the state and its derivatives.

    scan = split_scan_of(step, shared)
    ends, slopes, outputs, tangents = scan(inputs, parameter, seeds, states, slopes)

A fit of a model with forty directions spends half of its time in tangents.  In a plain loop over
eight lanes, five blocks of directions would each repeat the state and all derivatives.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Final

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.model.instructions import without_repeats
from identification.model.machine import Level, Loaded, compiled
from identification.model.scan import COMPILED, LANES, SHORT, Recent, Task, key_of, padded, run
from identification.model.split_loop import lower_split
from identification.threads import threads
from identification.work import charge, charge_once

__all__ = ["SplitScan", "split_scan_of"]

_ARGUMENTS: Final = (*[ctypes.c_int64] * 3, *[ctypes.c_void_p] * 7)


class SplitScan:
    """Step function and its tangents compiled into a loop over time.

    Args:
        step: SX function (state, slope, input, parameter, seed) -> (state, slope, output, tangent);
            slope, seed and tangent have lanes.
        shared: Operations of the step without its tangents.
        key: Key of the machine code in the cache on disk.
    """

    def __init__(self, step: ca.Function, shared: int, key: str) -> None:
        self.n_output = step.size1_out(2)
        self._step, self._key = step, key
        self._shared = shared
        self._own = max(step.n_instructions() - shared, 1)
        self._kernels: dict[Level, Loaded] = {}

    def __call__(
        self,
        inputs: Sequence[Array],
        parameter: Array,
        seeds: Array,
        states: Sequence[Array],
        slopes: Sequence[Array],
    ) -> tuple[list[Array], list[Array], list[Array], list[Array]]:
        """Run the loop over every record, in parallel over records and groups of lanes.

        The inputs are (n_row, n_input) for each record, the parameters (n_parameter,) and seeds
        (n_parameter, n_lane) for all.  The states (n_state,) and slopes (n_state, n_lane) of each
        record are those before the first row and are returned after the last one, with the outputs
        (n_row, n_output) and tangents (n_row, n_output, n_lane).
        """
        n_lane = seeds.shape[1]
        kernel = self._kernel(0 if sum(rows.shape[0] for rows in inputs) <= SHORT else 2)
        parameter, seeds = np.ascontiguousarray(parameter), padded(seeds)
        stride = seeds.shape[1]
        width = self._width(stride, [rows.shape[0] for rows in inputs])
        firsts = range(0, stride, width)
        tasks: list[Task] = []
        kept: list[Array] = []
        ends, ended, outputs, tangents = [], [], [], []
        for rows, state, slope in zip(inputs, states, slopes, strict=True):
            rows, slope = np.ascontiguousarray(rows, dtype=np.float64), padded(slope)
            # Each group of lanes computes the states for itself.
            end = np.repeat(state[None], len(firsts), axis=0)
            output = np.empty((len(firsts), rows.shape[0], self.n_output))
            tangent = np.empty((rows.shape[0], self.n_output, stride))
            kept.append(rows)
            for group, first in enumerate(firsts):
                groups = rows, parameter, seeds[:, first:], end[group], slope[:, first:]
                places = [
                    each.ctypes.data for each in (*groups, output[group], tangent[..., first:])
                ]
                tasks.append((kernel, (rows.shape[0], stride, min(width, stride - first), *places)))
            ends.append(end[0])
            ended.append(slope[:, :n_lane])
            outputs.append(output[0])
            tangents.append(tangent[..., :n_lane])
        charge_once(self, COMPILED["some"] * (self._shared + self._own))
        charge(self._work(stride) * sum(rows.shape[0] for rows in inputs))
        run(tasks)
        return ends, ended, outputs, tangents

    def _work(self, lanes: int) -> float:
        """Operations of one row; a scalar takes as long as a block of lanes."""
        return float(self._shared * LANES + self._own * lanes)

    def _width(self, stride: int, rows: Sequence[int]) -> int:
        """Lanes of a group: those with which all threads end first, as each repeats the states."""
        found = []
        for groups in range(1, stride // LANES + 1):
            width = LANES * -(-stride // (LANES * groups))
            number = -(-stride // width)
            each = self._work(width)
            longest = max(max(rows), sum(rows) * number / threads()) * each
            found.append((longest, groups, width))
        return min(found)[2]

    def _kernel(self, level: Level) -> Loaded:
        if level not in self._kernels:
            made = without_repeats if level else lambda one: one
            key = f"{self._key}{level}"
            machine = compiled(lambda: lower_split(made(self._step)), level, key)
            self._kernels[level] = Loaded(machine, _ARGUMENTS)
        return self._kernels[level]


def split_scan_of(step: ca.Function, shared: int) -> SplitScan:
    """Compiled loop of a step and its tangents; equal functions are compiled once and cached."""
    key = key_of("split", step.serialize())
    return _scans.of(key, lambda: SplitScan(step, shared, key))


_scans: Recent[SplitScan] = Recent()
