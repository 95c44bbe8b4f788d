"""Smoothing of the logged voltage: measurement noise removed, jumps kept.

An output-error fit takes the voltage as exact.  Noise of the voltage sensor is then simulated as
current, and the fit suppresses it with a larger R and L (bias by errors in variables).  The bias is
small if the voltage jumps, and large if it varies slowly, so that the motor draws little current.

The rounding of a slow voltage that is logged in coarse steps persists over many samples, so that
cross-validation takes it for a part of the voltage.  Its size is known instead: it is uniform over
one step (`model/quantisation.py`), and the smoother is the stiffest one that removes no more.

Source: Eilers, Analytical Chemistry 75 (2003), 3631-3636; Morozov, Soviet Mathematics Doklady 7
(1966), 414-417 (regularisation by the known size of the error).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.linalg import solveh_banded

from identification.arrays import Array, Bool, stretches
from identification.model.quantisation import stays, step_of

__all__ = ["smooth_voltage", "voltage_step"]

_JUMP: Final = 6.0
"""Change of the voltage between two samples that is a jump, in robust standard deviations about the
slope of the neighbouring samples; of a million samples of normal noise, none exceeds it."""
_NEIGHBOURS: Final = 2
"""Changes on either side whose median is the slope."""
_NORMAL: Final = 1.4826
"""Standard deviation of normal noise over its median absolute deviation."""
_OUTLYING: Final = 4.0
"""Part of the voltage, in robust standard deviations, that is too large for noise; one sample of
16,000 with normal noise has more."""
_PASSES: Final = 3
_FEWEST_LEVELS: Final = 8
"""Levels of a rounded voltage at least; fewer do not show its course, or are those of a switch."""
_UNEVEN: Final = 1.0 / 6.0
"""Changes that differ by one step from the previous one, over all changes, from which a voltage is
rounded.  A slope of n + f steps in a sample has such a difference with the probability 2 f (1 - f),
which is 1/3 on average; ramps and steps of a signal generator have hardly any."""
_STIFFNESSES: Final = 10.0 ** np.arange(-6, 9)


def voltage_step(logged: Array) -> float:
    """Step of a voltage (n_sample,) whose rounding errors persist over samples, else zero [V]."""
    step = step_of(logged)
    if step is None or not stays(logged):
        return 0.0
    if np.unique(np.round(logged / step)).size < _FEWEST_LEVELS:
        return 0.0
    changes = np.round(np.diff(logged) / step)
    uneven = np.count_nonzero(np.abs(np.diff(changes)) == 1.0)
    return step if uneven > _UNEVEN * np.count_nonzero(changes) else 0.0


def smooth_voltage(logged: Array) -> tuple[Array, Array]:
    """Logged voltage without white noise or coarse rounding, by Whittaker smoothing, and its noise.

    It is smoothed between its jumps with one penalty for the whole series, from generalised
    cross-validation or the size of the rounding.  A voltage without noise is returned unchanged:
    all of its changes are jumps, or the smallest penalty is chosen.  The second series is random,
    with the distribution of the noise that the smoother leaves in the first.  All are (n_sample,)
    [V].
    """
    if logged.size < 3:
        return logged, np.zeros_like(logged)
    step = voltage_step(logged)
    kept = np.ones(logged.size - 2, dtype=bool)
    for jump in _jumps(logged, step):
        kept[max(jump - 2, 0) : jump] = False
    smooth, stiffness, size = _smoothed(logged, kept, step)
    for _ in range(_PASSES):
        rough = _outlying(logged - smooth, step)
        again = kept & ~(rough[:-2] | rough[1:-1] | rough[2:])
        if np.array_equal(again, kept):
            break
        kept = again
        smooth, stiffness, size = _smoothed(logged, kept, step)
    rng = np.random.default_rng(logged.size)
    if step:
        smooth = np.clip(smooth, logged - 0.5 * step, logged + 0.5 * step)
        # Between other levels the error is another one; it is constant while a level is held.
        held = np.cumsum(np.diff(logged, prepend=logged[0]) != 0.0)
        shifted = smooth + rng.uniform(0.0, step, held[-1] + 1)[held]
        error = step * np.round(shifted / step) - shifted
    else:
        error = rng.normal(0.0, size, logged.size)
    return smooth, _whittaker(error, stiffness * kept)


def _smoothed(logged: Array, kept: Bool, step: float) -> tuple[Array, float, float]:
    """Smoothed series, its penalty, and the size of the noise [V].

    The second differences with `kept` (n_sample - 2,) are penalised.
    """
    if not step:
        return _cross_validated(logged, kept)
    best, chosen, rounding = logged, 0.0, step / np.sqrt(12.0)
    for stiffness in _STIFFNESSES:
        trial = _whittaker(logged, stiffness * kept)
        if np.mean((logged - trial) ** 2) > rounding**2:
            break
        best, chosen = trial, float(stiffness)
    return best, chosen, rounding


def _cross_validated(logged: Array, kept: Bool) -> tuple[Array, float, float]:
    """Smoothed series, the penalty of generalised cross-validation, and the size of the noise [V].

    The second differences with `kept` (n_sample - 2,) are penalised.
    """
    # Each run of n penalised differences joins n + 2 samples; all other samples stand alone.
    sizes, counts = np.unique(np.diff(stretches(kept)) + 2, return_counts=True)
    alone = logged.size - float(sizes @ counts)
    best, chosen, noise, least = logged, 0.0, 0.0, np.inf
    for stiffness in _STIFFNESSES:
        trial = _whittaker(logged, stiffness * kept)
        squares = float(np.sum((logged - trial) ** 2))
        fitted = alone + sum(
            n * _trace(size, stiffness) for size, n in zip(sizes, counts, strict=True)
        )
        free = max(logged.size - fitted, 1e-9)
        if squares > 0.0 and squares / free**2 < least:
            best, chosen, least = trial, float(stiffness), squares / free**2
            noise = float(np.sqrt(squares / free))
    return best, chosen, noise


def _outlying(removed: Array, step: float) -> Bool:
    """Samples whose removed part is no noise: the voltage varies too fast there to be smoothed."""
    size = np.abs(removed)
    if step:
        return size > step
    if not size.any():
        return size > 0.0
    return size > _OUTLYING * _NORMAL * float(np.median(size[size > 0.0]))


def _jumps(logged: Array, step: float) -> list[int]:
    """First sample after each jump of the series; rounding causes changes of one step."""
    change = np.diff(logged)
    if change.size <= 2 * _NEIGHBOURS:
        return []
    padded = np.pad(change, _NEIGHBOURS, mode="edge")
    window = np.lib.stride_tricks.sliding_window_view(padded, 2 * _NEIGHBOURS + 1)
    beyond = np.abs(change - np.median(window, axis=1))
    limit = max(_JUMP * _NORMAL * float(np.median(beyond)), 1.5 * step)
    return [int(k) + 1 for k in np.flatnonzero(beyond > limit)]


def _whittaker(series: Array, stiffness: Array) -> Array:
    """Series x with the least |y - x|^2 + sum of stiffness (D x)^2, D the second difference.

    The series y is (n_sample,), the stiffness (n_sample - 2,), zero across a jump.
    """
    # Upper bands of D' diag(stiffness) D + 1, from the rows (1, -2, 1) of D.
    bands = np.zeros((3, series.size))
    bands[2] = 1.0
    for k, weight in enumerate((1.0, 4.0, 1.0)):
        bands[2, k : series.size - 2 + k] += weight * stiffness
    bands[1, 1:-1] -= 2.0 * stiffness
    bands[1, 2:] -= 2.0 * stiffness
    bands[0, 2:] = stiffness
    return np.asarray(solveh_banded(bands, series, check_finite=False))


def _trace(size: int, stiffness: float) -> float:
    """Degrees of freedom of a piece, from the asymptotic eigenvalues of D'D."""
    angle = np.pi * (np.arange(size - 2) + 1.5) / size
    roughness = (2.0 - 2.0 * np.cos(angle)) ** 2
    return 2.0 + float(np.sum(1.0 / (1.0 + stiffness * roughness)))
