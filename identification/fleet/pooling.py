"""Partial pooling of temperature coefficients and effect sizes over the motors of one type.

Motors of one type are similar, so each one informs about the others: an imprecise estimate is
shrunk towards the mean of its type, a precise one hardly, and a motor whose runs do not determine
the coefficient obtains the distribution of its type.  `identification.fleet.normal_means` describes
the model.  Effect sizes are pooled as logarithms if all are positive.  The estimate of the motor
itself is not changed.

A foreign motor would widen the spread of the type and shift its mean.  Outliers by the rule of
`identification.fleet.outliers`, applied within the type, are therefore left out and reported.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.fleet.normal_means import population_of
from identification.fleet.outliers import LEAST_MOTORS, THRESHOLD, scores_of
from identification.fleet.refit import Estimate, Refit
from identification.quantities import DECLARED_PARAMETERS

__all__ = ["LEAST_POOLED", "POOLED_PARAMETERS", "Pool", "pools_of"]

Quantiles = tuple[float, float, float]

POOLED_PARAMETERS: Mapping[str, float] = {"alpha_Ra": 1e-3, "alpha_Kt": 5e-4}
"""Pooled nominal parameters, each with the prior scale of its spread within a type [1/K]: a quarter
of the coefficient of copper, and half of that of NdFeB magnets."""
LEAST_POOLED = 3
"""Smallest number of motors of a type whose runs determine the quantity."""

_RELATIVE_SCALE = 0.3


@dataclass(frozen=True)
class Pool:
    """Distribution of one quantity over the motors of one type."""

    type: str
    name: str
    """Parameter, or effect and parameter such as ``brush_drop.voltage``."""
    unit: str
    is_relative: bool
    """Whether the spread is that of the logarithm [-], not in the unit."""
    count: int
    """Number of motors whose estimates are pooled."""
    left_out: tuple[int, ...]
    """Outlying motors, which are not pooled, as indices of the fleet."""
    mean: Quantiles
    """Quantiles 5, 50 and 95 % of the mean of the type; of the geometric mean if `is_relative`."""
    spread: Quantiles
    """The same of the standard deviation between the motors of the type."""
    own: Mapping[int, Estimate]
    """The estimate of each motor itself, by index of the fleet."""
    motors: Mapping[int, Quantiles]
    """Pooled quantiles by index of the fleet; without the outlying motors."""


def pools_of(refits: Sequence[Refit]) -> list[Pool]:
    """Pooled quantities of all types that have enough motors."""
    pools = []
    for kind in dict.fromkeys(refit.type for refit in refits):
        motors = {n: r for n, r in enumerate(refits) if r.type == kind and r.estimates}
        for name, scale in POOLED_PARAMETERS.items():
            found = {n: r.estimates[name] for n, r in motors.items() if name in r.estimates}
            unit = DECLARED_PARAMETERS[name].unit
            pools.append(_pool(kind, name, unit, found, scale))
        sizes = dict.fromkeys(
            (name, size.unit, size.meaning)
            for refit in motors.values()
            for name, size in refit.sizes.items()
        )
        for name, unit, meaning in sizes:
            found = {
                n: r.sizes[name].estimate
                for n, r in motors.items()
                if name in r.sizes and r.sizes[name].meaning == meaning
            }
            pools.append(_pool(kind, name, unit, found, None))
    return [pool for pool in pools if pool is not None]


def _pool(
    kind: str, name: str, unit: str, own: Mapping[int, Estimate], scale: float | None
) -> Pool | None:
    """Pool one quantity of one type of motor; None if too few motors determine it.

    The prior scale of the spread is in `unit`; None for an effect size, whose spread is relative to
    its magnitude.
    """
    usable = {n: one for n, one in own.items() if one.usable and one.usable[1] > 0.0}
    if len(usable) < LEAST_POOLED:
        return None
    is_relative = scale is None and all((one.q05 or 0.0) > 0.0 for one in usable.values())
    given = [usable.get(number) for number in own]
    pairs = [None if one is None else one.logarithm if is_relative else one.usable for one in given]
    known = np.array([pair[0] for pair in pairs if pair])
    scores, _ = scores_of(pairs)
    is_outlier = [
        len(known) >= LEAST_MOTORS and score is not None and abs(score) > THRESHOLD
        for score in scores
    ]
    pooled = [n for n, is_left_out in enumerate(is_outlier) if not is_left_out]
    count = sum(pairs[n] is not None for n in pooled)
    if count < LEAST_POOLED:
        return None
    if scale is None:
        scale = _RELATIVE_SCALE * (1.0 if is_relative else float(np.median(np.abs(known))))
    found = population_of(
        np.array([(pairs[n] or (0.0, 0.0))[0] for n in pooled]),
        np.array([(pairs[n] or (0.0, math.inf))[1] for n in pooled]),
        scale or _RELATIVE_SCALE,
    )
    numbers = list(own)
    return Pool(
        type=kind,
        name=name,
        unit=unit,
        is_relative=is_relative,
        count=count,
        left_out=tuple(numbers[n] for n, is_left_out in enumerate(is_outlier) if is_left_out),
        mean=_quantiles(found.mean, is_relative),
        spread=_quantiles(found.spread, False),
        own=own,
        motors={
            numbers[n]: _quantiles(quantiles, is_relative)
            for n, quantiles in zip(pooled, found.groups, strict=True)
        },
    )


def _quantiles(values: NDArray[np.float64], is_logarithmic: bool) -> Quantiles:
    low, median, high = (float(v) for v in (np.exp(values) if is_logarithmic else values))
    return low, median, high
