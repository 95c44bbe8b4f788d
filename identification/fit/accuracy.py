"""Number of substeps per sample interval that a fitted model needs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.model.division import Counts
from identification.model.simulate import Simulator

__all__ = ["TOLERATED", "accurate", "change_between"]

Array = NDArray[np.float64]

TOLERATED: Final = 0.05
"""RMS discretisation error over the noise [-] that is accepted; it raises a residual by 0.1 %."""

_SHARE: Final = 0.02
_FINER: Final = 8.0
_ATTEMPTS: Final = 3


def accurate(
    simulator: Simulator,
    values: Array,
    states: Sequence[Array],
    deviation: Array,
    start: tuple[Counts, ...] | None = None,
) -> Simulator:
    """Simulator with the fewest substeps whose discretisation error the noise hides.

    A single interval may be wrong by a fiftieth of the noise.  How such errors accumulate is
    measured against a simulation with an eight times smaller tolerance.  If the two differ by more
    than `TOLERATED` of the noise, the finer simulation takes over and is tested in the same way, up
    to three times.

    Args:
        simulator: Model, records and integrator plan.
        values: (n_parameter,) physical values.
        states: For each record (n_state,) at its first sample.
        deviation: (2,) noise of current and speed [A, rad/s].
        start: Least number of substeps of each interval; one if absent.
    """
    share = _SHARE
    coarse = simulator.divided_for(values, states, share * deviation, start=start)
    for _ in range(_ATTEMPTS):
        share /= _FINER
        fine = simulator.divided_for(
            values, states, share * deviation, looks=1, start=coarse.divisions
        )
        if np.all(change_between(coarse, fine, values, states) < TOLERATED * deviation):
            return coarse
        coarse = fine
    return coarse


def change_between(
    one: Simulator, other: Simulator, values: Array, states: Sequence[Array]
) -> Array:
    """(2,) RMS difference between the logged channels of two simulators [A, rad/s]."""
    pairs = zip(
        one.records,
        one.logged(values[:, None], states),
        other.logged(values[:, None], states),
        strict=True,
    )
    squares, counts = np.zeros(2), np.zeros(2)
    for record, a, b in pairs:
        squares += np.sum(record.weight * (a - b)[:, :, 0] ** 2, axis=0)
        counts += record.weight.sum(axis=0)
    return np.asarray(np.sqrt(squares / np.maximum(counts, 1.0)))
