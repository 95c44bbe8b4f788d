"""Residual statistics of one channel, and their distribution under a complete model.

Under a complete model the residual is sensor noise, possibly coloured and with outliers.  On
validation runs it also contains the error caused by parameter uncertainty, whose covariance is
known: the parameter covariance propagated through the derivative of the simulation.  The unknown
initial state of a validation run is not a fault of the model, so its directions are projected out.

Source: Bartlett, J. R. Statist. Soc. Suppl. 8 (1946) 27-41 (variance of the mean square of a linear
process: (2 sum rho^2 + excess kurtosis of its innovations) / n).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from scipy import fft, signal, stats

from identification.arrays import Array
from identification.diagnosis.residual import cross_correlation, lagged_products
from identification.fit.autoregression import autoregression, spectrum
from identification.fit.effective_samples import effective_fraction
from identification.fit.evaluate import Simulated
from identification.fit.solve import Fit
from identification.linear import eigh, least_squares
from identification.model.excitation import Record
from identification.model.simulate import Simulator
from identification.model.tangent import tangent

__all__ = ["ChannelResiduals", "residuals_of_training", "residuals_of_validation"]

_CLIP: Final = 5.0
"""Robust standard deviations at which innovations are clipped."""
_LAGS: Final = 30
"""Lags of the whiteness test, in addition to the order of the whitening filter."""
_BEYOND: Final = 60
"""Largest lag of the cross-correlation with the voltage [samples]."""


@dataclass(frozen=True, eq=False)
class ChannelResiduals:
    """Residuals of one channel over the records of one role."""

    residuals: tuple[Array, ...]
    """For each record (n_sample,), zero at samples without weight."""
    voltages: tuple[Array, ...]
    """For each record (n_sample,) [V]."""
    errors: tuple[Array, ...]
    """For each record (n_sample, n_direction) matrix; the error by parameter uncertainty is this
    matrix times a standard normal vector."""
    count: int
    """Number of samples with weight."""

    @cached_property
    def taps(self) -> Array:
        """Whitening filter of the residuals."""
        return autoregression(self.residuals)

    @cached_property
    def innovations(self) -> list[Array]:
        """For each record (n_sample - n_tap,) one-step prediction errors."""
        order = self.taps.size
        return [signal.lfilter(self.taps, [1.0], r)[order:] for r in self.residuals]

    @cached_property
    def rms(self) -> float:
        """Root mean square over the samples with weight."""
        return float(np.sqrt(sum(float(np.sum(r * r)) for r in self.residuals) / self.count))

    def scatter(self) -> float:
        """Relative variance of the mean square for noise with this spectrum and kurtosis [-]."""
        power = spectrum(self.taps, fft.next_fast_len(4096))
        stacked = np.concatenate(self.innovations)
        excess = max(float(stats.kurtosis(stacked)), 0.0) if stacked.size > 3 else 0.0
        return (2.0 * float(np.mean(power**2)) + excess) / self.count

    def error_variance(self, noise: float) -> tuple[float, float]:
        """Mean and variance, over noise^2, of the mean square error by uncertain parameters."""
        if not self.errors or not self.errors[0].shape[1]:
            return 0.0, 0.0
        gram = np.sum([e.T @ e for e in self.errors], axis=0) / (self.count * noise**2)
        values = np.maximum(eigh(gram)[0], 0.0)
        # Cross term of the errors with the noise: 4 sigma^2 z'Gz / count, times the noise spectrum.
        power = float(spectrum(self.taps, 4096).max())
        cross = 4.0 * power * float(values.sum()) / self.count
        return float(values.sum()), float(2.0 * np.sum(values**2) + cross)

    def whiteness(self) -> float:
        """Ljung-Box test of the whitened residual: p value.

        Innovations are clipped at five robust standard deviations, because a few outliers would
        otherwise determine the variance of the correlations.
        """
        order = self.taps.size - 1
        lags = min(_LAGS + order, max(len(r) for r in self.innovations) // 4)
        if lags <= order:
            return 1.0
        stacked = np.concatenate(self.innovations)
        reach = _CLIP * float(np.median(np.abs(stacked))) / 0.6745
        if not reach > 0:
            return 1.0
        clipped = [np.clip(s, -reach, reach) for s in self.innovations if s.size > lags]
        energy = sum(float(np.sum(s**2)) for s in clipped)
        if not energy > 0:
            return 1.0
        products = np.sum([lagged_products(s, s, lags)[lags + 1 :] for s in clipped], axis=0)
        size = float(sum(s.size for s in clipped))
        pairs = size - len(clipped) * np.arange(1, lags + 1)
        statistic = float(np.sum((products / energy) ** 2 * size * (size + 2) / pairs))
        return float(stats.chi2.sf(statistic, lags - order))

    def voltage_outside(self, level: float) -> float:
        """Fraction of lags at which the correlation with the voltage leaves a band.

        `level` is the probability that any lag of a complete model is outside.
        """
        lag = min(_BEYOND, max(max(r.size for r in self.residuals) // 4, 1))
        each = 1.0 - level / (2 * lag + 1)
        found = cross_correlation(self.residuals, self.voltages, lag, each)
        quantile = float(stats.norm.isf(0.5 * (1.0 - each)))
        driven = [v - v.mean() for v in self.voltages]
        scale = np.sqrt(
            sum(float(np.sum(r * r)) for r in self.residuals)
            * sum(float(np.sum(v * v)) for v in driven)
        )
        variance = (found.half_width / quantile) ** 2
        if scale > 0 and self.errors:
            for k in range(self.errors[0].shape[1]):
                moved = sum(
                    (
                        lagged_products(e[:, k], v, lag)
                        for e, v in zip(self.errors, driven, strict=True)
                    ),
                    np.zeros(2 * lag + 1),
                )
                variance = variance + (moved / scale) ** 2
        return float(np.mean(np.abs(found.values) > quantile * np.sqrt(variance)))


def residuals_of_training(simulated: Sequence[Simulated]) -> list[ChannelResiduals]:
    """Residuals of current and speed over the simulated training records."""
    none = [np.zeros((s.record.rows, 2, 0)) for s in simulated]
    return _by_channel([s.record for s in simulated], [s.residual for s in simulated], none)


def residuals_of_validation(
    fit: Fit, simulated: Sequence[Simulated], noise: Array
) -> list[ChannelResiduals]:
    """Residuals of the simulated validation records [A, rad/s]; empty without records."""
    if not simulated:
        return []
    records = [one.record for one in simulated]
    simulator = Simulator.fitting(fit.simulator.model, records, fit.values)
    slopes = fit.coordinates.slopes(fit.position)
    states = [one.initial for one in simulated]
    _, tangents = tangent(simulator, fit.values, states, np.diag(slopes))
    n = fit.position.size
    spread = _spread(fit, noise)
    residuals, errors = [], []
    for one, derivative in zip(simulated, tangents, strict=True):
        both = np.concatenate([one.residual[:, :, None], derivative[:, :, :n] @ spread], axis=2)
        left = _without_start(both, derivative[:, :, n:], one.record.weight, noise)
        residuals.append(left[:, :, 0])
        errors.append(left[:, :, 1:])
    return _by_channel([s.record for s in simulated], residuals, errors)


def _spread(fit: Fit, noise: Array) -> Array:
    """(n, n) factor of the parameter covariance under a complete model, in search coordinates.

    The covariance of the fit is based on its own residuals; here it is scaled down to the noise.
    """
    residuals = fit.residuals()
    rms = np.sqrt(np.mean(np.concatenate(residuals) ** 2, axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.where(rms > 0, np.minimum(noise / rms, 1.0), 1.0)
    covariance = fit.equations.covariance(effective_fraction(fit)) * float(shares.max()) ** 2
    values, vectors = eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _without_start(series: Array, directions: Array, weight: Array, noise: Array) -> Array:
    """Series (n_sample, 2, k) with the influence of the initial state projected out."""
    scale = np.where(noise > 0, noise, 1.0)
    root = (weight > 0) / scale
    basis = (directions * root[:, :, None]).reshape(-1, directions.shape[2])
    target = (series * root[:, :, None]).reshape(-1, series.shape[2])
    shift = least_squares(basis, target, 1e-10)
    return np.asarray(series - directions @ shift)


def _by_channel(
    records: Sequence[Record], residuals: Sequence[Array], errors: Sequence[Array]
) -> list[ChannelResiduals]:
    found = []
    for channel in range(2):
        counts = [record.weight[:, channel] > 0 for record in records]
        found.append(
            ChannelResiduals(
                tuple(r[:, channel] * c for r, c in zip(residuals, counts, strict=True)),
                tuple(record.column("voltage") for record in records),
                tuple(e[:, channel] * c[:, None] for e, c in zip(errors, counts, strict=True)),
                int(sum(int(c.sum()) for c in counts)),
            )
        )
    return found
