"""Voltage profiles as sequences of constant and sloped segments, and the families of candidates.

A profile is normalised: levels are between -1 and 1, lengths are relative.  Each family excites
another part of a motor: staircases and slow triangles the friction over speed, binary signals and
multisines the time constants, starts from rest the inertia and the breakaway, one direction against
the other the asymmetries and offsets.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from identification.arrays import Array

__all__ = ["Profile", "library", "multisine", "pauses", "prbs", "random_levels", "slew_limited"]

_PAUSES: Final = (0.02, 0.06)
"""Standstill at zero voltage before and after a profile, as fractions of the run [-]."""
_MOST_SEGMENTS: Final = 400


@dataclass(frozen=True)
class Profile:
    """Normalised voltage profile."""

    label: str
    """Description for people."""
    lengths: Array
    """(n_segment,) relative lengths."""
    starts: Array
    """(n_segment,) levels at the start of each segment."""
    ends: Array
    """(n_segment,) levels at its end."""

    def sampled(self, rows: int) -> Array:
        """The profile between two pauses, (rows,) [-]; the last sample is zero."""
        before, after = pauses(rows)
        inner = rows - before - after
        edges = np.concatenate([[0.0], np.cumsum(self.lengths)]) / np.sum(self.lengths)
        place = (np.arange(inner) + 0.5) / inner
        k = np.clip(np.searchsorted(edges, place, side="right") - 1, 0, self.lengths.size - 1)
        share = (place - edges[k]) / (edges[k + 1] - edges[k])
        shape = self.starts[k] + share * (self.ends[k] - self.starts[k])
        return np.concatenate([np.zeros(before), shape, np.zeros(after)])

    def followed_by(self, other: Profile) -> Profile:
        """This profile in the first half of the run, the other one in the second half."""
        halves = [self.lengths / self.lengths.sum(), other.lengths / other.lengths.sum()]
        return Profile(
            f"{self.label}, then {other.label}",
            np.concatenate(halves),
            np.concatenate([self.starts, other.starts]),
            np.concatenate([self.ends, other.ends]),
        )

    def scaled(self, factor: float) -> Profile:
        """The profile with all levels multiplied by a factor."""
        return Profile(self.label, self.lengths, factor * self.starts, factor * self.ends)


def pauses(rows: int) -> tuple[int, int]:
    """Samples at zero voltage and without load at the start and at the end of a run."""
    before, after = (max(1, round(part * rows)) for part in _PAUSES)
    return before, after


def library(
    duration: float, fast: float, slow: float, rng: np.random.Generator
) -> Iterable[Profile]:
    """Candidate profiles for a run of a duration [s].

    `fast` is the shortest time constant of the motor that the sampling resolves, `slow` the longest
    [s].
    """
    up = np.linspace(0.0, 1.0, 6)
    down = np.linspace(1.0, -1.0, 11)
    yield _held("staircase in both directions", [*up, *down[1:], *-up[::-1][1:]])
    yield _held("staircase forward", [*up, *up[::-1][1:]])
    yield _held("starts from rest in both directions", _starts((1.0, -1.0, 0.5, -0.5, 0.2, -0.2)))
    yield _held("starts from rest forward", _starts((1.0, 0.25, 0.6, 0.12)))
    for turns in (1, 3, 10):
        yield _corners(f"triangle, {turns} periods", np.tile([0.0, 1.0, 0.0, -1.0], turns))
        yield _corners(f"flat triangle, {turns} periods", np.tile([0, 0.25, 0, -0.25], turns))
    longest = min(max(slow, fast), duration / 8.0)
    for clock in np.unique(np.geomspace(max(fast, duration / _MOST_SEGMENTS), longest, 4)):
        yield prbs(duration, float(clock), rng)
        yield prbs(duration, float(clock), rng).scaled(0.4)
        yield random_levels(duration, float(clock), rng)
        yield random_levels(duration, float(clock), rng, lowest=0.05)
    low = max(3.0 / duration, 0.03 / slow)
    for high in (0.1 / slow, 0.6 / slow, 0.3 / fast):
        if high > low:
            yield multisine(duration, low, high, rng)


def prbs(duration: float, clock: float, rng: np.random.Generator) -> Profile:
    """Binary signal of full amplitude that may switch at each tick of a clock [s]."""
    signs = rng.choice([-1.0, 1.0], max(4, round(duration / clock)))
    return _held(f"binary signal, clock {1e3 * clock:.3g} ms", signs)


def random_levels(
    duration: float, clock: float, rng: np.random.Generator, lowest: float = -1.0
) -> Profile:
    """Random levels; dwell times are log-uniform between a clock [s] and ten times that."""
    count = max(4, round(duration / (4.0 * clock)))
    lengths = np.exp(rng.uniform(0.0, np.log(10.0), count))
    levels = rng.uniform(lowest, 1.0, count)
    where = "in both directions" if lowest < 0 else "forward"
    label = f"random levels {where}, held {1e3 * clock:.3g} ms or longer"
    return Profile(label, lengths, levels, levels)


def multisine(duration: float, low: float, high: float, rng: np.random.Generator) -> Profile:
    """Sum of 20 sines of equal amplitude and random phase between two frequencies [Hz]."""
    count = int(np.clip(8.0 * high * duration, 100, 2000))
    time = duration * np.arange(count) / count
    frequencies = np.geomspace(low, high, 20)
    phases = rng.uniform(0.0, 2.0 * np.pi, 20)
    wave = np.sin(2.0 * np.pi * time[:, None] * frequencies + phases).sum(axis=1)
    return _corners(f"multisine, {low:.3g} to {high:.3g} Hz", wave / np.abs(wave).max())


def slew_limited(voltage: Array, step: float) -> Array:
    """Voltage whose change per sample is at most `step`, from zero and back to zero.

    It lies between zero and `voltage`.
    """
    limited = voltage.copy()
    limited[0] = limited[-1] = 0.0
    if not math.isfinite(step):
        return limited
    # A change of sign passes through zero.
    limited[:-1][limited[:-1] * limited[1:] < 0.0] = 0.0
    # The largest Lipschitz function below each sign's magnitude: min over k of u_k + step |n - k|.
    slope = step * np.arange(limited.size)
    parts = []
    for magnitude in (np.maximum(limited, 0.0), np.maximum(-limited, 0.0)):
        forward = np.minimum.accumulate(magnitude - slope) + slope
        backward = np.minimum.accumulate((magnitude + slope)[::-1])[::-1] - slope
        parts.append(np.maximum(np.minimum(forward, backward), 0.0))
    return np.asarray(parts[0] - parts[1])


def _starts(levels: Sequence[float]) -> list[float]:
    return [value for level in levels for value in (level, 0.0)]


def _held(label: str, levels: Sequence[float] | Array) -> Profile:
    """Constant segments of equal length."""
    values = np.asarray(levels, dtype=np.float64)
    return Profile(label, np.ones(values.size), values, values)


def _corners(label: str, levels: Sequence[float] | Array) -> Profile:
    """Slopes of equal length between corners, back to zero at the end."""
    values = np.append(np.asarray(levels, dtype=np.float64), 0.0)
    return Profile(label, np.ones(values.size - 1), values[:-1], values[1:])
