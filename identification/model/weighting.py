"""The noise model: how much each sample counts.

Each channel has its own standard deviation, estimated from the residuals.  Where residuals are
correlated in time an autoregressive filter whitens them, so that a thousand samples of slow noise
do not pass for a thousand pieces of evidence; where they have heavy tails each sample is weighted
by the Student-t likelihood of its size, never deleted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from identification.model.excitation import Record

__all__ = ["Weighting"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Weighting:
    """Noise model of the two channels.

    Args:
        records: The records whose samples are weighted.
        deviation: (2,) standard deviation of the whitened residuals [A, rad/s].
        whitening: For each channel the coefficients (1, -a1, -a2, ...) of the filter that
            whitens its residuals.
        robust: For each record (n_sample, 2) weights of the samples by their size, or None.
        floor: (2,) deviations below which a fit is perfect [A, rad/s].
    """

    records: tuple[Record, ...]
    deviation: Array
    whitening: tuple[Array, Array]
    robust: tuple[Array, ...] | None
    floor: Array

    @staticmethod
    def white(records: Sequence[Record]) -> Weighting:
        """Independent normal errors of unknown size."""
        stacked = np.concatenate([record.measured for record in records])
        spread = np.maximum(np.std(stacked, axis=0), 1e-12 * np.abs(stacked).max(axis=0))
        spread[spread == 0] = 1.0
        one = np.ones(1)
        # The discretisation is exact to 1e-8 of the signal; errors are not resolved below that.
        return Weighting(tuple(records), spread, (one, one), None, 1e-8 * spread)

    @cached_property
    def counts(self) -> Array:
        """(2,) number of samples that count in each channel."""
        return np.asarray(np.sum([record.weight.sum(axis=0) for record in self.records], axis=0))

    @property
    def memory(self) -> int:
        """Samples before one that its whitened residual depends on."""
        return max(taps.size for taps in self.whitening) - 1

    def whitened(self, series: Array, channel: int) -> Array:
        """A series (n_sample, ...) through the whitening filter of a channel."""
        taps = self.whitening[channel]
        return series if taps.size == 1 else signal.lfilter(taps, [1.0], series, axis=0)

    def sample_weights(self, k: int) -> Array:
        """(n_sample, 2) weights of record `k` before division by the variance."""
        weight = self.records[k].weight
        return weight if self.robust is None else weight * self.robust[k]

    def sums_of_squares(self, residuals: Sequence[Array]) -> Array:
        """(2,) weighted sums of squares of whitened residuals."""
        total = np.zeros(2)
        for k, residual in enumerate(residuals):
            weight = self.sample_weights(k)
            for channel in range(2):
                white = self.whitened(residual[:, channel], channel)
                total[channel] += float(np.dot(weight[:, channel], white * white))
        return total

    def sized(self, sums: Array) -> tuple[Weighting, Array]:
        """This model with the deviations that fit best, and the cost there.

        Args:
            sums: (2,) or (2, n_lane) sums of squares, see `sums_of_squares`.

        Returns:
            The model with the deviations of the best lane, and the negative log likelihood of
            each lane up to a constant, infinite where the simulation diverged.
        """
        counts = np.maximum(self.counts, 1.0)
        lanes = sums.reshape(2, -1)
        with np.errstate(invalid="ignore"):
            deviation = np.sqrt(lanes / counts[:, None])
        deviation = np.where(np.isfinite(deviation), deviation, np.inf)
        deviation = np.maximum(deviation, self.floor[:, None])
        cost = np.sum(counts[:, None] * np.log(deviation), axis=0)
        return replace(self, deviation=deviation[:, int(np.argmin(cost))]), cost
