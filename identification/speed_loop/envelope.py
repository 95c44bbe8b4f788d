"""Upper bounds of a decaying sum of modes, and the time after which it stays below a level.

Two bounds hold for all t >= 0.  The modal bound, sum |c_k| exp(Re p_k t), is tight, but useless
for nearly coincident poles, whose weights grow without limit.  The Newton bound,

    (|a_1| + |a_2| t + |a_3| t^2 / 2 + ...) exp(p t)          p the largest real part,

holds for all poles, because a divided difference of the exponential is a mean of its derivatives
(Hermite-Genocchi formula), but is loose for widely separated poles.  The bound that falls below the
level first limits the horizon in which a response has to be searched.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array
from identification.speed_loop.bracketing import root
from identification.speed_loop.modes import Modes

__all__ = ["bound_at", "time_below"]

Index = NDArray[np.intp]

_LARGEST_WEIGHT: Final = 1e60
_FIXED_POINT_STEPS: Final = 40
# The bound may equal the sum; this relative margin in time covers rounding.
_ROUNDING: Final = 1e-6


def bound_at(modes: Modes, time: Array, loop: Index) -> Array:
    """Smaller of the two bounds of |x| of stable modes from times (n_time,) on [s].

    `loop` (n_time,) is the index of the loop for each time.
    """
    modal = np.sum(
        _modal_weights(modes)[loop] * np.exp(modes.poles.real[loop] * time[:, None]), axis=1
    )
    slowest = modes.poles.real[loop].max(axis=1)
    newton = _polynomial(np.abs(modes.weights[loop]), time) * np.exp(slowest * time)
    # Newton's bound may rise up to this time; it bounds no later value before.
    falls = time * -slowest >= modes.poles.shape[1] - 1
    return np.asarray(np.where(falls, np.minimum(modal, newton), modal))


def time_below(modes: Modes, level: float) -> Array:
    """Time (n_loop,) [s] after which |x| of stable modes stays below a level < |x(0)|."""
    slowest = modes.poles.real.max(axis=1)
    newton = _newton_time(np.abs(modes.weights), slowest, level)
    weights = _modal_weights(modes)
    # One exponential at the slowest rate bounds the modal sum; its crossing ends the bracket.
    total = np.log(np.maximum(weights.sum(axis=1) / level, 1.0))
    latest = np.maximum(total, 1.0) / -slowest * (1 + _ROUNDING)

    def excess(time: Array, loop: Index) -> Array:
        exponents = modes.poles.real[loop] * time[..., None]
        largest = exponents.max(axis=-1)
        rest = np.sum(weights[loop] * np.exp(exponents - largest[..., None]), axis=-1)
        return np.asarray(np.log(rest / level) + largest)

    found = root(excess, (np.zeros_like(latest), latest), (np.arange(latest.size),))
    modal = np.where(np.isfinite(found), found, latest)
    return np.asarray(np.minimum(modal, newton) * (1 + _ROUNDING))


def _modal_weights(modes: Modes) -> Array:
    return np.nan_to_num(np.abs(modes.residues), nan=_LARGEST_WEIGHT).clip(max=_LARGEST_WEIGHT)


def _polynomial(weights: Array, time: Array) -> Array:
    """|a_1| + |a_2| t + |a_3| t^2 / 2 + ..., by Horner's rule."""
    total: Array = np.zeros_like(time)
    for k in range(weights.shape[1], 0, -1):
        total = np.asarray(weights[:, k - 1] + total * time / k)
    return total


def _newton_time(weights: Array, slowest: Array, level: float) -> Array:
    """Largest fixed point of t = log(polynomial(t) / level) / -slowest, approached from above.

    From t = (n_pole - 1) / -slowest the right-hand side grows more slowly than t, so each iterate
    stays above the fixed point: stopping early only loosens the bound.
    """

    def later(time: Array) -> Array:
        return np.log(np.maximum(_polynomial(weights, time) / level, 1.0)) / -slowest

    time: Array = max(1, weights.shape[1] - 1) / -slowest
    while np.any(short := later(time) > time):
        time = np.where(short, 2 * time, time)
    for _ in range(_FIXED_POINT_STEPS):
        time = later(time)
    return time
