"""Quantisation step of a logged signal, and whether its rounding errors persist.

Rounding adds an error that is uniform over one step, with a standard deviation of step / sqrt(12).
If noise or motion carries the signal across steps from sample to sample, this error acts as white
noise.  With noise below about half a step it does not: consecutive samples keep one value and one
error, which more samples do not reduce and their scatter does not show.

Source: Widrow and Kollar, Quantization Noise, Cambridge University Press 2008, chapters 5 and 9.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from identification.arrays import Array

__all__ = ["stays", "step_of"]

_STAYS: Final = 0.25
"""Fraction of samples equal to their predecessor above which rounding errors persist."""
_RARE: Final = 0.01
"""Fraction of samples whose values may lie off the steps, as in averaged logs."""
_ON_STEP: Final = 0.1


def step_of(signal: Array) -> float | None:
    """Quantisation step of a signal (n_sample,); None if differences are not multiples of one."""
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


def stays(signal: Array) -> bool:
    """True if many samples equal their predecessor, zeros at standstill excluded."""
    same = signal[1:] == signal[:-1]
    moving = signal[1:] != 0.0
    return int(np.count_nonzero(same & moving)) > _STAYS * max(int(np.count_nonzero(moving)), 1)
