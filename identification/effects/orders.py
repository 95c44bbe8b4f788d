"""Order tracking: orders of the shaft rotation at which the residual is periodic.

The spectrum of the residual over the shaft angle phi instead of time,

    S(n) = sum_t  r(t) exp(-i n phi(t)),

is a sum over samples, so speed and direction may change freely.  The orders n are not restricted
to integers: an angle integrated from the logged speed turns slightly faster or slower than the
shaft, and a motor with fourteen pulses per revolution then has an order of 13.96, for example.

Source: Fyfe and Munck, Mechanical Systems and Signal Processing 11 (1997), 187-205 (order
tracking).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy import signal

from identification.arrays import Array
from identification.model.excitation import Record

__all__ = ["HIGHEST_ORDER", "largest_peaks", "orders_of"]

HIGHEST_ORDER: Final = 36
"""Highest order that is searched, in periods per revolution."""

_KEPT: Final = 6
_BINS: Final = 4.0
_MOST_BINS: Final = 2**22
_STANDS_OUT: Final = 16.0
"""Least power of a peak over the local median; white noise exceeds it with probability
exp(-16 log 2) = 1.5e-5 per bin."""


def orders_of(
    records: Sequence[Record], residuals: Sequence[Array], highest: float
) -> tuple[float, ...]:
    """Most prominent orders of the residual of either channel up to the highest, ascending [-].

    No order is returned if every record is shorter than two revolutions, or if the spectrum would
    exceed 2^22 bins.  The residual of each record is (n_sample, 2) measured minus simulated [A,
    rad/s].
    """
    angles = [record.column("angle") for record in records]
    spans = [float(np.ptp(angle)) for angle in angles]
    longest = max(spans, default=0.0)
    width = np.pi / (_BINS * highest)
    bins = int(2 ** np.ceil(np.log2(max(2.0 * longest / width, 2.0))))
    if longest < 4 * np.pi or bins > _MOST_BINS:
        return ()
    found: list[float] = []
    for channel in range(2):
        power = np.zeros(bins // 2 + 1)
        for angle, residual, record in zip(angles, residuals, records, strict=True):
            place = ((angle - angle.min()) / width).astype(np.int64)
            kept = residual[:, channel] * record.weight[:, channel]
            summed = np.bincount(place, weights=kept - kept.mean(), minlength=bins)
            power += np.abs(np.fft.rfft(summed, bins).astype(np.complex128)) ** 2
        orders = np.arange(power.size, dtype=np.float64) * (2 * np.pi / (bins * width))
        found += _peaks(power, orders, highest, longest)
    return tuple(sorted(set(found)))


def _peaks(power: Array, orders: Array, highest: float, longest: float) -> list[float]:
    """Highest separate peaks of the power relative to its local median."""
    step = orders[1]
    around = max(int(1.0 / step), 3)
    # Local median over a window of about two orders, on a coarser grid.
    coarse = max(around // 8, 1)
    blocks = power[: power.size // coarse * coarse].reshape(-1, coarse)
    floor = np.asarray(signal.medfilt(np.median(blocks, axis=1), 17), dtype=np.float64)
    usual = np.interp(
        np.arange(power.size), (np.arange(floor.size) + 0.5) * coarse, np.maximum(floor, 1e-300)
    )
    relative = np.where((orders > 0.5) & (orders <= highest), power / usual, 0.0)
    apart = int(np.ceil(4 * np.pi / longest / step))
    return [float(orders[at]) for at in largest_peaks(relative, _KEPT, apart, _STANDS_OUT)]


def largest_peaks(power: Array, most: int, apart: int, least: float) -> list[int]:
    """Indices of the largest values of at least `least` that are more than `apart` bins apart."""
    left = power.copy()
    found: list[int] = []
    while len(found) < most and not left.max() < least:
        found.append(int(np.argmax(left)))
        left[max(found[-1] - apart, 0) : found[-1] + apart + 1] = 0.0
    return found
