"""Noise model of the residuals: autoregressive whitening and Student-t weights.

Bench noise departs from independent normal errors in two ways.  Neither follows the inputs, which
distinguishes it from a missing effect.  *Autocorrelated* noise is whitened by an autoregressive
filter, whose order the Bayesian information criterion selects; the fit is then repeated on whitened
residuals (generalised least squares).  *Heavy-tailed* noise (outliers) follows a Student-t
distribution.  Its likelihood is maximised by weighting each sample by the size of its residual; no
sample is deleted.

The fit absorbs part of slow noise, so the residuals are whiter than the noise, and intervals from
their colour are too narrow on short records.  The filter is therefore estimated again from the
whitened fit, with the expected absorbed part A C A' added to the autocovariance of the residuals (A
sensitivities, C covariance of parameters and initial states): a step of expectation-maximisation
for the restricted likelihood.

If the model lacks an effect, whitening would reduce the one-step prediction error at the expense of
the simulation error.  In that case the ordinary fit is kept, and its uncertainty is widened for the
autocorrelated residuals (sandwich covariance).

Source: Ljung, System Identification, 2nd edition, sections 7.5 and 16.4; Lange, Little and Taylor,
J. American Statistical Association 84 (1989), 881-896 (Student-t weights); Laird, Lange and Stram,
J. American Statistical Association 82 (1987), 97-105 (restricted likelihood); White, Econometrica
48 (1980), 817-838 (sandwich).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy import signal, stats

from identification.arrays import Array
from identification.fit.autoregression import LARGEST_ORDER, autoregression, lag_products
from identification.fit.effective_samples import effective_fraction
from identification.fit.solve import Fit, TerminationLimits, continued
from identification.linear import root, solution
from identification.model.weighting import Weighting

__all__ = [
    "noise_deviation",
    "student_weights",
    "with_noise_model",
]

_LARGEST_RISE: Final = 0.1
_LEG: Final = 4
"""Steps between two checks of the simulation error."""
_LEGS: Final = 4
_DEGREES: Final = (3.0, 4.0, 6.0, 10.0)


def with_noise_model(fit: Fit) -> Fit:
    """Refit a fit with white normal noise under the noise model that the residuals require.

    The same fit if its residuals are white and normal, or if the noise model makes the simulation
    worse.
    """
    changed = _refitted(fit, fit)
    if changed is fit:
        return fit
    # The first weights come from the ordinary fit and retain a third of its error; the first filter
    # is that of residuals from which the ordinary fit has absorbed the most.
    again = _refitted(fit, changed)
    return changed if again is fit and changed.weighting.robust is None else again


def _refitted(fit: Fit, latest: Fit) -> Fit:
    """Refit under the noise model of the latest residuals.

    The result is `fit` if the residuals are white and normal, or if the simulation gets worse.
    """
    residuals = latest.residuals()
    robust = student_weights(residuals, [np.ones_like(residual) for residual in residuals])
    absorbed = None if latest is fit else _absorbed(latest)
    weighting = replace(
        fit.weighting, robust=robust, whitening=_whitening(fit.weighting, residuals, absorbed)
    )
    if robust is None and all(taps.size == 1 for taps in weighting.whitening):
        return fit
    return _whitened(fit, latest, weighting)


def _whitened(fit: Fit, latest: Fit, weighting: Weighting) -> Fit:
    """Refit under a noise model, starting from `latest`; `fit` if the simulation gets worse.

    If the model lacks an effect, whitening moves it towards the least one-step prediction error
    over many steps.  The simulation error is therefore checked every few steps.  If the refit does
    not converge, a converged `fit` is kept.
    """
    plain = weighting.unwhitened
    most = _tolerated_rise(fit) * plain.sums_of_squares(fit.residuals())
    changed = replace(latest, weighting=weighting)
    for _ in range(_LEGS):
        changed = continued(changed, TerminationLimits(_LEG))
        if not np.all(plain.sums_of_squares(changed.residuals()) <= most):
            return fit
        if changed.converged:
            return changed
    return fit if fit.converged else changed


def _tolerated_rise(fit: Fit) -> float:
    """Factor by which chance alone may raise the sum of squares.

    An ordinary fit to autocorrelated noise overfits: each unknown removes about one effective
    sample from the sum of squares, three at most.  The rise is limited to a tenth; beyond that,
    noise cannot be distinguished from a missing effect.
    """
    unknowns = fit.position.size + sum(state.size for state in fit.states)
    samples = float(fit.weighting.counts.max()) * effective_fraction(fit)
    return 1.0 + min(3.0 * unknowns / max(samples, 1.0), _LARGEST_RISE)


def _whitening(
    weighting: Weighting, residuals: Sequence[Array], absorbed: Array | None
) -> tuple[Array, Array]:
    taps = []
    for channel in range(2):
        series = [
            residual[:, channel] * np.sqrt(weighting.sample_weights(k)[:, channel])
            for k, residual in enumerate(residuals)
        ]
        extra = None if absorbed is None else absorbed[channel]
        taps.append(autoregression(series, absorbed=extra))
    return taps[0], taps[1]


def _absorbed(fit: Fit) -> Array:
    """(2, LARGEST_ORDER + 1) expected lag products of the noise that a fit has absorbed.

    They are those of the simulated channels under the covariance of the fit: its parameters, with
    the initial states that follow them, and the initial states given the parameters.
    """
    n, equations = fit.position.size, fit.equations
    of_parameters = root(equations.covariance())
    found = np.zeros((2, LARGEST_ORDER + 1))
    for block in equations.derivatives.blocks(fit.weighting.order):
        k, tangent = block.record, block.tangent[block.lead :]
        weight = fit.weighting.records[k].weight[block.samples][block.lead :]
        of_states = root(solution(equations.state_matrices[k], np.eye(tangent.shape[2] - n)))
        response = equations.state_response(k)
        for channel in range(2):
            own = tangent[:, channel, :n] + tangent[:, channel, n:] @ response
            spread = np.hstack([own @ of_parameters, tangent[:, channel, n:] @ of_states])
            spread *= np.sqrt(weight[:, channel, None])
            found[channel] += lag_products(spread, LARGEST_ORDER)
    return found


def student_weights(
    residuals: Sequence[Array], counted: Sequence[Array]
) -> tuple[Array, ...] | None:
    """Weights (n_sample, 2) of the best Student-t fit; None if a normal distribution fits as well.

    Samples of the residuals (n_sample, 2) with a weight of zero in `counted` are not fitted.
    """
    weights = [np.ones_like(residual) for residual in residuals]
    heavy = False
    for channel in range(2):
        pairs = zip(residuals, counted, strict=True)
        stacked = np.concatenate([r[:, channel][w[:, channel] > 0] for r, w in pairs])
        freedom, scale = _student(stacked) if stacked.size else (None, 0.0)
        if freedom is None:
            continue
        heavy = True
        for k, residual in enumerate(residuals):
            ratio = residual[:, channel] / scale
            weights[k][:, channel] = (freedom + 1) / (freedom + ratio**2)
    return tuple(weights) if heavy else None


def _student(series: Array) -> tuple[float | None, float]:
    """Degrees of freedom and scale of the best Student-t fit; None if normal fits as well."""
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

    In a channel with a whitening filter, the whole residual is noise, including its autocorrelated
    part.  A channel without one either has a white residual or lacks an effect (`with_noise_model`
    kept the ordinary fit).  Its noise is the innovation, the part of the residual that its own past
    does not predict.
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
