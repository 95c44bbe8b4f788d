"""How strong the missing voltage and the missing torque are, by maximum likelihood.

Unknown are size and memory of both disturbances, size and memory of a slow noise of each sensor,
the white noise of each sensor, and white noise of the logged voltage.  The last five belong to a
complete model too: coloured or white sensor noise and a noisy voltmeter are no missing physics, and
a disturbance has to explain what they cannot, which is how both channels move together through the
motor's own dynamics.

Whether a strength is zero is a question at the edge of what is allowed, and its memory means
nothing if it is.  For one memory, twice the gain of the log likelihood is half a chi-squared of one
degree.  Over a range of memories it is the square of the largest value of a process over u = log
memory, whose correlation at distance du follows from two Gauss-Markov covariances in white noise:
1 / cosh(du / 2).  Rice's count of upcrossings bounds its tail,

    p <= P(Z > c) + (u_max - u_min) / (4 pi) exp(-c^2 / 2),       c^2 = 2 gain.

Source: Davies, Biometrika 64 (1977) 247-254 and 74 (1987) 33-43; Self and Liang, J. American
Statistical Association 82 (1987) 605-610 (the half at the edge).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import special

from identification.diagnosis.ascent import climb
from identification.diagnosis.deviation import Deviation, Piece
from identification.diagnosis.filtering import HYPER, likelihood

__all__ = ["Strengths", "longest_memory", "p_value_of", "strongest"]

Array = NDArray[np.float64]

_SLOW: Final = 4
"""Slow processes: missing voltage, missing torque, slow noise of current and of speed."""

_SHORTEST: Final = 0.5
"""Least memory of a disturbance [samples]; a shorter one is white noise of the voltage."""

_LARGEST: Final = 12.0
"""Bound of the logarithm of a size in its unit."""

_NONE: Final = -14.0
"""Logarithm of a size that is no more than nothing."""


@dataclass(frozen=True)
class Strengths:
    """A candidate: logarithms of sizes in the units of `Deviation` and of memories [samples].

    Args:
        place: (11,) four sizes, four memories, white noise of current, speed and voltage.
        value: Log likelihood.
    """

    place: Array
    value: float

    @property
    def sizes(self) -> Array:
        """(4,) stationary deviations of missing voltage and torque and of both slow noises."""
        return np.asarray(np.exp(self.place[:_SLOW]))

    @property
    def memories(self) -> Array:
        """(4,) their memories [samples]."""
        return np.asarray(np.exp(self.place[_SLOW : 2 * _SLOW]))

    @property
    def white(self) -> Array:
        """(2,) deviation of the white noise of both channels."""
        return np.asarray(np.exp(self.place[8:10]))

    @property
    def hyper(self) -> Array:
        """(n_hyper, 1) what the filter takes."""
        return hyper_of(self.place[:, None])


def hyper_of(places: Array) -> Array:
    """(n_hyper, n_lane) of places (11, n_lane)."""
    hyper = np.empty((len(HYPER), places.shape[1]))
    keep = np.exp(-np.exp(-places[_SLOW : 2 * _SLOW]))
    variance = np.exp(2 * places[:_SLOW]) * (places[:_SLOW] > _NONE)
    hyper[0:8:2] = keep
    hyper[1:8:2] = (1 - keep**2) * variance
    hyper[8:11] = np.exp(2 * places[8:11])
    return hyper


def p_value_of(gain: float, longest: float) -> float:
    """Probability of a gain at least as large from a complete model.

    Args:
        gain: Gain of the log likelihood over strength zero.
        longest: Longest memory that was tried [samples].
    """
    if gain <= 0.0:
        return 1.0
    reach = np.sqrt(2.0 * gain)
    span = np.log(longest / _SHORTEST)
    return float(min(1.0, special.ndtr(-reach) + span / (4 * np.pi) * np.exp(-gain)))


def longest_memory(pieces: Sequence[Piece]) -> float:
    """Longest memory that the records can show: half the longest of them [samples]."""
    return max(max(piece.rows for piece in pieces) / 2.0, 2.0 * _SHORTEST)


def strongest(
    deviation: Deviation,
    pieces: Sequence[Piece],
    allowed: tuple[bool, bool],
    start: Array | None = None,
    rival: float | None = None,
) -> Strengths:
    """The most likely strengths.

    Args:
        deviation: The model.
        pieces: Independent stretches of the records.
        allowed: Whether there may be a missing voltage, a missing torque.
        start: (11,) where to begin; a grid is tried if absent.
        rival: Log likelihood with which the result is compared, see `climb`.
    """
    lower, upper = _bounds(deviation, pieces, allowed)

    def valued(places: Array) -> Array:
        return likelihood(deviation, pieces, hyper_of(places)).value

    if start is None:
        grid = np.clip(_grid(pieces), lower[:, None], upper[:, None])
        start = grid[:, int(np.argmax(valued(grid)))]
    found = climb(valued, start, (lower, upper), rival=rival)
    return Strengths(found.place, found.value)


def _bounds(
    deviation: Deviation, pieces: Sequence[Piece], allowed: tuple[bool, bool]
) -> tuple[Array, Array]:
    supply = np.log(max(_voltage_noise(pieces) / float(deviation.scale[0]), 1e-4))
    longest = np.log(longest_memory(pieces))
    lower = np.array(
        [-7.0] * 4
        + [np.log(_SHORTEST)] * 2
        + [np.log(0.5)] * 2
        + [-7.0, -7.0, min(supply, -9.0) - 1]
    )
    upper = np.array([_LARGEST] * 4 + [longest] * 4 + [5.0, 5.0, supply])
    for k, is_allowed in enumerate(allowed):
        if not is_allowed:
            for place in (k, _SLOW + k):
                lower[place] = upper[place] = _NONE if place == k else np.log(_SHORTEST)
    return lower, upper


def _voltage_noise(pieces: Sequence[Piece]) -> float:
    """Most noise that the logged voltage can have [V].

    Where the drive holds its voltage for a few samples the second difference is noise alone; where
    it never does the bound is only looser.  The noise is that of one sensor, so the quietest
    record decides.
    """
    found = []
    for piece in pieces:
        voltage = piece.record.column("voltage")
        steps = np.abs(np.diff(voltage))
        quantum = float(steps[steps > 0].min(initial=np.inf))
        second = float(np.median(np.abs(np.diff(voltage, n=2)))) / 0.6745 / np.sqrt(6.0)
        found.append(max(second, quantum / np.sqrt(12.0) if np.isfinite(quantum) else 0.0))
    return float(min(found))


def _grid(pieces: Sequence[Piece]) -> Array:
    """(11, n_lane) places to begin with, from weak to strong and from short to long."""
    residual = np.concatenate([piece.targets[:, :, 0] for piece in pieces])
    size = float(np.log(max(np.sqrt(np.mean(residual**2)), 1.0)))
    longest = np.log(longest_memory(pieces))
    places = []
    for strength in (-2.0, 0.0, size):
        for share in (0.2, 0.5, 0.8):
            memory = np.log(_SHORTEST) + share * (longest - np.log(_SHORTEST))
            for other in (-2.0, strength):
                for colour in (-2.0, 0.0):
                    sizes = [other, strength, colour, colour]
                    memories = [memory, memory, 2.0, 2.0]
                    places.append([*sizes, *memories, -0.1, -0.1, -4.0])
                    if other != strength:
                        sizes = [strength, other, colour, colour]
                        places.append([*sizes, *memories, -0.1, -0.1, -4.0])
    return np.array(places).T
