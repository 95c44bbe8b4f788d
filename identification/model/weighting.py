"""Noise model: standard deviation, autocorrelation and heavy tails of the residuals.

Each channel has its own standard deviation, estimated from the residuals.  If the residuals are
autocorrelated, an autoregressive filter whitens them, so that a thousand samples of slow noise do
not count as a thousand independent samples.  If they have heavy tails, each sample has a Student-t
weight; none is deleted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import signal

from identification.arrays import Array
from identification.model.excitation import Record

__all__ = ["Weighting"]


@dataclass(frozen=True)
class Weighting:
    """Noise model of the two channels."""

    records: tuple[Record, ...]
    deviation: Array
    """(2,) standard deviation of the whitened residuals [A, rad/s]."""
    whitening: tuple[Array, Array]
    """For each channel the taps (1, c_1, ...) of the filter that whitens its residuals."""
    robust: tuple[Array, ...] | None
    """For each record (n_sample, 2) Student-t weights, or None."""
    floor: Array
    """(2,) standard deviations below which a fit counts as perfect [A, rad/s]."""

    @staticmethod
    def white(records: Sequence[Record]) -> Weighting:
        """Independent normal errors, with the standard deviation of the data as starting value."""
        stacked = np.concatenate([record.measured for record in records])
        spread = np.maximum(np.std(stacked, axis=0), 1e-12 * np.abs(stacked).max(axis=0))
        spread[spread == 0] = 1.0
        one = np.ones(1)
        # The integration error is about 1e-8 of the signal; smaller residuals are not resolved.
        return Weighting(tuple(records), spread, (one, one), None, 1e-8 * spread)

    @cached_property
    def counts(self) -> Array:
        """Sum of the sample weights of each channel, (2,)."""
        return np.asarray(np.sum([record.weight.sum(axis=0) for record in self.records], axis=0))

    @property
    def order(self) -> int:
        """Order of the longest whitening filter, in samples."""
        return max(taps.size for taps in self.whitening) - 1

    def whitened(self, series: Array, channel: int) -> Array:
        """Apply the whitening filter of a channel to a series (n_sample, ...)."""
        taps = self.whitening[channel]
        return series if taps.size == 1 else signal.lfilter(taps, [1.0], series, axis=0)

    @property
    def unwhitened(self) -> Weighting:
        """The noise model with independent errors."""
        return replace(self, whitening=(np.ones(1), np.ones(1)))

    def both_whitened(self, series: Array) -> Array:
        """Apply the whitening filters to a series of both channels, (n_sample, 2, ...)."""
        return np.stack([self.whitened(series[:, channel], channel) for channel in range(2)], 1)

    def sample_weights(self, k: int) -> Array:
        """Weights of the samples of record `k` before division by the variance, (n_sample, 2)."""
        weight = self.records[k].weight
        return weight if self.robust is None else weight * self.robust[k]

    def sums_of_squares(self, residuals: Sequence[Array]) -> Array:
        """Weighted sums of squares of the whitened residuals, (2,)."""
        total = np.zeros(2)
        for k, residual in enumerate(residuals):
            weight = self.sample_weights(k)
            for channel in range(2):
                white = self.whitened(residual[:, channel], channel)
                total[channel] += float(np.dot(weight[:, channel], white * white))
        return total

    def sized(self, sums: Array) -> tuple[Weighting, Array]:
        """Maximum-likelihood standard deviations, and the profile cost at them.

        For `sums_of_squares` (2,) or (2, n_lane): the noise model with the standard deviations of
        the best lane, and the negative log likelihood of each lane up to a constant, infinite if
        its simulation diverged.
        """
        counts = np.maximum(self.counts, 1.0)
        lanes = sums.reshape(2, -1)
        with np.errstate(invalid="ignore"):
            deviation = np.sqrt(lanes / counts[:, None])
        deviation = np.where(np.isfinite(deviation), deviation, np.inf)
        deviation = np.maximum(deviation, self.floor[:, None])
        cost = np.sum(counts[:, None] * np.log(deviation), axis=0)
        return replace(self, deviation=deviation[:, int(np.argmin(cost))]), cost
