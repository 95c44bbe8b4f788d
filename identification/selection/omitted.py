"""Consider covariance: parameter uncertainty caused by omitted terms.

After a search the residual may still have structure: a term has a predicted gain above chance, but
it fails the acceptance criteria because its law is not that of the motor.  The structure is real
and biases the parameters, although its law is unknown.  The screening gives this bias to first
order: the change of every parameter at the best amplitude of the term.  Each of these changes,
times a standard normal number, is added to the draws of the posterior, so that the intervals cover
the bias.  The change is bounded by the joint prior of the term and of all parameters (decision
0020).

If no term has a predicted gain above chance, nothing is added.

Source: Schmidt, in Advances in Control Systems 3 (1966), 293-340; Tapley, Schutz and Born,
Statistical Orbit Determination (2004), chapter 6 (consider covariance); Schwarz, Annals of
Statistics 6 (1978), 461-464 (gain by chance).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from identification.arrays import Array
from identification.fit.derivatives import gradient_of
from identification.fit.solve import Fit
from identification.linear import root, solution
from identification.selection.policy import DEFAULT
from identification.selection.score import Score

__all__ = [
    "OmittedTerm",
    "consider_variances",
    "independent",
    "input_errors",
    "omitted_terms",
    "optimum_shifts",
    "removal_steps",
    "unknown_gain",
    "with_omitted_drawn",
]


@dataclass(frozen=True)
class OmittedTerm:
    """A term outside the model that may bias its parameters."""

    name: str
    """Effect type, ``unlisted``, or what is unknown of an input, such as ``current_gain``."""
    gain: float | None
    """Predicted gain of the log likelihood, in effective samples; negative for the loss at another
    optimum, None if the data contain no information on it."""
    chance: float | None
    """Gain that the best of all prototypes reaches by chance; for a confounded term, the loss that
    excludes it; None if `gain` is None."""
    steps: dict[str, float]
    """Change of each parameter at the best amplitude of the term, in search coordinates."""
    parameter: str = ""
    """Motor parameter that is confounded with the term; empty if there is none."""
    time: float | None = None
    """Time constant of the term at another optimum [s]; the draws lie between the fit and that
    optimum.  None for a first-order change."""
    surrogate: float | None = None
    """Probability that the term, an effect of the model, is a surrogate [-]; None for a term that
    is not in the model."""
    possible: float = 1.0
    """Probability that the change applies, for a term that is not in the model [-]."""
    is_linear: bool = False
    """True if the change is proportional to the amplitude of the term in the physical values; else
    in the search coordinates, as a scaling of all parameters or the way to another optimum."""

    @property
    def share(self) -> float:
        """Fraction of the draws that contain the change [-]."""
        return self.possible if self.surrogate is None else self.surrogate


def optimum_shifts(fit: Fit, changes: Sequence[Array]) -> list[Array]:
    """Change (n_parameter, n_change) of the search coordinates by the change in each record alone.

    The changes are those of the simulated channels, (n_sample, 2, n_change) for each record [A,
    rad/s]; the optimum moves by the sum over the records.  With sensitivities J, weights W and the
    covariance C of the parameters, a change d moves it by -C J'W d to first order.  Initial states
    are eliminated, as in the normal equations.
    """
    equations, weighting = fit.equations, fit.weighting
    size = fit.position.size
    rights = [np.zeros((size + fit.simulator.n_state, each.shape[2])) for each in changes]
    for block in equations.derivatives.blocks(weighting.order):
        k = block.record
        change = changes[k][block.samples]
        rights[k] += gradient_of(change, block.tangent, weighting, k, block.start, block.lead)
    covariance = equations.covariance()
    return [
        -covariance @ (right[:size] - coupling.T @ solution(matrix, right[size:]))
        for right, coupling, matrix in zip(
            rights, equations.couplings, equations.state_matrices, strict=True
        )
    ]


def omitted_terms(
    fit: Fit, fraction: float, scores: Iterable[Score], tried: int
) -> tuple[OmittedTerm, ...]:
    """Plausible terms with a predicted gain above chance, one per effect type, best first.

    `tried` is the number of prototypes from which the best was selected.
    """
    samples = max(float(fit.weighting.counts.sum()) * fraction, 2.0)
    found: dict[str, OmittedTerm] = {}
    for score in sorted(scores, key=lambda score: -score.gain):
        chance = 0.5 * score.candidate.joint * np.log(samples) + np.log(max(tried, 1))
        gain = fraction * score.gain
        if score.along is None or not gain > chance or score.candidate.term.name in found:
            continue
        position = score.best * np.reshape(score.along.position, -1)
        if np.isfinite(position).all() and not _is_implausible(score):
            step = position / np.sqrt(1.0 + _distance(fit, score, position))
            steps = dict(zip(fit.coordinates.names, map(float, step), strict=True))
            name = score.candidate.term.name
            found[name] = OmittedTerm(name, float(gain), float(chance), steps, is_linear=True)
    return tuple(found.values())


def _is_implausible(score: Score) -> bool:
    """True if the term at its best amplitude contradicts its effect and so cannot be missing."""
    term = score.candidate.final
    names = [parameter.name for parameter in term.parameters]
    return bool(term.flaw(dict(zip(names, map(float, score.start), strict=True))))


def _distance(fit: Fit, score: Score, position: Array) -> float:
    """Squared Mahalanobis distance of an omitted term at its best amplitude from the priors.

    The amplitude, as a multiple of the best one, is normal with a standard deviation of 1.  The
    priors of its physical size and of the parameters, which change in proportion to it, are further
    observations of it: their precisions add to 1.
    """
    parameters = score.candidate.final.parameters
    sizes = [
        score.best * value / (one.scale * one.prior_sd)
        for one, value in zip(parameters, score.start, strict=True)
        if one.vanishes
    ]
    return float(np.sum((position / fit.coordinates.prior_sd) ** 2) + np.sum(np.square(sizes)))


def removal_steps(fit: Fit, simpler: Fit) -> dict[str, float]:
    """Change of each common parameter from a fit to that of a simpler model, in search coordinates.

    Empty if the simpler model cannot be simulated.
    """
    if not np.isfinite(simpler.cost):
        return {}
    known, coordinates = simpler.by_name, fit.coordinates
    values = np.array([known.get(name, fit.by_name[name]) for name in coordinates.names])
    moved = np.clip(coordinates.of(values), coordinates.lower, coordinates.upper) - fit.position
    steps = zip(coordinates.names, map(float, moved), strict=True)
    return {name: step for name, step in steps if name in known}


def unknown_gain(fit: Fit, ratios: Iterable[float]) -> tuple[OmittedTerm, ...]:
    """Parameter changes by an unknown gain of the current sensor; empty if the gains agree.

    A sensor that reads g times the current gives Ra/g, L/g, J g and b g at the same fit.  The
    ratios are the readings of the runs over that of the first training run, for the same current
    [-].
    """
    largest = max((abs(float(np.log(ratio))) for ratio in ratios), default=0.0)
    if largest == 0.0:
        return ()
    slopes = dict(zip(fit.coordinates.names, fit.coordinates.slopes(fit.position), strict=True))
    values = fit.by_name
    powers = {"Ra25": -1.0, "L": -1.0, "J": 1.0, "b": 1.0}
    steps = {
        name: power * largest * float(values[name] / slopes[name]) for name, power in powers.items()
    }
    return (OmittedTerm("current_gain", None, None, steps),)


def input_errors(
    fit: Fit, fraction: float, name: str, changes: Sequence[Array]
) -> tuple[OmittedTerm, ...]:
    """Parameter changes by independent unknown errors of an input; see `independent`.

    The changes of the simulated channels are (n_sample, 2, n_error) for each record, by one
    standard deviation of each error, which has another value in each record [A, rad/s].
    """
    return independent(fit, fraction, name, np.hstack(optimum_shifts(fit, changes)))


def independent(fit: Fit, fraction: float, name: str, steps: Array) -> tuple[OmittedTerm, ...]:
    """Parameter changes (n_parameter, n_error) by independent errors, as orthogonal directions.

    The changes are in search coordinates, by one standard deviation of each error.  A direction
    that widens an interval too little is dropped.
    """
    if not np.isfinite(steps).all():
        return ()
    factor = root(fit.equations.covariance(fraction))
    directions, widenings, _ = np.linalg.svd(solution(factor, steps), full_matrices=False)
    names = fit.coordinates.names
    return tuple(
        OmittedTerm(
            name,
            None,
            None,
            dict(zip(names, map(float, factor @ direction * widening), strict=True)),
        )
        for direction, widening in zip(directions.T, widenings, strict=True)
        if widening > DEFAULT.widening
    )


def consider_variances(fit: Fit, omitted: Sequence[OmittedTerm]) -> Array:
    """(n_parameter,) variances added by omitted terms, in search coordinates."""
    variances: Array = np.sum(_steps(fit, omitted) ** 2, axis=1)
    return variances


def with_omitted_drawn(
    draws: dict[str, Array], fit: Fit, omitted: Sequence[OmittedTerm], seed: int
) -> dict[str, Array]:
    """Draws with the changes by omitted terms added; other values are unchanged."""
    if not omitted:
        return draws
    names = fit.coordinates.names
    shape = draws[names[0]].shape
    rng = np.random.default_rng([seed, 2])
    amplitudes = rng.standard_normal((len(omitted), *shape))
    has_own = np.array([term.time is not None for term in omitted])
    amplitudes[has_own] = np.abs(amplitudes[has_own])
    shares = np.array([term.share for term in omitted]).reshape(-1, *[1] * len(shape))
    acts = rng.random(amplitudes.shape) < shares
    amplitudes = np.where(acts, amplitudes, 0.0) / np.sqrt(shares)
    with np.errstate(invalid="ignore", divide="ignore"):
        position = fit.coordinates.of(np.stack([draws[name] for name in names]))
    # Rounding can put a draw slightly below a bound of 0, where it has no logarithm.
    lowest = fit.coordinates.lower.reshape(-1, *[1] * len(shape))
    position = np.where(np.isnan(position) | np.isneginf(position), lowest, position)
    steps, is_linear = _steps(fit, omitted), np.array([term.is_linear for term in omitted])
    moves, linear = (
        np.tensordot(steps[:, chosen], amplitudes[chosen], axes=1)
        for chosen in (~is_linear, is_linear)
    )
    position = fit.coordinates.moved(position + moves, linear)
    values = fit.coordinates.values(fit.coordinates.mirrored(position))
    return draws | dict(zip(names, values, strict=True))


def _steps(fit: Fit, omitted: Sequence[OmittedTerm]) -> Array:
    """(n_parameter, n_term) standard deviations that the terms add, their shares included.

    They are zero for a parameter that was not part of the screening.

    Together they do not exceed the standard deviation of the prior: terms can leave a parameter
    undetermined, but not less certain than without any run.
    """
    names = fit.coordinates.names
    steps = [[term.steps.get(name, 0.0) for name in names] for term in omitted]
    found = np.array(steps, dtype=np.float64).reshape(len(omitted), len(names)).T
    found = found * np.sqrt([term.share for term in omitted])
    limit = fit.coordinates.prior_sd / np.maximum(np.linalg.norm(found, axis=1), 1e-300)
    return np.asarray(found * np.minimum(limit, 1.0)[:, None])
