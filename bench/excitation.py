"""Excitation signals of a test bench, normalised to the range -1 to 1.

Each excitation is a function of the number of rows, the pace of the motor (its two time constants
in samples) and a random generator.  Dwell times are log-uniform over the range of the two time
constants, since steps of a single length excite only one of them.

    >>> import numpy as np
    >>> shape = EXCITATIONS["prbs"](500, Pace(2.0, 20.0), np.random.default_rng(1))
    >>> sorted(set(shape.tolist()))
    [-1.0, 1.0]
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["EXCITATIONS", "Excitation", "Pace", "one_way"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Pace:
    """Fast and slow time constant of a motor [samples]."""

    fast: float
    slow: float

    @property
    def dwell(self) -> tuple[float, float]:
        """Shortest and longest useful dwell time of a step [samples]."""
        shortest = max(2.0, 0.3 * self.fast)
        return shortest, max(2.0 * shortest, 4.0 * self.slow)


Excitation = Callable[[int, Pace, np.random.Generator], Array]


def _dwells(rows: int, pace: Pace, rng: np.random.Generator) -> NDArray[np.int64]:
    """Dwell times that cover the run, log-uniform over the useful range [samples]."""
    shortest, longest = pace.dwell
    longest = max(shortest + 1.0, min(longest, rows / 10.0))
    lengths: list[int] = []
    while sum(lengths) < rows:
        lengths.append(round(float(np.exp(rng.uniform(np.log(shortest), np.log(longest))))))
    return np.array(lengths)


def _hold(values: Array, lengths: NDArray[np.int64], rows: int) -> Array:
    """Hold each value for its dwell time, cut to the length of the run."""
    return np.repeat(values, lengths)[:rows]


def _sweep_phase(rows: int, first: float, last: float) -> Array:
    """Phase of an exponential sine sweep between two frequencies in cycles per sample [rad]."""
    share = np.arange(rows) / rows
    rate = np.log(last / first)
    return np.asarray(2.0 * np.pi * first * rows * np.expm1(rate * share) / rate, np.float64)


def _band(pace: Pace, rows: int) -> tuple[float, float]:
    """Lowest and highest useful frequency [cycles/sample]."""
    lowest = max(0.03 / pace.slow, 3.0 / rows)
    highest = min(0.15, 0.6 / max(pace.fast, 0.02 * pace.slow))
    return lowest, max(highest, 4.0 * lowest)


def prbs(rows: int, pace: Pace, rng: np.random.Generator) -> Array:
    """Random binary signal: full voltage, reversed after random dwell times."""
    lengths = _dwells(rows, pace, rng)
    signs = np.where(np.arange(lengths.size) % 2 == 0, 1.0, -1.0)
    return _hold(signs, lengths, rows)


def multilevel(rows: int, pace: Pace, rng: np.random.Generator) -> Array:
    """Random levels with random dwell times."""
    lengths = _dwells(rows, pace, rng)
    return _hold(rng.uniform(-1.0, 1.0, lengths.size), lengths, rows)


def staircase(rows: int, pace: Pace, rng: np.random.Generator) -> Array:
    """Stairs up, down through zero and back, each step about five slow time constants or less."""
    levels = np.concatenate(
        [np.linspace(0.0, 1.0, 9), np.linspace(1.0, -1.0, 17)[1:], np.linspace(-1.0, 0.0, 9)[1:]]
    )
    turns = max(1, round(rows / (33 * 5.0 * pace.slow)))
    stairs = np.tile(levels, turns) * rng.uniform(0.9, 1.0)
    return np.interp(np.arange(rows) * stairs.size // rows, np.arange(stairs.size), stairs)


def ramps(rows: int, pace: Pace, rng: np.random.Generator) -> Array:
    """Ramps between random levels, each about six slow time constants long."""
    count = max(4, min(round(rows / (6.0 * pace.slow)), rows // 20))
    corners = np.sort(np.concatenate([[0, rows - 1], rng.uniform(0, rows - 1, count - 1)]))
    levels = rng.uniform(-1.0, 1.0, corners.size)
    levels[1::2] = np.sign(levels[1::2]) * np.maximum(np.abs(levels[1::2]), 0.6)
    return np.interp(np.arange(rows), corners, levels)


def chirp(rows: int, pace: Pace, rng: np.random.Generator) -> Array:
    """Exponential sine sweep over the frequency band of the motor."""
    lowest, highest = _band(pace, rows)
    return np.sin(_sweep_phase(rows, lowest, highest) + rng.uniform(0.0, 2.0 * np.pi))


def sine_sweep(rows: int, pace: Pace, rng: np.random.Generator) -> Array:
    """Eight single sines in sequence, as for the measurement of a frequency response."""
    lowest, highest = _band(pace, rows)
    frequencies = np.geomspace(lowest, highest, 8)
    cycles = np.repeat(frequencies, rows // 8 + 1)[:rows]
    level = np.repeat(rng.uniform(0.6, 1.0, 8), rows // 8 + 1)[:rows]
    return level * np.sin(2.0 * np.pi * np.cumsum(cycles))


def multisine(rows: int, pace: Pace, rng: np.random.Generator) -> Array:
    """Sum of 30 sines of equal amplitude and random phase over the frequency band of the motor."""
    lowest, highest = _band(pace, rows)
    frequencies = np.geomspace(lowest, highest, 30)
    phases = rng.uniform(0.0, 2.0 * np.pi, 30)
    wave = np.sin(2.0 * np.pi * np.arange(rows)[:, None] * frequencies + phases).sum(axis=1)
    return np.asarray(wave / np.abs(wave).max(), np.float64)


def steps(rows: int, pace: Pace, rng: np.random.Generator) -> Array:
    """Steps from zero to random levels of alternating sign and back to zero."""
    length = round(min(max(5.0 * pace.slow, 10.0), rows / 6.0))
    count = rows // length + 1
    levels = np.where(np.arange(count) % 2 == 1, rng.uniform(0.3, 1.0, count), 0.0)
    levels *= np.where(np.arange(count) % 4 == 3, -1.0, 1.0)
    return _hold(levels, np.full(count, length), rows)


def one_way(shape: Array, least: float = 0.15) -> Array:
    """Map an excitation to one direction only, between `least` and 1."""
    return least + (1.0 - least) * 0.5 * (shape + 1.0)


EXCITATIONS: dict[str, Excitation] = {
    "prbs": prbs,
    "multilevel": multilevel,
    "staircase": staircase,
    "ramps": ramps,
    "chirp": chirp,
    "sine_sweep": sine_sweep,
    "multisine": multisine,
    "steps": steps,
}
