"""Gain and phase margin of a loop with a delay: L(s) = N(s) / D(s) exp(-s tau).

The delay of a sampled controller is its computing time and half a sample time of the zero-order
hold.  It does not change the loop gain, so the gain crossovers are roots of polynomials as without
delay (`margins.py`), and each phase margin falls by exactly omega tau.  The phase crossovers are
roots of a transcendental equation; they are bracketed on a logarithmic frequency grid up to the
Nyquist frequency and refined by bisection.

Source: Astrom and Wittenmark, Computer-Controlled Systems, 1997, section 1.3 (hold as a delay of
half a sample time).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from identification.arrays import Array
from identification.speed_loop.loop import Loop
from identification.speed_loop.margins import Margins, gain_crossovers, open_loop

__all__ = ["delayed_margins"]

_DECADES: Final = 5.0
_POINTS: Final = 160
_HALVINGS: Final = 30
_AT_ONCE: Final = 2000


def delayed_margins(loop: Loop, delay: float, highest: float) -> Margins:
    """Margins of each open loop N / D with a delay [s]; the smallest over all crossovers.

    `highest` is the largest frequency of a phase crossover, the Nyquist frequency [rad/s].
    """
    with np.errstate(all="ignore"):
        frequency = gain_crossovers(loop)
        lead = np.angle(-open_loop(loop, frequency), deg=True) - np.rad2deg(frequency * delay)
        phase = np.where(np.isnan(lead), np.inf, lead).min(axis=1, initial=np.inf)
        parts = [
            _gain_margin(
                Loop(loop.numerator[k : k + _AT_ONCE], loop.open_denominator[k : k + _AT_ONCE]),
                delay,
                highest,
            )
            for k in range(0, phase.size, _AT_ONCE)
        ]
    return Margins(np.concatenate(parts), phase)


def _gain_margin(loop: Loop, delay: float, highest: float) -> Array:
    grid = np.geomspace(highest * 10**-_DECADES, highest, _POINTS)
    count = loop.numerator.shape[0]
    value = open_loop(loop, np.broadcast_to(grid, (count, _POINTS))) * np.exp(-1j * grid * delay)
    is_above = value.imag > 0
    # The phase passes -180 degrees where the imaginary part changes its sign left of the origin.
    turns = (is_above[:, :-1] != is_above[:, 1:]) & (value.real[:, 1:] < 0)
    rows, first = np.nonzero(turns)
    some = Loop(loop.numerator[rows], loop.open_denominator[rows])
    low, high, begin = grid[first], grid[first + 1], is_above[rows, first]
    for _ in range(_HALVINGS):
        middle = np.sqrt(low * high)
        at = open_loop(some, middle[:, None])[:, 0] * np.exp(-1j * middle * delay)
        is_before = (at.imag > 0) == begin
        low, high = np.where(is_before, middle, low), np.where(is_before, high, middle)
    found = open_loop(some, high[:, None])[:, 0]
    margin = np.full(count, np.inf)
    np.minimum.at(margin, rows, -20 * np.log10(np.abs(found)))
    return margin
