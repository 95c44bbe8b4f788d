"""Maximisation by BFGS with parallel function evaluations.

A likelihood evaluated on lanes gives a dozen values for the price of two.  One call therefore
evaluates the forward differences of the gradient together with shorter steps, in case the full step
fails.  The first Hessian comes from second differences: the curvatures of intensities and
correlation times differ by decades, and BFGS would need most of its steps to find them.

Source: Nocedal and Wright, Numerical Optimization, 2nd edition, section 6.1 (BFGS), procedure 18.2
(damping of the update).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from identification.arrays import Array, Index
from identification.linear import solution

__all__ = ["maximise"]

Valued = Callable[[Array], Array]
"""Function of (n, n_lane) points; returns (n_lane,) values, minus infinity if undefined."""

_DIFFERENCE: Final = 1e-4
"""Step of the forward differences of the gradient."""
_SECOND: Final = 3e-2
"""Step of the second differences of the first Hessian."""
_SHORTER: Final = (0.5, 0.2, 0.05, 0.01)
"""Fractions of a step that are tried together with the full one."""
_LONGEST: Final = 2.0
"""Largest change of a coordinate in one step."""
_ENOUGH: Final = 0.01
"""Gain that does not matter."""
_STEPS: Final = 40
_TRIED: Final = 4
"""Steps before the comparison with a rival may end the iteration."""
_OPTIMISM: Final = 20.0
"""Largest assumed ratio of the remaining gain to the gain that one step predicts."""
_FAR: Final = 50.0
"""Deficit to the rival, beyond the remaining gain, from which the iteration ends."""


def maximise(
    valued: Valued, start: Array, bounds: tuple[Array, Array], rival: float | None = None
) -> tuple[Array, float]:
    """Point (n,) and value of the maximum of a function within bounds, from a start (n,).

    The function is scaled so that a difference of 1 matters and 0.01 does not.  The bounds (n,) are
    equal for a fixed coordinate.  The iteration also ends once it has reached the value of a rival
    or is sure to stay far below it.
    """
    lower, upper = bounds
    point = np.clip(start, lower, upper)
    inverse = _first_inverse(valued, point)
    value, gradient, _ = _value_and_gradient(valued, point, bounds, np.zeros((point.size, 0)))
    small = 0
    for number in range(_STEPS):
        free = _free(point, gradient, bounds)
        step = np.zeros(point.size)
        step[free] = solution(_inverted(inverse)[np.ix_(free, free)], gradient[free])
        predicted = float(gradient @ step)
        behind = np.nan if rival is None else rival - value
        is_hopeless = number >= _TRIED and behind > _FAR + _OPTIMISM * predicted
        if not predicted > _ENOUGH or behind < _ENOUGH or is_hopeless:
            break
        step *= min(1.0, _LONGEST / np.abs(step).max())
        tries = np.clip(
            point[:, None] + step[:, None] * np.array(_SHORTER), lower[:, None], upper[:, None]
        )
        full = np.clip(point + step, lower, upper)
        ahead, slope, others = _value_and_gradient(valued, full, bounds, tries)
        if not ahead > value + 1e-4 * predicted or others.max() > ahead + 0.1 * abs(ahead - value):
            best = int(np.argmax(others))
            if not others[best] > value:
                if small > 1:
                    break
                small += 1
                inverse = _first_inverse(valued, point)
                continue
            full = tries[:, best]
            ahead, slope, _ = _value_and_gradient(valued, full, bounds, np.zeros((point.size, 0)))
        inverse = _bfgs_update(inverse, full - point, gradient - slope)
        small = small + 1 if ahead - value < _ENOUGH else 0
        point, value, gradient = full, ahead, slope
        if small > 1:
            break
    return point, value


def _free(point: Array, gradient: Array, bounds: tuple[Array, Array]) -> Index:
    """Indices of the coordinates that the gradient does not push against a bound."""
    lower, upper = bounds
    held = ((point <= lower) & (gradient <= 0)) | ((point >= upper) & (gradient >= 0))
    return np.flatnonzero(~held)


def _value_and_gradient(
    valued: Valued, point: Array, bounds: tuple[Array, Array], others: Array
) -> tuple[float, Array, Array]:
    """Value and gradient at one point, and values at others, in one call."""
    lower, upper = bounds
    moving = np.flatnonzero(upper > lower)
    lanes = np.repeat(point[:, None], moving.size + 1, axis=1)
    step = np.where(point[moving] + _DIFFERENCE > upper[moving], -_DIFFERENCE, _DIFFERENCE)
    lanes[moving, np.arange(1, moving.size + 1)] += step
    values = valued(np.concatenate([lanes, others], axis=1))
    gradient = np.zeros(point.size)
    with np.errstate(invalid="ignore"):
        found = (values[1 : moving.size + 1] - values[0]) / step
    gradient[moving] = np.where(np.isfinite(found), found, 0.0)
    value = float(values[0]) if np.isfinite(values[0]) else -np.inf
    own = values[moving.size + 1 :]
    return value, gradient, np.where(np.isfinite(own), own, -np.inf) if own.size else own


def _first_inverse(valued: Valued, point: Array) -> Array:
    """Inverse of the diagonal of the negative Hessian, from second differences."""
    size = point.size
    lanes = np.repeat(point[:, None], 2 * size + 1, axis=1)
    lanes[np.arange(size), np.arange(1, size + 1)] += _SECOND
    lanes[np.arange(size), np.arange(size + 1, 2 * size + 1)] -= _SECOND
    values = valued(lanes)
    with np.errstate(invalid="ignore"):
        curvature = (2 * values[0] - values[1 : size + 1] - values[size + 1 :]) / _SECOND**2
        slope = np.abs(values[1 : size + 1] - values[size + 1 :]) / (2 * _SECOND)
    # Where the curvature is negative or below the slope, the slope limits the step to one half.
    curvature = np.where(np.isfinite(curvature) & (curvature > 0), curvature, 0.0)
    slope = np.where(np.isfinite(slope), slope, 0.0)
    return np.diag(
        1.0 / np.maximum.reduce([curvature, 2.0 * slope * (curvature < slope), np.full(size, 0.3)])
    )


def _bfgs_update(inverse: Array, step: Array, change: Array) -> Array:
    """BFGS update of the inverse, damped so that it stays positive definite."""
    if not np.abs(step).max() > 0:
        return inverse
    matrix = _inverted(inverse)
    own = float(step @ matrix @ step)
    along = float(step @ change)
    if along < 0.2 * own:
        share = 0.8 * own / (own - along)
        change = share * change + (1 - share) * (matrix @ step)
        along = float(step @ change)
    pushed = matrix @ step
    matrix = matrix + np.outer(change, change) / along - np.outer(pushed, pushed) / own
    return _inverted(0.5 * (matrix + matrix.T))


def _inverted(matrix: Array) -> Array:
    return solution(matrix, np.eye(matrix.shape[0]))
