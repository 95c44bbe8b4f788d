"""Orders in which the residual repeats with the shaft angle.

The spectrum of the residual over the angle in place of time,

    S(n) = sum_t  r(t) exp(-i n phi(t)),

is summed over samples, so that speed and direction may change as they like.  An angle that is
integrated from the logged speed turns a little faster or slower than the shaft; a motor with
fourteen pulses a revolution then shows an order of 13.96, which no list of whole numbers has.

Source: Fyfe and Munck, Mechanical Systems and Signal Processing 11 (1997), 187-205 (order
tracking).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from identification.model.excitation import Record

__all__ = ["HIGHEST_ORDER", "orders_of"]

Array = NDArray[np.float64]

HIGHEST_ORDER: Final = 36
"""Most periods a revolution that are looked for."""

_KEPT: Final = 6
_BINS: Final = 4.0
_MOST_BINS: Final = 2**22
_STANDS_OUT: Final = 16.0
"""Power of a peak over the median around it; noise alone exceeds it in exp(-16 log 2) of places."""


def orders_of(
    records: Sequence[Record], residuals: Sequence[Array], highest: float
) -> tuple[float, ...]:
    """The orders that stand out most of the residual of either channel, ascending.

    Args:
        records: With the angle among their inputs.
        residuals: For each record (n_sample, 2) measured minus simulated.
        highest: Highest order that is looked for.
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
    """The highest separate maxima over what is usual around them."""
    step = orders[1]
    around = max(int(1.0 / step), 3)
    # The median of a window as wide as two orders, on a coarser grid.
    coarse = max(around // 8, 1)
    blocks = power[: power.size // coarse * coarse].reshape(-1, coarse)
    floor = np.asarray(signal.medfilt(np.median(blocks, axis=1), 17), dtype=np.float64)
    usual = np.interp(
        np.arange(power.size), (np.arange(floor.size) + 0.5) * coarse, np.maximum(floor, 1e-300)
    )
    relative = np.where((orders > 0.5) & (orders <= highest), power / usual, 0.0)
    apart = int(np.ceil(4 * np.pi / longest / step))
    found = []
    for _ in range(_KEPT):
        at = int(np.argmax(relative))
        if relative[at] < _STANDS_OUT:
            break
        found.append(float(orders[at]))
        relative[max(at - apart, 0) : at + apart + 1] = 0.0
    return found
