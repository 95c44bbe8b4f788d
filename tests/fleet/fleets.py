"""Fleets whose parameters and errors are drawn at random with known standard deviations."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identification.fleet.refit import Estimate, Refit, compared_with
from identification.quantities import DECLARED_PARAMETERS

CENTRE = {"Ra25": 0.59, "alpha_Ra": 3.9e-3, "Kt25": 0.071, "alpha_Kt": -1.1e-3, "J": 4e-5,
          "b": 2e-5, "L": 5e-4}  # fmt: skip
TOLERANCE = 0.03
ERROR = 0.005


def estimate(median: float, sd: float, *, is_identified: bool = True) -> Estimate:
    """Estimate with a normal distribution."""
    return Estimate(median, sd, median - 1.645 * sd, median + 1.645 * sd, is_identified)


def fleet(
    count: int, seed: int = 0, changed: Mapping[tuple[int, str], float] | None = None
) -> list[Refit]:
    """Motors of one type, each fitted twice with independent errors.

    Args:
        count: Number of motors.
        seed: Of what is drawn.
        changed: Factors between the two fits, by motor and parameter.
    """
    rng = np.random.default_rng(seed)
    changed = changed or {}
    made = []
    for number in range(count):
        true = {n: v * (1.0 + TOLERANCE * rng.normal()) for n, v in CENTRE.items()}
        fits = []
        for moment in range(2):
            estimates = {}
            for name in DECLARED_PARAMETERS:
                factor = changed.get((number, name), 1.0) if moment else 1.0
                sd = ERROR * abs(CENTRE[name])
                estimates[name] = estimate(true[name] * factor + sd * rng.normal(), sd)
            ended_at = f"2026-11-0{moment + 1}T00:00:00.000000Z"
            fits.append(
                Refit(
                    motor=f"motor {number}",
                    status="fitted",
                    estimates=estimates,
                    fit=f"fit {number}.{moment}",
                    training=(f"run {number}.{moment}",),
                    ended_at=ended_at,
                )
            )
        made.append(compared_with(fits[1], fits[0]))
    return made
