"""Step plan: Taylor terms and squarings that the stiffness of a model requires.

The stiffness is the spectral radius of h df/dx.  The step (`step.py`) sums Taylor series of the
matrix functions of h df/dx, so it is valid up to a largest stiffness.

Source: Al-Mohy and Higham, SIAM J. Sci. Comput. 33 (2011), 488-511 (Taylor series with scaling).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.model.composite import MotorModel
from identification.model.excitation import Record
from identification.model.pointwise import values_at

__all__ = ["StepPlan", "plan_for", "spectral_radius", "stiffness"]

TOLERANCE: Final = 1e-8
"""Largest truncated term of the Taylor series, relative to the change over the interval.

Sensors resolve 1e-2 to 1e-5 of the signal; this tolerance keeps the integration error far below
that, even after accumulation over a time constant."""

_SAMPLED: Final = 100

_LARGEST_ACTION: Final = 12.0
"""Largest h |A| for which the Taylor series is applied to vectors."""

_SCALED: Final = 0.3
"""Largest h |A| after scaling; the series is summed at this size before the squarings."""

_LARGEST_SERIES: Final = 5.0
"""Value of both limits for the nominal model, in which a Taylor term costs two multiplications and
a squaring ten times that.  At this size, cancellation costs two of sixteen digits."""


@dataclass(frozen=True)
class StepPlan:
    """Settings of the integration step for one sample interval."""

    terms: int
    """Number of terms of the Taylor series."""
    squarings: int = 0
    """Number of squarings; 0 applies the series to vectors."""
    rate: float = field(default=1.0, compare=False)
    """Largest h |A| for which the plan is valid [-]; not compared, so that plans with the same code
    are equal."""

    def suits(self, rate: float) -> bool:
        """True if the plan covers h |A| of `rate` without covering more than five times that."""
        return 0.2 * self.rate <= rate <= self.rate


def plan_for(rate: float, *, linear: bool = False) -> StepPlan:
    """Cheapest plan for a sample interval with h |A| up to `rate` [-].

    For the nominal model, which is linear, a Taylor term costs two multiplications.
    """
    reach = _LARGEST_SERIES if linear else _LARGEST_ACTION
    if math.isfinite(rate) and rate <= reach:
        return StepPlan(_terms(rate), 0, rate)
    bounded = min(rate, 1e12) if math.isfinite(rate) else 1e12
    scaled = _LARGEST_SERIES if linear else _SCALED
    doublings = max(1, math.ceil(math.log2(bounded / scaled)))
    return StepPlan(_terms(bounded / 2**doublings), doublings, bounded)


def _terms(z: float) -> int:
    """Number of Taylor terms after which the next term is below the tolerance.

    It is rounded up to an even number, so that slightly stiffer models reuse the same code.
    """
    size, k = 1.0, 1
    while size > TOLERANCE or k < 3:
        k += 1
        size *= z / k
    return k + k % 2


def stiffness(
    model: MotorModel, records: Sequence[Record], values: Array, states: Sequence[Array]
) -> float:
    """Largest spectral radius of h df/dx along the measured current and speed [-].

    The sample interval h is the longest of each record.  If the shaft stops, the radius is
    evaluated at rest as well: friction is stiffest there, but the noise of the speed hides it.  The
    values are (n_parameter,) or (n_parameter, n_lane) physical; the states of terms keep their
    values in `states`, (n_state,) each.
    """
    points, inputs, intervals = [], [], []
    for record, state in zip(records, states, strict=True):
        rows = np.linspace(0, record.rows - 1, min(_SAMPLED, record.rows)).astype(int)
        along = np.repeat(state[None], rows.size, axis=0)
        along[:, :2] = record.measured[rows]
        if np.ptp(np.sign(record.measured[:, 1])) > 0.0:
            still = along.copy()
            still[:, 1] = 0.0
            along, rows = np.vstack([along, still]), np.tile(rows, 2)
        points.append(along)
        inputs.append(record.inputs[rows])
        intervals.append(np.full(rows.size, record.interval))
    interval, lanes = np.concatenate(intervals), values.reshape(values.shape[0], -1).T
    count = len(lanes)
    radii = _spectral_radii(
        model,
        np.tile(np.concatenate(points), (count, 1)),
        np.tile(np.concatenate(inputs), (count, 1)),
        np.repeat(lanes, interval.size, axis=0),
    )
    return float(np.max(radii * np.tile(interval, count), initial=0.0))


def spectral_radius(model: MotorModel, states: Array, inputs: Array, values: Array) -> float:
    """Largest spectral radius of df/dx at points where it is finite; 0 if there is none [1/s].

    The states are (n_point, n_state), the inputs (n_point, n_input), the physical values (n_point,
    n_parameter).
    """
    return float(_spectral_radii(model, states, inputs, values).max(initial=0.0))


def _spectral_radii(model: MotorModel, states: Array, inputs: Array, values: Array) -> Array:
    """Spectral radius at each point, (n_point,); 0 where df/dx is not finite [1/s]."""
    size = states.shape[1]
    found = values_at(_jacobian(model), states, inputs, values)
    stack = found.reshape(-1, size, size).transpose(0, 2, 1)
    radii = np.zeros(len(stack))
    finite = np.isfinite(stack).all(axis=(1, 2))
    radii[finite] = np.abs(np.linalg.eigvals(stack[finite])).max(axis=1)
    return radii


@lru_cache
def _jacobian(model: MotorModel) -> ca.Function:
    x, u, p = model.symbols()
    return ca.Function("jacobian", [x, u, p], [ca.densify(ca.jacobian(model.rates(x, u, p), x))])
