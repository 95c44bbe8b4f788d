"""Detection of a speed sensor that reads zero below a least speed.

A sensor that measures the time between pulses waits for a pulse up to a longest time, and then
reads zero; so does one with a threshold.  The logs then hold no speed between zero and the least
one, although they hold many between that and its double.  Counts of an encoder have few different
readings, and a sensor with noise has all of them.

A motor that was at rest whenever its speed is zero leaves the same gap if it starts fast.  The
voltage balance, fitted to the samples with a speed,

    v = R i + K w + L di/dt + g sign(i) + h

decides: it gives a speed to the samples that read zero.  They say nothing of the shaft, so the fit
omits them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from identification.arrays import Array, Bool
from identification.checks.balance import Signals, predicted, signals_of
from identification.checks.finding import Omission, omission
from identification.ingest.run import Run

__all__ = ["least_speeds_of"]

_FEWEST: Final = 20
"""Fewest different readings between the least speed and its double, and fewest samples that read
zero while the shaft turns."""
_REGRESSED: Final = 100
"""Fewest samples of the regression."""
_DEVIATIONS: Final = 5.0
"""Speed of a shaft that turns, in deviations of the regression."""
_NORMAL: Final = 1.4826
"""Standard deviation of normal noise over its median absolute deviation."""


def least_speeds_of(runs: Sequence[Run]) -> list[Omission | None]:
    """Samples of each run at which the speed is below that of the sensor; None for a run without.

    The runs have one sensor, so one run proves it for all.
    """
    none: list[Omission | None] = [None] * len(runs)
    sizes = np.concatenate([np.abs(run.speed) for run in runs]) if runs else np.zeros(0)
    least = float(np.min(sizes, where=sizes > 0.0, initial=np.inf))
    if np.unique(sizes[(sizes >= least) & (sizes <= 2.0 * least)]).size < _FEWEST:
        return none
    turning = max(_turning(signals_of(run, samples=run.rows), least) for run in runs)
    if turning < _FEWEST:
        return none
    return [_omission_of(run, least, turning) for run in runs]


def _omission_of(run: Run, least: float, turning: int) -> Omission | None:
    zero = run.speed == 0.0
    if not zero.any():
        return None
    return omission(
        run,
        zero,
        "least_speed",
        "speed_rad_s",
        f"reads zero, or at least {least:.3g} rad/s, and nothing between, and the voltage shows "
        "that the shaft turns while it reads zero: the sensor does not measure low speeds",
        ("samples that read zero while the shaft turns", float(turning), float(_FEWEST)),
        remedy="use a sensor of low speeds, such as an encoder, or reverse the motor less often",
    )


def _turning(signals: Signals, least: float) -> int:
    """Number of samples that read zero although the voltage balance gives them a speed.

    The balance misses single samples at steps of the voltage, so its deviation is that of the
    median, and as many samples as it misses elsewhere are subtracted.  Three quarters of the
    samples of a shaft that passes zero are above a quarter of the least speed [rad/s].
    """
    zero = signals.speed == 0.0
    # A coarse encoder shows the start late.
    started = np.maximum.accumulate(~zero)
    used = np.append(signals.joined, False) & ~zero
    if np.count_nonzero(used) < _REGRESSED or not zero.any():
        return 0
    missed = np.abs(signals.speed - _speed_of_balance(signals, used))
    limit = max(_DEVIATIONS * _NORMAL * float(np.median(missed[used])), 0.25 * least)
    by_chance = float(np.mean(missed[used] > limit)) * np.count_nonzero(zero)
    return int(np.count_nonzero(zero & started & (missed > limit)) - by_chance)


def _speed_of_balance(signals: Signals, used: Bool) -> Array:
    """(n_sample,) speed by the voltage balance [rad/s]."""
    v, i = signals.voltage, signals.current
    sign = np.clip(i / (0.02 * max(float(np.abs(i).max()), 1e-300)), -1.0, 1.0)
    columns = (v, i, np.gradient(i, signals.time), sign, np.ones(v.size))
    return predicted(columns, signals.speed, used, 0.0)[0]
