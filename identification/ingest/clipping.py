"""Clipping detection: samples at which a sensor saturated.

A saturated sensor repeats its highest or lowest value for longer than the signal stays constant
anywhere else.  In a noisy signal this is sufficient evidence, because noise never pauses.  A
noise-free signal must also enter the limit with a step of the usual size and above its resolution,
because a simulated speed settles smoothly to its last digit, and that of a coarse encoder to its
last count.  A noise-free voltage is never reported, because a programmed ramp enters its plateau
the same way.  Standstill, where the signal reads zero for long, is excluded.
"""

from __future__ import annotations

import math

import numpy as np

from identification.arrays import Array, Bool, Index, stretches
from identification.ingest.run import RunWarning, SourceLocator

__all__ = ["find_clipped"]

_SHORTEST_PLATEAU = 5
_FEWEST_SAMPLES = 10
_SHARE_BELOW_LIMIT = 0.2
_PLATEAU_RATIO = 3
_STANDSTILL = 0.02
_ENTRY_STEP = 0.3
_RESOLUTIONS = 1.5
_MANY_PLATEAUS = 10
_ORDER = 8
_GROWTH = 1.5
_OMITTED = "probably because the sensor saturates; these samples are omitted"
_USED = "probably because the drive is at its limit; the samples are used as logged"


def find_clipped(
    channels: dict[str, Array], locator: SourceLocator
) -> tuple[dict[str, Bool], list[RunWarning]]:
    """Find samples at the limit of a sensor.

    Returns:
        Channel name to boolean (n_sample,), True at the limit, for channels with such samples; and
        one warning for each limit.
    """
    clipped: dict[str, Bool] = {}
    warnings = []
    for name, signal in channels.items():
        treatment = _USED if name == "voltage_V" else _OMITTED
        for limit, word in ((float(np.max(signal)), "highest"), (float(np.min(signal)), "lowest")):
            at_limit = signal == limit
            if _is_clipped(name, signal, limit, at_limit):
                clipped[name] = clipped[name] | at_limit if name in clipped else at_limit
                count, first = int(at_limit.sum()), int(np.argmax(at_limit))
                message = f"stays at its {word} value {limit:.6g} in {count} samples, {treatment}"
                warnings.append(locator.warning("clipped_channel", message, name, first))
    return clipped, warnings


def _is_clipped(name: str, signal: Array, limit: float, at_limit: Bool) -> bool:
    """Return True if the samples at one extreme look like sensor saturation."""
    plateaus = stretches(at_limit)
    lengths = plateaus[:, 1] - plateaus[:, 0]
    long = lengths >= _SHORTEST_PLATEAU
    if int(lengths[long].sum()) < _FEWEST_SAMPLES:
        return False
    below = int(signal.size - at_limit.sum())
    if below < _SHARE_BELOW_LIMIT * signal.size or abs(limit) <= _STANDSTILL * np.ptp(signal):
        return False
    usual = _longest_repeat(signal, at_limit)
    longer = int(np.count_nonzero(lengths[long] > usual))
    if int(lengths.max()) <= _PLATEAU_RATIO * usual and longer < _MANY_PLATEAUS:
        return False
    if _has_noise(signal):
        return True
    return name != "voltage_V" and _enters_with_a_step(signal, at_limit, plateaus[long])


def _longest_repeat(signal: Array, at_limit: Bool) -> int:
    """Largest number of consecutive equal samples away from the limit."""
    same = (np.diff(signal) == 0.0) & ~at_limit[1:]
    # Exclude the other extreme, which may be a limit as well.
    other = np.min(signal) if at_limit[int(np.argmax(signal))] else np.max(signal)
    same &= signal[1:] != other
    # Exclude standstill, where an encoder reads exactly zero.
    same &= np.abs(signal[1:]) > _STANDSTILL * np.ptp(signal)
    plateaus = stretches(same)
    return 1 + (int((plateaus[:, 1] - plateaus[:, 0]).max()) if plateaus.size else 0)


def _has_noise(signal: Array) -> bool:
    """Return True if the signal carries noise above its quantisation step.

    Differences of high order cancel a smooth signal and grow by a factor of nearly 2 per order for
    white noise.  The median over all samples ignores the jumps of a stepped signal.
    """
    if signal.size < 4 * _ORDER:
        return False
    lower = np.diff(signal, n=_ORDER - 1)
    higher = np.median(np.abs(np.diff(lower)))
    if higher < _GROWTH * np.median(np.abs(lower)):
        return False
    levels = np.diff(np.unique(signal))
    # Median |x| of a standard normal: 0.67.  The binomial is the difference's noise gain.
    noise = higher / (0.67 * math.sqrt(math.comb(2 * _ORDER, _ORDER)))
    return bool(noise > np.min(levels))


def _enters_with_a_step(signal: Array, at_limit: Bool, long: Index) -> bool:
    """Return True if the median step into the limit is comparable to the usual step.

    A single step of the resolution has no slope: a coarse encoder shows it at a steady speed, too.
    """
    step = np.abs(np.diff(signal))
    moving = step[~at_limit[1:] & (step > 0.0)]
    entries = long[long[:, 0] > 0, 0]
    if not entries.size or not moving.size:
        return False
    entry = np.median(step[entries - 1])
    return bool(entry > max(_ENTRY_STEP * np.median(moving), _RESOLUTIONS * np.min(moving)))
