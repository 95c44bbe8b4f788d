"""What kind of noise the residuals are.

Two departures from independent normal errors occur on benches and are told from a missing effect
by what they do not do, follow the inputs.  *Coloured* noise is whitened by an autoregressive
filter whose order the Bayesian information criterion chooses; the fit is then repeated on
whitened residuals (generalised least squares).  *Spiky* noise is a Student-t distribution; its
likelihood is maximised by weighting each sample by its size, and no sample is deleted.

Where the residual is far from noise, since the model lacks something, whitening would trade the
simulation error for the one-step error.  Then the ordinary fit is kept and its uncertainty is
widened to what correlated residuals allow (sandwich covariance).

Source: Ljung, System Identification, 2nd edition, sections 7.5 and 16.4; Lange, Little and Taylor,
J. American Statistical Association 84 (1989), 881-896 (Student-t weights); White, Econometrica 48
(1980), 817-838 (sandwich).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, signal, stats

from identification.fit.solve import Fit, solve
from identification.model.weighting import Weighting

__all__ = ["autoregression", "effective_shares", "noise_deviation", "with_noise_model"]

Array = NDArray[np.float64]

_LARGEST_ORDER: Final = 12
_TOLERATED_RISE: Final = 1.01
_DEGREES: Final = (3.0, 4.0, 6.0, 10.0)


def with_noise_model(fit: Fit) -> Fit:
    """The fit under the noise model that its residuals ask for.

    Args:
        fit: A fit with white normal noise.

    Returns:
        The same fit where the residuals are white and normal; else the one repeated with weights
        and whitening, unless that made the simulation worse.
    """
    residuals = fit.residuals()
    weighting = replace(
        fit.weighting,
        robust=_student_weights(fit.weighting, residuals),
        whitening=_whitening(fit.weighting, residuals),
    )
    if weighting.robust is None and all(taps.size == 1 for taps in weighting.whitening):
        return fit
    changed = solve(fit.simulator, fit.coordinates, fit.position, fit.states, weighting)
    plain = replace(fit.weighting, robust=weighting.robust)
    before = plain.sums_of_squares(residuals)
    after = plain.sums_of_squares(changed.residuals())
    if np.all(after <= _TOLERATED_RISE * before) and changed.converged:
        return changed
    return fit


def autoregression(series: Sequence[Array], largest: int = _LARGEST_ORDER) -> Array:
    """Whitening filter (1, -a1, ..., -ap) of series that share one noise process.

    The order minimises the Bayesian information criterion over 0 to `largest`.

    Args:
        series: Residuals, one (n_sample,) array a record.
        largest: Largest order tried.
    """
    count = sum(s.size for s in series)
    largest = min(largest, count // 20)
    lags = np.zeros(largest + 1)
    for s in series:
        for lag in range(min(largest + 1, s.size)):
            lags[lag] += float(np.einsum("i,i->", s[lag:], s[: s.size - lag]))
    best, best_score = np.ones(1), count * np.log(max(lags[0], 1e-300) / count)
    if lags[0] <= 0:
        return best
    for order in range(1, largest + 1):
        taps = linalg.solve_toeplitz(lags[:order], lags[1 : order + 1])
        power = lags[0] - float(np.dot(taps, lags[1 : order + 1]))
        score = count * np.log(max(power, 1e-12 * lags[0]) / count) + order * np.log(count)
        if score < best_score:
            best, best_score = np.concatenate([[1.0], -taps]), score
    return best


def _whitening(weighting: Weighting, residuals: Sequence[Array]) -> tuple[Array, Array]:
    taps = []
    for channel in range(2):
        series = [
            residual[:, channel] * np.sqrt(weighting.sample_weights(k)[:, channel])
            for k, residual in enumerate(residuals)
        ]
        taps.append(autoregression(series))
    return taps[0], taps[1]


def _student_weights(weighting: Weighting, residuals: Sequence[Array]) -> tuple[Array, ...] | None:
    """Weights of the samples under the best Student-t law, None where the normal law is as good."""
    weights = [np.ones_like(residual) for residual in residuals]
    heavy = False
    for channel in range(2):
        stacked = np.concatenate([residual[:, channel] for residual in residuals])
        freedom, scale = _student(stacked)
        if freedom is None:
            continue
        heavy = True
        for k, residual in enumerate(residuals):
            ratio = residual[:, channel] / scale
            weights[k][:, channel] = (freedom + 1) / (freedom + ratio**2)
    return tuple(weights) if heavy else None


def _student(series: Array) -> tuple[float | None, float]:
    """Degrees of freedom and scale of the best Student-t law; None where normal fits as well."""
    normal = float(np.std(series))
    if not normal > 0:
        return None, normal
    best = float(np.sum(stats.norm.logpdf(series, scale=normal))) + np.log(series.size)
    found: tuple[float | None, float] = (None, normal)
    for freedom in _DEGREES:
        scale = normal
        for _ in range(15):
            weight = (freedom + 1) / (freedom + (series / scale) ** 2)
            scale = float(np.sqrt(np.mean(weight * series**2)))
        likelihood = float(np.sum(stats.t.logpdf(series, freedom, scale=scale)))
        if likelihood > best:
            best, found = likelihood, (freedom, scale)
    return found


def noise_deviation(fit: Fit) -> Array:
    """(2,) standard deviation of the noise of current and speed [A, rad/s].

    Where the noise model holds, coloured noise included, it is that of the residuals.  Where it
    does not (`with_noise_model` kept the ordinary fit although the residuals are correlated), the
    residuals hold what the model lacks as well, and the noise is what cannot be foretold of them
    from their own past.
    """
    residuals = fit.residuals()
    found = np.zeros(2)
    for channel in range(2):
        kept = [
            residual[:, channel][fit.weighting.records[k].weight[:, channel] > 0]
            for k, residual in enumerate(residuals)
        ]
        kept = [series for series in kept if series.size > 1]
        if not kept:
            continue
        if fit.weighting.whitening[channel].size == 1:
            taps = autoregression(kept)
            kept = [signal.lfilter(taps, [1.0], series)[taps.size - 1 :] for series in kept]
        found[channel] = np.sqrt(np.mean(np.concatenate(kept) ** 2))
    return found


def effective_shares(fit: Fit) -> Array:
    """(2,) share of the samples that count as independent evidence, at most one.

    The covariance of a least-squares fit with correlated residuals is the sandwich
    H^-1 M H^-1 with M the covariance of the gradient; the share is the mean ratio (geometric,
    over the directions of the parameters) of the plain covariance H^-1 to it.
    """
    residuals = fit.residuals()
    slopes = fit.coordinates.slopes(fit.position)
    _, tangents = fit.simulator.tangent(fit.values, fit.states, np.diag(slopes))
    n = fit.position.size
    plain, gradient = np.zeros((n, n)), np.zeros((n, n))
    for channel in range(2):
        series = [fit.weighting.whitened(residual[:, channel], channel) for residual in residuals]
        taps = autoregression(series)
        power = np.sqrt(
            np.mean(np.concatenate([signal.lfilter(taps, [1.0], s) ** 2 for s in series]))
        )
        deviation = float(fit.weighting.deviation[channel])
        for k, tangent in enumerate(tangents):
            root = np.sqrt(fit.weighting.sample_weights(k)[:, channel])[:, None]
            scaled = fit.weighting.whitened(tangent[:, channel, :n], channel) * root / deviation
            plain += scaled.T @ scaled
            spread = signal.lfilter([1.0], taps, scaled[::-1], axis=0) * (power / deviation)
            gradient += spread.T @ spread
    prior = np.diag(1.0 / fit.coordinates.prior_sd**2)
    root = np.linalg.cholesky(np.linalg.inv(plain + prior + 1e-12 * np.diag(np.diag(plain))))
    ratios = np.linalg.eigvalsh(root.T @ (gradient + prior) @ root)
    inflation = float(np.exp(np.mean(np.log(np.maximum(ratios, 1e-12)))))
    return np.full(2, 1.0 / max(inflation, 1.0))
