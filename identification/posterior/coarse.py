"""Response correction: a coarse simulation for the posterior, exact at the optimum.

A fit on long records needs many substeps per sample interval, because the error of a coarse
simulation would shift the optimum.  Near the optimum that error is almost constant.  It is measured
there once and subtracted from the measured channels.  The coarse simulation then has the optimum of
the fine one and differs only by the change of its error across the posterior.

Source: Koziel and Leifsson, Simulation-Driven Design by Knowledge-Based Response Correction
Techniques, Springer (2016), chapter 4 (response correction of a coarse model).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.model.composite import MotorModel
from identification.model.simulate import Simulator

__all__ = ["coarser"]

_TOLERANCES: Final = (np.inf, 1.0, 0.2)
"""Discretisation errors of one interval over the noise that are tried in turn."""


def coarser(
    fine: Simulator,
    values: Array,
    states: Sequence[Array],
    deviation: Array,
    smooth: MotorModel | None = None,
) -> Iterator[Simulator]:
    """Simulators that cost less than `fine` and have its residuals at `values`, cheapest first.

    The values at the optimum are (n_parameter,) physical, the states (n_state,) for each record at
    its first sample, the noise of current and speed is (2,) [A, rad/s].  `smooth` is the model with
    smoother friction, which needs fewer substeps; None for the same.
    """
    if fine.substeps is None:
        return
    right = fine.logged(values[:, None], states)
    rows = _rows(fine)
    for tolerance in _TOLERANCES:
        coarse = replace(fine, substeps=None)
        if smooth is not None:
            coarse = coarse.changed_to(smooth, values)
        if np.isfinite(tolerance):
            coarse = coarse.with_tolerance(values, states, tolerance * deviation)
        if _rows(coarse) > 0.8 * rows:
            return
        records = tuple(
            replace(record, measured=record.measured - (a - b)[:, :, 0])
            for record, a, b in zip(
                fine.records, right, coarse.logged(values[:, None], states), strict=True
            )
        )
        yield replace(coarse, records=records)


def _rows(simulator: Simulator) -> int:
    return sum(inputs.shape[0] for inputs in simulator.inputs)
