"""Consider covariance: how far omitted terms could change the parameters of a model.

A search may end with structure in the residual: a term promises more gain in log likelihood than
chance reaches and yet passes no gate, since its law is not that of the motor.  The structure is
real, and it pulls at the parameters although nothing says by which law.  How far such a term could
pull is known to first order: its screening tells the step of every parameter that goes with its
best amplitude.  Each of these steps, times a standard normal number, is added to the draws of the
posterior, so that the intervals hold what the model lacks (a consider covariance).

Where no term promises more than chance, nothing is added.

Source: Schmidt, in Advances in Control Systems 3 (1966), 293-340; Tapley, Schutz and Born,
Statistical Orbit Determination (2004), chapter 6 (consider covariance); Schwarz, Annals of
Statistics 6 (1978), 461-464 (what chance reaches).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.effects.score import Score
from identification.fit.solve import Fit

__all__ = [
    "OmittedTerm",
    "consider_variances",
    "omitted_terms",
    "unknown_gain",
    "with_omitted_drawn",
]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class OmittedTerm:
    """A term that promises more than chance and is not in the model.

    Args:
        name: Its kind, or ``unlisted``.
        gain: Promised gain of the log likelihood, in effective samples; None where no data tell.
        chance: Gain that the best of all prototypes reaches by chance.
        steps: Change of each parameter that goes with its best amplitude, in search coordinates.
        parameter: Parameter of the motor that may be taken for it; empty where there is none.
            `chance` is then the loss of log likelihood that excludes it.
        time: Time constant that it has at an optimum of its own [s], which draws lie on the way to;
            None where the change is one of first order.
    """

    name: str
    gain: float | None
    chance: float | None
    steps: dict[str, float]
    parameter: str = ""
    time: float | None = None


def omitted_terms(
    fit: Fit, share: float, scores: Iterable[Score], tried: int
) -> tuple[OmittedTerm, ...]:
    """Terms that promise more than chance beside a model, one of each kind, best first.

    Args:
        fit: The model at its optimum.
        share: Effective share of the samples.
        scores: What was screened beside it.
        tried: Number of prototypes among which the best was found.
    """
    samples = max(float(fit.weighting.counts.sum()) * share, 2.0)
    found: dict[str, OmittedTerm] = {}
    for score in sorted(scores, key=lambda score: -score.gain):
        chance = 0.5 * score.candidate.joint * np.log(samples) + np.log(max(tried, 1))
        gain = share * score.gain
        if score.along is None or not gain > chance or score.candidate.term.name in found:
            continue
        position = np.reshape(score.along.position, -1)
        if np.isfinite(position).all():
            steps = dict(zip(fit.coordinates.names, map(float, position), strict=True))
            name = score.candidate.term.name
            found[name] = OmittedTerm(name, float(gain), float(chance), steps)
    return tuple(found.values())


def unknown_gain(fit: Fit, ratios: Iterable[float]) -> tuple[OmittedTerm, ...]:
    """Changes by an unknown gain of the current sensor; empty where the gains agree.

    A sensor that reads g times the current gives Ra/g, L/g, J g and b g, and fits as well.

    Args:
        fit: Fit whose parameters they are.
        ratios: Readings of runs over that of the first training run, for the same current [-].
    """
    largest = max((abs(float(np.log(ratio))) for ratio in ratios), default=0.0)
    if largest == 0.0:
        return ()
    slopes = dict(zip(fit.coordinates.names, fit.coordinates.slopes(fit.position), strict=True))
    values = dict(zip(fit.coordinates.names, fit.values, strict=True))
    powers = {"Ra25": -1.0, "L": -1.0, "J": 1.0, "b": 1.0}
    steps = {
        name: power * largest * float(values[name] / slopes[name]) for name, power in powers.items()
    }
    return (OmittedTerm("current_gain", None, None, steps),)


def consider_variances(fit: Fit, omitted: Sequence[OmittedTerm]) -> Array:
    """(n_parameter,) variances that omitted terms add, in search coordinates.

    Args:
        fit: Fit whose parameters they are.
        omitted: The terms.
    """
    variances: Array = np.sum(_steps(fit, omitted) ** 2, axis=1)
    return variances


def with_omitted_drawn(
    draws: dict[str, Array], fit: Fit, omitted: Sequence[OmittedTerm], seed: int
) -> dict[str, Array]:
    """Draws with what omitted terms could change added to them.

    Args:
        draws: Physical values by name, of one shape each; others than parameters stay.
        fit: Fit whose posterior they are of.
        omitted: The terms.
        seed: Seed of their amplitudes.
    """
    if not omitted:
        return draws
    names = fit.coordinates.names
    shape = draws[names[0]].shape
    amplitudes = np.random.default_rng([seed, 2]).standard_normal((len(omitted), *shape))
    has_own = np.array([term.time is not None for term in omitted])
    amplitudes[has_own] = np.abs(amplitudes[has_own])
    with np.errstate(invalid="ignore", divide="ignore"):
        position = fit.coordinates.of(np.stack([draws[name] for name in names]))
    # A draw at a bound of 0 is a last digit below it now and then, and has no logarithm.
    lowest = fit.coordinates.lower.reshape(-1, *[1] * len(shape))
    position = np.where(np.isnan(position) | np.isneginf(position), lowest, position)
    position = position + np.tensordot(_steps(fit, omitted), amplitudes, axes=1)
    values = fit.coordinates.values(fit.coordinates.mirrored(position))
    return draws | dict(zip(names, values, strict=True))


def _steps(fit: Fit, omitted: Sequence[OmittedTerm]) -> Array:
    """(n_parameter, n_term) steps; parameters that a term was not screened with stay."""
    names = fit.coordinates.names
    steps = [[term.steps.get(name, 0.0) for name in names] for term in omitted]
    return np.array(steps, dtype=np.float64).reshape(len(omitted), len(names)).T
