"""Consider covariance of the noise and rounding that are left in a smoothed voltage.

What a smoother leaves in the voltage acts on the motor model as an error of its input.  Rounding
persists while the log holds one level, so more samples do not average its effect on the parameters.
The change of all parameters, to first order, by independent series like that error joins the
intervals.  The series of a record are shifted copies of one.

Source: Schmidt, in Advances in Control Systems 3 (1966), 293-340 (consider covariance).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from identification.fit.solve import Fit
from identification.selection.omitted import OmittedTerm, input_errors

__all__ = ["voltage_errors"]

_SERIES: Final = 8
"""Series of each record; with eight or more, a standard deviation scatters by a quarter."""


def voltage_errors(fit: Fit, fraction: float) -> tuple[OmittedTerm, ...]:
    """Parameter changes by what is left of the noise of the voltage; none if it is as logged."""
    if all(record.voltage_noise is None for record in fit.simulator.records):
        return ()
    known = fit.simulated()
    changed = []
    for number in range(_SERIES):
        records = tuple(
            record.with_voltage_noise(number * record.rows // _SERIES)
            for record in fit.simulator.records
        )
        logged = replace(fit.simulator, records=records).logged(fit.values[:, None], fit.states)
        changed.append([y[:, :, 0] - k for y, k in zip(logged, known, strict=True)])
    changes = [np.stack(own, axis=2) / np.sqrt(_SERIES) for own in zip(*changed, strict=True)]
    return input_errors(fit, fraction, "voltage_noise", changes)
