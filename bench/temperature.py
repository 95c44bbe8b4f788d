"""How the temperature at the thermometer goes over a campaign and within a run.

Between runs the chamber is set to levels over the range; within a run the motor drifts, warms
towards a balance, or is cycled.  Motion inside a run is what parts a lag of the thermometer from
the temperature coefficients, so every run has some.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["run_temperature", "temperature_levels"]

_ORDERS = ((0, 2, 4, 1, 3), (1, 4, 0, 3, 2), (0, 4, 2, 1, 3), (2, 0, 4, 3, 1))


def temperature_levels(
    training: int, validation: int, span: tuple[float, float], rng: np.random.Generator
) -> list[float]:
    """Level of each run in the order of recording [degC].

    Training covers the span evenly, validation lies inside it.  The order is mixed and the hottest
    run is never the last of training: what heat does for good shows only when it cools again.

    Args:
        training: Number of training runs.
        validation: Number of validation runs.
        span: Lowest and highest level [degC].
        rng: Draws the order.
    """
    levels = np.linspace(*span, training) if training > 1 else np.array([span[0]])
    if training == 5:
        order: Sequence[int] = _ORDERS[int(rng.integers(len(_ORDERS)))]
    else:
        order = rng.permutation(training).tolist()
        if training > 2 and order[-1] == training - 1:
            order = [order[-1], *order[:-1]]
    inside = span[0] + (span[1] - span[0]) * rng.uniform(0.15, 0.85, validation)
    return [float(levels[k]) for k in order] + [float(level) for level in np.sort(inside)]


def run_temperature(
    level: float, rows: int, motion: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Temperature over one run: a drift, a warming, or a cycle about its level.

    Args:
        level: Where the run is centred, roughly [degC].
        rows: Samples.
        motion: Size of the movement within the run [K].
        rng: Draws which kind of movement.

    Returns:
        (rows,) [degC].
    """
    share = np.arange(rows) / rows
    kind = int(rng.integers(3))
    if kind == 0:
        shape = rng.choice([-1.0, 1.0]) * (share - 0.5)
    elif kind == 1:
        shape = 1.0 - np.exp(-4.0 * share) - 0.5
    else:
        shape = 0.5 * np.sin(2.0 * np.pi * (rng.uniform(0.8, 2.0) * share + rng.uniform()))
    wave = 0.06 * np.sin(2.0 * np.pi * (rng.uniform(3.0, 6.0) * share + rng.uniform()))
    return np.asarray(np.clip(level + motion * (shape + wave), 15.0, 130.0), dtype=np.float64)
