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
from scipy import signal, stats

from identification.fit.solve import Fit, Patience, solve
from identification.linear import eigh, root, solution
from identification.model.weighting import Weighting

__all__ = [
    "autoregression",
    "effective_share",
    "noise_deviation",
    "student",
    "with_noise_model",
]

Array = NDArray[np.float64]

_LARGEST_ORDER: Final = 12
_LARGEST_RISE: Final = 0.1
_LEG: Final = 4
"""Steps after which the simulation error is looked at."""
_LEGS: Final = 4
_DEGREES: Final = (3.0, 4.0, 6.0, 10.0)


def with_noise_model(fit: Fit) -> Fit:
    """The fit under the noise model that its residuals ask for.

    Args:
        fit: A fit with white normal noise.

    Returns:
        The same fit where the residuals are white and normal; else the one repeated with weights
        and whitening, unless that made the simulation worse.
    """
    changed = _refitted(fit, fit)
    if changed is not fit and changed.weighting.robust is not None:
        # The first weights are those of the ordinary fit and carry a third of its error on.
        changed = _refitted(fit, changed)
    return changed


def _refitted(fit: Fit, latest: Fit) -> Fit:
    """The fit under the noise model of the latest residuals.

    Itself where they are plain noise, and where that model makes the simulation worse.
    """
    residuals = latest.residuals()
    robust = _student_weights(fit.weighting, residuals)
    weighting = replace(
        fit.weighting, robust=robust, whitening=_whitening(fit.weighting, residuals)
    )
    if robust is None and all(taps.size == 1 for taps in weighting.whitening):
        return fit
    return _whitened(fit, latest, weighting)


def _whitened(fit: Fit, latest: Fit, weighting: Weighting) -> Fit:
    """The fit under a noise model, from the latest; itself where the simulation gets worse.

    A model that lacks something goes its way to the one-step error for many steps, so that it is
    given up on the way.  A fit that ended where nothing improves it, at a bound or a corner, is as
    good as it was.
    """
    plain = replace(fit.weighting, robust=weighting.robust)
    most = _tolerated_rise(fit) * plain.sums_of_squares(fit.residuals())
    changed = replace(latest, weighting=weighting)
    for _ in range(_LEGS):
        changed = solve(
            fit.simulator,
            fit.coordinates,
            changed.position,
            changed.states,
            changed.weighting,
            Patience(_LEG),
        )
        if not np.all(plain.sums_of_squares(changed.residuals()) <= most):
            return fit
        if changed.converged:
            return changed
    return fit if fit.converged else changed


def _tolerated_rise(fit: Fit) -> float:
    """Factor by which chance alone may raise the sum of squares.

    An ordinary fit to coloured noise follows it with each of its unknowns: it removes about as many
    independent samples from the sum of squares as it has unknowns, three times that at most.  Where
    this is more than a tenth, noise cannot be told from a missing effect and nothing is risked.
    """
    unknowns = fit.position.size + sum(state.size for state in fit.states)
    samples = float(fit.weighting.counts.max()) * effective_share(fit)
    return 1.0 + min(3.0 * unknowns / max(samples, 1.0), _LARGEST_RISE)


def autoregression(
    series: Sequence[Array], largest: int | None = None, penalty: float | None = None
) -> Array:
    """Whitening filter (1, -a1, ..., -ap) of series that share one noise process.

    Levinson's recursion on the biased covariance, which makes every order stable; the order
    minimises n log(innovation variance) + penalty * order.

    Args:
        series: Residuals, one (n_sample,) array a record; their mean is not taken away.
        largest: Largest order tried; by default 12, or a twentieth of the samples.
        penalty: Price of an order: 2 is Akaike's criterion, the default log(n) the Bayesian one.
    """
    count = sum(s.size for s in series)
    largest = min(_LARGEST_ORDER, count // 20) if largest is None else largest
    lags = np.array(
        [
            sum(
                float(np.einsum("i,i->", s[lag:], s[: s.size - lag]))
                for s in series
                if s.size > lag
            )
            for lag in range(largest + 1)
        ]
    )
    best = taps = np.zeros(0)
    power = lags[0]
    if power <= 0:
        return np.ones(1)
    price = np.log(count) if penalty is None else penalty
    lowest = count * np.log(power)
    for order in range(1, largest + 1):
        foretold = float(np.dot(taps, lags[order - 1 : 0 : -1]))
        reflection = (lags[order] - foretold) / power
        taps = np.append(taps - reflection * taps[::-1], reflection)
        power *= 1.0 - reflection**2
        if power <= 1e-12 * lags[0]:
            best = taps
            break
        score = count * np.log(power) + price * order
        if score < lowest:
            lowest, best = score, taps
    return np.concatenate([[1.0], -best])


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
        freedom, scale = student(stacked)
        if freedom is None:
            continue
        heavy = True
        for k, residual in enumerate(residuals):
            ratio = residual[:, channel] / scale
            weights[k][:, channel] = (freedom + 1) / (freedom + ratio**2)
    return tuple(weights) if heavy else None


def student(series: Array) -> tuple[float | None, float]:
    """Degrees of freedom and scale of the best Student-t law; None where normal fits as well.

    Args:
        series: (n_sample,) any unit.
    """
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


def effective_share(fit: Fit) -> float:
    """Share of the samples that count as independent evidence, at most one.

    With residuals e, weights w and tangents a the fit solves sum a w e = 0.  Its covariance is the
    sandwich H^-1 M H^-1 with M the covariance of the gradient, in which w e may be correlated in
    time, and H = E[d(w e)/de] A its mean slope; A = sum w a a' is what the covariance of the fit is
    made of.  The share is the mean ratio (geometric, over the directions of the parameters) of the
    plain covariance A^-1 to the sandwich.  For white noise and the right Student-t weights it is
    (freedom + 1) / (freedom + 3), the information of a location.

    Source:
        White, Econometrica 48 (1980) 817-838; Huber, Ann. Math. Statist. 35 (1964) 73-101.
    """
    weighting, n = fit.weighting, fit.position.size
    weights = [weighting.sample_weights(k) for k in range(len(weighting.records))]
    memories = _memories(fit, weights)
    slopes = [_mean_slope([each[:, channel] for each in weights]) for channel in range(2)]
    plain, curvature, gradient = (np.zeros((n, n)) for _ in range(3))
    ends: dict[tuple[int, int], Array] = {}
    for block in fit.equations.derivatives.blocks(weighting.memory):
        for channel, (taps, power) in enumerate(memories):
            weight = weights[block.record][block.samples, channel][block.lead :, None]
            deviation = float(weighting.deviation[channel])
            whitened = weighting.whitened(block.tangent[:, channel, :n], channel)[block.lead :]
            scaled = whitened * np.sqrt(weight) / deviation
            own = scaled.T @ scaled
            plain += own
            curvature += slopes[channel] * own
            place = (block.record, channel)
            begin = ends.get(place, np.zeros((taps.size - 1, n)))
            counted = whitened * (weight > 0) * (power / deviation**2)
            # Its covariance with itself is that of the gradient but for the ends of a record.
            spread, ends[place] = signal.lfilter([1.0], taps, counted, axis=0, zi=begin)
            gradient += spread.T @ spread
    prior = np.diag(1.0 / fit.coordinates.prior_sd**2) + 1e-12 * np.diag(np.diag(plain))
    factor = root(plain + prior)
    turned = solution(curvature + prior, factor)
    ratios, _ = eigh(turned.T @ (gradient + prior) @ turned)
    inflation = float(np.exp(np.mean(np.log(np.maximum(ratios, 1e-12)))))
    return 1.0 / max(inflation, 1.0)


def _memories(fit: Fit, weights: Sequence[Array]) -> list[tuple[Array, float]]:
    """For each channel the filter that whitens its weighted residuals, and what that leaves."""
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
    """Mean of d(w e)/de over mean of w, for Student-t weights w = (f + 1) / (f + z^2).

    With the largest weight (f + 1) / f the slope is w (2 w f / (f + 1) - 1), so that the weights
    alone tell it.
    """
    stacked = np.concatenate(weights)
    largest, mean = float(stacked.max()), float(stacked.mean())
    if not largest > 1.0:
        return 1.0
    return float(np.mean(stacked * (2.0 * stacked / largest - 1.0))) / mean
