"""Checks of the values of runs that need not come from the file reader."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from identification.errors import InputError
from identification.ingest.run import Run

__all__ = ["check_values"]

_LEAST_ROWS: Final = 50
_LARGEST: Final = 1e15
"""Largest value of a channel; beyond it, the squares of a long record exhaust double precision."""


def check_values(training: Sequence[Run], validation: Sequence[Run]) -> None:
    """Reject too few samples and invalid values.

    A run need not come from the file reader, whose limits are tighter.

    Raises:
        InputError: There are too few samples, time does not increase, or a value is not finite or
            too large to be squared.
    """
    if not training:
        raise InputError("no training run was given; expected at least one run file")
    rows = sum(run.rows for run in training)
    if rows < _LEAST_ROWS:
        raise InputError(
            f"the training runs have {rows} samples together; expected at least {_LEAST_ROWS}: "
            "record longer or give more runs",
            file=training[0].name,
            value=rows,
        )
    for run in (*training, *validation):
        _check_run(run)


def _check_run(run: Run) -> None:
    for name, values in run.channels.items():
        wrong = np.flatnonzero(~(np.abs(values) < _LARGEST))
        if wrong.size:
            raise InputError(
                f"sample {wrong[0]} is {values[wrong[0]]:.6g}; expected a finite value below "
                f"{_LARGEST:.0e}: check the sensor and its scale",
                file=run.name,
                column=name,
                value=float(values[wrong[0]]),
            )
    steps = np.diff(run.time)
    if not (np.isfinite(run.time).all() and (steps > 0).all()):
        raise InputError(
            "time does not increase from sample to sample; expected finite increasing seconds",
            file=run.name,
            column="time_s",
        )
