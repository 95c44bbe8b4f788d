"""Effective sample fraction: how much less the samples say than as many independent ones.

The fit assumes normal errors, independent after whitening.  Autocorrelation, outliers and errors of
the model make its covariance too small.  The sandwich covariance allows for them.

Source: White, Econometrica 48 (1980), 817-838; Huber, Ann. Math. Statist. 35 (1964), 73-101; Liang
and Zeger, Biometrika 73 (1986), 13-22.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from scipy import signal
from scipy.special import digamma

from identification.arrays import Array
from identification.fit.autoregression import autoregression
from identification.fit.solve import Fit
from identification.linear import eigh, root, solution
from identification.model.tangent import TangentBlock

__all__ = ["effective_fraction", "influences", "scattered_fraction"]

_STRETCHES: Final = 10
"""Stretches for each parameter over which the gradient scatters."""


def effective_fraction(fit: Fit) -> float:
    """Effective sample fraction: independent samples over all samples, at most one.

    With residuals e, weights w and sensitivities a, the fit solves sum a w e = 0.  Its covariance
    is the sandwich H^-1 M H^-1.  M is the covariance of the gradient, in which w e may be
    autocorrelated.  H = E[d(w e)/de] A is the mean slope of the gradient.  A = sum w a a' is the
    information matrix, and A^-1 the plain covariance of the fit.  The fraction is the geometric
    mean, over the directions of the parameters, of the ratio of the plain covariance to the
    sandwich.  For white noise and correct Student-t weights it is (freedom + 1) / (freedom + 3),
    the information about a location parameter.

    Source:
        White, Econometrica 48 (1980) 817-838; Huber, Ann. Math. Statist. 35 (1964) 73-101.
    """
    weights = [fit.weighting.sample_weights(k) for k in range(len(fit.weighting.records))]
    filters = _weighted_filters(fit, weights)
    n, information = fit.position.size, _Information(fit, weights)
    gradient = np.zeros((n, n))
    ends: dict[tuple[int, int], Array] = {}
    for block, channel, tangent in _whitened_tangents(fit):
        taps, power = filters[channel]
        weight = weights[block.record][block.samples, channel][block.lead :, None]
        information.add(channel, tangent[:, :n], weight)
        key = (block.record, channel)
        begin = ends.get(key, np.zeros((taps.size - 1, n)))
        counted = tangent[:, :n] * (weight > 0)
        counted *= power / float(fit.weighting.deviation[channel]) ** 2
        # Its Gram matrix is the covariance of the gradient, except at the ends of a record.
        spread, ends[key] = signal.lfilter([1.0], taps, counted, axis=0, zi=begin)
        gradient += spread.T @ spread
    return float(1.0 / max(np.exp(information.log_inflation(gradient)), 1.0))


def scattered_fraction(fit: Fit) -> float:
    """Effective sample fraction from the scatter of the gradient over stretches of the records.

    A residual of the model's own errors may be white and yet larger where the sensitivities are
    large, as at each reversal of a motor with friction; `effective_fraction` does not see that.
    Here the covariance M of the gradient is the sum of the products of its parts in stretches, ten
    for each parameter.  With a correct model the parts are independent and M is a Wishart matrix,
    whose mean logarithm is subtracted.  At most one; one if there are too few samples.

    Source:
        Liang and Zeger, Biometrika 73 (1986) 13-22 (sandwich over clusters); Bishop, Pattern
        Recognition and Machine Learning, appendix B (mean logarithm of a Wishart determinant).
    """
    parts, information = _stretches(fit)
    number, n = parts.shape
    if number < 2 * n:
        return 1.0
    gradient = parts.T @ parts * (number / (number - 1))
    chance = digamma(0.5 * (number - np.arange(n))) + np.log(2.0 / number)
    found = information.log_inflation(gradient) - float(np.mean(chance))
    return float(1.0 / max(np.exp(found), 1.0))


def influences(fit: Fit) -> Array:
    """Change of the search coordinates by the residual of each stretch, (n_parameter, n_stretch).

    The stretches are those of `scattered_fraction`.  The sum of the products of the changes is the
    sandwich covariance; the sum of the changes is zero, except for the prior.

    Source:
        Hampel, J. American Statistical Association 69 (1974), 383-393 (influence curve).
    """
    parts, information = _stretches(fit)
    return information.moved(parts.T)


def _stretches(fit: Fit) -> tuple[Array, _Information]:
    """Gradient (n_stretch, n_parameter) in each stretch of the records, and the information."""
    n, rows = fit.position.size, [record.rows for record in fit.simulator.records]
    length = max(sum(rows) // (_STRETCHES * n), 1)
    parts = [np.zeros((-(-each // length), n)) for each in rows]
    weights = [fit.weighting.sample_weights(k) for k in range(len(rows))]
    residuals, information = fit.residuals(), _Information(fit, weights)
    for block, channel, tangent in _whitened_tangents(fit):
        k, samples = block.record, block.samples
        weight = weights[k][samples, channel][block.lead :, None]
        information.add(channel, tangent[:, :n], weight)
        left = fit.weighting.whitened(residuals[k][samples, channel], channel)
        left = left[block.lead :, None] * weight / float(fit.weighting.deviation[channel]) ** 2
        total = tangent[:, :n] + tangent[:, n:] @ fit.equations.state_response(k)
        at = np.arange(rows[k])[samples][block.lead :] // length
        np.add.at(parts[k], at, total * left)
    return np.vstack(parts), information


def _whitened_tangents(fit: Fit) -> Iterator[tuple[TangentBlock, int, Array]]:
    """Each block of samples, each channel, and its whitened sensitivities without the lead."""
    for block in fit.equations.derivatives.blocks(fit.weighting.order):
        for channel in range(2):
            tangent = fit.weighting.whitened(block.tangent[:, channel], channel)
            yield block, channel, tangent[block.lead :]


class _Information:
    """Information matrix A and mean slope H of the gradient, summed over blocks of samples."""

    def __init__(self, fit: Fit, weights: Sequence[Array]) -> None:
        n = fit.position.size
        self._plain, self._curvature = np.zeros((n, n)), np.zeros((n, n))
        self._prior = np.diag(1.0 / fit.coordinates.prior_sd**2)
        self._deviation = fit.weighting.deviation
        self._slopes = [_mean_slope([each[:, c] for each in weights]) for c in range(2)]

    def add(self, channel: int, tangent: Array, weight: Array) -> None:
        """Add samples: sensitivities (n_sample, n_parameter) and weights (n_sample, 1)."""
        scaled = tangent * np.sqrt(weight) / float(self._deviation[channel])
        own = scaled.T @ scaled
        self._plain += own
        self._curvature += self._slopes[channel] * own

    def moved(self, gradients: Array) -> Array:
        """Change of the optimum by gradients (n_parameter, n) to first order."""
        return solution(self._curvature + self._regular, gradients)

    @property
    def _regular(self) -> Array:
        """Precision of the prior, and a little for directions without information."""
        return np.asarray(self._prior + 1e-12 * np.diag(np.diag(self._plain)))

    def log_inflation(self, gradient: Array) -> float:
        """Mean logarithm of the sandwich over the plain covariance, over all directions [-].

        The covariance of the gradient is (n_parameter, n_parameter).
        """
        prior = self._regular
        turned = solution(self._curvature + prior, root(self._plain + prior))
        ratios, _ = eigh(turned.T @ (gradient + prior) @ turned)
        return float(np.mean(np.log(np.maximum(ratios, 1e-12))))


def _weighted_filters(fit: Fit, weights: Sequence[Array]) -> list[tuple[Array, float]]:
    """For each channel the filter that whitens its weighted residuals, and the RMS innovation."""
    residuals = fit.residuals()
    found = []
    for channel in range(2):
        series = [
            weight[:, channel] * fit.weighting.whitened(residual[:, channel], channel)
            for weight, residual in zip(weights, residuals, strict=True)
        ]
        taps = autoregression(series)
        squares = [np.sum(signal.lfilter(taps, [1.0], each) ** 2) for each in series]
        power = float(np.sqrt(np.sum(squares) / sum(each.size for each in series)))
        found.append((taps, power))
    return found


def _mean_slope(weights: Sequence[Array]) -> float:
    """Mean of d(w e)/de over the mean of w, for Student-t weights w = (f + 1) / (f + z^2).

    The largest weight is (f + 1) / f.  The slope is w (2 w f / (f + 1) - 1), which depends on the
    weights alone.
    """
    stacked = np.concatenate(weights)
    largest, mean = float(stacked.max()), float(stacked.mean())
    if not largest > 1.0:
        return 1.0
    return float(np.mean(stacked * (2.0 * stacked / largest - 1.0))) / mean
