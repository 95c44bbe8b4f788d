"""Temperature at the thermometer over a campaign and within a run.

Between runs, the chamber is set to levels over the range.  Within a run, the temperature drifts,
approaches equilibrium, or cycles.  The variation within a run separates the effect of a thermal lag
from that of the temperature coefficients, so every run has some.
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
    """Temperature level of each run, in the order of recording [degC].

    The training levels cover the span evenly; the validation levels lie inside it.  The order is
    mixed.  With more than two training runs, the hottest is never the last: irreversible
    demagnetisation is visible only after cooling.

    Args:
        training: Number of training runs.
        validation: Number of validation runs.
        span: Lowest and highest level [degC].
        rng: Random generator for the order and the validation levels.
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
    """Temperature over one run: a drift, a warm-up, or a cycle about its level.

    Args:
        level: Approximate centre [degC].
        rows: Number of samples.
        motion: Approximate peak-to-peak variation within the run [K].
        rng: Random generator for the shape.

    Returns:
        (rows,) temperature, clipped to the range from 15 to 130 [degC].
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
