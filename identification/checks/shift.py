"""Detection of a channel shifted in time, as by two loggers with separate clocks.

The voltage balance is evaluated on short means with one channel taken earlier or later.  A shift is
reported if the balance leaves much of the voltage unexplained as logged and little at another lag.
A delay of a few samples, as in the effect `channel_delay`, stays far below that.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from identification.arrays import Array
from identification.checks.balance import Signals, balances_of
from identification.checks.finding import Finding
from identification.ingest.run import Run

__all__ = ["shifted_findings"]

_MISSED: Final = 0.1
_LEFT: Final = 0.3
_WINDOWS: Final = 1500
_SHORTEST_WINDOW: Final = 8
_FEWEST_WINDOWS: Final = 100
_LEAST: Final = 2
_SPAN: Final = 0.35
_RATE: Final = "rate"
_NAMES: Final = {"voltage_V": "voltage", "current_A": "current", "speed_rad_s": "speed"}


def shifted_findings(run: Run, signals: Signals) -> list[Finding]:
    """Finding for a channel that is shifted in time against the others."""
    length = max(_SHORTEST_WINDOW, signals.time.size // _WINDOWS)
    count = (signals.time.size - 1) // length
    if count < _FEWEST_WINDOWS or not signals.joined.all():
        return []
    fits = [b.electrical for b in balances_of(signals)]
    before = min((fit.missed for fit in fits if fit is not None), default=0.0)
    if before < _MISSED:
        return []
    means = {name: _means(getattr(signals, word), length) for name, word in _NAMES.items()}
    means[_RATE] = np.diff(signals.current[: count * length + 1 : length])
    far = int(_SPAN * count)
    missed, name, shift = min(
        (_balance_missed(means, name, shift), name, shift)
        for name in _NAMES
        for shift in range(-far, far + 1)
    )
    if missed > _LEFT * before or abs(shift) < _LEAST:
        return []
    interval = float(np.median(np.diff(signals.time)))
    samples = abs(shift) * length
    sense, advice = ("lags", "earlier") if shift > 0 else ("leads", "later")
    return [
        Finding(
            "shifted_channel",
            "refuse",
            run.name,
            name,
            f"{sense} the other channels by about {samples} samples ({samples * interval:.3g} s); "
            f"log all channels with one clock, or shift the column to {advice} times",
            "unexplained fraction of the voltage variance",
            before,
            missed / _LEFT,
        )
    ]


def _means(signal: Array, length: int) -> Array:
    """Window means by the trapezoidal rule."""
    count = (signal.size - 1) // length
    middles = 0.5 * (signal[1:] + signal[:-1])
    return np.asarray(middles[: count * length].reshape(count, length).mean(axis=1))


def _balance_missed(means: dict[str, Array], name: str, shift: int) -> float:
    """Unexplained fraction of the voltage with one channel taken `shift` windows later."""
    count = means[name].size
    moved = (name, _RATE) if name == "current_A" else (name,)
    late = slice(max(shift, 0), count + min(shift, 0))
    early = slice(max(-shift, 0), count + min(-shift, 0))
    channels = {other: x[late] if other in moved else x[early] for other, x in means.items()}
    voltage, current, speed = (channels[n] for n in _NAMES)
    matrix = np.column_stack([current, speed, channels[_RATE], np.ones(current.size)])
    size = float(np.var(voltage))
    if size == 0.0:
        return 1.0
    scale = np.sqrt(np.mean(matrix**2, axis=0))
    matrix = matrix / np.where(scale > 0.0, scale, 1.0)
    values, *_ = np.linalg.lstsq(matrix, voltage, rcond=1e-10)
    if values[0] <= 0.0 or values[1] <= 0.0:
        return 1.0
    return float(np.mean((voltage - matrix @ values) ** 2)) / size
