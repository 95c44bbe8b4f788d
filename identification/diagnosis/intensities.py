"""Maximum likelihood of the intensities of the missing voltage and torque.

The unknowns are intensity and correlation time of both disturbances, intensity and correlation time
of a slow noise of each sensor, the white noise of each sensor, and the white noise of the logged
voltage.  The five noises also belong to a complete model: coloured or white sensor noise and a
noisy voltmeter are not missing physics.  A disturbance has to explain what they cannot: how both
channels move together through the motor's own dynamics.

The test of a zero intensity is at the boundary of the parameter space, and the correlation time is
not identifiable under the null hypothesis.  For one correlation time, twice the gain of the log
likelihood is distributed as an equal mixture of zero and chi-squared with one degree of freedom.
Over a range of correlation times, twice the gain is the squared maximum of a process over u = log
correlation time.  The autocorrelation of this process at distance du, from two Gauss-Markov
covariances in white noise, is 1 / cosh(du / 2).  Rice's count of upcrossings bounds the tail (Z is
standard normal),

    p <= P(Z > c) + (u_max - u_min) / (4 pi) exp(-c^2 / 2),       c^2 = 2 gain.

Source: Davies, Biometrika 64 (1977) 247-254 and 74 (1987) 33-43; Self and Liang, J. American
Statistical Association 82 (1987) 605-610 (the mixture at the boundary).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np
from scipy import special

from identification.arrays import Array
from identification.diagnosis.deviation import Deviation, Piece
from identification.diagnosis.filtering import HYPER, likelihood
from identification.diagnosis.maximise import maximise
from identification.differences import difference_noise

__all__ = ["Hyperparameters", "longest_correlation_time", "p_value_of", "maximum_likelihood"]

_SLOW: Final = 4
"""Slow processes: missing voltage, missing torque, slow noise of current and of speed."""

_SHORTEST: Final = 0.5
"""Shortest correlation time of a disturbance [samples]; a shorter one is white voltage noise."""

_LARGEST: Final = 12.0
"""Upper bound of the logarithm of an intensity in its unit."""

_NONE: Final = -14.0
"""Logarithm of an intensity that counts as zero."""


@dataclass(frozen=True)
class Hyperparameters:
    """Hyperparameters of one candidate, as logarithms.

    Intensities (stationary standard deviations) are in the units of `Deviation`, correlation times
    in samples.
    """

    point: Array
    """(11,) four intensities, four correlation times, white noise of current, speed and voltage."""
    value: float
    """Log likelihood."""

    @property
    def intensities(self) -> Array:
        """(4,) intensities of missing voltage, missing torque and both slow noises."""
        return np.asarray(np.exp(self.point[:_SLOW]))

    @property
    def correlation_times(self) -> Array:
        """(4,) their correlation times [samples]."""
        return np.asarray(np.exp(self.point[_SLOW : 2 * _SLOW]))

    @property
    def white(self) -> Array:
        """(2,) standard deviation of the white noise of both channels."""
        return np.asarray(np.exp(self.point[8:10]))

    @property
    def hyper(self) -> Array:
        """(n_hyper, 1) input of the filter, see `HYPER`."""
        return hyper_of(self.point[:, None])


def hyper_of(points: Array) -> Array:
    """(n_hyper, n_lane) input of the filter from points (11, n_lane)."""
    hyper = np.empty((len(HYPER), points.shape[1]))
    keep = np.exp(-np.exp(-points[_SLOW : 2 * _SLOW]))
    variance = np.exp(2 * points[:_SLOW]) * (points[:_SLOW] > _NONE)
    hyper[0:8:2] = keep
    hyper[1:8:2] = (1 - keep**2) * variance
    hyper[8:11] = np.exp(2 * points[8:11])
    return hyper


def p_value_of(gain: float, longest: float) -> float:
    """Probability of at least this gain over zero intensity for a complete model.

    `longest` is the longest correlation time that was tried [samples].
    """
    if gain <= 0.0:
        return 1.0
    reach = np.sqrt(2.0 * gain)
    span = np.log(longest / _SHORTEST)
    return float(min(1.0, special.ndtr(-reach) + span / (4 * np.pi) * np.exp(-gain)))


def longest_correlation_time(pieces: Sequence[Piece]) -> float:
    """Longest correlation time that the records resolve: half the longest record [samples]."""
    return max(max(piece.rows for piece in pieces) / 2.0, 2.0 * _SHORTEST)


def maximum_likelihood(
    deviation: Deviation,
    pieces: Sequence[Piece],
    allowed: tuple[bool, bool],
    start: Array | None = None,
    rival: float | None = None,
) -> Hyperparameters:
    """Maximum likelihood hyperparameters of independent segments, from a start (11,) or a grid.

    `allowed` says whether a missing voltage and a missing torque are allowed; `rival` is a log
    likelihood to compare with, see `maximise`.
    """
    lower, upper = _bounds(deviation, pieces, allowed)

    def valued(points: Array) -> Array:
        return likelihood(deviation, pieces, hyper_of(points)).value

    if start is None:
        grid = np.clip(_grid(pieces), lower[:, None], upper[:, None])
        start = grid[:, int(np.argmax(valued(grid)))]
    return Hyperparameters(*maximise(valued, start, (lower, upper), rival=rival))


def _bounds(
    deviation: Deviation, pieces: Sequence[Piece], allowed: tuple[bool, bool]
) -> tuple[Array, Array]:
    supply = np.log(max(_voltage_noise(pieces) / float(deviation.scale[0]), 1e-4))
    longest = np.log(longest_correlation_time(pieces))
    lower = np.array(
        [-7.0] * 4
        + [np.log(_SHORTEST)] * 2
        + [np.log(0.5)] * 2
        + [-7.0, -7.0, min(supply, -9.0) - 1]
    )
    upper = np.array([_LARGEST] * 4 + [longest] * 4 + [5.0, 5.0, supply])
    for k, is_allowed in enumerate(allowed):
        if not is_allowed:
            lower[k] = upper[k] = _NONE
            lower[_SLOW + k] = upper[_SLOW + k] = np.log(_SHORTEST)
    return lower, upper


def _voltage_noise(pieces: Sequence[Piece]) -> float:
    """Upper bound of the noise of the logged voltage [V].

    If the drive holds its voltage for a few samples, the second difference is noise alone;
    otherwise the bound is only looser.  All records share one voltage sensor, so the quietest
    record decides.
    """
    found = []
    for piece in pieces:
        voltage = piece.record.column("voltage")
        steps = np.abs(np.diff(voltage))
        quantum = float(steps[steps > 0].min(initial=np.inf))
        rounding = quantum / np.sqrt(12.0) if np.isfinite(quantum) else 0.0
        found.append(max(difference_noise([voltage], 2), rounding))
    return float(min(found))


def _grid(pieces: Sequence[Piece]) -> Array:
    """(11, n_lane) starting points over the ranges of intensities and correlation times."""
    residual = np.concatenate([piece.targets[:, :, 0] for piece in pieces])
    size = float(np.log(max(np.sqrt(np.mean(residual**2)), 1.0)))
    longest = np.log(longest_correlation_time(pieces))
    points = []
    sizes, shares = (-2.0, 0.0, size), (0.2, 0.5, 0.8)
    for intensity, share, is_equal, slow in product(sizes, shares, (False, True), (-2.0, 0.0)):
        time = np.log(_SHORTEST) + share * (longest - np.log(_SHORTEST))
        other = intensity if is_equal else -2.0
        for pair in dict.fromkeys([(other, intensity), (intensity, other)]):
            points.append([*pair, slow, slow, time, time, 2.0, 2.0, -0.1, -0.1, -4.0])
    return np.array(points).T
