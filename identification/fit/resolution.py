"""Detection of channels whose quantisation step exceeds their noise.

Rounding adds an error that is uniform over one step, with a standard deviation of step / sqrt(12).
If noise or motion carries the signal across steps from sample to sample, this error acts as white
noise.  With noise below about half a step it does not: consecutive samples keep one value and one
error, which more samples do not reduce and their scatter does not show.

Source: Widrow and Kollar, Quantization Noise, Cambridge University Press 2008, chapters 5 and 9.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.ingest.run import Run

__all__ = ["coarse_warnings", "step_of"]

Array = NDArray[np.float64]

_COARSE: Final = 2.0
"""Step over the residual, rounding included, above which the step is too coarse; the noise without
rounding is then below 0.41 of a step."""
_STAYS: Final = 0.25
"""Fraction of samples equal to their predecessor above which rounding errors persist."""
_RARE: Final = 0.01
"""Fraction of samples whose values may lie off the steps, as in averaged logs."""
_ON_STEP: Final = 0.1
_MOST_NAMED: Final = 5


def coarse_warnings(runs: Sequence[Run], noise: Array) -> tuple[str, ...]:
    """Warnings about channels whose quantisation step is too coarse for their noise.

    Args:
        runs: Training runs.
        noise: (2,) standard deviation of the residual of current and speed [A, rad/s].
    """
    warnings = []
    for channel, (name, unit) in enumerate((("current_A", "A"), ("speed_rad_s", "rad/s"))):
        steps: dict[int, float] = {}
        for number, run in enumerate(runs):
            signal = (run.current, run.speed)[channel]
            step = step_of(signal)
            if step is not None and _stays(signal) and step > _COARSE * noise[channel] > 0.0:
                steps[number] = step
        if steps:
            sizes = [f"{size:.3g}" for size in (min(steps.values()), max(steps.values()))]
            warnings.append(
                f"{_named([runs[number].name for number in steps])}, {name}: logged in steps of "
                f"{' to '.join(dict.fromkeys(sizes))} {unit}, while the residual, rounding "
                f"included, is {noise[channel]:.3g} {unit}; its rounding is no noise that averages "
                "out, so values may be off and intervals are too narrow; log it in finer steps"
            )
    return tuple(warnings)


def step_of(signal: Array) -> float | None:
    """Quantisation step of a signal; None if its differences are not multiples of one step.

    Args:
        signal: (n_sample,) any unit.
    """
    span = float(np.ptp(signal))
    if span == 0.0:
        return None
    # Values that differ only in the last digits are equal.
    values, counts = np.unique(np.round(signal / span, 9), return_counts=True)
    rare = np.argsort(counts, kind="stable")
    rare = rare[np.cumsum(counts[rare]) <= _RARE * signal.size]
    gaps = np.diff(np.delete(values, rare))
    if not gaps.size:
        return None
    step = float(np.median(gaps[gaps < 1.5 * gaps.min()]))
    off = np.abs(gaps / step - np.round(gaps / step))
    if np.count_nonzero(off > _ON_STEP) > _ON_STEP * gaps.size:
        return None
    return step * span


def _stays(signal: Array) -> bool:
    """Whether many samples equal their predecessor, zeros at standstill excluded."""
    same = signal[1:] == signal[:-1]
    moving = signal[1:] != 0.0
    return int(np.count_nonzero(same & moving)) > _STAYS * max(int(np.count_nonzero(moving)), 1)


def _named(names: Sequence[str]) -> str:
    distinct = list(dict.fromkeys(names))
    more = len(distinct) - _MOST_NAMED
    return ", ".join(distinct[:_MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
