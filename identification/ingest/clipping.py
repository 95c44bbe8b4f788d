"""Samples at which a sensor was at its limit.

A sensor at its limit writes the same highest (or lowest) number again and again, in a signal that
otherwise never stands still, and it arrives there with a jolt.  All three are asked for, because
each alone is also something sound: a commanded voltage stands still on every level, a motor at
rest reads zero for long, and a simulated speed settles to its last digit softly.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.ingest.place import Places
from identification.ingest.run import RunWarning

__all__ = ["find_clipped"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_SHORTEST_STAY = 5
_FEWEST_SAMPLES = 10
_SHARE_BELOW_LIMIT = 0.2
_STAY_RATIO = 3
_REST = 0.02
_JOLT = 0.3


def find_clipped(
    channels: dict[str, Array], places: Places
) -> tuple[dict[str, Mask], list[RunWarning]]:
    """Find samples at the limit of a sensor.

    Args:
        channels: Channel name to (n_sample,), in SI units.
        places: Where the samples stand.

    Returns:
        Channel name to (n_sample,), True at the limit, for channels that have such samples; and
        a warning for each limit.
    """
    clipped: dict[str, Mask] = {}
    warnings = []
    for name, signal in channels.items():
        for limit, word in ((float(np.max(signal)), "highest"), (float(np.min(signal)), "lowest")):
            at_limit = signal == limit
            if not _is_clipped(name, signal, at_limit):
                continue
            clipped[name] = clipped.get(name, np.zeros(signal.size, dtype=bool)) | at_limit
            warnings.append(
                places.warning(
                    "clipped_channel",
                    f"stands at its {word} value {limit:.6g} in {int(at_limit.sum())} samples, as "
                    "a sensor at its limit does; these samples are marked as clipped",
                    name,
                    int(np.argmax(at_limit)),
                )
            )
    return clipped, warnings


def _is_clipped(name: str, signal: Array, at_limit: Mask) -> bool:
    """Whether the samples at one extreme look like a limit."""
    span = float(np.ptp(signal))
    limit = float(signal[int(np.argmax(at_limit))])
    below = int(signal.size - at_limit.sum())
    stays = _stays(at_limit)
    long = stays[stays[:, 1] - stays[:, 0] >= _SHORTEST_STAY]
    if not long.size or int((long[:, 1] - long[:, 0]).sum()) < _FEWEST_SAMPLES:
        return False
    if below < _SHARE_BELOW_LIMIT * signal.size or abs(limit) <= _REST * span:
        return False
    longest = int((long[:, 1] - long[:, 0]).max())
    if longest <= _STAY_RATIO * _longest_repeat(signal, at_limit):
        return False
    if name == "voltage_V" and not _is_noisy(signal, at_limit):
        # A ramp that ends on a plateau is an ordinary command.
        return False
    return _arrives_with_a_jolt(signal, at_limit, long)


def _stays(flags: Mask) -> NDArray[np.intp]:
    """Stretches of True as rows of first and one past last sample, (n_stay, 2)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False]))))
    return edges.reshape(-1, 2)


def _longest_repeat(signal: Array, at_limit: Mask) -> int:
    """Largest number of equal samples in a row away from the limit."""
    same = (np.diff(signal) == 0.0) & ~at_limit[1:]
    # The other extreme may be a limit as well, and is no measure of how still the signal stands.
    other = np.min(signal) if at_limit[int(np.argmax(signal))] else np.max(signal)
    same &= signal[1:] != other
    # Nor is a motor at rest, whose encoder reads exactly zero.
    same &= np.abs(signal[1:]) > _REST * np.ptp(signal)
    stays = _stays(same)
    return 1 + (int((stays[:, 1] - stays[:, 0]).max()) if stays.size else 0)


def _is_noisy(signal: Array, at_limit: Mask) -> bool:
    """Whether neighbouring steps differ as noise does, not as a drawn curve."""
    step = np.diff(signal)
    bend = np.diff(step)
    free = ~(at_limit[:-2] | at_limit[1:-1] | at_limit[2:])
    if not np.any(free):
        return False
    return bool(np.median(np.abs(bend[free])) > 0.5 * np.median(np.abs(step[:-1][free])))


def _arrives_with_a_jolt(signal: Array, at_limit: Mask, long: NDArray[np.intp]) -> bool:
    """Whether the last step before most long stays is of the usual size."""
    step = np.abs(np.diff(signal))
    moving = step[~at_limit[1:] & (step > 0.0)]
    entries = long[long[:, 0] > 0, 0]
    if not entries.size or not moving.size:
        return False
    return bool(np.median(step[entries - 1]) > _JOLT * np.median(moving))
